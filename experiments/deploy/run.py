"""Runs on boats: checks, a black box, boats that obey; they are always left stopped.

`deploy` lets a policy play, `preflight` checks and drills, `sea_trial` drives the manoeuvres a boat is fitted to: all
three are one `run_boats` with another driver.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

from steerclear.policies.registry import SB3_PREFIX
from steerclear.shield.bridge.blackbox import McapWriter, check_disk, header_of_fleet, log_path
from steerclear.shield.bridge.clock import Clock, MonotonicClock
from steerclear.shield.bridge.control_loop import ControlLoop, Timing
from steerclear.shield.bridge.drill import Drill, Missed, drill_checks
from steerclear.shield.bridge.feed import FeedSender, PositionPublisher
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.link_checks import check_fence, link_checks
from steerclear.shield.bridge.mavlink.vehicle import MavlinkLink
from steerclear.shield.bridge.messages import Tick, TickSink, WantedSource
from steerclear.shield.bridge.moos.checks import moos_checks
from steerclear.shield.bridge.moos.links import POLICY as MOOS_POLICY
from steerclear.shield.bridge.moos.links import MoosNominal
from steerclear.shield.bridge.moos.vehicle import MoosLink
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.preflight_checks import SITUATION, Check, check_situation, not_passed, run_checks
from steerclear.shield.bridge.session import VehicleSession, key_of
from steerclear.shield.bridge.tracker import Tracker

from .orders import (
    LONGEST_MINUTES,
    Orders,
    Outcome,
    Surface,
    check_accepted,
    may_start,
    read_fleet,
    refuse_early,
)
from .plain import Tally
from .policy_process import PolicyProcess
from .preflight_file import DRILLED, check_drill, keep
from .quiet import ended_by_signals, undisturbed, warm_up
from .rules import game_obstacles
from .sea_trial import SeaTrial, longest_s

LOOK_S = 1.5
"""How long boats are looked at before their situation is judged, s."""


@dataclass(frozen=True)
class Begun:
    """A run whose boats obey.

    Attributes:
        session: links and feed, prepared.
        box: the black box.
        orders, surface, operator: as given.
        outcome: to be filled in.
    """

    session: VehicleSession
    box: McapWriter
    orders: Orders
    surface: Surface
    operator: Operator
    outcome: Outcome

    def sail(
        self,
        nominal: WantedSource,
        seconds: float | None,
        sinks: Sequence[TickSink] = (),
        *,
        plays: bool = False,
        begins: Callable[[ControlLoop], None] = lambda loop: None,
    ) -> ControlLoop:
        """Steer by nominal commands, each through the shield, until the time is over or somebody ends it.

        Args:
            nominal: where they come from.
            seconds: how long; None: until ended.
            sinks: get every tick, besides the black box and the surface's.
            plays: whether the referee's state of the game counts.
            begins: is given the loop before its first turn.
        """
        fleet, clock = self.session.fleet, self.session.clock
        with contextlib.ExitStack() as stack:
            shown = self.surface.sinks(fleet, self.operator, clock)
            for sink in (*sinks, *shown):
                stack.callback(sink.close)
            parts = self.session.parts(nominal, (self.box, *sinks, *shown), game_obstacles(fleet), plays=plays)
            loop = ControlLoop(fleet, parts, self.operator, clock)
            begins(loop)
            with undisturbed():
                self.outcome.ended = loop.run(seconds)
        return loop


def run_boats(
    orders: Orders,
    surface: Surface,
    operator: Operator,
    read: tuple[FleetFile, str],
    policy: str,
    drive: Callable[[Begun], None] | None,
    *,
    clock: MonotonicClock | None = None,
    opened: Callable[[VehicleSession], Sequence[Check]] = lambda session: (),
    elsewhere: Sequence[str] = (),
) -> Outcome:
    """Open the boats, run the checks, and drive when they allow it.

    Args:
        orders: of the run.
        surface: where a person sees it.
        operator: whose orders count.
        read: the file and its text, see `orders.read_fleet`.
        policy: name of what steers, for the log.
        drive: steers boats that obey; None: no boat is moved.
        clock: the loop's; None: a new one.
        opened: called with the open session before anything is sent; its further checks.
        elsewhere: kinds of checks made elsewhere that may be accepted too.

    Raises:
        ConfigError: a name to accept is no check's.
        BridgeError: a port is taken, a boat does not answer or refuses; boats heard until then are left stopped.
    """
    fleet, text = read
    outcome, clock = Outcome(), clock or MonotonicClock(orders.speed)
    session = VehicleSession(fleet, orders.boat, clock, tlog=orders.tlog, begun_unix_s=orders.begun_unix_s)
    try:
        with session, ended_by_signals(operator):
            checks = [*checks_of(session, orders.minutes or LONGEST_MINUTES), *opened(session)]
            check_accepted(checks, orders.accept, elsewhere)
            session.connect(orders.connect_s)  # the first packets to boats; whatever needs none was refused by now
            if may_start(checks, orders.accept, surface, outcome) and drive is not None and not operator.ended:
                header = header_of_fleet(
                    fleet,
                    text,
                    policy=policy,
                    commanded=session.links,
                    clock_s=clock.now_s(),
                    notes={f"accepted {check.name}": check.text for check in outcome.checks if not check.passed},
                )
                path = log_path(fleet.log_dir, ".mcap", session.begun_unix_s)
                with contextlib.closing(McapWriter(path, header, key=session.key)) as box:
                    outcome.log = box.path
                    session.prepare()
                    drive(Begun(session, box, orders, surface, operator, outcome))
    finally:
        outcome.left = (*session.left, *(f"at the end {text}: take it over by hand" for text in outcome.near))
    return outcome


def checks_of(session: VehicleSession, minutes: float) -> list[Check]:
    """Checks that move no boat, in the order to run: the log's, the links', the situation's.

    Args:
        session: open.
        minutes: how long the run may take.
    """
    fleet, look = session.fleet, _Look(session)
    disk = Check("disk", lambda: check_disk(fleet.log_dir, boats=len(fleet.boats), minutes=minutes))
    mavlink = {name: link for name, link in session.links.items() if isinstance(link, MavlinkLink)}
    moos = {name: link for name, link in session.links.items() if isinstance(link, MoosLink)}
    fences = [Check(f"fence:{name}", partial(check_fence, name, fleet, link)) for name, link in mavlink.items()]
    links = [*link_checks(mavlink, fleet.platform_of, session.clock), *fences, *moos_checks(moos, fleet)]
    fixed = game_obstacles(fleet)
    situation = [Check(name, lambda name=name: check_situation(name, fleet, look.tracker, fixed)) for name in SITUATION]
    return [disk, *links, *situation]


class _Look:
    """What is known of all boats after watching them for a while, when first asked for."""

    def __init__(self, session: VehicleSession) -> None:
        self._session = session

    @cached_property
    def tracker(self) -> Tracker:
        session = self._session
        fleet, clock = session.fleet, session.clock
        tracker = Tracker(fleet, session.links)
        due = clock.now_s()
        for _ in range(math.ceil(LOOK_S / fleet.dt_s)):
            due += fleet.dt_s
            clock.sleep_until(due)
            readings = {name: link.read() for name, link in session.links.items()}
            tracker.update(clock.now_s(), readings, session.contacts())
        return tracker


def deploy(orders: Orders, surface: Surface | None = None, operator: Operator | None = None) -> Outcome:
    """Run boats by a policy.

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
    fleet, text = read_fleet(orders)
    refuse_early(fleet)
    clock, boats = MonotonicClock(orders.speed), tuple(entry.name for entry in fleet.commanded(orders.boat))
    with contextlib.ExitStack() as stack:
        policy = _policy(fleet, orders, clock, boats)
        stack.callback(policy.close)
        warm_up(fleet)
        policy.start()
        publishers = _publishers(fleet, orders)
        for publisher in publishers:
            stack.callback(publisher.close)

        def opened(session: VehicleSession) -> list[Check]:
            if isinstance(policy, MoosNominal):
                policy.use(session.links)
            return [Check("drill", lambda: check_drill(fleet, text, orders.boat, tuple(session.links), orders.accept))]

        def drive(begun: Begun) -> None:
            timing, tally, outcome = Timing(), Tally(), begun.outcome
            seconds = None if orders.minutes is None else 60.0 * orders.minutes
            loop = begun.sail(policy, seconds, (*publishers, timing, tally), plays=True)
            outcome.near = loop.near
            outcome.figures = {**timing.figures(), **tally.figures(), "missed_turns": float(loop.overruns.missed)}
            outcome.figures |= {f"margin_{name}_m": margin for name, margin in loop.model_error.margin_m.items()}

        return run_boats(
            *(orders, surface, operator, (fleet, text), orders.policy, drive),
            clock=clock,
            opened=opened,
            elsewhere=DRILLED,
        )


