"""Searching for opponents that get within the radius: differential evolution over the opponents' numbers.

Each attacker has `N_GENES` numbers in [0, 1]: where it starts, and three phases. In the first it pursues with some
lead, aside by an angle, at some speed, some way ahead of the bow; at a time or a distance it goes over to the second,
with another lead, angle and speed; and in the end, a while later, to plain lead pursuit at top speed. It always turns
with all the rudder its boat has, and goes for the nearest own boat.

Differential evolution (Storn and Price 1997) as SciPy has it, rather than CMA-ES: it comes with what is installed
already, takes a whole generation as one batch, and keeps a spread population in a landscape of many separate basins
(each side to feint to, each moment to strike) that is flat wherever the guard holds. Attackers may start close to
each other but never close to an own boat, so that what is found is not the start's doing. The distance alone is
minimised: with a share of the guard's least certificate added, fewer searches of ten got through (5 at 0.1, 3 at 0.5,
7 without; heron, one attacker, 32 opponents in 8 generations).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Group
from scipy.optimize import differential_evolution
from scipy.stats import qmc
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array

from ..baselines.registry import check_guard, is_shield
from ..play.spec import check_count, check_seed
from ..replay_html import write_replay
from ..result_files import write_json
from ..runner import RESULTS_FILE, ROWS_FILE, Experiment, Run
from ..tables import number_text, titled
from ..warming import compile_encounters, compile_judge
from ..workers import Job, Row
from . import script as S
from .builder import SceneBuilder, ahead, under_way
from .outcomes import Columns, judge_game, side_name, start_certificate_m, tally
from .replay import records_with_and_without
from .scene import Conditions, Scenes, scene_content, scenes_of
from .simulate import Trajectory, play

N_GENES = 14
ROOM_M = 25.0
MOST_OWN, MOST_ATTACKERS, MOST_REPLAYS = 6, 3, 10
MOST_PLAYED = 10_000
"""Opponents of a generation, generations of a search and searches at most: a generation is played in memory at once."""
MOST_JUDGED = 3
"""Breaches judged in one generation: a search ends with the first avoidable one."""
NO_SUCCESS_M = 1.0
"""Merit beyond the radius, m, of an opponent whose breach nobody could have avoided: the search turns elsewhere."""


@dataclass(frozen=True)
class Search:
    """One search.

    Attributes:
        own: platform of the own boats.
        other: platform of the attackers.
        attackers: how many.
        own_boats: how many.
        guard: name of what is attacked.
        conditions: of the encounters.
        seed: of waypoints and search.
        restart: number of the search.
        population: opponents per generation.
        generations: at most.

    Raises:
        SteerclearError: an unknown name or a number out of range.
    """

    own: str = "heron"
    other: str = "heron"
    attackers: int = 1
    own_boats: int = 1
    guard: str = "shield"
    conditions: Conditions = field(default_factory=Conditions)
    seed: int = 0
    restart: int = 0
    population: int = 64
    generations: int = 30

    def __post_init__(self) -> None:
        check_guard(self.guard)
        for name, value, most in (("--attackers", self.attackers, MOST_ATTACKERS), ("--own", self.own_boats, MOST_OWN)):
            if not 1 <= value <= most:
                raise ConfigError(f"{name} must be from 1 to {most}; got {value}")
        check_count("--population", self.population, 8, MOST_PLAYED)
        check_count("--generations", self.generations, 1, MOST_PLAYED)
        check_seed(self.seed)

    def duel(self) -> Duel:
        """The own boats that are attacked."""
        return Duel(self)

    @classmethod
    def of_job(cls, job: Job) -> Search:
        """The search that plain values describe, as `dataclasses.asdict` gives them."""
        known = {name: job[name] for name in cls.__dataclass_fields__}
        return cls(**{**known, "conditions": Conditions(**job["conditions"])})


class Duel:
    """What is the same for all opponents of one search: own boats with their waypoints, current, noise."""

    def __init__(self, search: Search) -> None:
        self.attackers, own_boats = search.attackers, search.own_boats
        self.build = SceneBuilder(search.own, search.other, search.conditions, search.seed, "attack", search.restart)
        self.length_s = 30.0 + 15.0 * min(self.build.scale, 4.0)
        room, self.spread_m = ROOM_M * self.build.scale, 0.0 if own_boats == 1 else 6.0 * self.build.scale
        for k in range(own_boats):
            x, y = ahead(0.0, 0.0, 360.0 * k / own_boats, self.spread_m)
            goals = [self.build.place_in((-room, -room, room, room)) for _ in range(4)]
            self.build.add_own(x, y, self.build.uniform(-180.0, 180.0), self.build.uniform(0.5, 1.0), *goals)
        self.build.settle()

    @property
    def genes(self) -> int:
        """How many numbers describe the attackers."""
        return N_GENES * self.attackers

    def scenes(self, points: Array) -> Scenes:
        """Scenes of (S, genes) points in [0, 1], one game each."""
        build, games = self.build, len(points)
        attackers = [[self._attacker(row) for row in point.reshape(-1, N_GENES)] for point in points]
        far = [build.goals[0]] * self.attackers
        return Scenes(
            family="attack",
            platforms=(*build.platforms, *[build.other] * self.attackers),
            team=np.array([0] * len(build.state) + [1] * self.attackers, dtype=np.int64),
            state=np.array([[*build.state, *(state for state, _ in line)] for line in attackers]),
            script=np.array([[*build.script, *(row for _, row in line)] for line in attackers]),
            goals=np.tile(np.array([*build.goals, *far], dtype=np.float64), (games, 1, 1, 1)),
            current=np.tile(np.array(build.current), (games, 1)),
            noise_seed=np.full(games, build.noise_seed, dtype=np.uint64),
            number=np.arange(games, dtype=np.int64),
            field=None,
            length_s=self.length_s,
        )

    def _attacker(self, gene: Array) -> tuple[Array, Array]:
        """State and script of one attacker."""
        build, top, u = self.build, self.build.top(self.build.other), np.clip(gene, 0.0, 1.0)
        # the spread: so that nobody starts too near one of the own boats
        distance = build.nearest_m + u[1] * (build.farthest_m - build.nearest_m) + self.spread_m
        bearing = 360.0 * u[0] - 180.0
        x, y = ahead(0.0, 0.0, bearing, distance)
        state = under_way(build.other, x, y, bearing + 180.0 + 180.0 * (u[2] - 0.5), (0.3 + 0.7 * u[3]) * top)
        first_s = 0.6 * self.length_s * u[8]
        first = S.phase(
            S.AIM_TARGET,
            (0.3 + 0.7 * u[6]) * top,
            lead=1.5 * u[4],
            angle_deg=140.0 * (u[5] - 0.5),
            standoff_m=(25.0 * u[7] - 10.0) * build.scale,
        )
        second = S.phase(
            S.AIM_TARGET,
            (0.3 + 0.7 * u[12]) * top,
            lead=1.5 * u[10],
            angle_deg=80.0 * (u[11] - 0.5),
            at_s=first_s,
            within_m=20.0 * build.scale * u[9],
        )
        last = S.phase(S.AIM_TARGET, top, lead=1.0, at_s=first_s + 0.4 * self.length_s * u[13])
        return state, S.script(first, second, last, authority=True)


class _Hunt:
    """A search under way: what was tried, the best of it, the breaches that were judged."""

    def __init__(self, search: Search) -> None:
        self.search, self.duel = search, search.duel()
        self.best_m, self.point = np.inf, np.zeros(self.duel.genes)
        self.history: list[float] = []
        self.tried = self.breached = 0
        self.judged: list[dict[str, Any]] = []
        self.avoidable: dict[str, Any] | None = None

    def merits(self, points: Array) -> Array:
        """What is minimised, of a generation (genes, S): closest distance, m, or more where a breach is no success."""
        scenes = self.duel.scenes(points.T)
        played = play(scenes, self.search.guard, self.search.conditions)
        columns = tally(played)
        closest = columns["closest_m"]
        best = int(closest.argmin())
        if closest[best] < self.best_m:
            self.best_m, self.point = float(closest[best]), points.T[best].copy()
        self.history.append(self.best_m)
        self.tried += scenes.games
        merits = closest.copy()
        merits[self._judge(played, columns)] = self.search.conditions.radius_m + NO_SUCCESS_M
        return merits

    def _judge(self, played: Trajectory, columns: Columns) -> list[int]:
        """Judge the worst of a generation until one is avoidable; the games in which none was."""
        hits, vain = columns["breaches_teammate"] + columns["breaches_opponent"], []
        self.breached += int((hits > 0).sum())
        for game in np.argsort(columns["closest_m"])[:MOST_JUDGED]:
            if hits[game] == 0 or self.avoidable is not None:
                break
            found = judge_game(played, int(game))
            start_m = float(start_certificate_m(played)[game])
            entry: dict[str, Any] = {"closest_m": float(columns["closest_m"][game]), "breaches": int(hits[game])}
            entry |= found | {"start_certificate_m": start_m, "responsible": side_name(found["responsible"])}
            self.judged.append(entry)
            if found["avoidable"]:
                scene = played.scenes.take([int(game)])
                self.avoidable = scene_content(scene, played.conditions, guard=self.search.guard, **entry)
            else:
                vain.append(int(game))
        return vain


def run_search(search: Search) -> dict[str, Any]:
    """Search for an avoidable breach.

    Returns:
        JSON-ready: ``closest_m`` (least distance of all), ``history`` (best so far per generation), ``tried`` and
        ``breached`` opponents, ``judged`` breaches, ``scene`` (the one with an avoidable breach, else None) and
        ``closest_scene``.
    """
    hunt = _Hunt(search)
    random = np.random.default_rng([search.seed, search.restart, 7])
    start = qmc.LatinHypercube(hunt.duel.genes, rng=random).random(search.population)
    differential_evolution(
        hunt.merits,
        [(0.0, 1.0)] * hunt.duel.genes,
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
    return {
        "restart": search.restart,
        "closest_m": hunt.best_m,
        "history": hunt.history,
        "tried": hunt.tried,
        "breached": hunt.breached,
        "judged": hunt.judged,
        "scene": hunt.avoidable,
        "closest_scene": scene_content(hunt.duel.scenes(hunt.point[None]), search.conditions, guard=search.guard),
    }


def run_job(job: Job) -> list[Row]:
    """Run a search that plain values describe; its one row."""
    return [run_search(Search.of_job(job))]


def experiment_of(first: Search, restarts: int) -> Experiment:
    """The same search from so many starts."""
    jobs = [asdict(replace(first, restart=k)) for k in range(restarts)]
    settings = {**asdict(first), "restarts": restarts}
    return Experiment("attack", settings, jobs, run_job, "searches", (compile_encounters, compile_judge))


def write_all(run: Run) -> dict[str, Any]:
    """Write scenes, replay and results.json of what was found; return the content of results.json."""
    files: dict[str, str] = {"searches": ROWS_FILE, "results": RESULTS_FILE}
    rows = []
    for entry in run.rows:
        name = None
        if entry["scene"] is not None:
            name = f"scenes/attack-{entry['restart']:03d}.json"
            write_json(run.folder / name, entry["scene"])
        rows.append({k: v for k, v in entry.items() if k not in ("scene", "closest_scene")} | {"scene": name})
    if run.rows and not run.interrupted:
        files["replay"] = _write_replay(run.folder, run.experiment.settings["guard"], run.rows).name
    results = {
        **run.head(),
        "searches": rows,
        "failed": [{name: job[name] for name in ("restart", "error", "fault")} for job in run.failed],
        "found": sum(row["scene"] is not None for row in rows),
        "files": files,
    }
    run.write(results)
    return results


def _write_replay(folder: Path, guard: str, found: Sequence[dict[str, Any]]) -> Path:
    """The avoidable breaches, then the closest, each with the guard and without."""
    order = sorted(found, key=lambda entry: (entry["scene"] is None, entry["closest_m"]))[:MOST_REPLAYS]
    records = []
    for entry in order:
        scenes, conditions = scenes_of(entry["scene"] or entry["closest_scene"])
        words = "avoidable breach" if entry["scene"] else f"closest {entry['closest_m']:.2f} m"
        records += records_with_and_without(scenes, guard, conditions, f"search {entry['restart']}, {words}")
    return write_replay(records, folder / "replay.html", title="Attacks")


def searches_table(results: dict[str, Any]) -> Group:
    """Table for the terminal."""
    settings = results["settings"]
    title = (
        f"{settings['attackers']} {settings['other']} against {settings['own_boats']} {settings['own']}, "
        f"guard {settings['guard']}"
    )
    rows = [
        [
            f"{row['restart']}",
            f"{row['tried']}",
            number_text(row["closest_m"]),
            f"{row['breached']}",
            f"{len(row['judged'])}",
            row["scene"] or "-",
        ]
        for row in results["searches"]
    ]
    return titled(title, ["search", "tried", "closest, m", "breached", "judged", "avoidable"], rows)


def passed(results: dict[str, Any]) -> bool:
    """Whether no shield was made to breach avoidably."""
    return not (results["found"] and is_shield(results["settings"]["guard"]))


KEYS = {
    "complete": "false when interrupted or a search could not be run",
    "searches[].restart": "number of the search",
    "searches[].closest_m": "least distance that any of its opponents came to an own boat, m",
    "searches[].history[]": "the least distance after each generation, m",
    "searches[].tried": "opponents played",
    "searches[].breached": "of those, how many got within the radius",
    "searches[].judged[].*": "breaches the oracle judged: distance, entries, certificate at the start, verdicts",
    "searches[].scene": "file with the avoidable breach found; null without one",
    "failed[].*": "search that could not be run, and why",
    "found": "searches that found an avoidable breach",
    "files.*": "what was written, relative to the folder",
}
"""Keys of the JSON that ``steerclear attack`` writes, with meaning and unit."""
