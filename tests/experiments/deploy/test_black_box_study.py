"""What an operator sees of `deploy`, `preflight`, `sea-trial`, `replay` and `fit`: commands, exit codes, texts, files.

Knows nothing of the inside, so that it passes before and after any change of it.
"""

import contextlib
import json
import re
import shutil
import subprocess
import sys
import time

import pytest
from steerclear.experiments.deploy.demo import free_ports

pytestmark = pytest.mark.study
PROGRAM = [sys.executable, "-m", "steerclear.experiments.cli"]
SPEED = "4"
BUSY = [f"--accept={name}" for name in ("latency", "rates", "spread")]
DRILLED = [*BUSY, "--accept=course", "--accept=response"]
"""Checks that a busy machine may fail on boats that live four times as fast, without and with a drill."""
FLEET = """
version: 1
team: blue
field: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, size_m: [160, 80]}
geofence: {xmin_m: -40, ymin_m: -40, xmax_m: 200, ymax_m: 120}
limits: {navigation: {max_age_s: 2.0, then: stop, lost_after_s: 5.0}, contact: {max_age_s: 3.0, then: slow}}
boats:
  - name: blue_1
    agent: agent_0
    platform: heron
    link: {kind: mavlink, address: "udpin:127.0.0.1:LINK", system_id: 1}
  - {name: red_1, agent: agent_1, platform: heron, contact: feed}
feed: {listen: "127.0.0.1:FEED"}
"""


def steerclear(folder, *arguments, status=0):
    """What a command says, once it has left with that status."""
    done = subprocess.run([*PROGRAM, *arguments], cwd=folder, capture_output=True, text=True, timeout=600)
    said = " ".join((done.stdout + done.stderr).split())
    assert done.returncode == status, said[-3000:]
    return said


@contextlib.contextmanager
def boats(folder, *more):
    """Simulated boats of the folder's file, until it is left; what they said is in boats.txt."""
    with (folder / "boats.txt").open("w") as out:
        command = [*PROGRAM, "sim-boats", "FLEET.yaml", "--speed", SPEED, "--boot", "5", "--opponents", "hold", *more]
        process = subprocess.Popen(command, cwd=folder, stdout=out, stderr=subprocess.STDOUT)
    try:
        end = time.monotonic() + 300.0
        while "Simulated boats" not in (folder / "boats.txt").read_text():
            assert process.poll() is None, (folder / "boats.txt").read_text()
            assert time.monotonic() < end
            time.sleep(0.2)
        yield
    finally:
        process.terminate()
        process.wait(60.0)


@pytest.fixture
def folder(tmp_path):
    link, feed = free_ports(2)
    (tmp_path / "FLEET.yaml").write_text(FLEET.replace("LINK", str(link)).replace("FEED", str(feed)))
    return tmp_path


SOLUTION = """
class solution:
    def compute_action(self, agent_id, full_obs_normalized, full_obs, global_state):
        bearing = float(full_obs[agent_id]["opponent_home_bearing"])
        turns = [180, 135, 90, 45, 0, -45, -90, -135]
        return min(range(8), key=lambda k: abs((bearing - turns[k] + 180) % 360 - 180))
"""


@pytest.mark.parametrize("link", ["mavlink", "moos"])
def test_a_submission_plays_a_demonstration_and_its_log_is_proved(tmp_path, link):
    (tmp_path / "our_team").mkdir()
    (tmp_path / "our_team" / "solution.py").write_text(SOLUTION, encoding="utf-8")
    options = ("--policy", "our_team", "--minutes", "0.4", "--plain", "--json", "run.json")
    said = steerclear(tmp_path, "deploy", "--demo", "--link", link, *options)
    assert ("moosdb:blue_1" in said) == (link == "moos")
    for words in ("turns", "commands changed by the shield", "turns skipped", "commands changed"):
        assert words in said
    assert link == "moos" or "blue_1: in HOLD" in said
    content = json.loads((tmp_path / "run.json").read_text())
    assert content["refused"] == []
    assert content["figures"]["ticks"] > 100
    (folder,) = (tmp_path / "steerclear_demo").iterdir()
    assert (folder / "FLEET.yaml").exists()
    (log,) = folder.glob("logs/*.mcap")
    assert content["log"].endswith(log.name)
    assert link == "moos" or log.with_suffix(".tlog").exists()
    assert "the same bit for bit" in steerclear(tmp_path, "replay", str(log))
    shutil.copyfile(log, tmp_path / "cut.mcap")
    with (tmp_path / "cut.mcap").open("r+b") as file:
        file.truncate(log.stat().st_size // 2)
    assert "not closed (crash, power or kill)" in steerclear(tmp_path, "replay", "cut.mcap")


def test_without_a_preflight_nothing_starts_and_with_one_the_boat_sails(folder):
    drive = ("FLEET.yaml", "--speed", SPEED, "--wait", "120")
    with boats(folder):
        said = steerclear(folder, "deploy", *drive, "--plain", "--policy", "waypoints", *DRILLED, status=1)
        assert "FAIL drill: no preflight of these boats; run steerclear preflight first" in said
        assert "not started: 1 checks do not pass" in said
        assert not list((folder / "logs").glob("*.mcap"))
        said = steerclear(folder, "preflight", *drive, *DRILLED)
        for name in ("disk", "rates:blue_1", "known", "geofence", "backup", "response:blue_1", "model:blue_1"):
            assert f"{name}: " in said
        assert (folder / "logs" / "preflight_blue.json").exists()
        said = steerclear(folder, "deploy", *drive, "--plain", "--minutes", "0.2", "--policy", "waypoints", *DRILLED)
        assert "boats drilled" in said
        assert "blue_1: in HOLD" in said


def test_a_sea_trial_is_driven_and_fitted(folder):
    with boats(folder):
        accepted = [*BUSY, "--accept=known"]
        said = steerclear(folder, "sea-trial", "FLEET.yaml", "--speed", SPEED, "--wait", "120", *accepted)
    assert "blue_1: turning circle to starboard" in said
    assert re.search(r"blue_1: 12 manoeuvres, \d+ % of its commands changed by the shield", said)
    assert "next: steerclear fit" in said
    (log,) = (folder / "logs").glob("*.mcap")
    said = steerclear(folder, "fit", str(log), "--boat", "blue_1", "--out", "blue_1.yaml", "--kind", "rate")
    assert "held-out errors" in said
    assert (folder / "blue_1.yaml").exists()
    assert (folder / "blue_1.png").exists()
