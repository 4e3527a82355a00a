"""``steerclear reach``: reachability value tables, solved, shown and checked."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from steerclear.shield.exceptions import SteerclearError, TableError
from steerclear.shield.platforms.registry import get_platform
from steerclear.shield.tables.files import (
    SHIPPED,
    ValueTable,
    cache_folder,
    check_parameters,
    load_table,
    read_table,
    save_table,
)
from steerclear.shield.tables.make import COARSER, RADII_M, RUNS, Stage, check_radii, coarser, make_table
from steerclear.shield.tables.settings import problem_of, read_other_may
from steerclear.shield.tables.solve import Notice

from ..reach.show import check_picture, draw_sets, show_card
from ..result_files import NEW, check_new
from . import options as o
from .console import Interrupted, command, err, finish, out
from .once import App
from .plain_progress import PlainProgress
from .reach_compare import OtherBoat, OwnBoat, compare
from .reach_play import play

app = App(help="Reachability value tables: solve, show and check them.", no_args_is_help=True)

OtherMay = Annotated[str, typer.Option(metavar="MODE", help="What the other boat may do: worst-case or cooperative.")]
Radius = Annotated[
    list[float] | None,
    typer.Option(
        metavar="M", help="Separation radius to check the table for, m; may be repeated.", show_default="2.5, 4"
    ),
]
DrawnRadius = Annotated[
    list[float] | None,
    typer.Option(
        "--radius", metavar="M", help="Separation radius that --picture draws, m; may be repeated.",
        show_default="2.5, 4",
    ),
]  # fmt: skip
OutFile = Annotated[
    Path | None,
    typer.Option("--out", metavar="FILE", help="File to write, a new one.", show_default="the user's cache folder"),
    NEW,
]
Horizon = Annotated[
    float | None, typer.Option(metavar="S", help="Longest play looked ahead, s.", show_default="fitted to the boats")
]
CoarseGrid = Annotated[bool, typer.Option("--quick", help="A coarse grid and few runs: for a first look only.")]
Checkpoint = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Where an interrupted solve is kept.", show_default="beside --out")
]
Picture = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Also draw the sets, as PNG or SVG; a new file."), NEW
]
TableFiles = Annotated[
    list[Path] | None, typer.Argument(help="Table files.", show_default="all shipped and cached ones")
]
CONVERGED_SHARE = 0.1
"""Largest mean change of area from the coarser grid that `check` lets pass."""


@app.command()
@command
def solve(
    own: OwnBoat,
    other: OtherBoat,
    other_may: OtherMay = "worst-case",
    radius: Radius = None,
    out_file: OutFile = None,
    horizon: Horizon = None,
    jobs: o.Jobs = None,
    quick: CoarseGrid = False,
    checkpoint: Checkpoint = None,
) -> None:
    """Solve the game of two boats and write its value table.

    One table serves every separation radius; --radius says for which its grid and its promise are checked.
    Ctrl-C keeps the state: the same command then goes on from there.
    """
    problem = problem_of(own, other, other_may, horizon_s=horizon)
    if quick:
        problem = coarser(problem, 2.0)
    radii = tuple(radius) if radius else RADII_M
    check_radii(problem, radii)
    target = out_file or cache_folder() / f"{problem.name}.npz"
    check_new(target, "--out")
    kept = checkpoint or target.with_name(target.name + ".checkpoint")
    try:
        with _stages() as stage:
            table = make_table(
                problem, radii, threads=jobs, checkpoint=kept, runs=RUNS // 20 if quick else RUNS, stage=stage
            )
    except KeyboardInterrupt:
        raise Interrupted(f"interrupted; what was solved is kept in {kept}: the same command goes on") from None
    save_table(table, target)
    show_card(out(), table.card)
    out().print(f"written to {target}, {target.stat().st_size / 1e6:.2f} MB", soft_wrap=True)


@contextmanager
def _stages() -> Iterator[Stage]:
    if not err().is_terminal:
        yield _plain_stage
        return
    columns = (TextColumn("{task.description}"), BarColumn(20), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TextColumn("{task.fields[change]}"), console=err(), transient=True) as bar:

        def stage(name: str) -> Notice:
            task = bar.add_task(name, total=None, change="")

            def notice(done: int, total: int, residual_m: float) -> None:
                bar.update(task, completed=done, total=total, change=_change(residual_m))

            return notice

        yield stage


def _plain_stage(name: str) -> Notice:
    """A stage where there is no terminal."""
    shown: PlainProgress | None = None

    def notice(done: int, total: int, residual_m: float) -> None:
        nonlocal shown
        shown = shown or PlainProgress(name, total, err())
        shown(done, _change(residual_m))

    return notice


def _change(residual_m: float) -> str:
    return f"largest change {residual_m:.3f} m" if residual_m else ""


@app.command()
@command
def show(
    own: OwnBoat,
    other: OtherBoat,
    other_may: OtherMay = "worst-case",
    radius: DrawnRadius = None,
    file: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A table file instead of the installed one.")
    ] = None,
    picture: Picture = None,
) -> None:
    """Show a table's card and the sets in which a radius cannot be kept."""
    check_picture(picture)
    radii = tuple(radius) if radius else RADII_M
    if radius and picture is None:
        raise TableError("--radius is what --picture draws; the card has its own radii: give --picture FILE as well")
    table = _open(own, other, other_may, file)
    check_radii(problem_of(own, other, other_may), radii)
    show_card(out(), table.card)
    if picture is not None:
        draw_sets(table, radii, picture)
        out().print(f"picture: {picture}", soft_wrap=True)


def _open(own: str, other: str, other_may: str, file: Path | None) -> ValueTable:
    if file is None:
        return load_table(own, other, other_may)
    mode = read_other_may(other_may)
    try:
        table = read_table(file)
        check_parameters(table.card, get_platform(own), get_platform(other), mode)
    except TableError as error:
        raise TableError(f"{error}; {file} is left as it is: name that table's boats, or leave --file out") from error
    return table


app.command()(compare)
app.command()(play)


@app.command()
@command
def check(files: TableFiles = None) -> None:
    """Check tables: checksum, boats' parameters, convergence.

    Exit status: 0 all in order, 1 one is damaged, made for other parameters or not converged, 2 no table found.
    """
    paths = list(files or [])
    if not paths:
        paths = [path for folder in (SHIPPED, cache_folder()) for path in sorted(folder.glob("*.npz"))]
    if not paths:
        raise TableError("no table is installed; make one with: steerclear reach solve --own heron --other heron")
    for path in paths:
        if not path.is_file():
            raise TableError(f"there is no table file {path}; make one with steerclear reach solve --out {path}")
    faults = [_fault(path) for path in paths]
    for path, fault in zip(paths, faults, strict=True):
        out().print(f"{path.name}: {fault or 'in order'}", markup=False, soft_wrap=True)
    finish(not any(faults))


def _fault(path: Path) -> str:
    """What is wrong with a table file; empty when nothing is."""
    try:
        card = read_table(path).card
        check_parameters(card, get_platform(card.own), get_platform(card.other), read_other_may(card.other_may))
    except SteerclearError as error:
        return str(error)
    for radius, change in card.convergence.items():
        if change["mean"] > CONVERGED_SHARE:
            share = f"{100 * change['mean']:.0f} %"
            return f"not converged at {radius} m: areas differ by {share} on a grid {COARSER:g} times coarser"
    return "" if card.convergence else "convergence was never checked"
