"""Drills of the black box: killed, disk full, disk slow, disk stuck. Nothing waits, and every failure has a text."""

import errno
import gc
import random
import re
import signal
import subprocess
import sys
import threading
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from logged_runs import Encounter, header_of, numbered, write_log
from steerclear.shield.bridge.blackbox import Disk, LogReader, McapWriter, TlogWriter, foxglove
from steerclear.shield.bridge.blackbox.recorder import McapFile
from steerclear.shield.bridge.failsafe_table import CONDITIONS
from steerclear.shield.bridge.messages import Tick
from steerclear.shield.exceptions import BridgeError
from waiting import wait_for

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def ticks():
    return list(Encounter(header_of(), 40))


def is_writing():
    return any(thread.name == "log run.mcap" for thread in threading.enumerate())


def kept(path):
    """Numbers of the ticks in a log, whether it is whole, and its lines of the black box itself."""
    with LogReader(path) as log:
        entries = list(log.entries())
    numbers = [entry.number for entry in entries if isinstance(entry, Tick)]
    lines = [entry.text for entry in entries if not isinstance(entry, Tick) and entry.name == "black box"]
    return numbers, log.complete, lines


class FullDisk(Disk):
    """Takes so many bytes, then there is no more space."""

    room = 30_000

    def put(self, data):
        if self.size + len(data) > self.room:
            if self.size < self.room:
                return super().put(data[: self.room - self.size])
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().put(data)


class NoRoom(FullDisk):
    room = 10


class StuckDisk(Disk):
    """Takes nothing more once it is told to, until it is let go."""

    def __init__(self, path):
        super().__init__(path)
        self.free = threading.Event()
        self.free.set()

    def put(self, data):
        self.free.wait(30.0)
        return super().put(data)


def opened(folder, kind, **settings):
    """A writer and the disk it writes to; one that can get stuck takes nothing from now on."""
    found = []

    def open_disk(path):
        found.append(kind(path))
        return found[0]

    writer = McapWriter(folder / "run.mcap", header_of(), **{"flush_s": 0.02, **settings}, open_disk=open_disk)
    if kind is StuckDisk:
        found[0].free.clear()
    return writer, found[0]


def take_until_it_fails(writer, ticks, limit=20_000):
    """Take ticks until the writer says no, in its words."""
    for number in range(limit):
        began = time.perf_counter()
        try:
            writer.take(numbered(ticks, number))
        except BridgeError as error:
            return str(error)
        finally:
            assert time.perf_counter() - began < 5.0, "the loop never hangs on it"
        time.sleep(0.001)
    pytest.fail("it was never noticed")
    return ""


