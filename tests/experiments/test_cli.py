import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import json_keys as keys
import numpy as np
import pytest
from commands import run
from steerclear.env.record import load, save
from steerclear.experiments import ablation
from steerclear.experiments import cli_options as options
from steerclear.experiments.console import ExitCode
from steerclear.shield import ShieldConfig
from steerclear.shield.exceptions import GameError

pytestmark = pytest.mark.usefixtures("elsewhere")

TRACES = sorted((Path(__file__).parents[1] / "data" / "traces").glob("*.npz"))
TINY = ["--games", "2", "--max-time", "2", "--jobs", "1"]


@pytest.mark.parametrize("text", ["medium_attack,rammer", "heron", "1.5.2", "f(x)", "{1, 2}", "b'a'", "1j", 9999 * "("])
def test_what_is_no_number_stays_text(text):
    assert options.key_values([f"a={text}"], "--set") == {"a": text}


@pytest.mark.parametrize(("name", "text"), [("adversary_horizon_s", "inf"), ("work_budget", " Infinity")])
def test_a_setting_without_bound_is_given_as_inf(name, text):
    """As the page of settings has it."""
    given = options.ShieldOptions(shield_set=[f"{name}={text}"]).given()
    assert getattr(ShieldConfig.of(**given), name) == math.inf


BAD_INPUT, FAULT = GameError("no such game"), RuntimeError("sunk")


@pytest.mark.parametrize(("error", "code"), [(BAD_INPUT, ExitCode.BAD_INPUT), (FAULT, ExitCode.FAULT)])
def test_a_game_that_cannot_be_played_is_told_and_the_rest_is_kept(error, code, monkeypatch):
    whole = ablation.play_job

    def broken(job):
        if job["opponent"] == "hold":
            raise error
        return whole(job)

    monkeypatch.setattr(ablation, "play_job", broken)
    done = run("ablate", "--opponents", "easy,hold", *TINY, "--out", "out")
    assert done.exit_code == code
    words = "no such game" if error is BAD_INPUT else "this is a fault of steerclear, not of yours (RuntimeError: sunk)"
    assert f"not played: medium vs hold, game 0, shield off: {words}" in done.stdout
    assert "6 games could not be played" in done.stderr
    assert ("its traceback is in" in done.stderr) == (error is FAULT)
    assert "Traceback" not in done.output
    content = json.loads(Path("out/results.json").read_text())
    assert content["games_played"] == 6
    nothing = run("ablate", "--opponents", "hold", *TINY, "--out", "none")
    assert (nothing.exit_code, "A hit is" in nothing.stdout) == (code, False)
    assert not Path("none/results.json").exists()
    about = {"pairing": "medium vs hold", "game": 0, "shielded": False, "state": "off", "fault": error is FAULT}
    assert {**content["failed"][0], "error": ""} == {**about, "error": ""}


def test_goals_decide_the_exit_status_only_when_asked(monkeypatch):
    goal = {"name": "hits", "value": 1.0, "low": None, "high": None, "sense": "<=", "limit": 0.0, "met": False}
    monkeypatch.setattr(ablation, "check", lambda goals, table: [goal])
    arguments = ["ablate", "--opponents", "hold", "--games", "1", "--max-time", "1", "--jobs", "1"]
    assert run(*arguments, "--out", "a").exit_code == ExitCode.OK
    assert run(*arguments, "--out", "b", "--check").exit_code == ExitCode.GOAL_MISSED


def test_evaluate_plays_with_or_without_the_shield():
    off = run("evaluate", "medium", "--opponents", "hold", *TINY, "--out", "off", "--json", "off.json")
    on = run("evaluate", "medium", "--opponents", "hold", *TINY, "--out", "on", "--json", "on.json", "--shield")
    assert (off.exit_code, on.exit_code) == (ExitCode.OK, ExitCode.OK), off.output + on.output
    assert "one stay within 4 m may hold several\ninto 2.5 m." in off.stdout
    contents = [json.loads(Path(name).read_text()) for name in ("off.json", "on.json")]
    assert [(c["pairings"][0]["games_off"], c["pairings"][0]["games_on"]) for c in contents] == [(2, 0), (0, 2)]
    assert all(keys.undocumented(content, keys.KEYS["ablate"]) == [] for content in contents)
    titles = [Path(name, "report.html").read_text() for name in ("off", "on")]
    assert "Games without the shield" in titles[0]
    assert "Games with the shield" in titles[1]
    assert all(content["goals"] == [] for content in contents)
    assert run("docs", "off", "--out", "pages").exit_code == ExitCode.OK
    assert "shield on" not in Path("pages/evaluation_aamas2024.md").read_text()
    assert "shield on" not in off.stdout
    assert "shield off" not in on.stdout
    assert "on, covered" in on.stdout
    assert "covered: they are." in " ".join(on.stdout.split())
    left = run("evaluate", "medium", "--opponents", "hold", *TINY, "--out", "left", "--shield", "--no-shield-autopilot")
    assert "on, left to the game" in left.stdout


