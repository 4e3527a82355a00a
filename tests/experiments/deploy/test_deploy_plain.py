"""Lines instead of a dashboard, logs that never make the loop wait, counts of a run, the demonstration's processes."""

import logging
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from deploy_ticks import Stream
from steerclear.experiments.deploy.plain import PlainLines, logging_aside
from steerclear.experiments.deploy.quiet import LOOP_FIRST, NICENESS, OTHERS_FIRST, ended_by_signals, undisturbed
from steerclear.experiments.deploy.tally import Tally
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.tick import Action


@pytest.fixture
def ticks(fleet_of):
    stream = Stream(fleet_of(2))
    return [stream.tick() for _ in range(5)]


def told(lines, seconds=10.0):
    end = time.monotonic() + seconds
    while not lines and time.monotonic() < end:
        time.sleep(0.01)
    return lines


def test_lines_say_how_it_goes(ticks):
    lines = []
    sink = PlainLines(lines.append, every_s=0.02)
    sink.take(type(ticks[0])(**{**vars(ticks[0]), "actions": (Action("red_1", "contact", "slow", "red_1 old"),)}))
    said = told(lines)
    sink.close()
    assert "closest" in said[0]
    assert any("red_1 old" in line for line in lines)


def test_nothing_is_said_before_the_first_tick():
    lines = []
    sink = PlainLines(lines.append, every_s=0.01)
    time.sleep(0.1)
    sink.close()
    assert lines == []


def test_logs_go_to_the_file(tmp_path):
    path = tmp_path / "logs" / "run.log"
    before = list(logging.getLogger().handlers)
    with logging_aside(path, shown=False):
        logging.getLogger("steerclear.test").warning("override of %s", "red_1")
    assert "override of red_1" in path.read_text()
    assert logging.getLogger().handlers == before


def test_a_run_is_counted(ticks):
    tally = Tally()
    for tick in ticks:
        tally.take(tick)
    figures = tally.figures()
    at = ticks[-1].fleet.state[:, :2]
    assert figures["ticks"] == figures["decided"] == 5.0
    assert figures["closest_m"] <= np.hypot(*(at[0] - at[1])) + 1e-9
    assert 0.0 <= figures["changed_share"] <= 1.0
    assert Tally().figures()["ticks"] == 0.0


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_signals_end_a_run_in_order_and_a_second_one_at_once(name):
    operator, before = Operator(), signal.getsignal(getattr(signal, name))
    with ended_by_signals(operator):
        signal.raise_signal(getattr(signal, name))
        assert operator.ended == name
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(getattr(signal, name))
    assert signal.getsignal(getattr(signal, name)) == before


def scheduled():
    """Policy and priority of this thread, what it hands on left out."""
    return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK, os.sched_getparam(0).sched_priority


def may_go_first():
    """Whether this system lets a program go before others."""
    try:
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(1))
    except OSError:
        return False
    os.sched_setscheduler(0, os.SCHED_OTHER | os.SCHED_RESET_ON_FORK, os.sched_param(0))
    return True


def test_what_makes_a_run_quiet_is_taken_back_and_not_handed_on():
    before, nice, plain = sys.getswitchinterval(), os.getpriority(os.PRIO_PROCESS, 0), scheduled()
    question = "import os; print(os.nice(0), os.sched_getscheduler(0))"
    with undisturbed():
        assert sys.getswitchinterval() < before
        assert os.getpriority(os.PRIO_PROCESS, 0) in (nice, NICENESS)
        told = subprocess.run([sys.executable, "-c", question], capture_output=True, check=True, text=True).stdout
        niceness, policy = map(int, told.split())
        assert niceness >= min(0, nice)
        assert policy & ~os.SCHED_RESET_ON_FORK == os.SCHED_OTHER
    assert sys.getswitchinterval() == pytest.approx(before)
    assert os.getpriority(os.PRIO_PROCESS, 0) == nice
    assert scheduled() == plain


@pytest.mark.skipif(not may_go_first(), reason="this system gives no program real-time priority")
def test_the_loop_goes_before_all_other_programs_and_the_runners_threads_after_it():
    seen, ends = [], threading.Event()

    def look():
        ends.wait(20.0)
        seen.append(scheduled())

    thread = threading.Thread(target=look)
    thread.start()
    with undisturbed():
        assert scheduled() == (os.SCHED_RR, LOOP_FIRST)
        ends.set()
        thread.join(20.0)
    assert seen == [(os.SCHED_RR, OTHERS_FIRST)]


def test_a_system_that_allows_nothing_is_no_fault(monkeypatch):
    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr(os, "setpriority", refuse)
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with undisturbed():
        assert scheduled()[0] == os.SCHED_OTHER
