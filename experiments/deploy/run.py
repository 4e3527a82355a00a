"""Runs on boats: checks, a black box, and steering; boats are always left stopped.

`deploy` lets a policy play, `preflight` checks and drills, and `sea_trial` drives the manoeuvres that models are fitted
to. All three call `run_boats` with different drivers. They raise `FleetFileError` before anything is opened if the file
cannot be used, and `BridgeError` if a port is taken, or a boat does not answer or refuses: boats connected by then are
left stopped.
"""

from __future__ import annotations

import contextlib
import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial

from steerclear.policies.registry import SB3_PREFIX
from steerclear.shield.bridge.blackbox import McapWriter, check_disk, header_of_fleet, log_path
from steerclear.shield.bridge.clock import Clock, MonotonicClock
from steerclear.shield.bridge.control_loop import ControlLoop, Timing
from steerclear.shield.bridge.drill import Drill, drill_checks
from steerclear.shield.bridge.feed_packets import FeedSender, PositionPublisher
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.link_checks import link_checks
from steerclear.shield.bridge.mavlink.vehicle import MavlinkLink
from steerclear.shield.bridge.messages import NominalSource, TickSink
from steerclear.shield.bridge.moos import POLICY as MOOS_POLICY
from steerclear.shield.bridge.moos.checks import moos_checks
from steerclear.shield.bridge.moos.links import MoosNominal
from steerclear.shield.bridge.moos.vehicle import MoosLink
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.preflight_checks import (
    SITUATION,
    Check,
    CheckResult,
    check_situation,
    not_passed,
    run_checks,
    validate_accepted,
)
from steerclear.shield.bridge.session import VehicleSession, key_of
from steerclear.shield.bridge.tracker import Tracker

from .orders import DRILLED, LONGEST_MINUTES, Orders, Outcome, Surface, check_drill, keep, read_fleet, refuse_early
from .plain import Tally
from .policy_process import PolicyProcess
from .quiet import ended_by_signals, undisturbed, warm_up
from .referee import game_obstacles
from .sea_trial import SeaTrial, longest_s

LOG = logging.getLogger(__name__)

LOOK_S = 1.5  # how long boats are observed before their situation is judged, s


@dataclass(frozen=True)
class Run:
    """A run: its orders, its fleet file with text, and its outcome."""

    orders: Orders
    surface: Surface
    operator: Operator
    fleet: FleetFile
    text: str
    clock: MonotonicClock
    outcome: Outcome

    @classmethod
    def of(cls, orders: Orders, surface: Surface | None, operator: Operator | None) -> Run:
        """Read the file and reject what cannot be run; nothing is opened."""
        fleet, text = read_fleet(orders)
        refuse_early(fleet)
        clock = MonotonicClock(orders.speed)
        return cls(orders, surface or Surface(), operator or Operator(), fleet, text, clock, Outcome())


class Boats:
    """The boats of a run, ready to be commanded: open session and black box."""

    def __init__(self, run: Run, session: VehicleSession, box: McapWriter) -> None:
        self.run, self.session, self._box = run, session, box

    def sail(
        self,
        nominal: NominalSource,
        seconds: float | None,
        sinks: Sequence[TickSink] = (),
        *,
        plays: bool = False,
        begins: Callable[[ControlLoop], None] = lambda loop: None,
    ) -> ControlLoop:
        """Steer by nominal commands, filtered by the shield, until the time is over or somebody ends the run.

        Sinks get every tick, as do the black box and the user interface. ``plays``: use the referee's state of the
        game. ``begins`` is called with the loop before its first turn.
        """
        run = self.run
        with contextlib.ExitStack() as stack:
            shown = run.surface.sinks(run.fleet, run.operator, run.clock)
            for sink in (*sinks, *shown):
                stack.callback(sink.close)
            fixed = game_obstacles(run.fleet)
            parts = self.session.parts(nominal, (self._box, *sinks, *shown), fixed, plays=plays)
            loop = ControlLoop(run.fleet, parts, run.operator, run.clock)
            begins(loop)
            with undisturbed():
                run.outcome.ended = loop.run(seconds)
        return loop