def _policy(fleet: FleetFile, orders: Orders, clock: Clock, boats: tuple[str, ...]) -> PolicyProcess | MoosNominal:
    """Where nominal commands come from: a process of ours, or the boats' own communities."""
    if orders.policy == MOOS_POLICY:
        return MoosNominal(fleet, boats)
    options = {"allow_code": True} if orders.trust and orders.policy.startswith(SB3_PREFIX) else {}
    return PolicyProcess(fleet, orders.policy, clock=clock, boats=boats, options=options, seed=orders.seed)


def _publishers(fleet: FleetFile, orders: Orders) -> list[TickSink]:
    if fleet.feed is None or not fleet.feed.publish:
        return []
    sender = FeedSender(f"deploy_{orders.boat or fleet.team}", fleet.feed.publish, key_of(fleet))
    return [PositionPublisher(sender, fleet.frame, fleet.shield_config.position_error_m)]


def preflight(
    orders: Orders, surface: Surface | None = None, operator: Operator | None = None, *, drill: bool = True
) -> Outcome:
    """Run all checks, and the drill when the others allow it; boats are left stopped. What was found is kept.

    Args:
        orders: of a run; its policy is not needed.
        surface: where a person sees it.
        operator: whose orders count.
        drill: whether boats are moved.

    Raises:
        FleetFileError: the file cannot be used; nothing was opened.
        BridgeError: a port is taken, a boat does not answer or refuses, or the result cannot be kept.
    """
    surface, operator = surface or Surface(), operator or Operator()
    fleet, text = read_fleet(orders)
    refuse_early(fleet)
    warm_up(fleet)
    drive = _drill if drill else None
    outcome = run_boats(orders, surface, operator, (fleet, text), "drill", drive, elsewhere=(*DRILLED, "drill"))
    outcome.ended = operator.ended
    outcome.log = keep(fleet, text, orders.boat, outcome.checks, [result.name for result in outcome.refused])
    return outcome


