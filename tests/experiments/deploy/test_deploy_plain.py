"""Lines instead of a dashboard and of checks, counts of a run, and what keeps it on time: logs, priority, compiling."""

import dataclasses
import io
import logging
import math
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from logged_runs import Encounter, header_of
from rich.console import Console
from steerclear.experiments.cli_boats import CompileNotice, show_check, show_outcome
from steerclear.experiments.deploy.keys import FIGURES, figure_rows
from steerclear.experiments.deploy.orders import Outcome
from steerclear.experiments.deploy.plain import PlainLines, Tally
from steerclear.experiments.deploy.quiet import (
    LOOP_FIRST,
    OTHERS_FIRST,
    before_others,
    ended_by_signals,
    logging_aside,
    undisturbed,
)
from steerclear.shield import Commands, Shield, ShieldConfig
from steerclear.shield.bridge.messages import Action
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.preflight_checks import CheckResult
from steerclear.shield.fleet import Fleet


@pytest.fixture
def ticks():
    return list(Encounter(header_of(), 5))


def said_of(ticks, every_s=0.3):
    """Lines about ticks, once the first has come."""
    lines, end = [], time.monotonic() + 10.0
    sink = PlainLines(lines.append, every_s)
    for tick in ticks:
        sink.take(tick)
    while not lines and time.monotonic() < end:
        time.sleep(0.01)
    sink.close()
    return lines


def test_a_boat_alone_has_no_closest_approach(ticks):
    fleet = ticks[0].fleet
    one = Fleet(fleet.state[:1], fleet.team[:1], fleet.platforms[:1], fleet.controlled[:1], fleet.names[:1])
    decisions = Shield(ShieldConfig()).decide(one, Commands.relative_deg([[1.0, 0.0]]))
    (line,) = said_of([dataclasses.replace(ticks[0], fleet=one, decisions=decisions)], 0.02)[:1]
    assert "no other boat, " in line
    assert "inf" not in line
    rows = dict(figure_rows({figure.key: 3.456 for figure in FIGURES} | {"closest_m": math.inf}))
    assert rows["closest approach of our boats, as believed"] == "no other boat"
    assert rows["turn began late, 999 of 1000 within"] == "3456.0 ms"


def test_every_tick_is_counted_in_one_line_and_no_line_tells_of_none(ticks):
    lines, own = [], int(ticks[0].fleet.controlled.sum())
    sink = PlainLines(lines.append, every_s=0.01)
    for _ in range(400):
        sink.take(ticks[0])
        time.sleep(0.0005)
    time.sleep(0.1)
    sink.close()
    counted = [int(line.split(" of ")[1].split()[0]) for line in lines if " of " in line]
    assert sum(counted) == 400 * own
    assert all(counted)


def test_what_lasts_is_said_once_whatever_its_figures_and_again_when_its_response_changes(ticks):
    lines = []
    sink = PlainLines(lines.append, every_s=0.05)
    time.sleep(0.1)
    assert lines == [], "nothing is said before the first tick"
    for response, ages in (("slow", (1.0, 1.5, 2.0)), ("stop", (5.0, 5.5))):
        for age in ages:
            action = Action("red_1", "contact", response, f"red_1 {age} s old")
            sink.take(dataclasses.replace(ticks[0], actions=(action,)))
            time.sleep(0.12)
    sink.close()
    said = [line.strip() for line in lines if "red_1" in line]
    assert len(said) == 2
    for line, response, ages in zip(said, ("slow", "stop"), ((1.0, 1.5, 2.0), (5.0, 5.5)), strict=True):
        assert line.split("; ")[0] in {f"red_1 {age} s old -> {response}" for age in ages}
        assert "; control returns: by itself" in line


def test_that_machine_code_is_compiled_is_said_until_the_dashboard_takes_the_screen(capsys):
    log, notice = logging.getLogger("steerclear.shield.jit"), CompileNotice()
    notice.open()
    assert notice in log.handlers
    for text, count in (("nothing of note", 0), ("steerclear compiles its machine code, once: about a minute", 1)):
        notice.handle(logging.makeLogRecord({"msg": text}))
        assert capsys.readouterr().err.count("compiles its machine code") == count
    assert notice not in log.handlers, "it is said once"
    notice.open()
    notice.close()
    assert notice not in log.handlers


def test_a_drill_is_offered_to_be_accepted_in_simulation_only(capsys):
    for name, words in (("drill", True), ("latency:gannet", False)):
        show_outcome(Outcome(refused=[CheckResult(name, False, "no")]), "not ready")
        said = capsys.readouterr().out
        assert "not ready: 1 check does not pass" in said
        assert ("in simulation only" in said) == words


def test_checks_without_which_boats_are_not_safe_are_not_offered_to_be_accepted(capsys):
    names = ("rates:gannet", "known", "geofence", "backup", "autopilot:gannet", "commanders:gannet")
    show_outcome(Outcome(refused=[CheckResult(name, False, "no") for name in names]))
    said = capsys.readouterr().out
    assert "--accept rates:gannet" in said
    assert said.count("--accept") == 1
    assert "put right, boats are not safe without: known, geofence, backup, autopilot:gannet, commanders:gannet" in said


