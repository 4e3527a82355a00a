"""``steerclear reach``: value tables solved, shown, checked; the sets that they and the shield give up."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from steerclear.shield.exceptions import SteerclearError, TableError
from steerclear.shield.platforms.registry import get_platform
from steerclear.shield.tables import files as F
from steerclear.shield.tables.make import COARSER, RADII_M, RUNS, check_radii, coarser, make_table
from steerclear.shield.tables.settings import problem_of, read_other_may
from steerclear.shield.tables.solve import Notice

from . import cli_options as o
from .cli_games import met
from .console import App, Interrupted, bars, finish, out, progress, say
from .reach import pages as P
from .reach.sets import PlayedSet, compare_sets, looks_up, places, played_experiment, sets_config
from .result_files import NEW, check_new, write_json
from .runner import RESULTS_FILE, execute
from .tables import goals_table, titled
from .workers import processes_of

app = App(help="Reachability value tables: solve, show and check them.", no_args_is_help=True)
CONVERGED_SHARE = 0.1
"""Largest mean change of area from the coarser grid that `check` lets pass."""


@dataclass(frozen=True)
class BoatOptions:
    """The two boats of a table."""

    own: Annotated[str, o.option("NAME", "Platform of the own boat.", "--own")]
    other: Annotated[str, o.option("NAME", "Platform of the other boat.", "--other")]


OtherMay = Annotated[str, o.option("MODE", "What the other boat may do: worst-case or cooperative.")]
Separation = Annotated[float, o.option("M", "Separation, m.", "--separation", "--radius")]


@app.command()
def solve(
    boats: BoatOptions,
    other_may: OtherMay = "worst-case",
    separation: Annotated[
        list[float] | None,
        o.option(
            "M",
            "Separation to check the table for, m; may be repeated.",
            "--separation",
            "--radius",
            default="2.5, 4",
        ),
    ] = None,
    out_file: Annotated[
        Path | None, o.option("FILE", "File to write, a new one.", "--out", default="the user's cache folder"), NEW
    ] = None,
    horizon: Annotated[
        float | None, o.option("S", "Longest play looked ahead, s.", default="fitted to the boats")
    ] = None,
    jobs: o.Jobs = None,
    quick: Annotated[bool, o.flag("A coarse grid and few runs: for a first look only.", "--quick")] = False,
) -> None:
    """Solve the game of two boats and write its value table.

    One table serves every separation; --separation says for which its grid and its promise are checked.
    Ctrl-C keeps the state: the same command then goes on from there.
    """
    problem = problem_of(boats.own, boats.other, other_may, horizon_s=horizon)
    problem = coarser(problem, 2.0) if quick else problem
    radii, runs = tuple(separation) if separation else RADII_M, RUNS // 20 if quick else RUNS
    check_radii(problem, radii)
    target = out_file or F.cache_folder() / f"{problem.name}.npz"
    check_new(target, "--out")
    kept = target.with_name(target.name + ".checkpoint")
    try:
        with bars() as begin:

            def stage(name: str) -> Notice:
                tell = begin(name)
                return lambda done, total, left_m: tell(done, f"largest change {left_m:.3f} m" if left_m else "", total)

            table = make_table(problem, radii, threads=jobs, checkpoint=kept, runs=runs, stage=stage)
    except KeyboardInterrupt:
        raise Interrupted(f"interrupted; what was solved is kept in {kept}: the same command goes on") from None
    F.save_table(table, target)
    P.show_card(out(), table.card)
    say(f"written to {target}, {target.stat().st_size / 1e6:.2f} MB")


@app.command()
def show(
    boats: BoatOptions,
    other_may: OtherMay = "worst-case",
    file: Annotated[Path | None, o.option("FILE", "A table file instead of the installed one.")] = None,
) -> None:
    """Show a table's card: how it was made, how good it is, the areas in which a separation cannot be kept."""
    if file is None:
        table = F.load_table(boats.own, boats.other, other_may)
    else:
        mode = read_other_may(other_may)
        try:
            table = F.read_table(file)
            F.check_parameters(table.card, get_platform(boats.own), get_platform(boats.other), mode)
        except TableError as error:
            words = "is left as it is: name that table's boats, or leave --file out"
            raise TableError(f"{error}; {file} {words}") from error
    P.show_card(out(), table.card)


