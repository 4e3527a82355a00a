"""``entry wrap``: a shielded zip runs where only numpy is, and decides as the compiled shield does."""

import ast
import json
import math
import re
import subprocess
import sys
import textwrap
import zipfile
from pathlib import Path

import alone
import commands
import numpy as np
import pytest
import steerclear.shield
from json_keys import KEYS, undocumented
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.console import ExitCode
from steerclear.experiments.entries.onboard.state import GameSpec
from steerclear.experiments.entries.onboard.team_shield import ShieldedTeam, _tuples
from steerclear.experiments.entries.wrap import STAND_INS, code, game_spec
from steerclear.policies.submissions.made_for import made_for
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig, Surroundings
from steerclear.shield.exceptions import ConfigError

STATES = Path(__file__).parents[2] / "data" / "plain_states.npz"
CHASE = """
    import numpy as np
    from helper import TOP
    class Net: pass
    class solution:
        def __init__(self): self.asked = []
        def compute_action(self, agent_id, full_obs_normalized, full_obs, global_state):
            self.asked.append(agent_id)
            away = np.array([80.0, 40.0]) - global_state[agent_id, "pos"]
            bearing = np.degrees(np.arctan2(*away))
            return TOP, float((bearing - global_state[agent_id, "heading"] + 180) % 360 - 180)
"""
"""An entry that sends all its boats to one place."""


def run(*arguments):
    return commands.run("entry", *arguments)


