"""Nothing that a command reads, or that is there, is written over by what it writes."""

import inspect
from pathlib import Path
from typing import get_args, get_type_hints

import pytest
from commands import run
from logged_runs import header_of, write_log
from steerclear.experiments.cli import app
from steerclear.experiments.cli_files import check_apart, check_files, written_by
from steerclear.experiments.cli_games import ablate
from steerclear.experiments.console import ExitCode
from steerclear.policies.entrants.learned import FILES
from steerclear.shield import ShieldConfig
from steerclear.shield.exceptions import ConfigError


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "run.mcap"
    write_log(path, 20, header=header_of(ShieldConfig()))
    return path.read_bytes()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("--json run.mcap", "named twice, by log and by --json"),
        ("--html ../here/run.mcap", "named twice, by log and by --html"),
        ("--html out.html --json out.html", "named twice, by --html and by --json;"),
        ("--html other.mcap", "does not end in .html"),
        ("--json other.mcap", "the ending of black boxes"),
    ],
)
def test_a_replay_leaves_the_black_box_alone(more, words, written, tmp_path, monkeypatch):
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    Path("run.mcap").write_bytes(written)
    done = run("replay", "run.mcap", *more.split(), terminal_width=200)
    assert done.exit_code == ExitCode.BAD_INPUT
    assert words in " ".join(done.stderr.split())
    assert [path.name for path in here.iterdir()] == ["run.mcap"]
    assert Path("run.mcap").read_bytes() == written


def test_folders_devices_and_what_is_no_file_may_be_named_twice(tmp_path):
    check_apart({"--out": tmp_path, "sources": [tmp_path], "--json": Path("/dev/null"), "--html": Path("/dev/null")})
    check_apart({"records": [tmp_path / "a.npz", tmp_path / "a.npz"], "seed": 3, "--to": None})


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ("play --save a.html --save b.npz --save ./a.html", "a.html is named twice by --save"),
        ("play --save link.npz --save a.npz", "a.npz is named twice by --save"),
        ("fit run.csv ../here/run.csv", "../here/run.csv is named twice by LOG..."),
        ("play --save a.npz --json a.npz", "a.npz is named twice, by --save and by --json"),
    ],
)
def test_one_option_names_a_file_once(words, named, tmp_path, monkeypatch):
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    Path("run.csv").touch()
    Path("link.npz").symlink_to("a.npz")
    done = run(*words.split(), terminal_width=200)
    assert done.exit_code == ExitCode.BAD_INPUT
    assert f"error: {named}" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert sorted(path.name for path in here.iterdir()) == ["link.npz", "run.csv"]


READ = {
    "deploy fleet", "preflight fleet", "referee fleet", "sim-boats fleet", "sea-trial fleet", "train config",
    "train-study config", "export model", "encounters scene", "parity traces", "render records",
    "docs sources", "compare first", "compare second", "replay log", "replay key", "fit logs",
    "reach show file", "reach check files",
}  # fmt: skip
"""Files that commands read."""
FOLDERS = {
    f"{name} folder"
    for name in ("evaluate", "ablate", "tournament", "train", "encounters", "attack", "docs", "train-study",
                 "reach play", "entry report")
}  # fmt: skip
"""Folders of results: refused or gone on with by `ResultStore` and its like, see test_results_write_over_nothing."""


def all_commands(where, begin=""):
    for entry in where.registered_commands:
        yield f"{begin}{entry.name or entry.callback.__name__}", entry.callback
    for group in where.registered_groups:
        yield from all_commands(group.typer_instance, f"{begin}{group.name} ")


def files_of(function):
    """Names of arguments that are paths."""
    hints = get_type_hints(inspect.unwrap(function), include_extras=True)
    return [name for name, hint in hints.items() if name != "return" and "pathlib.Path" in str(get_args(hint)[:1])]


def test_every_file_that_a_command_writes_must_be_new():
    """A new option for a path is one of these, or marked `NEW`: then no file there is written over."""
    known, marked = READ | FOLDERS, set()
    for name, function in all_commands(app):
        written = {f"{name} {argument}" for argument in written_by(function)}
        assert {f"{name} {argument}" for argument in files_of(function)} - known == written
        marked |= written
    assert len(marked) > 30
    assert {"fit file", "reach solve out_file", "render to", "play save", "ablate json_file"} <= marked


THERE = "is there already; name another {}, or remove it"
RESULTS = "would be written over; choose another --out, or move it"
TAKEN = [
    ("fit none.csv", "boat.yaml", THERE.format("--out")),
    ("fit none.csv --out new.yaml", "new.png", THERE.format("--plot")),
    ("fit none.csv --plot mine.svg", "mine.svg", THERE.format("--plot")),
    ("render none.npz --to mine.html", "mine.html", THERE.format("--to")),
    ("play --save new.npz --save mine.npz", "mine.npz", THERE.format("--save")),
    ("reach solve --own heron --other heron --out mine.npz", "mine.npz", THERE.format("--out")),
    ("sim-boats --demo --record mine.npz", "mine.npz", THERE.format("--record")),
    ("platform new mine", "mine.yaml", THERE.format("--out")),
    ("ablate --json mine.json", "mine.json", THERE.format("--json")),
    ("entry check none.zip --json mine.json", "mine.json", THERE.format("--json")),
    (f"export {FILES['jin']} --out mine.npz", "mine.npz", THERE.format("--out")),
    (f"export {FILES['jin']} --out new.npz --submission mine.zip", "mine.zip", THERE.format("--submission")),
    ("encounters --scene none.json --out .", "replay.html", THERE.format("--out")),
    ("train a.yaml --out .", "config.yaml", "would be written over; name another --out, or move it"),
    ("train a.yaml --out .", "best.npz", "would be written over; name another --out, or move it"),
    ("docs --out .", "json_keys.md", "was not made by steerclear docs; choose another --out, or move it"),
    *(
        (f"{command} --out .", name, RESULTS)
        for command in ("ablate --quick", "evaluate medium --quick", "encounters", "attack", "tournament")
        for name in ("report.html", "rows.csv")[: 1 + (command == "attack")]
    ),
]
"""Command lines, a file of that name there, and what is said of it."""


@pytest.mark.parametrize(("words", "name", "said"), TAKEN)
def test_no_command_writes_over_a_file(words, name, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a.yaml").write_text("algorithm: cloning\n")
    Path(name).write_text("mine")
    done = run(*words.split(), terminal_width=200)
    assert done.exit_code == ExitCode.BAD_INPUT
    assert f"{name} {said}" in done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"a.yaml", name}
    assert Path(name).read_text() == "mine"


def test_a_run_that_is_gone_on_with_writes_its_json_again(tmp_path):
    (tmp_path / "a.json").write_text("mine")
    given = {"json_file": tmp_path / "a.json", "resume": True}
    check_files(ablate, given)
    with pytest.raises(ConfigError, match=r"a\.json is there already; name another --json"):
        check_files(ablate, {**given, "resume": False})


def test_docs_makes_its_own_pages_anew(tmp_path):
    for _ in range(2):
        assert run("docs", "--out", tmp_path).exit_code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["json_keys.md"]
