"""A run of encounters: its settings and jobs, and what is made of their rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import get_platform

from ..baselines.registry import NONE, check_guard, is_shield
from ..metrics import judged
from ..play.spec import check_seed
from ..result_files import table_name
from ..runner import Experiment, Run
from ..warming import compile_encounters, compile_judge
from ..workers import Job, Row
from .figures import summarise
from .outcomes import Columns, chunk_size, measure_chunk, side_name
from .scenarios import FAMILIES, draw, get_family
from .scene import Conditions

Pair = tuple[str, str]
MOST_ENCOUNTERS = 1_000_000
"""Encounters of a family, platform and guard at most: all are listed before the first is played."""
ONE_RAMMER = "rammer_1"
UNAVOIDABLE_PERCENT = 1.0
"""Most encounters with several others that may be breached unavoidably, %."""
MOST_WORST = 10
FAR_M = 1e4
"""A safety margin beyond this, m, says that nobody is near."""


@dataclass(frozen=True)
class Cell:
    """One row of the table: a guard on encounters of a family between two platforms."""

    guard: str
    own: str
    other: str
    family: str


@dataclass(frozen=True)
class Settings:
    """What to play; they are the command line and what results.json keeps.

    Attributes:
        platforms: platforms of own and other boats.
        families: names.
        guards: names.
        n: encounters per cell.
        seed: of the scenes, the same for every guard.
        conditions: of all encounters.
        judge: whether the post-hoc analysis judges breaches.

    Raises:
        SteerclearError: an unknown name or a number out of range.
    """

    platforms: tuple[Pair, ...]
    families: tuple[str, ...]
    guards: tuple[str, ...] = ("shield",)
    n: int = 1000
    seed: int = 0
    conditions: Conditions = field(default_factory=Conditions)
    judge: bool = True

    def __post_init__(self) -> None:
        if not 1 <= self.n <= MOST_ENCOUNTERS:
            raise ConfigError(f"--n must be at least 1 and at most {MOST_ENCOUNTERS:,}; got {self.n:,}")
        check_seed(self.seed)
        for name in self.families:
            get_family(name)
        for name in self.guards:
            check_guard(name)
        for name in {name for pair in self.platforms for name in pair}:
            get_platform(name)

    def experiment(self) -> Experiment:
        """What `runner.execute` runs."""
        compiles = (compile_encounters, *((compile_judge,) if self.judge else ()))
        return Experiment("encounters", asdict(self), list(self._jobs()), play_job, "chunks of encounters", compiles)

    def _jobs(self) -> Iterator[Job]:
        """Chunks of all cells, those of the same scenes next to each other."""
        same = {"conditions": asdict(self.conditions), "seed": self.seed, "judge": self.judge}
        for own, other in self.platforms:
            for family in self.families:
                size = chunk_size(family, own, other, self.conditions, self.seed)
                for guard in self.guards:
                    cell = asdict(Cell(guard, own, other, family))
                    for first in range(0, self.n, size):
                        yield {"cell": cell, **same, "first": first, "count": min(size, self.n - first)}


def play_job(job: Job) -> list[Row]:
    """Play the encounters of a job; a row each."""
    cell, conditions = Cell(**job["cell"]), Conditions(**job["conditions"])
    scenes = draw(cell.family, cell.own, cell.other, conditions, job["seed"], job["first"], job["count"])
    columns = measure_chunk(scenes, cell.guard, conditions, job["judge"])
    names = asdict(cell)
    return [{**names, **dict(zip(columns, values, strict=True))} for values in np.array([*columns.values()]).T.tolist()]


def columns_of(rows: Sequence[Row]) -> dict[Cell, Columns]:
    """Rows of encounters as columns, by cell."""
    groups: dict[Cell, list[Row]] = {}
    names = Cell.__dataclass_fields__
    for row in rows:
        groups.setdefault(Cell(**{name: row[name] for name in names}), []).append(row)
    return {
        cell: {name: np.array([row[name] for row in found], dtype=np.float64) for name in found[0] if name not in names}
        for cell, found in groups.items()
    }


def results_of(run: Run) -> dict[str, Any]:
    """Content of results.json, of what is on disk."""
    columns = columns_of(run.rows)
    cells = [{**asdict(cell), **summarise(values)} for cell, values in columns.items()]
    goals = goals_of(cells)
    return {
        **run.head(),
        "encounters_played": sum(cell["encounters"] for cell in cells),
        "encounters_resumed": run.resumed,
        "failed": [{**job["cell"], **{name: job[name] for name in ("first", "error", "fault")}} for job in run.failed],
        "cells": cells,
        "goals": goals,
        "worst": worst_encounters(columns),
        "files": {"games": table_name()},
        "deprecated": {"bars": goals},
    }


def goals_of(cells: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Goals of every shield: no avoidable breach, few unavoidable ones among several others.

    One rammer of the same platform must not breach at all where the start was outside the unavoidable set. A count
    that was not judged leaves the goal without data.
    """
    goals = []
    for guard in dict.fromkeys(cell["guard"] for cell in cells if is_shield(cell["guard"])):
        own = [cell for cell in cells if cell["guard"] == guard]
        many = [cell for cell in own if FAMILIES[cell["family"]].others > 1]
        same = [cell for cell in own if cell["family"] == ONE_RAMMER and cell["own"] == cell["other"]]
        goals.append(_goal(f"{guard}: encounters with avoidable breaches", _total(own, "avoidable"), 0.0, own))
        if same:
            name = f"{guard}: started outside, breached by one rammer"
            goals.append(_goal(name, _total(same, "breaches_outside"), 0.0))
        if many:
            share = 100.0 * max(cell["unavoidable"] / cell["encounters"] for cell in many)
            goals.append(_goal(f"{guard}: unavoidable, worst of several others, %", share, UNAVOIDABLE_PERCENT, many))
    return goals


def _total(cells: Sequence[Mapping[str, Any]], name: str) -> float:
    return float(sum(cell[name] for cell in cells))


def _goal(name: str, value: float, limit: float, cells: Sequence[Mapping[str, Any]] = ()) -> dict[str, Any]:
    """A goal; ``cells`` are those whose verdicts it hangs on: what was not judged leaves it without data."""
    return judged(name, value, "<=", limit, open_=any(cell["not_judged"] for cell in cells))


def worst_encounters(columns: Mapping[Cell, Columns], most: int = MOST_WORST) -> list[dict[str, Any]]:
    """The worst encounters of all cells with a shield: avoidable breaches first, then the closest.

    Without such a cell, those with another guard, or with none.
    """
    shields = [cell for cell in columns if is_shield(cell.guard)]
    cells = shields or [cell for cell in columns if cell.guard != NONE] or list(columns)
    found = []
    for cell in cells:
        values = columns[cell]
        for k in np.lexsort((values["closest_m"], -values["avoidable"]))[:most]:
            one = {name: float(column[k]) for name, column in values.items()}
            found.append(
                {
                    **asdict(cell),
                    "number": int(one["number"]),
                    "variant": int(one["variant"]),
                    "closest_m": one["closest_m"],
                    "breaches": int(one["breaches_teammate"] + one["breaches_opponent"]),
                    "avoidable": int(one["avoidable"]),
                    "last_preventable_s": _finite(one["last_preventable_s"]),
                    "responsible": side_name(one["responsible"]),
                    "start_certificate_m": _finite(one["start_certificate_m"]),
                }
            )
    return sorted(found, key=lambda entry: (-entry["avoidable"], entry["closest_m"]))[:most]


def _finite(value: float) -> float | None:
    return value if abs(value) < FAR_M else None