ALL_GAME = """
class solution:
    def compute_action(self, agent_id, full_obs_normalized, full_obs, global_state):
        raise RuntimeError("no model")
"""


@pytest.mark.parametrize("command", ["evaluate hold --opponents ./own", "play --own ./own"])
def test_a_policy_that_held_all_game_changes_the_exit_status(command):
    Path("own").mkdir()
    Path("own/solution.py").write_text(ALL_GAME)
    tiny = ["--max-time", "1"] if command.startswith("play") else [*TINY, "--out", "out", "--json", "a.json"]
    done = run(*command.split(), *tiny)
    assert done.exit_code == ExitCode.BAD_INPUT, done.output
    assert "gave no usable answer throughout" in " ".join(done.stderr.split())
    assert "no model" in done.stderr
    if not command.startswith("play"):
        assert len(json.loads(Path("a.json").read_text())["held"]) == 1
        assert "WARNING" in done.stdout


def test_play_saves_what_it_is_asked_to_and_render_goes_on_from_there(monkeypatch):
    """By a hand on the keys, in a window that nobody sees."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    saves = [part for name in ("a.npz", "a.html", "a.png") for part in ("--save", name)]
    words = ["--own", "keyboard", "--speed", "1000", "--max-time", "2", "--opponent", "hold"]
    done = run("play", *words, *saves, "--json", "a.json")
    assert done.exit_code == ExitCode.OK, done.output
    content = json.loads(Path("a.json").read_text())
    assert keys.undocumented(content, keys.KEYS["play"]) == []
    assert content["game"]["steps"] == 20
    assert len(load("a.npz")["nominal"]) == 20
    films = run("render", "a.npz", "--to", "b.gif", "--json", "b.json")
    assert films.exit_code == ExitCode.OK, films.output
    assert keys.undocumented(json.loads(Path("b.json").read_text()), keys.KEYS["render"]) == []
    assert Path("b.gif").read_bytes()[:3] == b"GIF"
    assert run("render", "a.npz", "a.npz", "--to", "two.html").exit_code == ExitCode.OK
    assert "only a replay" in run("render", "a.npz", "a.npz", "--to", "two.gif").stderr


@pytest.mark.parametrize("at", ["nan", "-0.2", "1e9"])
def test_a_record_becomes_a_replay_and_a_picture_of_no_moment_of_it_is_refused(at, game_record):
    save(game_record, "game.npz")
    assert run("render", "game.npz").stdout == "game.html\n"
    done = run("render", "game.npz", "--to", "a.png", "--at", at)
    assert done.exit_code == ExitCode.BAD_INPUT
    assert done.stderr.startswith("error: ")
    assert "the game has 0 to 6 s" in done.stderr
    assert not os.path.exists("a.png")


def test_parity_passes_on_a_recorded_game_and_fails_on_a_changed_one(tmp_path):
    trace = min(TRACES, key=lambda path: path.stat().st_size)
    done = run("parity", trace, "--json", "p.json")
    assert done.exit_code == ExitCode.OK, done.output
    content = json.loads(Path("p.json").read_text())
    assert keys.undocumented(content, keys.KEYS["parity"]) == []
    assert content["passed"] is True
    with np.load(trace) as archive:
        arrays = {name: archive[name] for name in archive.files}
    arrays["position"][-1, 0, 0] += 1e-3
    arrays["captures"][-1, 0] += 1
    np.savez(tmp_path / "moved.npz", **arrays)
    failed = run("parity", trace, "moved.npz", "--json", "q.json")
    assert failed.exit_code == ExitCode.GOAL_MISSED
    assert "position_m 0.001 is over 1e-06" in failed.stdout
    assert "captures of blue" in failed.stdout
    content = json.loads(Path("q.json").read_text())
    assert keys.undocumented(content, keys.KEYS["parity"]) == []
    assert [row["passed"] for row in content["traces"]] == [True, False]


def test_the_version_is_told():
    assert re.fullmatch(r"steerclear \d+\.\d+\.\d+\n", run("--version").stdout)


def test_a_folder_that_is_gone_is_named(tmp_path):
    here = tmp_path / "gone"
    here.mkdir()
    code = f"import os; os.chdir({str(here)!r}); os.rmdir({str(here)!r}); import steerclear.experiments.cli"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stderr == "error: the present folder is gone (No such file or directory); change to another: cd\n"
