"""``steerclear sea-trial``: drive the manoeuvres that a boat is fitted to, behind the shield."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer
from steerclear.shield.exceptions import ConfigError

from ..deploy.orders import Orders, Surface
from ..deploy.plain import PlainLines, logging_aside
from ..deploy.run import sea_trial as try_boats
from ..deploy.sea_trial import MANOEUVRES, SeaTrial
from . import deploying as d
from .console import Interrupted, command, err, finish, out

Fleet = Annotated[Path, typer.Argument(metavar="FLEET.yaml", help="The runner's own file.", show_default=False)]
Only = Annotated[str | None, typer.Option("--only", metavar="NAME", help="Drive this boat; the others lie still.")]
MaxSpeed = Annotated[
    float | None, typer.Option(metavar="M/S", help="Highest speed told.", show_default="the platform's top speed")
]


@command
def sea_trial(
    fleet: Fleet,
    only: Only = None,
    max_speed: MaxSpeed = None,
    boat: d.Boat = None,
    accept: d.Accept = None,
    speed: d.Speed = 1.0,
    wait: d.Wait = 15.0,
    no_tlog: d.NoTlog = False,
) -> None:
    """Drive speed steps, right angles, zig-zag, turning circles and stops inside the geofence, all behind the shield.

    About 6 minutes a boat, one after the other. The log it writes is what ``steerclear fit`` wants. Exit status: 0
    done, 1 checks do not allow the start, 2 bad input, 130 interrupted.
    """
    if max_speed is not None and not 0.1 <= max_speed <= 40.0:
        raise ConfigError(f"--max-speed is {max_speed:g}; give m/s, 0.1 to 40")
    orders = Orders(fleet, "", boat, None, tuple(accept or ()), 0, not no_tlog, speed, wait)
    console = out()
    surface = Surface(
        lambda result: d.show_check(console, result, orders.accept),
        lambda file, operator, clock: (PlainLines(lambda text: err().print(text, markup=False, soft_wrap=True)),),
    )
    with logging_aside(None, shown=True):
        outcome, trial = try_boats(
            orders, surface, only=only, speed_mps=max_speed, tell=lambda text: console.print(text, markup=False)
        )
    d.show_outcome(console, outcome)
    if outcome.ended.startswith("SIG"):
        raise Interrupted("interrupted; boats were stopped as said above, the log holds what was driven")
    if trial is not None:
        _show(trial)
        for name in trial.changed:
            out().print(next_words(outcome.log, name), markup=False, soft_wrap=True)
    finish(not outcome.refused)


def next_words(log: Path | None, boat: str) -> str:
    """What to type next, as a shell takes it."""
    return f"next: {shlex.join(['steerclear', 'fit', str(log), '--boat', boat, '--out', f'{boat}.yaml'])}"


def _show(trial: SeaTrial) -> None:
    for name, (changed, turns) in trial.changed.items():
        share = 100.0 * changed / max(1, turns)
        out().print(f"{name}: {len(MANOEUVRES)} manoeuvres, {share:.0f} % of its commands changed by the shield")
        if trial.broken_off[name]:
            names = ", ".join(trial.broken_off[name])
            out().print(f"{name}: ended at the geofence: {names}; a wider one tells more", soft_wrap=True)
