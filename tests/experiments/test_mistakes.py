"""One mistake in each command line: it ends in one line that names the remedy, before anything is done."""

import json
import shlex
from pathlib import Path

import pytest
import typer
from commands import run
from steerclear.env.record import save
from steerclear.experiments import cli
from steerclear.experiments import cli_train as train
from steerclear.experiments.console import ExitCode
from steerclear.experiments.unused import RULES
from steerclear.policies.entrants import learned
from steerclear.shield.extras import install_command

MISTAKES = [
    tuple(line.split(" -> "))
    for line in (Path(__file__).parents[1] / "data" / "mistakes.txt").read_text(encoding="utf-8").splitlines()
]
"""A command line, and words that what is said of it holds."""

ALONE = """version: 1
team: blue
field: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, size_m: [160, 80]}
geofence: {xmin_m: 0, ymin_m: 0, xmax_m: 160, ymax_m: 80}
boats:
  - {name: blue_1, team: blue, platform: heron, link: {kind: mavlink, address: "udpin:127.0.0.1:14550", system_id: 1}}
shield: {separation_m: 2.5, position_error_m: 0.0}
"""
"""A boat that plays no game."""


@pytest.fixture
def workplace(tmp_path, monkeypatch, game_record):
    """A folder with a few files, none of which is what it is given for."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    Path("text.txt").write_text("wind from the west\n")
    Path("a_folder").mkdir()
    Path("list.json").write_text("[1, 2]")
    Path("other.json").write_text(json.dumps({"command": "play", "game": {}}))
    Path("a.zip").write_bytes(b"PK\x05\x06" + bytes(18))
    Path("mypol.py").write_text("def act(observation):\n    return 4\n")
    Path("team").mkdir()
    Path("team", "solution.py").touch()
    save(game_record, "game.npz")
    demo = Path(cli.__file__).parent / "templates" / "demo_fleet.yaml"
    Path("fleet.yaml").write_text(demo.read_text(encoding="utf-8"))
    Path("alone.yaml").write_text(ALONE)
    Path("one_boat.yaml").write_text("name: tub\nmax_speed_mps: 2.0\n")
    Path("ashore.yaml").write_text(demo.read_text(encoding="utf-8").replace("log_dir: ./logs", "log_dir: text.txt"))
    Path("torn.py").write_text("class Torn(:\n")
    return tmp_path


@pytest.mark.parametrize(("line", "words"), MISTAKES, ids=[line for line, _ in MISTAKES])
def test_a_mistake_ends_in_one_line_that_names_the_remedy(line, words, workplace):
    before = sorted(workplace.rglob("*"))
    done = run(*shlex.split(line))
    said = " ".join(done.output.split())
    assert done.exit_code == ExitCode.BAD_INPUT, said
    assert isinstance(done.exception, SystemExit)
    assert "Traceback" not in said
    assert words.lower() in said.lower(), said
    if done.stderr.startswith("error:"):
        assert done.stderr.count("\n") == 1, "one line"
    left = [path.name for path in sorted(workplace.rglob("*")) if path not in before]
    assert left in ([], ["results"], ["logs"]), "nothing was done"


@pytest.mark.parametrize("line", ["train learn.yaml --out t", "train-study learn.yaml --out t"])
def test_who_learns_without_the_extra_is_told_which_it_is(line, workplace, monkeypatch):
    Path("learn.yaml").write_text((learned.TEAMS / "jin.yaml").read_text(encoding="utf-8"))
    monkeypatch.setattr(train, "find_spec", lambda name: None)
    done = run(*shlex.split(line))
    assert done.exit_code == ExitCode.BAD_INPUT, done.output
    assert install_command("train") in done.stderr
    assert not Path("t").exists()


def test_the_table_covers_every_command():
    named = {line.split()[0] for line, _ in MISTAKES}
    assert {info.name or info.callback.__name__.replace("_", "-") for info in cli.app.registered_commands} <= named
    assert len(MISTAKES) >= 80


def test_every_rule_of_options_that_change_nothing_has_a_line_and_names_arguments_there_are():
    """The lines above refuse each option of each rule by its own words."""
    said = [(line, words) for line, words in MISTAKES if "would change nothing" in words]
    for rule in RULES:
        for name in rule.commands:
            spelled = {option.name: option.opts[0] for option in command_of(name).params}
            assert {*rule.options} <= {*spelled}, f"{name} has no such options"
            lines = [words for line, words in said if line.startswith(f"{name} ")]
            assert any(words.partition(": ")[2] and words.partition(": ")[2] in rule.why for words in lines), rule


def command_of(name):
    """A command, or one of a group."""
    found = typer.main.get_command(cli.app)
    for part in name.split():
        found = found.commands[part]
    return found


@pytest.mark.parametrize(
    "line",
    ["evaluate hold --opponents hold --games 1", "tournament --teams hold,easy --shield off"],
)
def test_what_is_only_a_distance_to_count_at_is_said_once_nothing_else_is_wrong(line, workplace):
    words = "the shield is off: 3 m is only the distance at which hits are counted; add --shield to keep it"
    line = [*line.split(), "--separation", "3", "--max-time", "1", "--judge", "none", "--jobs", "1"]
    assert words not in run(*line, "--penalty", "nan").stderr
    done = run(*line)
    assert done.exit_code == ExitCode.OK, done.output
    assert done.stderr.count(words) == 1
