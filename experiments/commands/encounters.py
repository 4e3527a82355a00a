"""``steerclear encounters``: thousands of boats that meet, with any guard, counted and judged."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import get_platform, known_platforms
from steerclear.shield.platforms.files import is_path

from ..baselines.registry import parse_guards
from ..encounters.report import cells_table, heads_legend, write_all
from ..encounters.results import Pair, Settings, results_of
from ..encounters.scenarios import FAMILIES
from ..encounters.scene import Conditions
from ..result_files import write_json
from ..runner import Run, execute
from ..tables import goals_table
from ..workers import Workers as Engines
from ..workers import workers_of
from . import options as o
from .console import command, finish, out, progress
from .games import results_folder
from .scenes import play_scene_files

Platform = Annotated[
    str, typer.Option(metavar="A,B/C", help="Platforms: heron, or own/other as heron/surveyor, separated by commas.")
]
Family = Annotated[str, typer.Option(metavar="A,B", help="Families of encounters, or all.")]
Number = Annotated[int, typer.Option("--n", metavar="N", help="Encounters per family, platforms and guard.")]
GuardNames = Annotated[
    list[str] | None,
    typer.Option(
        "--guard", metavar="A,B", help="none, shield, reach, gatekeeper, pl-cbf (:KEY=VALUE,...), or a textbook."
    ),
]
Radius = Annotated[float, typer.Option(metavar="M", help="Separation to keep, m.")]
Delay = Annotated[float, typer.Option(metavar="S", help="From own command to effect, s, in whole steps, rounded up.")]
Noise = Annotated[float, typer.Option(metavar="M", help="Bound on the error of positions seen, m.")]
Current = Annotated[float, typer.Option(metavar="M/S", help="Speed of a current; the guard is told it, not where to.")]
Workers = Annotated[
    int | None, typer.Option("--workers", "--jobs", metavar="N", help="Processes.", show_default="all cores")
]
NoJudge = Annotated[bool, typer.Option("--no-judge", help="Do not ask the oracle about breaches.")]
SceneFiles = Annotated[
    list[Path] | None, typer.Option("--scene", metavar="FILE", help="Play scenes of a file instead.")
]
Folder = Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder.", show_default="results/...")]


@command
def encounters(
    platform: Platform = "heron,surveyor",
    family: Family = "all",
    n: Number = 1000,
    guard: GuardNames = None,
    radius: Radius = 2.5,
    delay: Delay = 0.0,
    noise: Noise = 0.0,
    current: Current = 0.0,
    seed: Annotated[int, typer.Option(metavar="N", help="Of the scenes, the same for every guard.")] = 0,
    folder: Folder = None,
    workers: Workers = None,
    engine: o.Engine = "pool",
    address: o.Address = None,
    resume: o.Resume = False,
    no_judge: NoJudge = False,
    scene: SceneFiles = None,
    json_file: o.JsonFile = None,
) -> None:
    """Let boats meet in every way there is; count breaches, judge them, write table, report and replays.

    Exit status: 0 done, 1 a shield did not keep a bar of no breaches, 2 bad input, 130 interrupted.
    """
    guards = tuple(dict.fromkeys(name for text in guard or ["shield"] for name in parse_guards(text)))
    if scene:
        _refuse_beside_scenes(
            {
                "--platform": platform != "heron,surveyor",
                "--family": family != "all",
                "--n": n != 1000,
                "--radius": radius != 2.5,
                "--delay": delay != 0.0,
                "--noise": noise != 0.0,
                "--current": current != 0.0,
                "--seed": seed != 0,
            },
            {"--jobs": workers is not None, "--resume": resume, "--json": json_file is not None},
        )
        finish(play_scene_files(scene, guards, folder, not no_judge))
        return
    settings = Settings(
        platforms=platform_pairs(platform),
        families=family_names(family),
        guards=guards,
        n=n,
        seed=seed,
        conditions=Conditions(radius, delay, noise, current),
        judge=not no_judge,
    )
    results, run = _run(settings, folder, workers_of(engine, address, workers), resume)
    if json_file is not None and not run.interrupted:
        write_json(json_file, results)
    run.end()
    finish(not any(goal["met"] is False and goal["limit"] == 0.0 for goal in results["goals"]))


def _refuse_beside_scenes(held: dict[str, bool], unused: dict[str, bool]) -> None:
    """Options of drawn encounters say nothing about scenes: what a scene file holds, and what is for many games.

    Raises:
        ConfigError: one of them was given.
    """
    for given, why in (
        (held, "a scene file holds its own; leave it out, or edit the file"),
        (unused, "scenes are played one after another and leave no results; leave it out"),
    ):
        named = [option for option, is_given in given.items() if is_given]
        if named:
            raise ConfigError(f"{', '.join(named)} beside --scene: {why}")


def platform_pairs(text: str) -> tuple[Pair, ...]:
    """Read ``heron,heron/surveyor`` as pairs of own and other platform.

    Raises:
        ConfigError: no name, or more than two in a pair.
    """
    pairs = []
    for piece in filter(None, (part.strip() for part in text.split(","))):
        pairs.append(_pair(piece))
    if not pairs:
        raise ConfigError("--platform names no platform; write e.g. heron,surveyor")
    return tuple(dict.fromkeys(pairs))


def _pair(piece: str) -> Pair:
    """One pair; a platform may be a file, whose path may have slashes of its own."""
    if is_path(piece) and Path(piece).is_file():
        return piece, piece
    for k in (k for k, letter in enumerate(piece) if letter == "/"):
        own, other = piece[:k], piece[k + 1 :]
        known = [name in known_platforms() or (is_path(name) and Path(name).is_file()) for name in (own, other)]
        if all(known):
            return own, other
    own, _, other = piece.partition("/")
    if is_path(piece):
        get_platform(piece)  # says why it cannot be read
    if not own or "/" in other or piece.endswith("/"):
        raise ConfigError(f"--platform holds {piece!r}; write a name, a file, or own/other")
    return own, other or own


def family_names(text: str) -> tuple[str, ...]:
    """Read names of families; ``all`` is every one.

    Raises:
        ConfigError: no name.
    """
    names = tuple(dict.fromkeys(filter(None, (part.strip() for part in text.split(",")))))
    if not names:
        raise ConfigError(f"--family names none; write all, or some of {', '.join(FAMILIES)}")
    return tuple(FAMILIES) if names == ("all",) else names


def _run(settings: Settings, folder: Path | None, workers: Engines, resume: bool) -> tuple[dict[str, Any], Run]:
    experiment = settings.experiment()
    with progress("chunks of encounters", len(experiment.jobs)) as notice:
        folder = results_folder("encounters", folder, resume)
        run = execute(experiment, folder, workers, resume, lambda done, of: notice(done))
    results = results_of(run)
    if results["cells"]:
        write_all(run, settings, results)
    if not run.interrupted:
        _show(results, run.folder)
    return results, run


def _show(results: dict[str, Any], folder: Path) -> None:
    console = out()
    for table in cells_table(results):
        console.print(table)
        console.print()
    if results["cells"]:
        console.print(f"{heads_legend()}\n", style="dim")
    if results["goals"]:
        console.print(goals_table(results["goals"]))
        console.print()
    for failed in results["failed"]:
        words = f"not played: {failed['guard']}, {failed['family']}: {failed['error']}"
        console.print(words, markup=False, soft_wrap=True)
    for name in results["files"].values():
        console.print(f"{folder / name}", soft_wrap=True)
