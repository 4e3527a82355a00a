"""The demonstration: a folder and ports of its own, and processes that end with the one that started them."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from steerclear.experiments.deploy.demo import PORTS, Demo, demo_file, end_with_parent
from steerclear.experiments.sim_boats.demo import demo_text
from steerclear.shield.bridge.fleet_file import load_fleet
from steerclear.shield.exceptions import BridgeError
from waiting import is_running, wait_for

STARTER = """
import sys, time
from pathlib import Path
from steerclear.experiments.deploy.demo import Demo
with Demo(Path(sys.argv[1]), "medium") as demo:
    demo.wait(240.0)
    print(*[process.pid for process in demo._processes.values()], flush=True)
    time.sleep(240.0)
"""


def ports_in(text):
    return {int(port) for port in re.findall(r"127\.0\.0\.1:(\d+)", text)}


def test_every_demonstration_has_a_folder_and_ports_of_its_own(tmp_path):
    first, second = demo_file(tmp_path / "demo"), demo_file(tmp_path / "demo")
    assert first.parent != second.parent
    assert {path.parent.parent for path in (first, second)} == {tmp_path / "demo"}
    for path in (first, second):
        assert load_fleet(path).team == "blue"
        assert len(ports_in(path.read_text())) == 3
    assert not ports_in(first.read_text()) & set(PORTS)
    assert ports_in(demo_text()) == set(PORTS), "the ports replaced are those of the file"
    (tmp_path / "file").write_text("")
    with pytest.raises(BridgeError, match="cannot write"):
        demo_file(tmp_path / "file")


def test_a_demonstration_that_cannot_begin_says_why_and_leaves_nothing(tmp_path):
    path = tmp_path / "FLEET.yaml"
    path.write_text("version: 2")
    (tmp_path / "boats.txt").write_text("said before")
    with Demo(path, "medium") as demo:
        with pytest.raises(BridgeError, match=r"ended: .*version"):
            demo.wait(60.0)
        processes = list(demo._processes.values())
    assert all(process.poll() is not None for process in processes)
    assert (tmp_path / "boats.txt").read_text() == "said before", "what an earlier one said is kept"


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="asks /proc who lives")
def test_killed_with_9_it_takes_its_processes_with_it(tmp_path):
    command = [sys.executable, "-c", STARTER, str(demo_file(tmp_path))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as starter:
        try:
            pids = [int(word) for word in starter.stdout.readline().split()]
            assert len(pids) == 2
            assert all(map(is_running, pids))
        finally:
            starter.kill()
    wait_for(lambda: not any(map(is_running, pids)), 8.0)


def test_a_closed_stream_ends_the_process_in_order(monkeypatch):
    told = []
    monkeypatch.setattr("steerclear.experiments.deploy.demo.GRACE_S", 0.01)
    monkeypatch.setattr(os, "kill", lambda pid, number: told.append((pid, number)))
    monkeypatch.setattr(os, "_exit", lambda status: told.append(status))
    ours, theirs = os.pipe()
    with os.fdopen(ours, "rb") as stream:
        thread = end_with_parent(stream)
        os.write(theirs, b"not yet")
        thread.join(0.1)
        assert told == []
        os.close(theirs)
        thread.join(10.0)
    assert told == [(os.getpid(), signal.SIGTERM), 1]
