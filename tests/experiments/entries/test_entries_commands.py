"""Commands put foreign code apart: its accidents cost its own moves, and its results say so."""

import json
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest
from commands import run
from steerclear.experiments.console import ExitCode

pytestmark = pytest.mark.usefixtures("elsewhere")

TINY = ["--games", "1", "--max-time", "1", "--jobs", "1", "--judge", "none"]


def steerclear(*arguments, **options):
    command = [sys.executable, "-m", "steerclear.experiments.cli", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


def test_an_entry_that_exits_forfeits_and_the_results_say_so(write_entry):
    entry = write_entry("self.n += 1\nif self.n > 6: os._exit(0)\nreturn 4", start="self.n = 0")
    done = run("evaluate", entry, "--opponents", "hold", *TINY, "--out", "out")
    assert done.exit_code == ExitCode.OK, done.output
    content = json.loads(Path("out/results.json").read_text())
    assert content["complete"]
    (words,) = content["warnings"]
    assert "failed 24 times" in words
    assert "process ended: ended itself with exit status 0; its boats hold for the rest of the game" in words
    assert "exit status 0" in Path("out/report.html").read_text()
    assert "exit status 0" in done.stdout.replace("\n", " ")


def test_an_entry_that_cannot_be_loaded_is_bad_input(write_entry):
    done = run("evaluate", write_entry("return 4", start="os._exit(0)"))
    assert done.exit_code == ExitCode.BAD_INPUT
    assert "cannot load: ended itself with exit status 0" in done.stderr
    assert not Path("results").exists()


@pytest.mark.parametrize("command", ["evaluate", "ablate --own", "play --own", "deploy --demo --policy"])
def test_a_model_among_entries_is_refused_before_it_is_loaded(command):
    Path("entries").mkdir()
    with zipfile.ZipFile("entries/model.zip", "w") as archive:
        archive.writestr("data", "{}")
    done = run(*command.split(), "sb3:entries/model.zip")
    assert done.exit_code == ExitCode.BAD_INPUT
    assert "among entries of others" in done.stderr
    assert "--trust" in done.stderr
    assert not Path("results").exists()


def test_what_loading_a_model_means_is_said_once_before():
    with zipfile.ZipFile("model.zip", "w") as archive:
        archive.writestr("data", "[]")
    done = run("play", "--own", "sb3:model.zip", "--opponent", "sb3:model.zip")
    assert done.exit_code == ExitCode.BAD_INPUT
    assert done.stderr.count("loading the model model.zip runs code of whoever made it") == 1
    assert "is not a Stable-Baselines3 model" in done.stderr


def test_sigterm_keeps_what_is_finished_and_leaves_nobody(write_entry, tmp_path):
    note = tmp_path / "pids"
    entry = write_entry("time.sleep(0.05); return 4", start=f"open({str(note)!r}, 'a').write(f'{{os.getpid()}} ')")
    arguments = ["--opponents", "hold", "--games", "40", "--max-time", "1", "--jobs", "2", "--judge", "none"]
    done = steerclear("evaluate", entry, *arguments, "--out", "out")
    try:
        lines, end_s = Path("out/rows.jsonl"), time.monotonic() + 200.0
        while not (lines.exists() and lines.read_text().count("\n") >= 2):
            assert time.monotonic() < end_s
            assert done.poll() is None, done.communicate()
            time.sleep(0.05)
        done.send_signal(signal.SIGTERM)
        _, said = done.communicate(timeout=60)
    finally:
        done.kill()
    assert done.returncode == ExitCode.INTERRUPTED
    assert "of 40 games kept in out/rows.jsonl" in said.replace("\n", " ")
    content = json.loads(Path("out/results.json").read_text())
    assert (content["complete"], content["games_played"]) == (False, len(lines.read_text().splitlines()))
    end_s = time.monotonic() + 20.0
    while any(Path(f"/proc/{pid}/cmdline").exists() for pid in note.read_text().split()):
        assert time.monotonic() < end_s
        time.sleep(0.05)
