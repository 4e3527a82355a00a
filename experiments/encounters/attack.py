"""Searching for opponents that get within the radius: differential evolution over the opponents' numbers.

Each attacker has `N_GENES` numbers in [0, 1]: where it starts, and three phases. In the first it pursues with some
lead, aside by an angle, at some speed, some way ahead of the bow; at a time or a distance it goes over to the second,
with another lead, angle and speed; and in the end, a while later, to plain lead pursuit at top speed. It always turns
with all the rudder its boat has, and goes for the nearest own boat.

Differential evolution (Storn and Price 1997) as SciPy has it, rather than CMA-ES: it comes with what is installed
already, takes a whole generation as one batch, and keeps a spread population in a landscape of many separate basins
(each side to feint to, each moment to strike) that is flat wherever the filter holds. Attackers may start close to
each other but never close to an own boat, so that what is found is not the start's doing. The distance alone is
minimised: with a share of the filter's least margin added, fewer searches of ten got through (5 at 0.1, 3 at 0.5,
7 without; heron, one attacker, 32 opponents in 8 generations).
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from rich.console import Group
from steerclear.shield.jit import Array

from ..baselines.registry import check_filter, is_shield
from ..play.spec import check_count, check_seed
from ..replay_html import write_replay
from ..result_files import write_json
from ..runner import RESULTS_FILE, ROWS_FILE, Experiment, Run
from ..tables import number_text, titled
from ..warming import compile_encounters, compile_judge
from ..workers import Job, Row
from . import scene as S
from .builder import SceneBuilder, ahead
from .outcomes import Columns, judge_game, side_name, start_safety_margin_m, tally
from .replay import records_with_and_without
from .scenarios import scenes_of_builds
from .scene import Conditions, Scenes, scene_content, scenes_of
from .simulate import Trajectory, play

N_GENES = 14
ROOM_M = 25.0
MOST_OWN, MOST_ATTACKERS, MOST_REPLAYS = 6, 3, 10
MOST_PLAYED = 10_000
"""Opponents of a generation, generations of a search and searches at most: a generation is played in memory at once."""
MOST_JUDGED = 3
"""Violations judged in one generation: a search ends with the first avoidable one."""
NO_SUCCESS_M = 1.0
"""Merit beyond the radius, m, of an opponent whose violation nobody could avoid: the search turns elsewhere."""


@dataclass(frozen=True)
class Search:
    """One search: ``attackers`` of platform ``other`` against ``own_boats`` with a filter, ``population`` a generation.

    Raises:
        SteerclearError: an unknown name or a number out of range.
    """

    own: str = "heron"
    other: str = "heron"
    attackers: int = 1
    own_boats: int = 1
    filter: str = "shield"
    conditions: Conditions = field(default_factory=Conditions)
    seed: int = 0
    restart: int = 0
    population: int = 64
    generations: int = 30

    def __post_init__(self) -> None:
        check_filter(self.filter)
        check_count("--attackers", self.attackers, 1, MOST_ATTACKERS)
        check_count("--own", self.own_boats, 1, MOST_OWN)
        check_count("--population", self.population, 8, MOST_PLAYED)
        check_count("--generations", self.generations, 1, MOST_PLAYED)
        check_seed(self.seed)


class Hunt:
    """A search under way: own boats with their waypoints, current and noise; what was tried, and the best of it."""

    def __init__(self, search: Search) -> None:
        self.search, self.genes, many = search, N_GENES * search.attackers, search.own_boats
        build = SceneBuilder(search.own, search.other, search.conditions, search.seed, "attack", search.restart)
        room, self.spread_m = ROOM_M * build.scale, 0.0 if many == 1 else 6.0 * build.scale
        for k in range(many):
            x, y = ahead(0.0, 0.0, 360.0 * k / many, self.spread_m)
            goals = build.places_in((-room, -room, room, room), 4)
            build.add_own(x, y, build.uniform(-180.0, 180.0), build.uniform(0.5, 1.0), *goals)
        build.settle()
        self.build, self.best_m, self.point = build, np.inf, np.zeros(self.genes)
        self.history: list[float] = []
        self.tried = self.violated = 0
        self.judged: list[dict[str, Any]] = []
        self.avoidable: dict[str, Any] | None = None

    def scenes(self, points: Array) -> Scenes:
        """Scenes of (S, genes) points in [0, 1], one game each."""
        builds = [deepcopy(self.build) for _ in points]
        for k, (build, point) in enumerate(zip(builds, points, strict=True)):
            build.number = k
            for gene in np.clip(point, 0.0, 1.0).reshape(-1, N_GENES):
                self._add_attacker(build, *gene)
        return scenes_of_builds("attack", builds, None, self.build.length_s)

    def _add_attacker(self, build: SceneBuilder, *u: float) -> None:
        top, length_s, whole = build.other_mps, build.length_s, {"aim": S.AIM_TARGET}
        # the spread: so that nobody starts too near one of the own boats
        distance, bearing = build.nearest_m + u[1] * (build.farthest_m - build.nearest_m), 360.0 * u[0] - 180.0
        x, y = ahead(0.0, 0.0, bearing, distance + self.spread_m)
        first_s, first_mps, second_mps = 0.6 * length_s * u[8], (0.3 + 0.7 * u[6]) * top, (0.3 + 0.7 * u[12]) * top
        ahead_m = (25.0 * u[7] - 10.0) * build.scale
        aside_deg = 140.0 * (u[5] - 0.5)
        first = S.phase(**whole, speed_mps=first_mps, lead=1.5 * u[4], angle_deg=aside_deg, standoff_m=ahead_m)
        begin: dict[str, Any] = {"at_s": first_s, "within_m": 20.0 * build.scale * u[9]}
        second = S.phase(**whole, speed_mps=second_mps, lead=1.5 * u[10], angle_deg=80.0 * (u[11] - 0.5), **begin)
        last = S.phase(**whole, speed_mps=top, lead=1.0, at_s=first_s + 0.4 * length_s * u[13])
        row, heading = S.script(first, second, last, authority=True), bearing + 180.0 + 180.0 * (u[2] - 0.5)
        build.add_other(x, y, heading, 0.3 + 0.7 * u[3], row, *build.goals[0])

    def merits(self, points: Array) -> Array:
        """What is minimised, of a generation (genes, S): closest distance, m, or more where a hit is no success."""
        played = play(self.scenes(points.T), self.search.filter, self.search.conditions)
        columns = tally(played)
        merits = columns["closest_m"].copy()
        best = int(merits.argmin())
        if merits[best] < self.best_m:
            self.best_m, self.point = float(merits[best]), points.T[best].copy()
        self.history.append(self.best_m)
        self.tried += len(merits)
        merits[self._judge(played, columns)] = self.search.conditions.radius_m + NO_SUCCESS_M
        return merits

    def _judge(self, played: Trajectory, columns: Columns) -> list[int]:
        """Judge the worst of a generation until one is avoidable; the games in which none was."""
        hits, vain = columns["violations_teammate"] + columns["violations_opponent"], []
        self.violated += int((hits > 0).sum())
        for game in np.argsort(columns["closest_m"])[:MOST_JUDGED].tolist():
            if hits[game] == 0 or self.avoidable is not None:
                break
            found = judge_game(played, game)
            entry: dict[str, Any] = {"closest_m": float(columns["closest_m"][game]), "violations": int(hits[game])}
            entry |= found | {"responsible": side_name(found["responsible"])}
            entry |= {"start_safety_margin_m": float(start_safety_margin_m(played)[game])}
            self.judged.append(entry)
            if found["avoidable"]:
                scene = played.scenes.take([game])
                self.avoidable = scene_content(scene, played.conditions, filter=self.search.filter, **entry)
            else:
                vain.append(game)
        return vain


def run_search(search: Search) -> dict[str, Any]:
    """Search for an avoidable separation violation.

    Returns:
        JSON-ready: ``closest_m`` (least distance of all), ``history`` (best so far per generation), ``tried`` and
        ``violated`` opponents, ``judged`` violations, ``scene`` (the one with an avoidable one, else None) and
        ``closest_scene``.
    """
    hunt = Hunt(search)
    random = np.random.default_rng([search.seed, search.restart, 7])
    from scipy.optimize import differential_evolution
    from scipy.stats import qmc

    start = qmc.LatinHypercube(hunt.genes, rng=random).random(search.population)
    differential_evolution(
        hunt.merits,
        [(0.0, 1.0)] * hunt.genes,
        strategy="rand1bin",
        init=start,
        maxiter=search.generations - 1,
        mutation=(0.4, 0.9),
        recombination=0.8,
        tol=0.0,
        polish=False,
        updating="deferred",
        vectorized=True,
        rng=random,
        callback=lambda intermediate_result: hunt.avoidable is not None,
    )
    closest = scene_content(hunt.scenes(hunt.point[None]), search.conditions, filter=search.filter)
    found = {name: getattr(hunt, name) for name in ("history", "tried", "violated", "judged")}
    head = {"restart": search.restart, "closest_m": hunt.best_m}
    return {**head, **found, "scene": hunt.avoidable, "closest_scene": closest}


def run_job(job: Job) -> list[Row]:
    """Run a search that plain values describe; its one row."""
    known = {name: job[name] for name in Search.__dataclass_fields__}
    return [run_search(Search(**{**known, "conditions": Conditions(**job["conditions"])}))]


def experiment_of(first: Search, restarts: int) -> Experiment:
    """The same search from so many starts."""
    jobs = [asdict(replace(first, restart=k)) for k in range(restarts)]
    settings = {**asdict(first), "restarts": restarts}
    return Experiment("attack", settings, jobs, run_job, "searches", (compile_encounters, compile_judge))


def write_all(run: Run) -> dict[str, Any]:
    """Write scenes, replay and results.json of what was found; return the content of results.json.

    The replay shows the avoidable violations, then the closest, each with the filter and without.
    """
    files, rows = {"searches": ROWS_FILE, "results": RESULTS_FILE}, []
    for entry in run.rows:
        row = {name: value for name, value in entry.items() if name != "closest_scene"}
        if entry["scene"] is not None:
            row["scene"] = f"scenes/attack-{entry['restart']:03d}.json"
            write_json(run.folder / row["scene"], entry["scene"])
        rows.append(row)
    if run.rows and not run.interrupted:
        records, safety_filter = [], run.experiment.settings["filter"]
        for entry in sorted(run.rows, key=lambda one: (one["scene"] is None, one["closest_m"]))[:MOST_REPLAYS]:
            scenes, conditions = scenes_of(entry["scene"] or entry["closest_scene"])
            words = "avoidable violation" if entry["scene"] else f"closest {entry['closest_m']:.2f} m"
            records += records_with_and_without(
                scenes, safety_filter, conditions, f"search {entry['restart']}, {words}"
            )
        files["replay"] = write_replay(records, run.folder / "replay.html", title="Attacks").name
    results = {
        **run.head(),
        "searches": rows,
        "failed": [{name: job[name] for name in ("restart", "error", "fault")} for job in run.failed],
        "found": sum(row["scene"] is not None for row in rows),
        "files": files,
    }
    run.write(results)
    return results


def searches_table(results: dict[str, Any]) -> Group:
    """Table for the terminal."""
    settings = results["settings"]
    fleet = f"{settings['attackers']} {settings['other']} against {settings['own_boats']} {settings['own']}"
    rows = [
        [
            *(f"{row[name]}" for name in ("restart", "tried")),
            number_text(row["closest_m"]),
            *(f"{number}" for number in (row["violated"], len(row["judged"]))),
            row["scene"] or "-",
        ]
        for row in results["searches"]
    ]
    heads = ["search", "tried", "closest, m", "hits", "judged", "avoidable"]
    return titled(f"{fleet}, filter {settings['filter']}", heads, rows)


def passed(results: dict[str, Any]) -> bool:
    """Whether no shield was hit avoidably."""
    return not (results["found"] and is_shield(results["settings"]["filter"]))


KEYS = {
    "complete": "false when interrupted or a search could not be run",
    "searches[].restart": "number of the search",
    "searches[].closest_m": "least distance that any of its opponents came to an own boat, m",
    "searches[].history[]": "the least distance after each generation, m",
    "searches[].tried": "opponents played",
    "searches[].violated": "of those, how many got within the separation",
    "searches[].judged[].*": "violations the analysis judged: distance, entries, safety margin at the start, verdicts",
    "searches[].scene": "file with the avoidable violation found; null without one",
    "failed[].*": "search that could not be run, and why",
    "found": "searches that found an avoidable violation",
    "files.*": "what was written, relative to the folder",
}
"""Keys of the JSON that ``steerclear attack`` writes, with meaning and unit."""