def run_boats(
    run: Run,
    policy: str,
    drive: Callable[[Boats], object] | None,
    *,
    opened: Callable[[VehicleSession], Sequence[Check]] = lambda session: (),
    elsewhere: Sequence[str] = (),
) -> Outcome:
    """Open the boats, run the checks, and drive if they allow it.

    Args:
        run: the run.
        policy: name of what steers, for the log.
        drive: steers the boats; None: no boat is moved.
        opened: called with the open session before anything is sent; returns further checks.
        elsewhere: kinds of checks made elsewhere that may also be accepted.

    Raises:
        ConfigError: a name to accept is not a check.
    """
    orders, fleet, outcome = run.orders, run.fleet, run.outcome
    session = VehicleSession(fleet, orders.boat, run.clock, tlog=orders.tlog, begun_unix_s=orders.begun_unix_s)
    try:
        with session, ended_by_signals(run.operator):
            checks = [*checks_of(session, orders.minutes or LONGEST_MINUTES), *opened(session)]
            known = [*checks, *(Check(kind, lambda: CheckResult("", False, "")) for kind in elsewhere)]
            validate_accepted([name for name in orders.accept if name.split(":")[0] not in elsewhere], known)
            session.connect(orders.connect_s)  # sends the first packets to boats
            outcome.checks = run_checks(checks, run.surface.shown)
            outcome.refused = not_passed(outcome.checks, orders.accept)
            accepted = [one for one in outcome.checks if not one.passed and one not in outcome.refused]
            for one in accepted:
                LOG.warning("accepted although not passed: %s: %s", one.name, one.text)
            if outcome.refused or drive is None or run.operator.ended:
                return outcome
            notes = {f"accepted {one.name}": one.text for one in accepted}
            now_s, links = run.clock.now_s(), session.links
            header = header_of_fleet(fleet, run.text, policy=policy, commanded=links, clock_s=now_s, notes=notes)
            path = log_path(fleet.log_dir, ".mcap", session.begun_unix_s)
            with contextlib.closing(McapWriter(path, header, key=session.key)) as box:
                outcome.log = box.path
                try:
                    session.prepare()
                    drive(Boats(run, session, box))
                finally:
                    box.close()
                    outcome.missing = box.missing
    except KeyboardInterrupt:  # a second signal, or one while boats are left: they are told of as ever
        run.operator.end("SIGINT")
        outcome.ended = run.operator.ended
    finally:
        outcome.left = (*session.left, *(f"at the end {text}: take it over by hand" for text in outcome.near))
    return outcome


def checks_of(session: VehicleSession, minutes: float) -> list[Check]:
    """Return the checks that move no boat, in order: log, links, situation; ``minutes`` is the run's length."""
    fleet = session.fleet
    disk = Check("disk", lambda: check_disk(fleet.log_dir, boats=len(fleet.boats), minutes=minutes))
    mavlink = {name: link for name, link in session.links.items() if isinstance(link, MavlinkLink)}
    moos = {name: link for name, link in session.links.items() if isinstance(link, MoosLink)}
    links = [*link_checks(mavlink, fleet, session.clock), *moos_checks(moos, fleet)]
    fixed = game_obstacles(fleet)

    @cache
    def tracker() -> Tracker:
        """Return a tracker that has observed all boats for a while; runs once, at the first call."""
        tracker, due_s = Tracker(fleet, session.links), session.clock.now_s()
        for _ in range(math.ceil(LOOK_S / fleet.dt_s)):
            due_s += fleet.dt_s
            session.clock.sleep_until(due_s)
            readings = {name: link.read() for name, link in session.links.items()}
            tracker.update(session.clock.now_s(), readings, session.contacts())
        return tracker

    def situation(name: str) -> CheckResult:
        return check_situation(name, fleet, tracker(), fixed)

    return [disk, *links, *(Check(name, partial(situation, name)) for name in SITUATION)]


