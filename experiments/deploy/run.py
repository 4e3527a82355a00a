"""A run on boats: from a fleet file and a policy's name to boats that are left stopped."""

from __future__ import annotations

import contextlib
import gc
import logging
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

from steerclear import policies
from steerclear.experiments.warming import compile_shield
from steerclear.shield.bridge.blackbox import McapWriter, header_of_fleet, log_path
from steerclear.shield.bridge.clock import Clock, MonotonicClock
from steerclear.shield.bridge.feed import FeedSender
from steerclear.shield.bridge.fleet_file import FleetFile, load_fleet
from steerclear.shield.bridge.loop import Loop, Parts
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.preflight.result import CheckResult, not_passed, run_checks, validate_accepted
from steerclear.shield.bridge.publishing import PositionPublisher
from steerclear.shield.bridge.tick import TickSink
from steerclear.shield.bridge.timing import Timing
from steerclear.shield.platforms import fresh_state, step_boat

from .checks import checks_of
from .policy_process import PolicyProcess
from .rules import game_config
from .station import Station
from .tally import Tally

LOG = logging.getLogger(__name__)

LONGEST_MINUTES = 120.0
"""Room for so long a log is asked for when no end is given."""

SWITCH_S = 0.0005
"""How long another thread may keep the interpreter from the loop, s."""

Shown = Callable[[CheckResult], None]


@dataclass(frozen=True)
class Orders:
    """What to run.

    Attributes:
        fleet_file: path of the FLEET.yaml.
        policy: name or path, as `steerclear.policies.make` takes it.
        boat: name of this process's boat (coordination per_boat); None: all of the team.
        minutes: how long; None: until ended.
        accept: names of checks that may fail.
        seed: of what the policy draws.
        tlog: whether raw packets are kept as well.
    """

    fleet_file: Path
    policy: str
    boat: str | None = None
    minutes: float | None = None
    accept: tuple[str, ...] = ()
    seed: int = 0
    tlog: bool = True


@dataclass
class Outcome:
    """What came of it.

    Attributes:
        ended: why it ended.
        refused: checks that forbade the start; nothing moved.
        checks: results of all checks.
        left: what each boat was left doing.
        log: path of the black box; None when it never began.
        figures: of the loop and its decisions.
    """

    ended: str = ""
    refused: list[CheckResult] = field(default_factory=list)
    checks: list[CheckResult] = field(default_factory=list)
    left: tuple[str, ...] = ()
    log: Path | None = None
    figures: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Surface:
    """Where a person sees and steers the run.

    Attributes:
        shown: called with each check's result.
        sinks: makes further sinks, such as a dashboard, once the run begins.
    """

    shown: Shown = lambda result: None
    sinks: Callable[[FleetFile, Operator, Clock], Sequence[TickSink]] = lambda fleet, operator, clock: ()


def deploy(orders: Orders, surface: Surface | None = None, operator: Operator | None = None) -> Outcome:
    """Run boats.

    Args:
        orders: what to run.
        surface: where a person sees it.
        operator: whose orders count; None: only signals end the run.

    Returns:
        What came of it; ``refused`` is not empty when checks forbade the start.

    Raises:
        FleetFileError: the file cannot be used; nothing was opened.
        PolicyError: there is no such policy, or it does not start; nothing was opened.
        BridgeError: a port is taken, a boat does not answer or refuses; boats heard until then are left stopped.
    """
    surface, operator = surface or Surface(), operator or Operator()
    fleet = load_fleet(orders.fleet_file)
    game_config(fleet)
    fleet.commanded(orders.boat)
    policies.make(orders.policy)
    clock, outcome = MonotonicClock(), Outcome()
    station = Station(fleet, orders.boat, clock, tlog=orders.tlog)
    try:
        with station, _ended_by_signals(operator):
            station.connect()
            if _may_start(station, orders, surface, outcome):
                _run(station, orders, surface, operator, outcome)
    finally:
        outcome.left = station.left
    return outcome


def _may_start(station: Station, orders: Orders, surface: Surface, outcome: Outcome) -> bool:
    checks = checks_of(station, orders.minutes or LONGEST_MINUTES)
    validate_accepted(orders.accept, checks)
    outcome.checks = run_checks(checks, surface.shown)
    outcome.refused = not_passed(outcome.checks, orders.accept)
    for result in outcome.checks:
        if not result.passed and result not in outcome.refused:
            LOG.warning("accepted although not passed: %s: %s", result.name, result.text)
    return not outcome.refused


def _run(station: Station, orders: Orders, surface: Surface, operator: Operator, outcome: Outcome) -> None:
    fleet, clock = station.fleet, station.clock
    warm_up(fleet)
    with contextlib.ExitStack() as stack:
        policy = PolicyProcess(fleet, orders.policy, clock=clock, boats=tuple(station.links), seed=orders.seed)
        stack.callback(policy.close)
        policy.start()
        station.prepare()
        box = _black_box(station, orders, outcome)
        timing, tally = Timing(), Tally()
        sinks: list[TickSink] = [box, timing, tally]
        if fleet.feed is not None and fleet.feed.publish:
            name = f"deploy_{orders.boat or fleet.team}"
            sinks.append(
                PositionPublisher(
                    FeedSender(name, fleet.feed.publish), fleet.frame, fleet.shield_config.position_error_m
                )
            )
        sinks += surface.sinks(fleet, operator, clock)
        for sink in sinks:
            stack.callback(sink.close)
        parts = Parts(
            links=station.links,
            policy=policy,
            ears=station.ears,
            contacts=() if station.feed is None else (station.feed,),
            game=station.feed,
            sinks=tuple(sinks),
        )
        loop = Loop(fleet, parts, operator, clock)
        with _undisturbed():
            outcome.ended = loop.run(None if orders.minutes is None else 60.0 * orders.minutes)
        outcome.figures = {**timing.figures(), **tally.figures(), "missed_turns": float(loop.overruns.missed)}


def _black_box(station: Station, orders: Orders, outcome: Outcome) -> McapWriter:
    fleet = station.fleet
    header = header_of_fleet(
        fleet,
        orders.fleet_file.read_text(encoding="utf-8"),
        policy=orders.policy,
        commanded=station.links,
        clock_s=station.clock.now_s(),
        notes={f"accepted {result.name}": result.text for result in outcome.checks if not result.passed},
    )
    outcome.log = log_path(fleet.log_dir, ".mcap")
    return McapWriter(outcome.log, header)


def warm_up(fleet: FleetFile) -> None:
    """Compile all that the loop runs, so that its first turn is as quick as any."""
    compile_shield(asdict(fleet.shield_config))
    for platform in set(fleet.platform_of.values()):
        step_boat(platform.pack(), fresh_state(0.0, 0.0, 0.0), 1.0, 0.0, fleet.dt_s)


@contextlib.contextmanager
def _undisturbed() -> Iterator[None]:
    """Fewer pauses: what was made so far is not looked through for garbage, and threads hand over quickly."""
    interval = sys.getswitchinterval()
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(SWITCH_S)
    try:
        yield
    finally:
        sys.setswitchinterval(interval)
        gc.unfreeze()


@contextlib.contextmanager
def _ended_by_signals(operator: Operator) -> Iterator[None]:
    """Ctrl-C and SIGTERM end the run in order, boats stopped; a second Ctrl-C does not wait for that."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, frame: FrameType | None) -> Any:
        if operator.ended:
            raise KeyboardInterrupt
        operator.end(signal.Signals(number).name)

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
