"""What users see of the commands: options, exit codes, files, figures of fixed seeds, and how runs end and go on."""

import errno
import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import typer
from commands import run
from json_keys import KEYS, undocumented
from steerclear.experiments import cli
from steerclear.experiments.console import ExitCode

ALL = (Path(__file__).parents[1] / "data" / "commands.txt").read_text(encoding="utf-8")
"""Every command with its options and arguments: public, so that none goes without a word."""


def commands_of(command, name=""):
    for sub, inner in getattr(command, "commands", {}).items():
        yield from commands_of(inner, f"{name} {sub}".strip())
    if not hasattr(command, "commands"):
        options = {text for one in command.params for text in (*one.opts, *one.secondary_opts)}
        yield name, {text for text in options if text.startswith("-") or text.isidentifier()} - {"--help", "-h"}


def test_commands_and_options_stay():
    lines = re.sub(r"\n    +", " ", ALL.strip()).splitlines()
    told = {name: set(options.split()) for name, _, options in (line.partition(":") for line in lines)}
    assert dict(commands_of(typer.main.get_command(cli.app))) == told


TINY = ["ablate", "--opponents", "easy", "--games", "2", "--max-time", "40", "--seed", "3", "--jobs", "1"]
FIGURES = {
    "tags": (2.0, 2.0, 2.0),
    "tags_against": (2.0, 2.0, 2.0),
    "violations_teammate_2.5m": (2.0, 0.0, 0.0),
    "violations_teammate_4.0m": (2.0, 1.0, 2.5),
    "violations_driven_4.0m": (1.5, 1.0, 2.5),
    "clean_games": (0.0, 1.0, 1.0),
    "closest_m": (0.9098, 3.5511, 3.1749),
    "closest_of_all_m": (0.1879, 3.4758, 2.7234),
    "changed_share": (None, 3.2193, 4.7083),
    "mean_heading_change_deg": (None, 81.1675, 68.8404),
    "mean_speed_change_mps": (None, 0.0, 0.0274),
    "reversals_per_boat_minute": (39.75, 47.5, 38.0),
    "collisions": (4.0, 0.0, 0.0),
    "primary": (-1.0, 0.0, 0.0),
}
"""Off, on and covered; those of off and covered are version 0.8.0's, whose "on" covered."""


def test_the_same_seeds_give_the_same_figures_and_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    done = run(*TINY, "--out", "out", "--json", "copy.json")
    assert done.exit_code == ExitCode.OK, done.output
    content = json.loads(Path("copy.json").read_text())
    assert json.loads(Path("out/results.json").read_text()) == content
    assert undocumented(content, KEYS["ablate"]) == []
    assert "medium vs easy: 2 games" in done.stdout
    assert "covered: they are. Goals are judged on shield on, left to the game." in " ".join(done.stdout.split())
    assert max(len(line) for line in done.stdout.splitlines()) <= 80
    metrics = content["pairings"][0]["metrics"]
    found = {key: tuple(metrics[key].get(s, {}).get("value") for s in ("off", "on", "covered")) for key in FIGURES}
    assert found == {key: pytest.approx(values, abs=5e-4) for key, values in FIGURES.items()}
    change, hits = metrics["closest_m"]["difference"], metrics["violations_teammate_2.5m"]["on"]
    assert [change[part] for part in ("value", "low", "high")] == pytest.approx([2.6413, 1.9946, 3.2879], abs=5e-4)
    assert (hits["low"], hits["high"], hits["n"]) == (0.0, pytest.approx(-math.log(0.05) / 2), 2)
    reasons = {name: count for name, count in content["pairings"][0]["reasons"].items() if count}
    assert reasons == {"PASSED": 1924, "LEAST_CHANGE": 34, "BACKUP": 28, "BEST_EFFORT": 2}
    assert {path.name for path in Path("out").iterdir()} - {".lock"} == {
        *("experiment.json", "rows.jsonl", "results.json", "report.html", "replay.html"), content["files"]["games"],
    }  # fmt: skip
    assert {"command", "complete", "settings", "versions", "machine", "wall_s", "failed", "goals"} <= set(content)
    assert run("compare", "out", "out").exit_code == ExitCode.OK
    assert run("docs", "out", "--out", "pages").exit_code == ExitCode.OK
    assert Path("pages/ablation_aamas2024.md").exists()
    refused = run("encounters", "--out", "out", "--resume")
    assert refused.exit_code == ExitCode.BAD_INPUT
    assert "holds results of 'ablate', not of 'encounters'; choose another --out" in refused.stderr


STANDINGS = {
    ("off", "ohto"): (1, -0.5, 2.0),
    ("off", "jin"): (2, -1.5, 6.0),
    ("all", "jin"): (1, 0.0, 0.0),
    ("all", "ohto"): (1, 0.0, 0.0),
}
"""Rank, score and collisions as version 0.8.0 has them."""