@pytest.fixture(scope="module")
def folder_of_entry(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bare") / "team"
    folder.mkdir()
    (folder / "solution.py").write_text(textwrap.dedent(CHASE))
    (folder / "helper.py").write_text("TOP = 3.0\n")
    return folder


@pytest.fixture(scope="module")
def wrapped(folder_of_entry, tmp_path_factory):
    """A shielded zip, what was told of it, and a folder it is unpacked in."""
    place = tmp_path_factory.mktemp("wrapped")
    done = run("wrap", folder_of_entry, "--out", place / "s.zip", "--profile", "ramming", "--json", place / "s.json")
    assert done.exit_code == ExitCode.OK, done.output
    with zipfile.ZipFile(place / "s.zip") as packed:
        packed.extractall(place / "unpacked")
    return place / "s.zip", json.loads((place / "s.json").read_text()), place / "unpacked"


def answers_alone(folder, what, tmp_path):
    out = tmp_path / f"{what}.npy"
    command = [sys.executable, "-W", "error", alone.__file__, str(folder), what, str(STATES), str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    return np.load(out), done.stderr


def test_it_decides_as_the_compiled_shield_does_where_only_numpy_is(wrapped, tmp_path):
    sent, _ = answers_alone(wrapped[2], "shield", tmp_path)
    settings = ShieldConfig.of(**wrapped[1]["shield"])
    recorded = dict(np.load(STATES))
    expected = alone.decide(Shield(settings), Fleet, Commands, Surroundings, recorded)
    np.testing.assert_array_equal(sent, expected)  # the same statements give the same bits
    assert (sent != recorded["wanted"]).any(axis=(1, 2)).sum() >= 10


def test_it_answers_as_an_entry_does_and_tells_nothing(wrapped, tmp_path):
    actions, told = answers_alone(wrapped[2], "entry", tmp_path)
    assert actions.shape == (10, 3, 2)
    assert np.isfinite(actions).all()
    assert told == ""


def write_team(place, speed):
    """An entry whose command is in a module beside it, which any other entry may have one of the same name of."""
    place.mkdir()
    (place / "solution.py").write_text(
        "import helper\nclass solution:\n    def compute_action(self, agent_id, a, b, c):\n"
        "        import helper as late\n        return helper.SPEED, late.SPEED\n"
    )
    (place / "helper.py").write_text(f"SPEED = {speed}\n")
    return place


def test_two_zips_in_one_process_play_their_own_policies(tmp_path):
    for name, speed in (("one", 1.0), ("two", 2.0)):
        done = run("wrap", write_team(tmp_path / f"bare_{name}", speed), "--out", tmp_path / f"{name}.zip")
        assert done.exit_code == ExitCode.OK, done.output
        with zipfile.ZipFile(tmp_path / f"{name}.zip") as packed:
            packed.extractall(tmp_path / f"team_{name}")
    for how in ("as solution", "as packages"):
        out = tmp_path / "two.npy"
        command = [sys.executable, alone.__file__, str(tmp_path), how, str(STATES), str(out)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        np.testing.assert_allclose(np.load(out), [(1.0, 1.0), (2.0, 2.0)])


def shielded_team():
    facts = game_spec("mctf2026", {"separation_m": 4.0})
    return ShieldedTeam(GameSpec(**{name: _tuples(value) for name, value in facts.items()}))


@pytest.mark.parametrize("key", ["global_state", "agent_0"])
def test_a_global_state_within_an_info_is_found(key):
    team = shielded_team()
    state = alone.state_of(np.array([(30.0 + 20 * i, 40.0, 0.0, 0.0) for i in range(6)]))
    info = {"global_state": state} if key == "global_state" else {"agent_0": {"global_state": state}}
    assert team.action(lambda name: (1.5, 10.0), "agent_0", info).tolist() == [1.5, 10.0]
    assert team.failure("agent_0") is None


def test_it_says_which_game_and_which_shield_it_is_for(wrapped, tmp_path):
    path, told, folder = wrapped
    assert path.stat().st_size == told["bytes"] <= 5e6
    assert undocumented(told, KEYS["entry wrap"]) == []
    assert (told["shield"]["dt_s"], told["shield"]["move_s"]) == (1.0, pytest.approx(0.1))
    assert (folder / "helper.py").read_text() == "TOP = 3.0\n"
    made = made_for(path)
    assert (made.preset, made.separation_m, made.decision_s) == ("mctf2026", 4.0, 1.0)
    assert made.shield == told["shield"]
    read_me = ast.get_docstring(ast.parse((folder / "solution.py").read_text()))
    assert "For preset mctf2026, a decision every 1 s. The shield keeps 4 m, profile ramming" in " ".join(
        read_me.split()
    )
    file = tmp_path / "c.json"
    done = run("check", path, "--max-time", 2, "--json", file)
    assert "made by steerclear for preset mctf2026; its shield keeps 4 m, profile ramming" in done.stdout
    assert json.loads(file.read_text())["made_for"]["shield"] == told["shield"]
    assert undocumented(json.loads(file.read_text()), KEYS["entry check"]) == []


def test_commands_refuse_a_game_it_is_not_for_and_tell_of_less(wrapped):
    other = run("check", wrapped[0], "--max-time", 2, "--preset", "mctf2025")
    assert other.exit_code == ExitCode.BAD_INPUT
    assert "is for a decision every 1 s, but this game decides every 0.1 s; play it by preset mctf2026" in other.stderr
    wider = ["play", "--own", str(wrapped[0]), "--opponent", "hold", "--preset", "mctf2026", "--max-time", "1"]
    done = commands.run(*wider, "--set", "agent_radius_m=3", "--no-shield")
    assert done.exit_code == ExitCode.OK, done.output
    assert done.stderr.count("keeps 4 m (separation_m), but this game counts collisions at 6 m") == 1


@pytest.mark.parametrize(("command", "told"), [("ablate --own", 1), ("evaluate", 0)])
def test_games_without_our_shield_are_not_without_one_where_the_entry_has_its_own(command, told, wrapped, monkeypatch):
    def begun(*arguments):
        raise ConfigError("games would be played now")

    monkeypatch.setattr("steerclear.experiments.cli_options.RunOptions.run", begun)
    words = [*command.split(), str(wrapped[0]), "--opponents", "hold", "--preset", "mctf2026"]
    done = commands.run(*words)
    assert "would be played now" in done.stderr
    assert done.stderr.count("has a shield in it: off means that one alone") == told


def test_two_boats_that_run_at_each_other_are_kept_apart(wrapped):
    """In our own game, with the entry's class found by its name in the zip's module, as pickles do."""
    env = MctfEnv(GameConfig.preset("mctf2026", max_time_s=40.0))
    observations, infos = env.reset(seed=3)
    ids = list(env.possible_agents)
    entry = policies.make(str(wrapped[0]))
    entry.reset(env, ids[:3], 3)
    hold = dict.fromkeys(ids[3:], 16)
    least_m = math.inf
    while env.agents:
        observations, _, _, _, infos = env.step({**entry.act(observations, infos), **hold})
        places = env.core.state[0, :3, :2]
        apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
        least_m = min(least_m, apart[np.triu_indices(3, 1)].min())
    report = entry.report()
    assert report.held == 0, report
    assert 4.0 <= least_m < 8.0
    env.close()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["medium", "--out", "x.zip"], "medium is no entry"),
        (["empty.zip", "--out", "x.zip"], "needs one solution.py"),
        (["{bare}", "--out", "there.zip"], "there.zip is there already"),
        (["{bare}", "--out", "shielded"], "give the name of a zip"),
        (["{bare}", "--out", "there.zip/x.zip"], "--out there.zip/x.zip cannot be written"),
        (["{bare}", "--out", "x.zip", "--profile", "pirates"], "unknown profile 'pirates'"),
        (["{bare}", "--out", "x.zip", "--separation", "500"], "the shorter side of the field, 80 m"),
        (["{bare}", "--out", "x.zip", "--shield-set", "speed=3"], "unknown shield setting 'speed'"),
        (["{bare}", "--out", "x.zip", "--preset", "mctf2025"], "give --preset mctf2026"),
        (["{zip}", "--out", "x.zip"], "is shielded already"),
        (["raises", "--out", "x.zip"], "raises gave nothing usable throughout the game"),
    ],
)
def test_what_cannot_be_wrapped_is_one_line(arguments, words, wrapped, folder_of_entry, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("there.zip").write_text("mine")
    with zipfile.ZipFile("empty.zip", "w") as archive:
        archive.writestr("notes.txt", "nothing")
    Path("raises").mkdir()
    Path("raises/solution.py").write_text(
        "class solution:\n    def compute_action(self, agent_id, a, b, c):\n        raise ValueError('bad day')\n"
    )
    given = [one.format(bare=folder_of_entry, zip=wrapped[0]) for one in arguments]
    done = run("wrap", *given)
    assert done.exit_code == ExitCode.BAD_INPUT, done.output
    assert words in done.stderr.replace("\n", " "), done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert not Path("x.zip").exists()
    assert Path("there.zip").read_text() == "mine"


FALTERS = """
    import os
    class Mute(Exception):
        def __str__(self): raise RuntimeError
    class solution:
        def compute_action(self, agent_id, full_obs_normalized, full_obs, global_state):
            if agent_id == "agent_1": raise Mute
            if agent_id == "agent_2" and os.path.exists({flag!r}): exit()
            return 4
"""


def test_what_fails_inside_a_zip_is_counted_as_that_of_a_bare_entry(tmp_path):
    (tmp_path / "team").mkdir()
    flag = tmp_path / "flag"
    (tmp_path / "team" / "solution.py").write_text(textwrap.dedent(FALTERS.format(flag=str(flag))))
    done = run("wrap", tmp_path / "team", "--out", tmp_path / "s.zip")
    assert done.exit_code == ExitCode.OK, done.output
    assert "plays, but agent_1 failed in 10 of 10 steps; its shield tells boats to stop" in done.stderr
    flag.touch()
    for entry in ("team", "s.zip"):
        done = run("check", tmp_path / entry, "--max-time", "2")
        assert done.exit_code == ExitCode.GOAL_MISSED, done.output
        assert "plays, but agent_1 failed in 2 of 2 steps, agent_2 failed in 2 of 2 steps." in done.stdout
        assert "failed: raised Mute (agent_1 x 2): Mute: (no text)" in done.stdout
        assert "failed: raised SystemExit (agent_2 x 2)" in done.stdout


def test_a_shield_that_cannot_decide_is_a_failure_of_the_boat():
    team = shielded_team()
    assert team.action(lambda name: 4, "agent_0", {}).tolist() == [0.0, 0.0]
    assert team.failure("agent_0")[0] == "shield could not decide"
    assert "cannot be read" in team.failure("agent_0")[1]
    assert team.failure("boat")[1] == "unknown boat 'boat'"


def test_the_shields_own_sources_are_packed_as_they_are():
    files, shield = code(), Path(steerclear.shield.__file__).parent
    packed = {name.removeprefix("shield/") for name in files if name.startswith("shield/")}
    own = [name for name in packed - set(STAND_INS) if not name.endswith("__init__.py")]
    assert len(own) > 30
    for name in own:
        text = files[f"shield/{name}"]
        assert text == (shield / name).read_text(encoding="utf-8")
        assert not re.search(r"^\s*(?:from|import) steerclear", text, re.MULTILINE), f"{name}: import relatively"
