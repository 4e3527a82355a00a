"""A run on boats: from a fleet file and a policy's name to boats that are left stopped."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

from steerclear.policies.registry import SB3_PREFIX
from steerclear.shield.bridge.clock import Clock, MonotonicClock
from steerclear.shield.bridge.control_loop import ControlLoop, Parts, Timing
from steerclear.shield.bridge.feed import FeedSender
from steerclear.shield.bridge.feed_sender import PositionPublisher
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.links import key_of
from steerclear.shield.bridge.messages import TickSink
from steerclear.shield.bridge.moos.links import POLICY as MOOS_POLICY
from steerclear.shield.bridge.moos.links import MoosNominal
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.session import VehicleSession

from .boxes import open_box
from .checks import checks_of, drilled_check
from .grounds import grounds_of
from .orders import LONGEST_MINUTES, Orders, Outcome, Surface, check_accepted, may_start, read_fleet
from .policy_process import PolicyProcess
from .preflight_file import DRILLED
from .quiet import ended_by_signals, undisturbed, warm_up
from .rehearsal import refuse_early
from .tally import Tally


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
    fleet, text = read_fleet(orders)
    refuse_early(fleet)
    clock, outcome = MonotonicClock(orders.speed), Outcome()
    boats = tuple(entry.name for entry in fleet.commanded(orders.boat))
    with contextlib.ExitStack() as stack:
        policy = _policy(fleet, orders, clock, boats)
        stack.callback(policy.close)
        warm_up(fleet)
        policy.start()
        publishers = _publishers(fleet, orders)
        for publisher in publishers:
            stack.callback(publisher.close)
        station = VehicleSession(fleet, orders.boat, clock, tlog=orders.tlog, begun_unix_s=orders.begun_unix_s)
        if isinstance(policy, MoosNominal):
            policy.use(station.links)
        try:
            with station, ended_by_signals(operator):
                checks = checks_of(station, orders.minutes or LONGEST_MINUTES)
                checks.append(drilled_check(station, text, orders.boat, orders.accept))
                check_accepted(checks, orders.accept, DRILLED)
                station.connect(orders.connect_s)  # the first packets to boats; whatever needs none was refused by now
                if may_start(checks, orders.accept, surface, outcome) and not operator.ended:
                    with contextlib.closing(open_box(station, text, orders.policy, outcome.checks)) as box:
                        outcome.log = box.path
                        station.prepare()
                        _run(station, policy, orders, [box, *publishers], surface, operator, outcome)
        finally:
            outcome.left = (*station.left, *(f"at the end {text}: take it over by hand" for text in outcome.near))
    return outcome


def _run(
    station: VehicleSession,
    policy: PolicyProcess | MoosNominal,
    orders: Orders,
    kept: Sequence[TickSink],
    surface: Surface,
    operator: Operator,
    outcome: Outcome,
) -> None:
    fleet, clock = station.fleet, station.clock
    with contextlib.ExitStack() as stack:
        timing, tally = Timing(), Tally()
        sinks: list[TickSink] = [*kept, timing, tally, *surface.sinks(fleet, operator, clock)]
        for sink in sinks:
            stack.callback(sink.close)
        parts = Parts(
            links=station.links,
            policy=policy,
            ears=station.ears,
            contacts=station.sources(),
            game=station.feed,
            grounds=grounds_of(fleet),
            sinks=tuple(sinks),
        )
        loop = ControlLoop(fleet, parts, operator, clock)
        with undisturbed():
            outcome.ended = loop.run(None if orders.minutes is None else 60.0 * orders.minutes)
        outcome.near = loop.near
        outcome.figures = {**timing.figures(), **tally.figures(), "missed_turns": float(loop.overruns.missed)}
        outcome.figures |= {f"margin_{name}_m": margin for name, margin in loop.model_error.margin_m.items()}


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
