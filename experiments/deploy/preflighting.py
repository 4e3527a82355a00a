"""`preflight`: all checks and a drill, boats left stopped, what was found kept for `deploy`."""

from __future__ import annotations

from steerclear.shield.bridge.control_loop import ControlLoop
from steerclear.shield.bridge.drill import Drill, Missed, drill_checks
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.preflight_checks import not_passed, run_checks

from .begin import Begun, run_boats
from .orders import Orders, Outcome, Surface, read_fleet
from .preflight_file import DRILLED, keep
from .quiet import warm_up
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