@app.command()
def compare(
    boats: BoatOptions, separation: Separation = 2.5, shield_set: o.ShieldSet = None, json_file: o.JsonFile = None
) -> None:
    """Compare the set the shield cannot promise to save with the reachability set, both of --separation.

    Exit status: 0 the shield's is nowhere more than 1.15 times as large, and nowhere calls safe more than 2 % of what
    the table calls lost; 1 somewhere it does, 2 bad input.
    """
    values, started = F.load_table(boats.own, boats.other, "worst-case"), time.perf_counter()
    check_radii(problem_of(boats.own, boats.other), (separation,))
    given = o.key_values(shield_set, "--shield-set")
    config = sets_config(separation, given)
    with progress("sets", len(places(values))) as notice:
        pairs = compare_sets(values, config, notice)
    settings = {"own": boats.own, "other": boats.other, "radius_m": separation, "shield": given}
    content = P.sets_content(settings, pairs, looks_up(values, config), started)
    _show(boats, separation, P.SETS_COLUMNS, pairs, content)
    if content["looked_up"]:
        out().print(" ".join(P.LOOKED_UP.split()))
    write_json(json_file, content)
    finish(met(content))


def _show(
    boats: BoatOptions, radius_m: float, columns: Mapping[str, str], sets: Sequence[Any], content: Mapping[str, Any]
) -> None:
    """Print a table of sets and its goals."""
    title = f"{boats.own} meets {boats.other}, {radius_m:g} m"
    out().print(titled(title, [*columns], P.rows_of(sets, columns)))
    out().print(goals_table(content["goals"]))


@app.command()
def play(
    boats: BoatOptions,
    separation: Separation = 2.5,
    shield_set: o.ShieldSet = None,
    folder: o.Out = None,
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
    check_radii(problem_of(boats.own, boats.other), (separation,))
    experiment = played_experiment(boats.own, boats.other, separation, o.key_values(shield_set, "--shield-set"))
    folder = folder or Path("results") / f"reach_play_{boats.own}_{boats.other}_{separation:g}"
    workers = processes_of(jobs)
    with progress("sets", len(experiment.jobs)) as notice:
        run = execute(experiment, folder, workers, resume, notice)
    run.end()
    sets = [PlayedSet(**row) for row in run.rows]
    content = P.played_content(run.head(), sets)
    _show(boats, separation, P.PLAYED_COLUMNS, sets, content)
    run.write(content)
    say(folder / RESULTS_FILE)
    write_json(json_file, content)
    finish(met(content))


@app.command()
def check(
    files: Annotated[
        list[Path] | None, typer.Argument(help="Table files.", show_default="all shipped and cached ones")
    ] = None,
) -> None:
    """Check tables: checksum, boats' parameters, convergence.

    Exit status: 0 all in order, 1 one is damaged, made for other parameters or not converged, 2 no table found.
    """
    paths = files or [path for folder in (F.SHIPPED, F.cache_folder()) for path in sorted(folder.glob("*.npz"))]
    if not paths:
        raise TableError("no table is installed; make one with: steerclear reach solve --own heron --other heron")
    for path in paths:
        if not path.is_file():
            raise TableError(f"there is no table file {path}; make one with steerclear reach solve --out {path}")
    faults = [_fault(path) for path in paths]
    say(*(f"{path.name}: {fault or 'in order'}" for path, fault in zip(paths, faults, strict=True)))
    finish(not any(faults))


def _fault(path: Path) -> str:
    """What is wrong with a table file; empty when nothing is."""
    try:
        card = F.read_table(path).card
        F.check_parameters(card, get_platform(card.own), get_platform(card.other), read_other_may(card.other_may))
    except SteerclearError as error:
        return str(error)
    for radius, change in card.convergence.items():
        if change["mean"] > CONVERGED_SHARE:
            share = f"{100 * change['mean']:.0f} %"
            return f"not converged at {radius} m: areas differ by {share} on a grid {COARSER:g} times coarser"
    return "" if card.convergence else "convergence was never checked"
