"""Settings of a run of encounters, and its jobs: guards x platforms x families, in chunks of alike scenes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import get_platform

from ..play.spec import check_seed
from ..runner import Experiment
from ..warming import compile_encounters, compile_judge
from ..workers import Job, Row
from .families import draw, get_family
from .guards import check_guard
from .measure import chunk_size, measure_chunk
from .scenes import Conditions
from .summary import summarise
from .tally import Columns

Pair = tuple[str, str]
MOST_ENCOUNTERS = 1_000_000
"""Encounters of a family, platform and guard at most: all are listed before the first is played."""


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
        judge: whether the oracle judges breaches.

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
        return Experiment("encounters", asdict(self), list(jobs_of(self)), play_job, "chunks of encounters", compiles)


@dataclass(frozen=True)
class Cell:
    """One row of the table: a guard on encounters of a family between two platforms."""

    guard: str
    own: str
    other: str
    family: str


def play_job(job: Job) -> list[Row]:
    """Play the encounters of a job; a row each."""
    cell, conditions = Cell(**job["cell"]), Conditions(**job["conditions"])
    scenes = draw(cell.family, cell.own, cell.other, conditions, job["seed"], job["first"], job["count"])
    columns = measure_chunk(scenes, cell.guard, conditions, job["judge"])
    names = asdict(cell)
    return [{**names, **dict(zip(columns, values, strict=True))} for values in np.array([*columns.values()]).T.tolist()]


def cells_of(settings: Settings) -> list[Cell]:
    """All cells, those of the same scenes next to each other."""
    return [
        Cell(guard, own, other, family)
        for own, other in settings.platforms
        for family in settings.families
        for guard in settings.guards
    ]


def jobs_of(settings: Settings) -> Iterator[Job]:
    """All jobs of a run."""
    for cell in cells_of(settings):
        size = chunk_size(draw(cell.family, cell.own, cell.other, settings.conditions, settings.seed, 0, 1))
        same = {"cell": asdict(cell), "conditions": asdict(settings.conditions), "seed": settings.seed}
        for first in range(0, settings.n, size):
            yield {**same, "first": first, "count": min(size, settings.n - first), "judge": settings.judge}


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


def cell_summaries(columns: Mapping[Cell, Columns]) -> list[dict[str, Any]]:
    """One JSON-ready entry per cell: its names and `summary.summarise` of it."""
    return [{**asdict(cell), **summarise(values)} for cell, values in columns.items()]
