"""What imports what: no circles, and ``shield/`` nothing of the rest."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest
import steerclear.shield
from steerclear.experiments.entries.wrap import LEFT_OUT, ONBOARD, STAND_INS

ROOT = Path(steerclear.shield.__file__).parent.parent
FOLDERS = ("shield", "env", "policies", "experiments")
KNOWN = {(f"steerclear.shield.{name}", "steerclear.shield.wrappers") for name in ("shield", "batch")}
"""Imports within a function that close a circle: short ways to the wrappers (`wrap`, `for_game`, `filter_for`)."""


def module_of(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(("steerclear", *parts[: -1 if parts[-1] == "__init__" else None]))


FILES = {module_of(path): path for name in FOLDERS for path in sorted((ROOT / name).rglob("*.py"))}


def statements(tree):
    """All imports, those within functions, too, but not those for types alone."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node
        elif not (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)):
            yield from statements(node)


def imported(name):
    """Our modules that a module imports, deepest first."""
    path, found = FILES[name], set()
    for node in statements(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name in FILES}
            continue
        base = name.split(".")
        base = base[: len(base) - node.level + (path.name == "__init__.py")] if node.level else []
        source = ".".join([*base, *([node.module] if node.module else [])])
        for alias in node.names:
            whole = f"{source}.{alias.name}"
            found |= {whole} if whole in FILES else {source} & FILES.keys()
    return {other for other in found if other != name and not any(a == name and other.startswith(b) for a, b in KNOWN)}


GRAPH = {name: imported(name) for name in FILES}


def test_nothing_imports_itself_by_way_of_others():
    left = {name: set(others) for name, others in GRAPH.items()}
    while free := [name for name, others in left.items() if not others & left.keys()]:
        for name in free:
            del left[name]
    asked = {other for others in left.values() for other in others}
    assert sorted(left.keys() & asked) == []


def test_a_circle_would_be_seen():
    assert {"steerclear.shield.shield", "steerclear.shield.decide"} <= GRAPH.keys()
    assert "steerclear.shield.config" in GRAPH["steerclear.shield.shield"]


def test_the_shield_imports_nothing_of_the_rest_and_the_game_nothing_of_policies_and_experiments():
    allowed = {"steerclear.shield": ("steerclear.shield",), "steerclear.env": ("steerclear.shield", "steerclear.env")}
    for folder, whom in allowed.items():
        for name in (name for name in FILES if name.startswith(folder)):
            assert not [other for other in GRAPH[name] if not other.startswith(whom)], name


def imported_names(module):
    """What the other modules that a zip packs import of a module of the shield."""
    found = set()
    for name, path in FILES.items():
        if not name.startswith("steerclear.shield.") or name.split(".")[2] in LEFT_OUT:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.level:
                base = name.split(".")
                base = base[: len(base) - node.level + (path.name == "__init__.py")]
                if ".".join([*base, *([node.module] if node.module else [])]) == module:
                    found |= {alias.name for alias in node.names}
    return found


@pytest.mark.parametrize(("place", "stand_in"), STAND_INS.items())
def test_a_stand_in_has_what_others_import_of_what_it_stands_for(place, stand_in):
    """In shielded zips, see `steerclear.experiments.entries.wrap`."""
    assert (ROOT / "shield" / place).is_file()
    tree = ast.parse((ONBOARD / "stand_ins" / stand_in).read_text(encoding="utf-8"))
    known = {node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    for node in [*tree.body, *(inner for one in tree.body if isinstance(one, ast.With) for inner in one.body)]:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        known |= {one.id for one in targets if isinstance(one, ast.Name)}
    module = "steerclear.shield." + place.removesuffix(".py").replace("/", ".")
    assert imported_names(module) <= known


SLOW = ("scipy.stats", "scipy.optimize", "pandas", "qpsolvers", "matplotlib", "torch")
"""What takes a quarter of a second or more to import: whoever needs it imports it where it is used."""


def test_commands_are_there_without_what_takes_long_to_import():
    code = f"import sys; from steerclear.experiments.cli import build; build(); print(*{{*{SLOW}}} & {{*sys.modules}})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