def _drill(begun: Begun) -> None:
    """Drive one boat after the other a short way, and judge what was seen."""
    fleet, outcome = begun.session.fleet, begun.outcome
    drill = Drill(fleet, tuple(begun.session.links))
    missed = Missed(drill)

    def begins(loop: ControlLoop) -> None:
        missed.model_error = loop.model_error

    begun.sail(drill, drill.seconds + 2.0 * fleet.dt_s, (drill, missed), begins=begins)
    outcome.checks += run_checks(drill_checks(drill, missed, fleet), begun.surface.shown)
    outcome.refused = not_passed(outcome.checks, begun.orders.accept)


def sea_trial(
    orders: Orders,
    surface: Surface | None = None,
    operator: Operator | None = None,
    *,
    only: str | None = None,
    speed_mps: float | None = None,
    tell: Callable[[str], None] = lambda text: None,
) -> tuple[Outcome, SeaTrial | None]:
    """Run the manoeuvres of a sea trial when the checks allow it; boats are left stopped.

    Args:
        orders: of a run; its policy is not needed.
        surface: where a person sees it.
        operator: whose orders count.
        only: the one boat to drive; None: all of the process, one after the other.
        speed_mps: highest speed told, m/s; None: top speed.
        tell: is told which manoeuvre begins.

    Raises:
        FleetFileError: the file cannot be used, or has no such boat; nothing was opened.
        BridgeError: a port is taken, a boat does not answer or refuses.
    """
    surface, operator = surface or Surface(), operator or Operator()
    fleet, text = read_fleet(orders)
    names = tuple(entry.name for entry in fleet.commanded(orders.boat))
    driven = names if only is None else (fleet.boat(only).name,)
    refuse_early(fleet)
    warm_up(fleet)
    trial = SeaTrial(fleet, driven, speed_mps, tell)
    begun: list[Begun] = []

    def drive(run: Begun) -> None:
        begun.append(run)
        run.sail(trial, longest_s(len(run.session.links)), (trial, _End(trial, operator)))

    outcome = run_boats(orders, surface, operator, (fleet, text), "sea-trial", drive)
    return outcome, trial if begun else None


class _End:
    """A sink that ends the run once the trial is done."""

    def __init__(self, trial: SeaTrial, operator: Operator) -> None:
        self._trial, self._operator = trial, operator

    def take(self, tick: Tick) -> None:
        if self._trial.done and not self._operator.ended:
            self._operator.end("the trial is done")

    def close(self) -> None:
        """Nothing is held."""
