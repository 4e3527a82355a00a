"""`sea_trial`: checks, then the manoeuvres, boats left stopped; what is kept is the log."""

from __future__ import annotations

from collections.abc import Callable

from steerclear.shield.bridge.messages import Tick
from steerclear.shield.bridge.operator import Operator

from .begin import Begun, run_boats
from .orders import Orders, Outcome, Surface, read_fleet
from .quiet import warm_up
from .rehearsal import refuse_early
from .sea_trial import SeaTrial, longest_s


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
