"""A run of encounters: its settings and jobs, what is made of their rows, and the goals of shields."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

import numpy as np
from steerclear.shield.platforms import get_platform

from ..baselines.registry import NONE, check_filter, is_shield
from ..metrics import judged
from ..play.spec import check_count, check_seed
from ..result_files import table_name
from ..runner import Experiment, Run
from ..warming import compile_encounters, compile_judge
from ..workers import Job, Row
from .figures import WORST, summarise
from .outcomes import Columns, chunk_size, measure_chunk, side_name
from .scenarios import FAMILIES, draw, get_family
from .scene import Conditions

Pair = tuple[str, str]
MOST_ENCOUNTERS = 1_000_000
"""Encounters of a family, platform and filter at most: all are listed before the first is played."""
UNAVOIDABLE_PERCENT = 1.0
"""Most encounters with several others that may have unavoidable violations, %."""
MOST_WORST, LEAST_WORST = 10, 2
"""Worst encounters that are shown: of all filters together, at most, and of each one, at least."""
FAR_M = 1e4
"""A safety margin beyond this, m, says that nobody is near."""


class Cell(NamedTuple):
    """One row of the table: a safety filter on encounters of a family between two platforms."""

    filter: str
    own: str
    other: str
    family: str


@dataclass(frozen=True)
class Settings:
    """What to play; they are the command line and what results.json keeps: ``n`` encounters per cell.

    Raises:
        SteerclearError: an unknown name or a number out of range.
    """

    platforms: tuple[Pair, ...]
    families: tuple[str, ...]
    filters: tuple[str, ...] = ("shield",)
    n: int = 1000
    seed: int = 0
    conditions: Conditions = field(default_factory=Conditions)
    judge: bool = True

    def __post_init__(self) -> None:
        check_count("--n", self.n, 1, MOST_ENCOUNTERS)
        check_seed(self.seed)
        for check, names in ((get_family, self.families), (check_filter, self.filters)):
            for name in names:
                check(name)
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
                for safety_filter in self.filters:
                    cell = Cell(safety_filter, own, other, family)._asdict()
                    for first in range(0, self.n, size):
                        yield {"cell": cell, **same, "first": first, "count": min(size, self.n - first)}


def play_job(job: Job) -> list[Row]:
    """Play the encounters of a job; a row each."""
    cell, conditions = Cell(**job["cell"]), Conditions(**job["conditions"])
    scenes = draw(cell.family, cell.own, cell.other, conditions, job["seed"], job["first"], job["count"])
    columns = measure_chunk(scenes, cell.filter, conditions, job["judge"])
    rows = np.array([*columns.values()]).T.tolist()
    return [{**cell._asdict(), **dict(zip(columns, values, strict=True))} for values in rows]


def columns_of(run: Run) -> dict[Cell, Columns]:
    """Rows of encounters as columns, by cell."""
    if not run.rows:
        return {}
    groups = run.table.groupby(list(Cell._fields), sort=False)
    return {
        Cell(*names): {name: rows[name].to_numpy(dtype=np.float64) for name in rows if name not in Cell._fields}
        for names, rows in groups
    }


def results_of(run: Run) -> dict[str, Any]:
    """Content of results.json, of what is on disk."""
    columns = columns_of(run)
    cells = [{**cell._asdict(), **summarise(values)} for cell, values in columns.items()]
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
    }


def goals_of(cells: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Goals of every shield: no avoidable violation, few unavoidable ones among several others.

    One rammer of the same platform must not violate the separation at all where the start was outside the
    unavoidable set. A count that was not judged leaves the goal without data.
    """
    goals = []
    for safety_filter in dict.fromkeys(cell["filter"] for cell in cells if is_shield(cell["filter"])):
        own = [cell for cell in cells if cell["filter"] == safety_filter]
        many = [cell for cell in own if FAMILIES[cell["family"]].others > 1]
        same = [cell for cell in own if cell["family"] == "rammer_1" and cell["own"] == cell["other"]]
        avoidable = float(sum(cell["avoidable"] for cell in own))
        goals.append(_goal(f"{safety_filter}: encounters with avoidable violations", avoidable, 0.0, own))
        if same:
            hit = float(sum(cell["violations_outside"] for cell in same))
            name = f"{safety_filter}: violations of one rammer, started outside the unavoidable set"
            goals.append(_goal(name, hit, 0.0))
        if many:
            share = 100.0 * max(cell["unavoidable"] / cell["encounters"] for cell in many)
            goals.append(
                _goal(f"{safety_filter}: unavoidable, worst of several others, %", share, UNAVOIDABLE_PERCENT, many)
            )
    return goals


def _goal(name: str, value: float, limit: float, cells: Sequence[Mapping[str, Any]] = ()) -> dict[str, Any]:
    """A goal; ``cells`` are those whose verdicts it hangs on: what was not judged leaves it without data."""
    return judged(name, value, "<=", limit, open_=any(cell["not_judged"] for cell in cells))


def worst_encounters(columns: Mapping[Cell, Columns]) -> list[dict[str, Any]]:
    """The worst encounters of each filter, of none where there is no other: avoidable ones first, then the closest."""
    filters = list(dict.fromkeys(cell.filter for cell in columns))
    filters = [name for name in filters if name != NONE] or filters
    most = max(LEAST_WORST, MOST_WORST // max(1, len(filters)))
    return [one for name in filters for one in _worst_of(name, columns, most)]


def _worst_of(safety_filter: str, columns: Mapping[Cell, Columns], most: int) -> list[dict[str, Any]]:
    found = []
    for cell, values in columns.items():
        if cell.filter != safety_filter:
            continue
        for k in np.lexsort((values["closest_m"], -values["avoidable"]))[:most]:
            one: dict[str, Any] = {**cell._asdict(), **{name: float(column[k]) for name, column in values.items()}}
            one["violations"] = one["violations_teammate"] + one["violations_opponent"]
            one |= {name: int(one[name]) for name in ("number", "variant", "violations", "avoidable")}
            one["responsible"] = side_name(one["responsible"])
            for name in ("last_preventable_s", "start_safety_margin_m"):
                one[name] = one[name] if abs(one[name]) < FAR_M else None
            found.append({name: one[name] for name in WORST})
    return sorted(found, key=lambda entry: (-entry["avoidable"], entry["closest_m"]))[:most]
