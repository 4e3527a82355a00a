"""``steerclear reach play``: the set from which the shield does not save a boat, found by playing."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from steerclear.shield.tables.files import load_table
from steerclear.shield.tables.make import check_radii
from steerclear.shield.tables.settings import problem_of

from ..reach.played_sets import PlayedSet, Task, check_settings, play_set, tasks_of
from ..reach.played_sets_page import HEADS, content_of, rows_of
from ..reach.unsafe_sets import places
from ..report.tables import bars_table, titled
from ..runs.failed_jobs import end_failed
from ..runs.pool import check_jobs, run_all
from ..runs.store import ResultStore, key_of, write_json
from . import options as o
from .console import Interrupted, command, finish, out, progress
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
    tasks = tasks_of(own, other, radius, given, places(values))
    processes = check_jobs(jobs)
    folder = out_folder or Path("results") / f"reach_play_{own}_{other}_{radius:g}"
    store = ResultStore(folder, resume, "reach-play")
    sets = _played(tasks, store, processes)
    settings = {"own": own, "other": other, "radius_m": radius, "shield": given}
    content = content_of(settings, sets, time.perf_counter() - started)
    out().print(titled(f"{own} meets {other}, {radius:g} m", list(HEADS), rows_of(sets)))
    out().print(bars_table(content["bars"]))
    write_json(store.folder / "results.json", content)
    out().print(store.folder / "results.json", soft_wrap=True)
    if json_file is not None:
        write_json(json_file, content)
    finish(all(bar["met"] is not False for bar in content["bars"]))


def _played(tasks: list[Task], store: ResultStore, processes: int) -> list[PlayedSet]:
    """Sets of all tasks, those that an earlier run left in the store taken from there."""
    keys = [key_of(asdict(task)) for task in tasks]
    found: dict[str, dict[str, Any]] = {key: row for key, row in store.load().items() if key in keys}
    missing = [task for task, key in zip(tasks, keys, strict=True) if key not in found]
    try:
        with progress("sets", len(tasks)) as notice:
            notice(len(found))
            for outcome in run_all(play_set, missing, processes):
                if outcome.answer is None:
                    end_failed([outcome.why], "a set could not be played", f": {outcome.error}")
                key = key_of(asdict(outcome.job))
                found[key] = asdict(outcome.answer)
                store.append(key, found[key])
                notice(len(found))
    except KeyboardInterrupt:
        raise Interrupted(
            f"interrupted: {len(found)} of {len(tasks)} sets kept in {store.lines}; the same command with --out "
            f"{store.folder} --resume goes on from there"
        ) from None
    return [PlayedSet(**found[key]) for key in keys]
