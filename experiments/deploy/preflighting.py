"""`preflight`: all checks and a drill, boats left stopped, what was found kept for `deploy`."""

from __future__ import annotations

import contextlib

from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.preflight_checks import not_passed, run_checks
from steerclear.shield.bridge.session import VehicleSession

from .boxes import open_box
from .checks import checks_of, drive_drill
from .orders import LONGEST_MINUTES, Orders, Outcome, Surface, check_accepted, may_start, read_fleet
from .preflight_file import DRILLED, keep
from .quiet import ended_by_signals, undisturbed, warm_up
from .rehearsal import refuse_early


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
    outcome = Outcome()
    clock = MonotonicClock(orders.speed)
    station = VehicleSession(fleet, orders.boat, clock, tlog=orders.tlog, begun_unix_s=orders.begun_unix_s)
    try:
        with station, ended_by_signals(operator):
            checks = checks_of(station, LONGEST_MINUTES)
            check_accepted(checks, orders.accept, (*DRILLED, "drill"))
            station.connect(orders.connect_s)
            if may_start(checks, orders.accept, surface, outcome) and drill and not operator.ended:
                _drill(station, text, orders, surface, operator, outcome)
    finally:
        outcome.left = station.left
    outcome.ended = operator.ended
    outcome.log = keep(fleet, text, orders.boat, outcome.checks, [result.name for result in outcome.refused])
    return outcome


def _drill(
    station: VehicleSession, text: str, orders: Orders, surface: Surface, operator: Operator, outcome: Outcome
) -> None:
    with contextlib.ExitStack() as stack:
        box = stack.enter_context(contextlib.closing(open_box(station, text, "drill", outcome.checks)))
        station.prepare()
        sinks = [box, *surface.sinks(station.fleet, operator, station.clock)]
        for sink in sinks[1:]:
            stack.callback(sink.close)
        with undisturbed():
            checks = drive_drill(station, operator, sinks)
    outcome.checks += run_checks(checks, surface.shown)
    outcome.refused = not_passed(outcome.checks, orders.accept)