def test_a_tournament_of_fixed_seeds(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments = ["tournament", "--teams", "ohto,jin", "--max-time", "40", "--seed", "3", "--jobs", "1", "--out", "out"]
    done = run(*arguments)
    assert done.exit_code == ExitCode.OK, done.output
    content = json.loads(Path("out/results.json").read_text())
    off, covered = content["states"]
    lines = {(state["state"], line["team"]): line for state in (off, covered) for line in state["standings"]}
    assert {key: (line["rank"], line["score"], line["collisions"]) for key, line in lines.items()} == STANDINGS
    assert {path.name for path in Path("out").iterdir()} >= {"report.html", "replay.html"}
    again = run(*arguments, "--resume")
    assert again.exit_code == ExitCode.OK, again.output
    assert "4 of 4 games are in out/rows.jsonl and are taken from there" in again.stderr
    assert json.loads(Path("out/results.json").read_text())["games_resumed"] == content["games_played"]


ENDS = {"SIGINT": ExitCode.INTERRUPTED, "SIGKILL": -9}
"""SIGTERM is sent where foreign code plays (entries/test_entries_commands.py) and to a training."""


def _heed_ctrl_c():
    """Undo what a shell does to what it starts in the background: there Ctrl-C is ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def children_of(pid):
    return Path(f"/proc/{pid}/task/{pid}/children").read_text().split()


@pytest.mark.skipif(sys.platform != "linux", reason="sends POSIX signals, looks into /proc")
def test_however_a_run_ends_what_is_finished_is_kept_and_gone_on_with(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    begin = ["ablate", "--opponents", "hold", "--max-time", "4", "--no-shield-autopilot", "--judge", "none", "--games"]
    command = [sys.executable, "-m", "steerclear.experiments.cli", *begin, "4000"]
    whole = run(*begin, "2", "--jobs", "1", "--out", "whole")
    assert whole.exit_code == ExitCode.OK, whole.output
    expected = json.loads(Path("whole", "results.json").read_text())
    for name, jobs in (("SIGINT", "1"), ("SIGKILL", "2")):
        process = subprocess.Popen(
            [*command, "--jobs", jobs, "--out", name], stderr=subprocess.PIPE, preexec_fn=_heed_ctrl_c
        )
        lines, deadline = tmp_path / name / "rows.jsonl", time.monotonic() + 300.0
        while not (lines.exists() and lines.read_bytes().count(b"\n") >= 2):
            assert time.monotonic() < deadline
            time.sleep(0.02)
        busy = run(*begin, "2", "--jobs", "1", "--out", name, "--resume")
        assert "is being written to by another process; wait until it is done" in busy.stderr
        workers = children_of(process.pid)
        process.send_signal(getattr(signal, name))
        assert len(workers) >= (2 if name == "SIGKILL" else 0)
        while any(Path(f"/proc/{pid}/exe").exists() for pid in workers):
            assert time.monotonic() < deadline, "no worker is left"
            time.sleep(0.02)
        _, errors = process.communicate(timeout=300.0)
        assert process.returncode == ENDS[name], errors
        if name == "SIGINT":
            assert f"--out {name} --resume goes on from there" in errors.decode()
            assert json.loads(Path(name, "results.json").read_text())["complete"] is False
        rows = Path(name, "rows.jsonl")  # two of the games that are asked for, and one cut in the middle of a line
        rows.write_bytes(b"".join([*rows.read_bytes().splitlines(keepends=True)[:2], b'{"cut']))
        again = run(*begin, "2", "--jobs", "1", "--out", name, "--resume")
        assert again.exit_code == ExitCode.OK, again.output
        found = json.loads(Path(name, "results.json").read_text())
        assert found["games_resumed"] >= 2
        assert (found["complete"], found["games_played"]) == (True, 4)
        assert without_times(found) == without_times(expected)


def without_times(content):
    metrics = content["pairings"][0]["metrics"]
    return {key: figures for key, figures in metrics.items() if not key.startswith("decision_")}


def test_a_full_disk_loses_nothing_and_says_so(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    kept, written = os.fsync, []

    def full(file):
        written.append(file)
        if len(written) > 2:
            raise OSError(errno.ENOSPC, "No space left on device")
        kept(file)

    monkeypatch.setattr(os, "fsync", full)
    done = run("ablate", "--opponents", "hold", "--games", "2", "--max-time", "2", "--jobs", "1", "--out", "out")
    monkeypatch.undo()
    assert done.exit_code == ExitCode.BAD_INPUT
    assert "(No space left on device)" in done.stderr
    assert "make room, then --resume" in done.stderr
    assert len((tmp_path / "out/rows.jsonl").read_text().splitlines()) == 2


def test_a_folder_of_an_earlier_version_is_refused_by_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("old").mkdir()
    Path("old/games.jsonl").write_text("{}\n")
    Path("old/results.json").write_text('{"command": "ablate", "versions": {"steerclear": "0.8.0"}}')
    before = {path.name: path.read_text() for path in Path("old").iterdir()}
    done = run("ablate", "--opponents", "hold", "--out", "old", "--resume")
    assert done.exit_code == ExitCode.BAD_INPUT
    assert "holds results of steerclear 0.8.0, whose games this version does not read; make them again" in done.stderr
    assert {path.name: path.read_text() for path in Path("old").iterdir()} == before
