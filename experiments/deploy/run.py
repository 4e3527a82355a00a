"""A run on boats: from a fleet file and a policy's name to boats that are left stopped."""

from __future__ import annotations

import contextlib

from steerclear.policies.registry import SB3_PREFIX
from steerclear.shield.bridge.clock import Clock, MonotonicClock
from steerclear.shield.bridge.control_loop import Timing
from steerclear.shield.bridge.feed import FeedSender
from steerclear.shield.bridge.feed_sender import PositionPublisher
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.links import key_of
from steerclear.shield.bridge.messages import TickSink
from steerclear.shield.bridge.moos.links import POLICY as MOOS_POLICY
from steerclear.shield.bridge.moos.links import MoosNominal
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.preflight_checks import Check
from steerclear.shield.bridge.session import VehicleSession

from .begin import Begun, run_boats
from .checks import drilled_check
from .orders import Orders, Outcome, Surface, read_fleet
from .policy_process import PolicyProcess
from .preflight_file import DRILLED
from .quiet import warm_up
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
    clock, boats = MonotonicClock(orders.speed), tuple(entry.name for entry in fleet.commanded(orders.boat))
    with contextlib.ExitStack() as stack:
        policy = _policy(fleet, orders, clock, boats)
        stack.callback(policy.close)
        warm_up(fleet)
        policy.start()
        publishers = _publishers(fleet, orders)

        def opened(session: VehicleSession) -> list[Check]:
            if isinstance(policy, MoosNominal):
                policy.use(session.links)
            return [drilled_check(session, text, orders.boat, orders.accept)]

        def drive(begun: Begun) -> None:
            timing, tally, outcome = Timing(), Tally(), begun.outcome
            seconds = None if orders.minutes is None else 60.0 * orders.minutes
            loop = begun.sail(policy, seconds, (*publishers, timing, tally), plays=True)
            outcome.near = loop.near
            outcome.figures = {**timing.figures(), **tally.figures(), "missed_turns": float(loop.overruns.missed)}
            outcome.figures |= {f"margin_{name}_m": margin for name, margin in loop.model_error.margin_m.items()}

        for publisher in publishers:
            stack.callback(publisher.close)
        return run_boats(
            orders,
            surface,
            operator,
            (fleet, text),
            orders.policy,
            drive,
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
