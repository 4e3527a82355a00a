"""Commands about scenes of a few boats: encounters, with any safety filter, and the search for those that it loses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import get_platform, known_platforms
from steerclear.shield.platforms.files import is_path

from . import cli_options as o
from .baselines.registry import NONE, is_shield, parse_filters
from .console import command, finish, out, say
from .encounters.attack import MOST_PLAYED, Search, experiment_of, passed, searches_table
from .encounters.attack import write_all as write_searches
from .encounters.outcomes import measure_chunk
from .encounters.replay import record_of
from .encounters.report import LEGEND, cells_table, write_all
from .encounters.results import Pair, Settings, results_of
from .encounters.scenarios import FAMILIES
from .encounters.scene import Conditions, read_scene
from .encounters.simulate import play
from .play.spec import check_count
from .replay_html import write_replay
from .result_files import check_new, make_folder
from .tables import goals_table, number_text, titled

FILTER = ("--filter", "--guard")
SEPARATION = ("--separation", "--radius")


@dataclass(frozen=True)
class SceneOptions:
    """Conditions of scenes."""

    radius: Annotated[float, o.option("M", "Separation to keep, m.", *SEPARATION)] = 2.5
    delay: Annotated[float, o.option("S", "From own command to effect, s, in whole steps, rounded up.")] = 0.0
    noise: Annotated[float, o.option("M", "Bound on the error of positions seen, m.")] = 0.0
    current: Annotated[float, o.option("M/S", "Speed of a current; the filter is told it, not where to.")] = 0.0

    def given(self) -> Conditions:
        """The conditions; ConfigError where one is out of range."""
        return Conditions(self.delay, self.noise, self.current, self.radius)


@dataclass(frozen=True)
class SceneRunOptions(o.RunOptions):
    """As of games; processes have two names."""

    jobs: Annotated[int | None, o.option("N", "Processes.", "--workers", "--jobs", default="all cores")] = None


@command()
def encounters(
    scenes: SceneOptions,
    where: SceneRunOptions,
    platform: Annotated[
        str, o.option("A,B/C", "Platforms: heron, or own/other as heron/surveyor, separated by commas.")
    ] = "heron,surveyor",
    family: Annotated[str, o.option("A,B", "Families of encounters, or all.")] = "all",
    n: Annotated[int, o.option("N", "Encounters per family, platforms and filter.", "--n")] = 1000,
    safety_filter: Annotated[
        list[str] | None,
        o.option("A,B", "none, shield, reach, gatekeeper, pl-cbf (:KEY=VALUE,...), or a textbook.", *FILTER),
    ] = None,
    seed: Annotated[int, o.option("N", "Of the scenes, the same for every filter.")] = 0,
    no_judge: Annotated[bool, o.flag("Do not analyse which violations were avoidable.", "--no-judge")] = False,
    scene: Annotated[list[Path] | None, o.option("FILE", "Play scenes of a file instead.", "--scene")] = None,
) -> None:
    """Let boats meet in every way there is; count separation violations, judge them, write table, report and replays.

    Exit status: 0 done, 1 a shield did not keep a goal of no violations, 2 bad input, 130 interrupted.
    """
    filters = tuple(dict.fromkeys(name for text in safety_filter or ["shield"] for name in parse_filters(text)))
    if scene:
        finish(play_scene_files(scene, filters, where.folder, not no_judge))
        return
    families = _names(family, "--family", f"all, or {', '.join(FAMILIES)}")
    families = tuple(FAMILIES) if families == ("all",) else families
    settings = Settings(platform_pairs(platform), families, filters, n, seed, scenes.given(), not no_judge)
    run = where.run(settings.experiment())
    results = results_of(run)
    if results["cells"]:
        write_all(run, settings, results)
    if not run.interrupted:
        _show(results, run.folder)
        where.copy(results)
    run.end()
    finish(not any(goal["met"] is False and goal["limit"] == 0.0 for goal in results["goals"]))


def _names(text: str, option: str, such_as: str) -> tuple[str, ...]:
    """Names separated by commas, each once; ConfigError where there is none."""
    names = tuple(dict.fromkeys(filter(None, (part.strip() for part in text.split(",")))))
    if not names:
        raise ConfigError(f"{option} names no {option.removeprefix('--')}; write {such_as}")
    return names


def platform_pairs(text: str) -> tuple[Pair, ...]:
    """Read ``heron,heron/surveyor`` as pairs of own and other platform."""
    return tuple(dict.fromkeys(map(_pair, _names(text, "--platform", "heron,surveyor"))))


def _pair(piece: str) -> Pair:
    """One pair; a platform may be a file, whose path may have slashes of its own."""
    if is_path(piece) and Path(piece).is_file():
        return piece, piece
    for k in (k for k, letter in enumerate(piece) if letter == "/"):
        own, other = piece[:k], piece[k + 1 :]
        if all(name in known_platforms() or (is_path(name) and Path(name).is_file()) for name in (own, other)):
            return own, other
    own, _, other = piece.partition("/")
    if is_path(piece):
        get_platform(piece)  # says why it cannot be read
    if not own or "/" in other or piece.endswith("/"):
        raise ConfigError(f"--platform holds {piece!r}; write a name, a file, or own/other")
    return own, other or own


def _show(results: dict[str, Any], folder: Path) -> None:
    console = out()
    for table in cells_table(results):
        console.print(table, "")
    if results["cells"]:
        console.print(f"{LEGEND}\n", style="dim")
    if results["goals"]:
        console.print(goals_table(results["goals"]), "")
    say(*(f"not played: {one['filter']}, {one['family']}: {one['error']}" for one in results["failed"]))
    say(*(folder / name for name in results["files"].values()))


def play_scene_files(paths: Sequence[Path], filters: Sequence[str], folder: Path | None, judge: bool = True) -> bool:
    """Play every scene of the files with every filter; print a table, write a replay when there is a folder.

    Returns:
        Whether no shield was hit avoidably.

    Raises:
        SteerclearError: a file that is no scene, a filter that cannot be made, or a folder with another replay.
    """
    replay = None if folder is None else folder / "replay.html"
    check_new(replay, "--out")
    rows, records, avoided = [], [], True
    for path in paths:
        scenes, conditions = read_scene(path)
        for safety_filter in filters:
            columns = measure_chunk(scenes, safety_filter, conditions, judge)
            hits, avoidable = (
                columns["violations_teammate"] + columns["violations_opponent"],
                columns["avoidable"].sum(),
            )
            closest = number_text(float(columns["closest_m"].min()))
            rows.append([path.name, safety_filter, closest, f"{hits.sum():.0f}", f"{avoidable:.0f}"])
            avoided = avoided and not (avoidable and is_shield(safety_filter))
            if replay is not None:
                played, worst = (
                    play(scenes, safety_filter, conditions),
                    int(columns["game"][columns["closest_m"].argmin()]),
                )
                records.append(record_of(played, worst, f"{path.stem}, {safety_filter}", safety_filter != NONE))
    out().print(titled("Scenes", ["file", "filter", "closest, m", "violations", "avoidable"], rows))
    if replay is not None:
        make_folder(replay.parent)
        say(write_replay(records, replay, title="Scenes"))
    return avoided


@dataclass(frozen=True)
class SearchOptions:
    """What is searched for."""

    platform: Annotated[str, o.option("A[/B]", "Own platform, or own/attackers'.")] = "heron"
    attackers: Annotated[int, o.option("N", "Attackers, 1 to 3.")] = 1
    own: Annotated[int, o.option("N", "Own boats, 1 to 6.")] = 1
    safety_filter: Annotated[str, o.option("NAME", "Safety filter to attack, as in encounters.", *FILTER)] = "shield"
    restarts: Annotated[int, o.option("N", "Searches, each from its own start.")] = 8
    population: Annotated[int, o.option("N", "Opponents per generation.")] = 64
    generations: Annotated[int, o.option("N", "Generations per search, at most.")] = 30
    seed: Annotated[int, o.option("N", "Of the searches.")] = 0


@command()
def attack(
    what: SearchOptions,
    scenes: SceneOptions,
    where: SceneRunOptions,
) -> None:
    """Search for opponents that get within the separation although it could be kept; keep what is found as scenes.

    Exit status: 0 done, 1 an avoidable violation with the shield on, 2 bad input, 130 interrupted.
    """
    filters = parse_filters(what.safety_filter)
    if len(filters) != 1:
        raise ConfigError(f"--filter names {len(filters)} safety filters; attack one at a time")
    pairs = platform_pairs(what.platform)
    if len(pairs) != 1:
        raise ConfigError(f"attack takes one --platform, own or own/attackers', not {len(pairs)}")
    check_count("--restarts", what.restarts, 1, MOST_PLAYED)
    given, sizes = scenes.given(), (what.population, what.generations)
    first = Search(*pairs[0], what.attackers, what.own, filters[0], given, what.seed, 0, *sizes)
    run = where.run(experiment_of(first, what.restarts))
    results = write_searches(run)
    if not run.interrupted:
        out().print(searches_table(results))
        say(*(run.folder / name for name in results["files"].values()))
        where.copy(results)
    run.end()
    finish(passed(results))
