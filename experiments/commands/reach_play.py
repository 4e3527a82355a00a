"""``steerclear reach play``: the set from which the shield does not save a boat, found by playing."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from steerclear.shield.tables.files import load_table
from steerclear.shield.tables.make import check_radii
from steerclear.shield.tables.settings import problem_of

from ..reach.played_sets import PlayedSet, check_settings, play_job, tasks_of
from ..reach.played_sets_page import HEADS, content_of, rows_of
from ..reach.unsafe_sets import places
from ..result_files import write_json
from ..runner import RESULTS_FILE, Experiment, execute
from ..tables import goals_table, titled
from ..workers import processes_of
from . import options as o
from .console import command, finish, out, progress
from .reach_compare import OtherBoat, OwnBoat


@command
def play(
    own: OwnBoat,
    other: OtherBoat,
    radius: Annotated[float, typer.Option(metavar="M", help="Separation radius, m.")] = 2.5,
    shield_set: o.ShieldSet = None,
    out_folder: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder for results.", show_default="results/...")
    ] = None,
    jobs: o.Jobs = None,
    resume: o.Resume = False,
    json_file: o.JsonFile = None,
) -> None:
    """Play from positions all round the reachability set and beyond, and tell from which the shield saves no boat.

    Each of 15 pairs of speed and heading takes one to a few minutes on a core; what is finished is kept.

    Exit status: 0 what is lost and the reachability set together are nowhere more than 1.15 times as large as the
    latter, and from no position tried beyond a boat was reached; 1 somewhere they are, or one was; 2 bad input, 130
    interrupted.
    """
    values, started = load_table(own, other, "worst-case"), time.perf_counter()
    check_radii(problem_of(own, other), (radius,))
    given = o.key_values(shield_set, "--shield-set")
    check_settings(given)
    tasks = [asdict(task) for task in tasks_of(own, other, radius, given, places(values))]
    settings = {"own": own, "other": other, "radius_m": radius, "shield": given}
    folder = out_folder or Path("results") / f"reach_play_{own}_{other}_{radius:g}"
    with progress("sets", len(tasks)) as notice:
        experiment = Experiment("reach-play", settings, tasks, play_job, "sets")
        run = execute(experiment, folder, processes_of(jobs), resume, lambda done, of: notice(done))
    run.end()
    sets = [PlayedSet(**row) for row in run.rows]
    content = content_of(settings, sets, time.perf_counter() - started)
    out().print(titled(f"{own} meets {other}, {radius:g} m", list(HEADS), rows_of(sets)))
    out().print(goals_table(content["goals"]))
    run.write(content)
    out().print(f"{folder / RESULTS_FILE}", soft_wrap=True)
    if json_file is not None:
        write_json(json_file, content)
    finish(all(bar["met"] is not False for bar in content["goals"]))
