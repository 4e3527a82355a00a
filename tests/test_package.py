"""The distribution: version, typed packages, a light base with extras, and what a source archive holds."""

import ast
import json
import re
import subprocess
import sys
from collections import Counter
from importlib.metadata import version
from pathlib import Path

import numba
import pytest
import steerclear
from packaging.specifiers import SpecifierSet
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.extras import EXTRA_OF, install_command, missing

tomllib = pytest.importorskip("tomllib", reason="Python 3.11 and newer read TOML")

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
EXTRAS = PROJECT["project"]["optional-dependencies"]
DISTRIBUTIONS = {"pygame": "pygame-ce", "imageio_ffmpeg": "imageio-ffmpeg", "stable_baselines3": "stable-baselines3"}
BARE = """
import sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {modules!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Missing())
sys.argv = ["steerclear", *{arguments!r}]
from steerclear.experiments.cli import main
main()
"""


def bare(*arguments):
    """The command where no module of any extra is installed (pydantic is typer's own, too)."""
    code = BARE.format(modules=set(EXTRA_OF) - {"pydantic"}, arguments=arguments)
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)


def test_the_root_tells_the_version():
    assert steerclear.__version__ == version("steerclear") == PROJECT["project"]["version"]


def test_every_folder_with_code_is_a_package():
    folders = {
        path.parent for name in ("shield", "env", "policies", "experiments") for path in (ROOT / name).rglob("*.py")
    }
    named = PROJECT["tool"]["setuptools"]["package-dir"]
    assert {path.relative_to(ROOT).as_posix() for path in folders} == set(named.values())
    assert set(PROJECT["tool"]["setuptools"]["packages"]) == set(named)
    assert {(ROOT / name / "py.typed").is_file() for name in ("shield/root", "shield", "env", "policies")} == {True}
    told = (ROOT / "MANIFEST.in").read_text(encoding="utf-8").split()
    assert {"tests", "docs", "mkdocs.yml", "CONTRIBUTING.md", "CHANGELOG.md"} <= set(told)


def test_no_folder_holds_fifty_files_side_by_side():
    places = (
        path.parent
        for name in ("shield", "env", "policies", "experiments", "tests")
        for path in (ROOT / name).rglob("*.py")
    )
    assert max(Counter(places).values()) < 50


@pytest.mark.parametrize("module", EXTRA_OF)
def test_the_extra_named_brings_the_module(module):
    brought = {re.split(r"[<>=\[]", line)[0] for line in EXTRAS[EXTRA_OF[module]]}
    assert DISTRIBUTIONS.get(module, module) in brought
    assert missing(ModuleNotFoundError(name="nowhere"), "this") is None
    told = missing(ModuleNotFoundError(name=f"{module}.sub"), "this")
    assert isinstance(told, ConfigError)
    assert install_command(EXTRA_OF[module]) in str(told)


@pytest.mark.parametrize(
    ("told", "command"),
    [
        ({"url": ROOT.as_uri(), "dir_info": {}}, f"pip install '{ROOT}[boats]'"),
        ({"url": ROOT.as_uri(), "dir_info": {"editable": True}}, f"pip install -e '{ROOT}[boats]'"),
        ({"url": "file:///gone", "dir_info": {}}, "pip install 'steerclear[boats]'"),
        (
            {"url": "https://host/s.git", "vcs_info": {"vcs": "git"}},
            "pip install 'steerclear[boats] @ git+https://host/s.git'",
        ),
        (None, "pip install 'steerclear[boats]'"),
    ],
)
def test_an_extra_is_installed_from_where_the_package_came_from(told, command, monkeypatch):
    class Installed:
        def read_text(self, name):
            return None if told is None else json.dumps(told)

    monkeypatch.setattr("steerclear.shield.extras.distribution", lambda name: Installed())
    assert install_command("boats") == command


def test_help_without_extras_names_them_in_brackets():
    done = bare("--help")
    assert done.returncode == 0, done.stderr
    assert "[boats]" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "extra"),
    [(("deploy", "FLEET.yaml", "--policy", "medium"), "boats"), (("fit", "LOG", "--out", "boat.yaml"), "boats")],
)
def test_without_its_extra_a_command_is_one_line_that_names_it(arguments, extra):
    done = bare(*arguments)
    assert done.returncode == 2, done.stderr
    assert install_command(extra) in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_help_of_a_command_that_lacks_its_extra_says_so_and_how_to_install_it():
    done = bare("replay", "--help")
    assert done.returncode == 0, done.stderr
    assert "Not installed:" in done.stdout
    assert "[boats]" in done.stdout


def test_the_base_runs_commands_that_need_no_extra():
    done = bare("platform", "show")
    assert done.returncode == 0, done.stderr
    assert "heron" in done.stdout


LATER = {
    "typing": {"Self", "assert_never", "assert_type", "LiteralString", "Never", "NotRequired", "Required", "Unpack"},
    "enum": {"StrEnum", "verify"},
    "datetime": {"UTC"},
    "contextlib": {"chdir"},
    "math": {"cbrt", "exp2", "sumprod"},
    "hashlib": {"file_digest"},
    "asyncio": {"timeout", "TaskGroup", "Runner"},
    "itertools": {"batched"},
    "tomllib": {"loads", "load"},
}
"""Names that Python 3.10 lacks; `steerclear.shield.compat` has those that are used."""


def later_names(source):
    """What a source takes of `LATER`, by import or as an attribute of a module."""
    tree, found = ast.parse(source), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{one.name}" for one in node.names if one.name in LATER.get(node.module, ())}
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            found |= {f"{node.value.id}.{node.attr}"} if node.attr in LATER.get(node.value.id, ()) else set()
    return found


def test_nothing_is_of_a_python_later_than_the_oldest_asked_for():
    assert PROJECT["project"]["requires-python"] == ">=3.10"
    assert later_names("from typing import Self\nimport hashlib\nhashlib.file_digest(f, 'x')") == {
        "typing.Self", "hashlib.file_digest",
    }  # fmt: skip
    for folder in ("shield", "env", "policies", "experiments"):
        for path in (ROOT / folder).rglob("*.py"):
            if path.name != "compat.py":
                assert later_names(path.read_text(encoding="utf-8")) == set(), path


def test_numba_is_one_that_was_tested():
    pinned = next(line for line in PROJECT["project"]["dependencies"] if line.startswith("numba"))
    assert "<" in pinned
    assert numba.__version__ in SpecifierSet(pinned.removeprefix("numba"))
