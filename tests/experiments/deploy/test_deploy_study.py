"""Bars measured over real sockets in real time: rate, delay, memory, and a runner that is killed.

STEERCLEAR_STUDY_MINUTES says how long the first one plays (default 10).
"""

import json
import logging
import os
import pty
import re
import select
import signal
import subprocess
import sys
import termios
import time

import numpy as np
import pytest
from steerclear.env.record import load
from steerclear.experiments.deploy.demo import Demo, demo_file
from steerclear.experiments.deploy.proof import prove
from steerclear.experiments.sim_boats import AutopilotSettings, SimFleet
from steerclear.shield.bridge.blackbox import LogReader
from steerclear.shield.bridge.fleet_file import load_fleet
from waiting import wait_for

logger = logging.getLogger(__name__)
pytestmark = pytest.mark.study
MINUTES = float(os.environ.get("STEERCLEAR_STUDY_MINUTES", "10"))
CLI = [sys.executable, "-m", "steerclear.experiments.cli"]


@pytest.fixture
def fleet_file(tmp_path):
    return demo_file(tmp_path)


def deploying(fleet_file, *more):
    """A runner without its screen."""
    command = [*CLI, "deploy", str(fleet_file), "--accept", "drill", "--plain", "--wait", "300", *more]
    with (fleet_file.parent / "deploy.txt").open("wb") as out:
        return subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT)


def resident_mib(pid):
    with open(f"/proc/{pid}/status") as status:
        line = next(line for line in status if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1024.0


def test_rate_delay_and_memory_of_three_against_three(fleet_file):
    """Jitter p99.9 <= 10 ms, telemetry to command p99 <= 20 ms, memory flat, no violation of ours."""
    truth, result = fleet_file.with_name("truth.npz"), fleet_file.with_name("deploy.json")
    memory = []
    with Demo(fleet_file, "medium", more=("--record", str(truth))) as water:
        water.wait(300.0)
        runner = deploying(fleet_file, "--minutes", f"{MINUTES:g}", "--json", str(result))
        while runner.poll() is None:
            time.sleep(5.0)
            memory.append(resident_mib(runner.pid) if runner.poll() is None else np.nan)
        assert runner.returncode == 0, (fleet_file.parent / "deploy.txt").read_text()
    figures = json.loads(result.read_text())["figures"]
    late, turn = 1e3 * figures["jitter_p999_s"], 1e3 * figures["read_to_sent_p99_s"]
    settled = np.array(memory[len(memory) // 4 : -2])
    growth = float(np.polyfit(5.0 * np.arange(len(settled)), settled, 1)[0]) * 3600.0
    logger.warning(
        "%g min: jitter p99.9 %.1f ms, read to sent p99 %.1f ms, %d missed, memory %.0f MiB %+.1f MiB per hour",
        MINUTES, late, turn, figures["missed_turns"], settled[-1], growth,
    )  # fmt: skip
    record = load(truth)
    meta = json.loads(str(record["meta"]))
    own, at = [i for i, team in enumerate(meta["team"]) if team == 0], record["position"]
    closest = min(np.hypot(*(at[:, i] - at[:, j]).T).min() for i in own for j in range(at.shape[1]) if j != i)
    logger.warning("closest approach of our boats: %.2f m", closest)
    assert late <= 10.0
    assert turn <= 20.0
    assert growth * max(1.0, MINUTES / 60.0) < 20.0
    assert closest >= 2.5


def test_boats_stop_by_themselves_when_the_runner_is_killed(fleet_file):
    """The autopilots' own 3 s; the log loses at most 1 s."""
    text = fleet_file.read_text()
    fleet_file.write_text(re.sub(r', referee: "[^"]*"', "", text))  # nobody keeps the game here
    fleet = load_fleet(fleet_file)
    with SimFleet.from_file(fleet, opponents="", autopilot=AutopilotSettings(boot_s=0.0)) as boats:
        runner = deploying(fleet_file, "--minutes", "5")
        try:
            wait_for(lambda: max(row[3] for row in boats.states().values()) > 1.0, 300.0)
            time.sleep(5.0)
        finally:
            runner.send_signal(signal.SIGKILL)
            killed, killed_unix_ns = time.monotonic(), time.time_ns()
            runner.wait()
        start = {name: row[:2].copy() for name, row in boats.states().items()}
        wait_for(lambda: max(abs(row[3]) for row in boats.states().values()) < 0.1, 30.0)
        stopped = time.monotonic() - killed
        run = max(float(np.hypot(*(row[:2] - start[name]))) for name, row in boats.states().items())
    (path,) = fleet.log_dir.glob("*.mcap")
    with LogReader(path) as log:
        ticks = list(log.ticks())
        lost_s = 1e-9 * (killed_unix_ns - log.header.time_ns(ticks[-1].sent_s))
    logger.warning("boats below 0.1 m/s %.1f s after the kill, %.1f m run; log lost %.2f s", stopped, run, lost_s)
    assert stopped < 8.0
    assert lost_s <= 1.0


@pytest.mark.parametrize("link", ["mavlink", "moos"])
def test_the_readmes_one_command_plays_and_shows_the_dashboard(tmp_path, link, write_entry):
    """`steerclear deploy --demo --policy medium` on a terminal: boats, referee, picture, all ended in order."""
    policy = "medium" if link == "mavlink" else write_entry("return 4")
    command = [*CLI, "deploy", "--demo", "--link", link, "--policy", policy, "--minutes", "0.4"]
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (45, 150))
    with subprocess.Popen(command, cwd=tmp_path, stdin=theirs, stdout=theirs, stderr=theirs) as runner:
        os.close(theirs)
        shown = read_all(ours, 600.0)
    os.close(ours)
    text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", shown.decode("utf-8", "replace"))
    assert runner.returncode == 0, text[-2000:]
    for word in ("SPACE or s STOP ALL", "blue_3", "red_3", "turns skipped"):
        assert word in text
    assert ("moosdb:blue_1" in text, "blue_1: in HOLD" in text) == (link == "moos", link == "mavlink")
    (path,) = tmp_path.rglob("*.mcap")
    with LogReader(path) as log:
        ticks = list(log.ticks())
        proof = prove(log.header, ticks)
    assert proof.same == proof.decisions > 100
    assert any(tick.surroundings.stops for tick in ticks if tick.surroundings is not None), "the own flag is home"


def read_all(descriptor, seconds):
    """Everything until the other end is closed."""
    data, end = b"", time.monotonic() + seconds
    while time.monotonic() < end:
        if not select.select([descriptor], [], [], 1.0)[0]:
            continue
        try:
            more = os.read(descriptor, 65536)
        except OSError:  # a terminal nobody holds any more
            return data
        if not more:
            return data
        data += more
    raise AssertionError(f"it did not end within {seconds:g} s")
