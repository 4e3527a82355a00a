"""``steerclear preflight``: are the boats, their links and this file fit for a run?"""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from steerclear.shield.bridge.blackbox import log_path
from steerclear.shield.bridge.fleet_file import load_fleet

from ..deploy.orders import Orders, Surface
from ..deploy.plain import PlainLines, logging_aside
from ..deploy.run import preflight as check_boats
from ..result_files import write_json
from . import deploying as d
from . import options as o
from .console import Interrupted, command, err, finish, out

Fleet = Annotated[Path, typer.Argument(metavar="FLEET.yaml", help="The runner's own file.", show_default=False)]
NoDrill = Annotated[bool, typer.Option("--no-drill", help="Move no boat; deploy will want the drill later.")]


@command
def preflight(
    fleet: Fleet,
    boat: d.Boat = None,
    accept: d.Accept = None,
    no_drill: NoDrill = False,
    speed: d.Speed = 1.0,
    wait: d.Wait = 15.0,
    no_tlog: d.NoTlog = False,
    json_file: o.JsonFile = None,
) -> None:
    """Check rates, delays, clocks, fixes, settings, geofence, certificate and disk; then drive each boat 20 s.

    Boats move in the drill, one after the other, all of them behind the shield. Exit status: 0 all pass, 1 not all, 2
    bad input, 130 interrupted.
    """
    accepted = tuple(accept or ())
    orders = Orders(fleet, "", boat, None, accepted, 0, not no_tlog, speed, wait, begun_unix_s=time.time())
    console, started = out(), time.perf_counter()
    surface = Surface(
        lambda result: d.show_check(console, result, orders.accept),
        lambda file, operator, clock: (PlainLines(lambda text: err().print(text, markup=False, soft_wrap=True)),),
    )
    with logging_aside(log_path(load_fleet(fleet).log_dir, ".log", orders.begun_unix_s), shown=True):
        outcome = check_boats(orders, surface, drill=not no_drill)
    d.show_outcome(console, outcome)
    if json_file is not None:
        settings = {**asdict(orders), "fleet_file": str(fleet)}
        write_json(json_file, d.content_of("preflight", settings, outcome, started))
    if outcome.ended:
        raise Interrupted("interrupted; boats were stopped as said above")
    finish(not outcome.refused)
