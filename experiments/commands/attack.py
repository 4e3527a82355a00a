"""``steerclear attack``: a search for opponents that make the shield breach."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from steerclear.shield.exceptions import ConfigError

from ..baselines.registry import parse_guards
from ..encounters.attack import MOST_PLAYED, Search, experiment_of, passed, searches_table, write_all
from ..encounters.scene import Conditions
from ..play.spec import check_count
from ..result_files import write_json
from ..runner import execute
from ..workers import workers_of
from . import options as o
from .console import command, finish, out, progress
from .encounters import Current, Delay, Noise, Radius, Workers, platform_pairs
from .games import results_folder
from .scenes import play_scene_files


@command
def attack(
    platform: Annotated[str, typer.Option(metavar="A[/B]", help="Own platform, or own/attackers'.")] = "heron",
    attackers: Annotated[int, typer.Option(metavar="N", help="Attackers, 1 to 3.")] = 1,
    own: Annotated[int, typer.Option(metavar="N", help="Own boats, 1 to 6.")] = 1,
    guard: Annotated[str, typer.Option(metavar="NAME", help="What is attacked, as in encounters.")] = "shield",
    restarts: Annotated[int, typer.Option(metavar="N", help="Searches, each from its own start.")] = 8,
    population: Annotated[int, typer.Option(metavar="N", help="Opponents per generation.")] = 64,
    generations: Annotated[int, typer.Option(metavar="N", help="Generations per search, at most.")] = 30,
    radius: Radius = 2.5,
    delay: Delay = 0.0,
    noise: Noise = 0.0,
    current: Current = 0.0,
    seed: Annotated[int, typer.Option(metavar="N", help="Of the searches.")] = 0,
    folder: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder.")] = None,
    workers: Workers = None,
    engine: o.Engine = "pool",
    address: o.Address = None,
    resume: o.Resume = False,
    replay: Annotated[
        list[Path] | None, typer.Option("--replay", metavar="FILE", help="Play found scenes again instead.")
    ] = None,
    json_file: o.JsonFile = None,
) -> None:
    """Search for opponents that get within the radius although it could be kept; keep what is found as scenes.

    Exit status: 0 done, 1 an avoidable breach with the shield on, 2 bad input, 130 interrupted.
    """
    guards = parse_guards(guard)
    if len(guards) != 1:
        raise ConfigError(f"--guard names {len(guards)} guards; attack one at a time")
    if replay:
        finish(play_scene_files(replay, guards, folder))
        return
    pairs = platform_pairs(platform)
    if len(pairs) != 1:
        raise ConfigError(f"attack takes one --platform, own or own/attackers', not {len(pairs)}")
    check_count("--restarts", restarts, 1, MOST_PLAYED)
    conditions = Conditions(radius, delay, noise, current)
    first = Search(*pairs[0], attackers, own, guards[0], conditions, seed, 0, population, generations)
    first.duel()
    folder = results_folder("attack", folder, resume)
    with progress("searches", restarts) as notice:
        workers_asked = workers_of(engine, address, workers)
        run = execute(experiment_of(first, restarts), folder, workers_asked, resume, lambda done, of: notice(done))
    results = write_all(run)
    if not run.interrupted:
        out().print(searches_table(results))
        for name in results["files"].values():
            out().print(f"{folder / name}", soft_wrap=True)
        if json_file is not None:
            write_json(json_file, results)
    run.end()
    finish(passed(results))
