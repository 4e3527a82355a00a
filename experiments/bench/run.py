"""The whole benchmark, and what it is judged by."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from steerclear.shield import ShieldConfig

from ..metrics import RADII_M
from ..play.spec import check_seed
from ..provenance import machine, versions
from .batch import BatchSize, batch_memory, steps_per_s
from .decide import COUNTS, decide_times, scaling
from .lookups import lookup_times
from .sampling import programs_of, questions_of_games
from .solvers import solver_times


@dataclass(frozen=True)
class BenchSettings:
    """How much to measure.

    Attributes:
        preset: rules of the games.
        table_preset: rules of games whose boats look opponents up in value tables; their decisions are timed as well.
        seed: of everything drawn.
        repeats: times each decision and program is timed; its median counts.
        game_s: length of the games that states are taken from, s.
        lookups: look-ups in a value table.
        programs: programs for the solvers, at most.
        batch: size of the batched runs.
        memory_games: games whose memory is measured.
        scenes: random scenes for the smallest fleet; fewer for larger ones.
        counts: sizes of fleets.
    """

    preset: str = "aamas2024"
    table_preset: str = "mctf2025"
    seed: int = 0
    repeats: int = 5
    game_s: float = 300.0
    lookups: int = 200_000
    programs: int = 400
    batch: BatchSize = field(default_factory=BatchSize)
    memory_games: int = 4096
    scenes: int = 200
    counts: tuple[int, ...] = COUNTS

    def __post_init__(self) -> None:
        check_seed(self.seed)

    def small(self) -> BenchSettings:
        """Return a version of seconds instead of minutes; its figures are rough."""
        batch = BatchSize(games=64, steps=20, repeats=2)
        return replace(
            self, repeats=1, game_s=20.0, lookups=20_000, programs=30, batch=batch, scenes=10, counts=self.counts[:2]
        )


def run_bench(settings: BenchSettings, notice: Callable[[str], None] = lambda words: None) -> dict[str, Any]:
    """Measure everything.

    Args:
        settings: how much.
        notice: told what is being measured.

    Returns:
        JSON-ready, see `keys.BENCH`.
    """
    started = time.perf_counter()
    shield = ShieldConfig(separation_m=RADII_M[0])  # in every game the same shield
    content: dict[str, Any] = {
        "command": "bench",
        "settings": asdict(settings),
        "versions": versions(),
        "machine": machine(),
    }
    for name, words, measure in _parts(settings, shield):
        notice(words)
        content[name] = measure()
    goals = bench_goals(content)
    return {**content, "goals": goals, "deprecated": {"bars": goals}, "wall_s": time.perf_counter() - started}


def _parts(settings: BenchSettings, shield: ShieldConfig) -> Iterator[tuple[str, str, Callable[[], Any]]]:
    kept: list[Any] = []

    def decide() -> dict[str, Any]:
        kept.extend(questions_of_games(settings.preset, settings.game_s, settings.seed, shield))
        return decide_times(kept, shield, settings.repeats)

    def decide_by_table() -> dict[str, Any]:
        looking_up = questions_of_games(settings.table_preset, settings.game_s, settings.seed, shield)
        return decide_times(looking_up, shield, settings.repeats)

    def solvers() -> list[dict[str, Any]]:
        return solver_times(programs_of(kept, shield, settings.programs, settings.seed), settings.repeats)

    def batch() -> list[dict[str, Any]]:
        ways = [("random", None), ("medium", None), ("random", shield), ("medium", shield)]
        return [steps_per_s(settings.preset, settings.batch, policy, settings.seed, way) for policy, way in ways]

    yield "decide", "one decision, 3 boats and 3 opponents", decide
    yield "decide_by_table", "one decision with value tables", decide_by_table
    yield (
        "lookups",
        "look-ups in a value table",
        lambda: lookup_times(settings.lookups, settings.repeats, settings.seed),
    )
    yield "solvers", "the same programs through every solver", solvers
    yield "batch", "games at once, one core", batch
    yield "memory", "memory", lambda: batch_memory(settings.preset, settings.memory_games, shield)
    yield (
        "scaling",
        "decisions for more boats",
        lambda: scaling(shield, settings.scenes, settings.seed, settings.counts),
    )


def bench_goals(content: dict[str, Any]) -> list[dict[str, Any]]:
    """Judge the figures; slowest of the policies counts for the batch."""
    decide, by_table, memory = content["decide"]["all"], content["decide_by_table"]["all"], content["memory"]
    plain, shielded = (
        min(row["median"] for row in content["batch"] if row["shielded"] is state) for state in (False, True)
    )
    held = memory["games_mib"] + memory["shield_mib"]
    return [
        _bar("decision p50, us", decide["p50_us"], "<=", 100.0),
        _bar("decision p99.9, us", decide["p99_9_us"], "<=", 1000.0),
        _bar("decision with value tables p50, us", by_table["p50_us"], "<=", 100.0),
        _bar("decision with value tables p99.9, us", by_table["p99_9_us"], "<=", 1000.0),
        _bar("game-steps/s, one core", plain, ">=", 250_000.0),
        _bar("game-steps/s, one team shielded", shielded, ">=", 80_000.0),
        _bar(f"memory of {memory['games']} games, one team shielded, MiB", held, "<=", 200e6 / 2**20),
    ]


def _bar(name: str, value: float, sense: str, limit: float) -> dict[str, Any]:
    met = value <= limit if sense == "<=" else value >= limit
    return {"name": name, "value": value, "low": None, "high": None, "sense": sense, "limit": limit, "met": bool(met)}
