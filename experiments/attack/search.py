"""Searching for an opponent that gets within the radius: differential evolution over the opponents' numbers.

Differential evolution (Storn and Price 1997) as SciPy has it, rather than CMA-ES: it comes with what is installed
already, takes a whole generation as one batch, and keeps a spread population in a landscape of many separate basins
(each side to feint to, each moment to strike) that is flat wherever the guard holds. Attackers may start close to
each other but never close to an own boat, so that what is found is not the start's doing. The distance alone is
minimised: with a share of the guard's least certificate added, fewer searches of ten got through (5 at 0.1, 3 at 0.5,
7 without; heron, one attacker, 32 opponents in 8 generations).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc
from steerclear.shield.jit import Array

from ..encounters.guards import check_guard
from ..encounters.play import Film, play
from ..encounters.scene_file import scene_content
from ..encounters.scenes import Conditions
from ..encounters.start import start_certificate_m
from ..encounters.tally import Columns, tally
from ..encounters.verdicts import judge_game, side_name
from ..play.spec import check_count, check_seed
from ..workers import Job, Row
from .opponents import Duel

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
        check_count("--population", self.population, 8, MOST_PLAYED)
        check_count("--generations", self.generations, 1, MOST_PLAYED)
        check_seed(self.seed)

    def duel(self) -> Duel:
        """The own boats that are attacked."""
        return Duel(self.own, self.other, self.attackers, self.own_boats, self.conditions, self.seed, self.restart)

    @classmethod
    def of_job(cls, job: Job) -> Search:
        """The search that plain values describe, as `dataclasses.asdict` gives them."""
        known = {name: job[name] for name in cls.__dataclass_fields__}
        return cls(**{**known, "conditions": Conditions(**job["conditions"])})


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
        film = play(scenes, self.search.guard, self.search.conditions)
        columns = tally(film)
        closest = columns["closest_m"]
        best = int(closest.argmin())
        if closest[best] < self.best_m:
            self.best_m, self.point = float(closest[best]), points.T[best].copy()
        self.history.append(self.best_m)
        self.tried += scenes.games
        merits = closest.copy()
        merits[self._judge(film, columns)] = self.search.conditions.radius_m + NO_SUCCESS_M
        return merits

    def _judge(self, film: Film, columns: Columns) -> list[int]:
        """Judge the worst of a generation until one is avoidable; the games in which none was."""
        hits, vain = columns["breaches_teammate"] + columns["breaches_opponent"], []
        self.breached += int((hits > 0).sum())
        for game in np.argsort(columns["closest_m"])[:MOST_JUDGED]:
            if hits[game] == 0 or self.avoidable is not None:
                break
            found = judge_game(film, int(game))
            start_m = float(start_certificate_m(film)[game])
            entry = {"closest_m": float(columns["closest_m"][game]), "breaches": int(hits[game])}
            entry |= found | {"start_certificate_m": start_m, "responsible": side_name(found["responsible"])}
            self.judged.append(entry)
            if found["avoidable"]:
                scene = film.scenes.take([int(game)])
                self.avoidable = scene_content(scene, film.conditions, guard=self.search.guard, **entry)
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
