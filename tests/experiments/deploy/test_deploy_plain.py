"""Lines instead of a dashboard, logs that never make the loop wait, counts of a run, the demonstration's processes."""

import dataclasses
import logging
import math
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from deploy_ticks import Stream
from steerclear.experiments.deploy.keys import FIGURES, figure_rows
from steerclear.experiments.deploy.plain import PlainLines, Tally, closest_m, logging_aside
from steerclear.experiments.deploy.quiet import (
    LOOP_FIRST,
    OTHERS_FIRST,
    before_others,
    ended_by_signals,
    undisturbed,
    warm_up,
)
from steerclear.shield import Commands, Shield, ShieldConfig, decide
from steerclear.shield.bridge.messages import Action
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.fleet import Fleet


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


def test_a_line_counts_all_that_happened_since_the_last_one(ticks):
    lines = []
    sink = PlainLines(lines.append, every_s=0.3)
    for tick in ticks:
        sink.take(tick)
    said = told(lines)
    sink.close()
    commands = sum(int(tick.fleet.controlled.sum()) for tick in ticks)
    changed = sum(tick.decisions.count_intervened for tick in ticks)
    closest = min(closest_m(tick.fleet) for tick in ticks)
    assert f"closest {closest:5.1f} m, {changed} of {commands} commands changed" in said[0]
    assert len(ticks) > 1 < commands


def test_a_boat_alone_has_no_closest_approach(fleet_of):
    tick = Stream(fleet_of(2)).tick()
    fleet = tick.fleet
    one = Fleet(fleet.state[:1], fleet.team[:1], fleet.platforms[:1], fleet.controlled[:1], fleet.names[:1])
    guard = Shield(ShieldConfig())
    alone = dataclasses.replace(tick, fleet=one, decisions=guard.decide(one, Commands.relative_deg([[1.0, 0.0]])))
    lines = []
    sink = PlainLines(lines.append, every_s=0.02)
    sink.take(alone)
    said = told(lines)
    sink.close()
    assert "no other boat, " in said[0]
    assert "inf" not in said[0]
    rows = dict(figure_rows({figure.key: 3.456 for figure in FIGURES} | {"closest_m": math.inf}))
    assert rows["closest approach of our boats, as believed"] == "no other boat"
    assert rows["turn began late, 999 of 1000 within"] == "3456.0 ms"


def test_what_lasts_is_said_once_whatever_its_figures_and_again_when_its_response_changes(ticks):
    lines = []
    sink = PlainLines(lines.append, every_s=0.05)
    for response, ages in (("slow", (1.0, 1.5, 2.0)), ("stop", (5.0, 5.5))):
        for age in ages:
            action = Action("red_1", "contact", response, f"red_1 {age} s old")
            sink.take(dataclasses.replace(ticks[0], actions=(action,)))
            time.sleep(0.12)
    sink.close()
    said = [line.strip() for line in lines if "red_1" in line]
    assert len(said) == 2
    assert said[0] in {f"red_1 {age} s old" for age in (1.0, 1.5, 2.0)}
    assert said[1] in {f"red_1 {age} s old" for age in (5.0, 5.5)}


def test_nothing_is_said_before_the_first_tick():
    lines = []
    sink = PlainLines(lines.append, every_s=0.01)
    time.sleep(0.1)
    sink.close()
    assert lines == []


def test_every_stage_of_a_decision_runs_before_boats_move(fleet_of, monkeypatch):
    seen, stages = set(), {"begin", "begin_group", "linearise", "accept", "end_group", "end"}
    for name in stages:
        stage = getattr(decide, name)
        monkeypatch.setattr(decide, name, lambda *values, name=name, stage=stage: (seen.add(name), stage(*values))[1])
    warm_up(fleet_of(2).with_shield(position_error_m=0.3, delay_s=0.1, solver="daqp"))
    assert seen == stages


def test_logs_go_to_the_file(tmp_path):
    path = tmp_path / "logs" / "run.log"
    before = list(logging.getLogger().handlers)
    with logging_aside(path, shown=False):
        logging.getLogger("steerclear.test").warning("override of %s", "red_1")
    assert "override of red_1" in path.read_text()
    assert logging.getLogger().handlers == before


