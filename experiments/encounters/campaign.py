"""Playing all cells of a run: guards x platforms x families, in chunks, each kept on disk as it comes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import get_platform

from ..play.spec import check_seed
from ..runs.pool import Engine, run_all
from ..runs.store import ResultStore, key_of
from .families import draw, get_family
from .guards import check_guard
from .measure import chunk_size, measure_chunk
from .scenes import Conditions
from .summary import summarise
from .tally import Columns

Pair = tuple[str, str]
MOST_ENCOUNTERS = 1_000_000
"""Encounters of a family, platform and guard at most: all are listed before the first is played."""

COLUMNS_VERSION = 4
"""Goes up when columns change, so that results kept by an earlier version are played anew."""


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

    def as_dict(self) -> dict[str, Any]:
        """JSON-ready."""
        return asdict(self)


@dataclass(frozen=True)
class Cell:
    """One row of the table: a guard on encounters of a family between two platforms."""

    guard: str
    own: str
    other: str
    family: str


@dataclass(frozen=True)
class Job:
    """Some encounters of a cell; ``columns`` tells results of different versions apart."""

    cell: Cell
    conditions: Conditions
    seed: int
    first: int
    count: int
    judge: bool
    columns: int = COLUMNS_VERSION

    @property
    def key(self) -> str:
        """Name under which the result is kept."""
        return key_of(asdict(self))


def play_job(job: Job) -> dict[str, Any]:
    """Play some encounters; the columns as lists, and the cell."""
    cell = job.cell
    scenes = draw(cell.family, cell.own, cell.other, job.conditions, job.seed, job.first, job.count)
    columns = measure_chunk(scenes, cell.guard, job.conditions, job.judge)
    return {"cell": asdict(cell), "columns": {name: values.tolist() for name, values in columns.items()}}


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
        for first in range(0, settings.n, size):
            count = min(size, settings.n - first)
            yield Job(cell, settings.conditions, settings.seed, first, count, settings.judge)


class Campaign:
    """A run, and where its results are kept.

    Args:
        settings: what to play.
        store: where results go and where finished ones come from.
        processes: how many at once, or the engine that plays them.
    """

    def __init__(self, settings: Settings, store: ResultStore, processes: int | Engine = 1) -> None:
        self.settings, self.store, self.processes = settings, store, processes
        self.jobs = list(jobs_of(settings))
        self.failed: list[dict[str, Any]] = []
        self.resumed = 0

    @property
    def encounters(self) -> int:
        """How many encounters the run has, over all cells."""
        return sum(job.count for job in self.jobs)

    def run(self, notice: Callable[[int], None]) -> None:
        """Play what is missing; ``notice`` is told how many encounters are done."""
        before = self.store.load()
        missing = [job for job in self.jobs if job.key not in before]
        self.resumed = done = self.encounters - sum(job.count for job in missing)
        notice(done)
        for outcome in run_all(play_job, missing, self.processes):
            if outcome.answer is None:
                self.failed.append({**asdict(outcome.job.cell), "first": outcome.job.first, **outcome.why})
            else:
                self.store.append(outcome.job.key, outcome.answer)
            done += outcome.job.count
            notice(done)

    def columns(self) -> dict[Cell, Columns]:
        """What is on disk of this run, by cell."""
        kept = self.store.load()
        parts: dict[Cell, list[Mapping[str, Any]]] = {}
        for job in self.jobs:
            if job.key in kept:
                parts.setdefault(job.cell, []).append(kept[job.key]["columns"])
        return {
            cell: {
                name: np.concatenate([np.array(part[name], dtype=np.float64) for part in found]) for name in found[0]
            }
            for cell, found in parts.items()
        }


def cell_summaries(columns: Mapping[Cell, Columns]) -> list[dict[str, Any]]:
    """One JSON-ready entry per cell: its names and `summary.summarise` of it."""
    return [{**asdict(cell), **summarise(values)} for cell, values in columns.items()]
