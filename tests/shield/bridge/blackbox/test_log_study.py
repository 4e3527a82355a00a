"""Figures of the black box that take longer: loss when killed, memory over an hour, time taken from the loop."""

import gc
import random
import signal
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from logged_runs import header_of, write_log
from steerclear.shield.bridge.blackbox import Disk, LogReader, McapWriter
from steerclear.shield.bridge.blackbox.recorder import McapFile
from steerclear.shield.bridge.messages import Tick

pytestmark = pytest.mark.study
HERE = Path(__file__).parent


def numbered(ticks, number):
    return Tick(**(vars(ticks[number % len(ticks)]) | {"number": number, "began_s": 1000.25 + 0.1 * number}))


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "source.mcap"
    write_log(path, 200)
    return path


@pytest.fixture(scope="module")
def ticks(source):
    with LogReader(source) as log:
        return list(log.ticks())


def kill_once(source, target, after):
    """Kill a writer at 10 Hz after so many ticks and a moment; returns how much was lost, s."""
    command = [sys.executable, str(HERE / "killed_writer.py"), str(source), str(target), "10"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        lines = [process.stdout.readline() for _ in range(after)]
        time.sleep(random.uniform(0.0, 0.1))
        process.send_signal(signal.SIGKILL)
        killed_s = time.monotonic()
        lines += process.stdout.readlines()
    taken = dict(map(float, line.split()) for line in lines if line.endswith("\n"))
    with LogReader(target) as log:
        found = [tick.number for tick in log.ticks()]
    assert found == list(range(len(found)))
    return killed_s - taken[found[-1]]


def test_loss_when_killed_twenty_times(source, tmp_path, record_property, capsys):
    random.seed(0)
    lost = [kill_once(source, tmp_path / f"{k}.mcap", random.randint(12, 30)) for k in range(20)]
    with capsys.disabled():
        sys.stdout.write(f"\nlost when killed, s: mean {np.mean(lost):.2f}, most {max(lost):.2f}\n")
    assert max(lost) <= 1.0


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
