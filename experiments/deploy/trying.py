"""`sea_trial`: checks, then the manoeuvres, boats left stopped; what is kept is the log."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.control_loop import ControlLoop, Parts
from steerclear.shield.bridge.messages import Tick
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.session import VehicleSession

from .boxes import open_box
from .checks import checks_of
from .grounds import grounds_of
from .orders import LONGEST_MINUTES, Orders, Outcome, Surface, check_accepted, may_start, read_fleet
from .quiet import ended_by_signals, undisturbed, warm_up
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
    outcome, trial = Outcome(), None
    clock = MonotonicClock(orders.speed)
    station = VehicleSession(fleet, orders.boat, clock, tlog=orders.tlog, begun_unix_s=orders.begun_unix_s)
    try:
        with station, ended_by_signals(operator):
            checks = checks_of(station, LONGEST_MINUTES)
            check_accepted(checks, orders.accept)
            station.connect(orders.connect_s)
            if may_start(checks, orders.accept, surface, outcome) and not operator.ended:
                trial = SeaTrial(fleet, driven, speed_mps, tell)
                with contextlib.closing(open_box(station, text, "sea-trial", outcome.checks)) as box:
                    outcome.log = box.path
                    station.prepare()
                    outcome.ended = _run(station, trial, box, surface, operator)
    finally:
        outcome.left = station.left
    return outcome, trial


class _End:
    """A sink that ends the run once the trial is done."""

    def __init__(self, trial: SeaTrial, operator: Operator) -> None:
        self._trial, self._operator = trial, operator

    def take(self, tick: Tick) -> None:
        if self._trial.done and not self._operator.ended:
            self._operator.end("the trial is done")

    def close(self) -> None:
        """Nothing is held."""


def _run(station: VehicleSession, trial: SeaTrial, box: Any, surface: Surface, operator: Operator) -> str:
    fleet = station.fleet
    with contextlib.ExitStack() as stack:
        shown = surface.sinks(fleet, operator, station.clock)
        for sink in shown:
            stack.callback(sink.close)
        parts = Parts(
            links=station.links,
            policy=trial,
            ears=station.ears,
            contacts=station.sources(),
            grounds=grounds_of(fleet),
            sinks=(box, trial, _End(trial, operator), *shown),
        )
        with undisturbed():
            return ControlLoop(fleet, parts, operator, station.clock).run(longest_s(len(station.links)))