@pytest.mark.parametrize(
    ("passed", "accepted", "mark"),
    [
        (True, (), "ok"),
        (True, ("drill",), "ok"),
        (False, (), "FAIL"),
        (False, ("rates",), "FAIL"),
        (False, ("drill",), "not passed, accepted:"),
        (False, ("drill:blue_1",), "not passed, accepted:"),
    ],
)
def test_a_check_that_was_accepted_beforehand_does_not_read_as_a_failure(passed, accepted, mark):
    stream = io.StringIO()
    show_check(Console(file=stream, width=80), CheckResult("drill:blue_1", passed, "42 [s] ago"), accepted)
    assert stream.getvalue().split("drill:blue_1")[0].strip() == mark
    assert "drill:blue_1: 42 [s] ago" in stream.getvalue()


def test_logs_go_to_the_file_and_an_empty_one_is_not_left(tmp_path):
    path, empty, before = tmp_path / "logs" / "run.log", tmp_path / "empty.log", list(logging.getLogger().handlers)
    with logging_aside(path, shown=False):
        logging.getLogger("steerclear.test").warning("override of %s", "red_1")
    assert "override of red_1" in path.read_text()
    assert logging.getLogger().handlers == before
    with logging_aside(empty, shown=False):
        assert empty.exists(), "it could be made"
    assert not empty.exists()


def test_a_run_is_counted_and_turns_with_a_response_are_those_in_which_something_was_done(ticks):
    tally = Tally()
    for tick in (*ticks, ticks[0]):  # boats come nearer, but for the last one
        tally.take(tick)
    figures, at = tally.figures(), ticks[-1].fleet.state[:, :2]
    assert figures["ticks"] == figures["decided"] == 6.0
    apart = [np.hypot(*(at[i] - at[k])) for i in (0, 1) for k in range(4) if k != i]
    assert figures["closest_m"] == pytest.approx(min(apart))
    assert 0.0 <= figures["changed_share"] <= 1.0
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


def test_what_makes_a_run_quiet_is_taken_back_and_not_handed_on():
    before, plain = sys.getswitchinterval(), scheduled()
    question = "import os; print(os.sched_getscheduler(0))"
    with undisturbed():
        assert sys.getswitchinterval() < before
        assert scheduled() in (plain, (os.SCHED_RR, LOOP_FIRST)), "as far as the system lets it"
        told = subprocess.run([sys.executable, "-c", question], capture_output=True, check=True, text=True).stdout
        assert int(told) & ~os.SCHED_RESET_ON_FORK == os.SCHED_OTHER
    assert sys.getswitchinterval() == pytest.approx(before)
    assert scheduled() == plain


class System:
    """Threads and what they were given; some may not be given more than a priority, some have ended."""

    def __init__(self, monkeypatch, tasks, most=99, gone=()):
        self.given, self.most, self.gone = dict(tasks), most, gone
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


@pytest.mark.parametrize("most", [99, OTHERS_FIRST, 0])
def test_the_loop_goes_first_the_runners_other_threads_after_it_or_nobody(monkeypatch, most):
    own, plain = threading.get_native_id(), (os.SCHED_BATCH, 0)
    tasks = {1: plain, own: plain, 2: plain, 3: (os.SCHED_FIFO, 7)}
    system = System(monkeypatch, tasks, most, gone=(1,))
    first, others = ((os.SCHED_RR, LOOP_FIRST), (os.SCHED_RR, OTHERS_FIRST)) if most > OTHERS_FIRST else (plain, plain)
    with before_others():
        assert (system.given[own], system.given[2]) == (first, others), "else they would make the loop wait"
        assert system.given[3] == (os.SCHED_FIFO, 7), "it has more already"
    assert system.given == tasks, "as they were"


TESTS = Path(__file__).parents[2]
COMPILED_LATE = """
from bridge_fakes import pair
from test_fault_figures import DRILLS, STRUCK_S
from steerclear.experiments.deploy.quiet import warm_up
from steerclear.shield import jit

world = pair()
world.run(0.0)
warm_up(world.fleet)
made, load = [], jit._Kept.load_overload
jit._Kept.load_overload = lambda kept, *args: made.append(kept._name) or load(kept, *args)
world.run(6.0)
for name in ("telemetry frozen, fresh time stamps", "telemetry jumps 30 m, the feed does not", "disk full"):
    again = pair()
    again.run(12.0, lambda world: world.clock.now_s() >= STRUCK_S - 1e-6 and DRILLS[name][0](world))
print("late:", made)
"""


def test_no_machine_code_is_made_while_boats_are_steered():
    path = [str(TESTS), str(TESTS / "shield"), str(TESTS / "shield" / "bridge")]
    program = f"import sys; sys.path[:0] = {path!r}\n{COMPILED_LATE}"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "late: []"
