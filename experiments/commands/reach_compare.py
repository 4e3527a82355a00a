"""``steerclear reach compare``: what the shield cannot promise to save beside what the table calls lost."""

from __future__ import annotations

import time
from typing import Annotated

import typer
from steerclear.shield.tables.files import load_table
from steerclear.shield.tables.make import check_radii
from steerclear.shield.tables.settings import problem_of

from ..reach.unsafe_sets import compare_sets, looks_up, places, sets_config
from ..reach.unsafe_sets_page import HEADS, LOOKED_UP, content_of, rows_of
from ..result_files import write_json
from ..tables import goals_table, titled
from . import options as o
from .console import command, finish, out, progress

OwnBoat = Annotated[str, typer.Option("--own", metavar="NAME", help="Platform of the own boat.")]
OtherBoat = Annotated[str, typer.Option("--other", metavar="NAME", help="Platform of the other boat.")]


@command
def compare(
    own: OwnBoat,
    other: OtherBoat,
    radius: Annotated[float, typer.Option(metavar="M", help="Separation radius, m.")] = 2.5,
    shield_set: o.ShieldSet = None,
    json_file: o.JsonFile = None,
) -> None:
    """Compare the set the shield cannot promise to save with the reachability set, both of --radius.

    Exit status: 0 the shield's is nowhere more than 1.15 times as large, and nowhere calls safe more than 2 % of what
    the table calls lost; 1 somewhere it does, 2 bad input.
    """
    values, started = load_table(own, other, "worst-case"), time.perf_counter()
    check_radii(problem_of(own, other), (radius,))
    given = o.key_values(shield_set, "--shield-set")
    config = sets_config(radius, given)
    with progress("sets", len(places(values))) as notice:
        pairs = compare_sets(values, config, notice)
    settings = {"own": own, "other": other, "radius_m": radius, "shield": given}
    content = content_of(settings, pairs, looks_up(values, config), time.perf_counter() - started)
    out().print(titled(f"{own} meets {other}, {radius:g} m", list(HEADS), rows_of(pairs)))
    out().print(goals_table(content["goals"]))
    if content["looked_up"]:
        out().print(" ".join(LOOKED_UP.split()), markup=False)
    if json_file is not None:
        write_json(json_file, content)
    finish(all(goal["met"] is not False for goal in content["goals"]))