def kill_once(source, target, after):
    """Kill a writer at 10 Hz after so many ticks and a moment; returns how much was lost, s."""
    command = [sys.executable, str(HERE / "killed_writer.py"), str(source), str(target), "10"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        lines = [process.stdout.readline() for _ in range(after)]
        time.sleep(random.uniform(0.0, 0.1))
        process.send_signal(signal.SIGKILL)
        killed_s = time.monotonic()
        lines += process.stdout.readlines()
    assert process.returncode == -signal.SIGKILL
    taken = dict(map(float, line.split()) for line in lines if line.endswith("\n"))
    found, complete, _ = kept(target)
    assert found == list(range(len(found)))
    assert not complete
    return killed_s - taken[found[-1]]


@pytest.mark.parametrize("times", [1, pytest.param(20, marks=pytest.mark.study)])
def test_killed_in_the_middle_at_most_a_second_is_lost(tmp_path, capsys, times):
    write_log(tmp_path / "source.mcap", 40)
    random.seed(0)
    lost = [kill_once(tmp_path / "source.mcap", tmp_path / f"{k}.mcap", random.randint(12, 30)) for k in range(times)]
    with capsys.disabled():
        sys.stdout.write(f"\nlost when killed, s: mean {np.mean(lost):.2f}, most {max(lost):.2f}\n" * (times > 1))
    assert max(lost) <= 1.0


def test_a_log_being_written_can_be_read(tmp_path, ticks):
    writer = McapWriter(tmp_path / "run.mcap", header_of(), flush_s=0.05)
    for number in range(10):
        writer.take(numbered(ticks, number))
    wait_for(lambda: len(kept(tmp_path / "run.mcap")[0]) == 10)
    assert not kept(tmp_path / "run.mcap")[1]
    writer.close()
    assert kept(tmp_path / "run.mcap")[:2] == (list(range(10)), True)


def test_a_full_disk_is_said_at_once_in_words_and_what_was_written_is_read(tmp_path, ticks):
    writer, _ = opened(tmp_path, FullDisk)
    assert take_until_it_fails(writer, ticks) == (
        "the log run.mcap cannot be written: the disk is full; end the run: it records nothing more; then free "
        "space on it or set log_dir to another disk and start anew. What was written before can be read"
    )
    with pytest.raises(BridgeError, match="the disk is full"):
        writer.take(ticks[0])
    writer.close()
    assert "the disk is full" in writer.fault
    found, complete, _ = kept(tmp_path / "run.mcap")
    assert found == list(range(len(found)))
    assert len(found) > 20
    said = re.fullmatch(r"the log is incomplete: (\d+) of (\d+) turns", writer.missing)
    assert int(said[1]) <= len(found) < int(said[2])
    assert "not in this run" in CONDITIONS["log"].returns
    assert not complete
    assert not is_writing()


def test_a_disk_too_full_for_the_header_is_said_before_anything_starts_and_one_that_fills_up_at_the_end(
    tmp_path, ticks
):
    with pytest.raises(BridgeError, match=r"cannot begin the log .*run\.mcap: the disk is full"):
        opened(tmp_path, NoRoom)
    (tmp_path / "run.mcap").unlink()
    writer, disk = opened(tmp_path, FullDisk, flush_s=30.0)
    writer.take(ticks[0])
    disk.room = disk.size
    writer.close()
    assert "the disk is full" in writer.fault


def test_a_slow_disk_delays_no_tick_and_what_is_dropped_is_counted(tmp_path, ticks):
    writer, disk = opened(tmp_path, StuckDisk, capacity=20)
    taken = 0  # nothing is written until all was taken: whoever waits for the disk waits for ever
    while writer.dropped < 200 and taken < 100_000:
        writer.take(numbered(ticks, taken))
        taken += 1
    assert writer.waiting <= 20
    disk.free.set()
    wait_for(lambda: writer.waiting == 0)
    dropped = writer.dropped
    writer.take(numbered(ticks, taken))
    writer.close()
    numbers, _, told = kept(tmp_path / "run.mcap")
    assert len(numbers) == taken + 1 - dropped
    assert numbers == sorted(numbers)
    assert all("the disk is too slow" in text for text in told)
    assert told[-1].endswith(f"ticks before this are missing, {dropped} in all")


def test_a_stuck_disk_is_said_and_forgiven_when_it_goes_on(tmp_path, ticks):
    writer, disk = opened(tmp_path, StuckDisk, give_up_s=0.3)
    assert "the disk has taken nothing for" in take_until_it_fails(writer, ticks)
    disk.free.set()
    wait_for(lambda: writer.waiting == 0)
    writer.take(numbered(ticks, 5000))
    writer.close()
    numbers, complete, _ = kept(tmp_path / "run.mcap")
    assert (numbers[-1], complete, writer.dropped) == (5000, True, 0)


def test_a_disk_that_falls_behind_is_told(tmp_path, ticks, caplog):
    writer, disk = opened(tmp_path, StuckDisk)
    assert writer.behind_s == 0.0
    taken = 0
    while writer.behind_s <= 1.1:
        writer.take(numbered(ticks, taken))
        taken += 1
        time.sleep(0.05)
    disk.free.set()
    wait_for(lambda: writer.behind_s == 0.0)
    writer.close()
    (told,) = (record.getMessage() for record in caplog.records)
    assert "s behind: the disk is slow" in told
    assert kept(tmp_path / "run.mcap")[:2] == (list(range(taken)), True)


SUSPENDED = """
import logging, sys, threading, time
from pathlib import Path
from steerclear.shield.bridge.blackbox.disk import AsyncWriter
logging.basicConfig()

class Slow:
    def keep(self, item): pass
    def flush(self): time.sleep(0.2)  # so that the process is suspended while something is on its way
    def finish(self): pass

spool = AsyncWriter("run", Slow(), flush_s=0.02, give_up_s=0.8)
print("begun", flush=True)
for number in range(24):
    spool.put(number)
    time.sleep(0.05)
spool.close()
print(spool.fault or "well", flush=True)
"""


def test_a_suspended_runner_is_not_told_as_a_slow_disk():
    process = subprocess.Popen(
        [sys.executable, "-c", SUSPENDED], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "begun\n"
    time.sleep(0.3)
    process.send_signal(signal.SIGSTOP)
    time.sleep(1.4)
    process.send_signal(signal.SIGCONT)
    assert process.communicate(timeout=60) == ("well\n", "")


def test_closing_does_not_wait_for_ever(tmp_path, ticks):
    writer, disk = opened(tmp_path, StuckDisk)
    writer.take(ticks[0])
    writer.close(timeout_s=0.2)
    assert "could not be completed within 0.2 s" in writer.fault
    disk.free.set()
    wait_for(lambda: not is_writing())


def test_a_tick_that_cannot_be_written_is_said(tmp_path, ticks):
    writer, _ = opened(tmp_path, Disk)
    writer.take(Tick(**(vars(ticks[0]) | {"number": object()})))
    wait_for(lambda: writer.fault)
    with pytest.raises(BridgeError, match=r"cannot be written \(TypeError: .*report this"):
        writer.take(ticks[0])
    writer.close()


def test_a_drawing_that_breaks_does_not_stop_the_record(tmp_path, ticks, monkeypatch):
    monkeypatch.setattr(foxglove, "scene_of", lambda *_: 1 / 0)
    writer, _ = opened(tmp_path, Disk)
    for number in range(5):
        writer.take(numbered(ticks, number))
    writer.close()
    assert writer.fault == ""
    numbers, _, told = kept(tmp_path / "run.mcap")
    assert numbers == list(range(5))
    assert told == ["drawing failed (ZeroDivisionError: division by zero); the ticks are whole"]


def test_a_tlog_on_a_full_disk_raises_nothing_and_says_so(tmp_path):
    writer = TlogWriter(tmp_path / "run.tlog", flush_s=0.02, open_disk=NoRoom)
    packet = bytes([0xFD, 2, 0, 0, 0, 1, 1, 0, 0, 0, 5, 5, 0, 0])
    writer.on_bytes("in", packet, 1)
    wait_for(lambda: writer.fault)
    writer.on_bytes("in", packet, 1)
    assert "the disk is full" in writer.fault
    writer.close()


@pytest.mark.study
def test_memory_over_an_hour(ticks, tmp_path, capsys):
    class NoSync(Disk):
        def sync(self):
            return

    file = McapFile(NoSync(tmp_path / "hour.mcap"), header_of())
    sizes = []
    tracemalloc.start()
    for number in range(36_000):
        file.keep(numbered(ticks, number))
        if number % 5 == 4:
            file.flush()
        if number % 6_000 == 5_999:
            gc.collect()
            sizes.append(tracemalloc.get_traced_memory()[0] / 2**20)
    tracemalloc.stop()
    file.finish()
    size = sum(path.stat().st_size for path in tmp_path.iterdir()) / 2**20
    with capsys.disabled():
        sys.stdout.write(
            f"\nan hour: least and most memory {max(sizes) - min(sizes):.1f} MiB apart, {size:.0f} MiB on disk\n"
        )
    assert max(sizes) - min(sizes) < 8.0, "the index, 90 kB a minute"


@pytest.mark.study
def test_time_taken_from_the_loop(ticks, tmp_path, capsys):
    writer = McapWriter(tmp_path / "run.mcap", header_of())
    taken = []
    for number in range(300):
        tick = numbered(ticks, number)
        began = time.perf_counter()
        writer.take(tick)
        taken.append(time.perf_counter() - began)
        time.sleep(0.1)
    writer.close()
    figures = 1e6 * np.quantile(taken, [0.5, 0.99, 1.0])
    with capsys.disabled():
        sys.stdout.write("\ntake at 10 Hz, us: median {:.0f}, p99 {:.0f}, most {:.0f}\n".format(*figures))
    assert figures[1] < 2_000.0