def test_a_run_of_which_nothing_was_logged_leaves_no_empty_file(tmp_path):
    path = tmp_path / "run.log"
    with logging_aside(path, shown=False):
        assert path.exists(), "it could be made"
    assert not path.exists()


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


def test_turns_with_a_response_are_those_in_which_something_was_done(ticks):
    tally = Tally()
    for response in ("none", "none", "slow", "stop"):
        tally.take(dataclasses.replace(ticks[0], actions=(Action("blue_1", "model", response, "off its model"),)))
    assert tally.figures()["ticks_with_actions"] == 2.0


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


def in_a_thread(act):
    """What is returned in a thread of its own: what it does to its scheduling ends with it."""
    answers = []
    thread = threading.Thread(target=lambda: answers.append(act()))
    thread.start()
    thread.join(20.0)
    return answers[0]


def may_go_first():
    """Whether this system lets a program go before others."""

    def go_first():
        try:
            os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(LOOP_FIRST))
        except OSError:
            return False
        return True

    return in_a_thread(go_first)


AT_FIRST = os.sched_getscheduler(0)
GOES_FIRST = pytest.mark.skipif(not may_go_first(), reason="this system gives no program real-time priority")


def test_asking_what_the_system_allows_leaves_these_tests_as_they_were():
    assert may_go_first() in (True, False)
    assert os.sched_getscheduler(0) == AT_FIRST


def test_what_makes_a_run_quiet_is_taken_back_and_not_handed_on():
    before, plain = sys.getswitchinterval(), scheduled()
    question = "import os; print(os.sched_getscheduler(0))"
    with undisturbed():
        assert sys.getswitchinterval() < before
        told = subprocess.run([sys.executable, "-c", question], capture_output=True, check=True, text=True).stdout
        assert int(told) & ~os.SCHED_RESET_ON_FORK == os.SCHED_OTHER
    assert sys.getswitchinterval() == pytest.approx(before)
    assert scheduled() == plain


@GOES_FIRST
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


@GOES_FIRST
def test_a_run_that_goes_before_others_already_is_not_put_back_and_is_left_as_it_was():
    def run():
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(7))
        with undisturbed():
            seen = scheduled()
        return seen, (os.sched_getscheduler(0), os.sched_getparam(0).sched_priority)

    assert in_a_thread(run) == ((os.SCHED_FIFO, 7), (os.SCHED_FIFO, 7))


class System:
    """Threads and what they were given; some may not be given more than a priority, some have ended."""

    def __init__(self, monkeypatch, tasks, most=99, gone=()):
        self.given, self.most, self.gone = dict.fromkeys(tasks, (os.SCHED_BATCH, 0)), most, gone
        monkeypatch.setattr("steerclear.experiments.deploy.quiet._tasks", lambda: list(self.given))
        monkeypatch.setattr(os, "sched_getscheduler", lambda task: self._of(task)[0])
        monkeypatch.setattr(os, "sched_getparam", lambda task: os.sched_param(self._of(task)[1]))
        monkeypatch.setattr(os, "sched_setscheduler", self._give)

    def _of(self, task):
        if task in self.gone:
            raise ProcessLookupError
        return self.given[task]

    def _give(self, task, policy, parameter):
        self._of(task)
        if parameter.sched_priority > self.most:
            raise PermissionError
        self.given[task] = policy & ~os.SCHED_RESET_ON_FORK, parameter.sched_priority


def test_a_thread_that_has_just_ended_keeps_no_other_from_going_first(monkeypatch):
    own = threading.get_native_id()
    system = System(monkeypatch, [1, own, 2], gone=(1,))
    with before_others():
        assert (system.given[own], system.given[2]) == ((os.SCHED_RR, LOOP_FIRST), (os.SCHED_RR, OTHERS_FIRST))
    assert set(system.given.values()) == {(os.SCHED_BATCH, 0)}, "as they were"


def test_no_thread_goes_first_where_the_loop_may_not(monkeypatch):
    system = System(monkeypatch, [1, threading.get_native_id(), 2], most=OTHERS_FIRST)
    with before_others():
        assert set(system.given.values()) == {(os.SCHED_BATCH, 0)}, "the others would make the loop wait"


def test_a_system_that_allows_nothing_is_no_fault(monkeypatch):
    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with undisturbed():
        assert scheduled()[0] == os.SCHED_OTHER