def deploy(orders: Orders, surface: Surface | None = None, operator: Operator | None = None) -> Outcome:
    """Run boats by a policy; without an operator only signals end the run.

    Returns:
        The outcome; ``refused`` is not empty if checks prevented the start.

    Raises:
        PolicyError: the policy does not exist or does not start; nothing was opened.
    """
    run = Run.of(orders, surface, operator)
    fleet = run.fleet
    with contextlib.ExitStack() as stack:
        policy = stack.enter_context(contextlib.closing(_policy(fleet, orders, run.clock)))
        warm_up(fleet)
        policy.start()
        publishers: list[TickSink] = []
        if fleet.feed is not None and fleet.feed.publish:
            sender = FeedSender(f"deploy_{orders.boat or fleet.team}", fleet.feed.publish, key_of(fleet))
            publishers.append(PositionPublisher(sender, fleet.frame, fleet.shield_config.position_error_m))
            stack.callback(publishers[0].close)

        def opened(session: VehicleSession) -> list[Check]:
            if isinstance(policy, MoosNominal):
                policy.use(session.links)
            names = tuple(session.links)
            return [Check("drill", lambda: check_drill(fleet, run.text, orders.boat, names, orders.accept))]

        def drive(boats: Boats) -> None:
            timing, tally = Timing(), Tally()
            seconds = None if orders.minutes is None else 60.0 * orders.minutes
            loop = boats.sail(policy, seconds, (*publishers, timing, tally), plays=True)
            margins = {f"margin_{name}_m": margin for name, margin in loop.model_error.margin_m.items()}
            run.outcome.near = loop.near
            missed = {"missed_turns": float(loop.overruns.missed)}
            run.outcome.figures = {**timing.figures(), **tally.figures(), **missed, **margins}

        return run_boats(run, orders.policy, drive, opened=opened, elsewhere=DRILLED)


def _policy(fleet: FleetFile, orders: Orders, clock: Clock) -> PolicyProcess | MoosNominal:
    """Return the source of nominal commands: a policy process, or the boats' MOOS communities."""
    boats = tuple(entry.name for entry in fleet.commanded(orders.boat))
    if orders.policy == MOOS_POLICY:
        return MoosNominal(fleet, boats)
    options = {"allow_code": True} if orders.trust and orders.policy.startswith(SB3_PREFIX) else {}
    return PolicyProcess(fleet, orders.policy, clock=clock, boats=boats, options=options, seed=orders.seed)


def preflight(
    orders: Orders, surface: Surface | None = None, operator: Operator | None = None, *, drill: bool = True
) -> Outcome:
    """Run all checks, then the drill, which moves boats, if they allow it; boats are left stopped.

    The results are stored if a drill was requested; `BridgeError` if they cannot be. The orders' policy is not used.
    """
    run = Run.of(orders, surface, operator)
    warm_up(run.fleet)
    outcome = run_boats(run, "drill", _drill if drill else None, elsewhere=(*DRILLED, "drill"))
    outcome.ended = run.operator.ended
    if drill and not outcome.ended.startswith("SIG"):  # else an earlier drill remains valid
        refused = [result.name for result in outcome.refused]
        outcome.log = keep(run.fleet, run.text, orders.boat, outcome.checks, refused)
    return outcome


def _drill(boats: Boats) -> None:
    """Drive one boat after the other a short way, and run the drill's checks."""
    run = boats.run
    drill = Drill(run.fleet, tuple(boats.session.links))

    def begins(loop: ControlLoop) -> None:
        drill.model_error = loop.model_error

    boats.sail(drill, drill.seconds + 2.0 * run.fleet.dt_s, (drill,), begins=begins)
    run.outcome.checks += run_checks(drill_checks(drill, run.fleet), run.surface.shown)
    run.outcome.refused = not_passed(run.outcome.checks, run.orders.accept)


def sea_trial(
    orders: Orders,
    surface: Surface | None = None,
    operator: Operator | None = None,
    *,
    only: str | None = None,
    speed_mps: float | None = None,
    tell: Callable[[str], None] = lambda text: None,
) -> tuple[Outcome, SeaTrial | None]:
    """Run the manoeuvres of a sea trial if the checks allow it; boats are left stopped.

    ``only`` names the one boat to drive; None: all of the process, one after the other. ``speed_mps`` is the highest
    commanded speed; None: top speed. ``tell`` is called with each manoeuvre that begins. The orders' policy is not
    used.
    """
    run = Run.of(orders, surface, operator)
    names = tuple(entry.name for entry in run.fleet.commanded(orders.boat))
    driven = names if only is None else (run.fleet.boat(only).name,)
    warm_up(run.fleet)
    trial = SeaTrial(run.fleet, driven, speed_mps, tell, run.operator)
    outcome = run_boats(run, "sea-trial", lambda boats: boats.sail(trial, longest_s(len(driven)), (trial,)))
    return outcome, trial if outcome.log is not None else None
