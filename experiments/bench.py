"""The benchmark: what it measures, what it is judged by, and its figures as tables."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from steerclear.shield import ShieldConfig

from .bench_measures import (
    PARTS,
    QUANTILES,
    STAGES,
    BatchSize,
    Question,
    batch_memory,
    decide_times,
    lookup_times,
    programs_of,
    questions_of_games,
    scaled,
    solver_times,
    stage_times,
    steps_per_s,
)
from .metrics import RADII_M, judged
from .play.spec import check_seed
from .provenance import head_of
from .tables import Table, number_text

WAYS = (("random", False), ("medium", False), ("random", True), ("medium", True))
"""Policies of batched games, and whether the blue team is shielded."""


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
    counts: tuple[int, ...] = (6, 20, 100, 500)

    def __post_init__(self) -> None:
        check_seed(self.seed)

    def small(self) -> BenchSettings:
        """Return a version of seconds instead of minutes; its figures are rough."""
        batch = BatchSize(games=64, steps=20, repeats=2)
        fewer = replace(self, repeats=1, game_s=20.0, lookups=20_000, programs=30, scenes=10)
        return replace(fewer, batch=batch, counts=self.counts[:2])


def run_bench(settings: BenchSettings, notice: Callable[[str], None] = lambda words: None) -> dict[str, Any]:
    """Measure everything, one thing after another in this process: what is timed shares its cores with nothing of ours.

    Args:
        settings: how much.
        notice: told what is being measured.

    Returns:
        JSON-ready, see ``bench`` in `docs_keys.KEYS`.
    """
    started = time.perf_counter()
    shield = ShieldConfig(separation_m=RADII_M[0])  # in every game the same shield
    seed, repeats, content = settings.seed, settings.repeats, dict[str, Any]()
    asked = list[tuple[str, list[list[Question]]]]()
    for key, preset, about in (
        ("decide", settings.preset, "one decision, 3 boats and 3 opponents"),
        ("decide_by_table", settings.table_preset, "one decision with value tables"),
    ):
        notice(about)
        asked.append((preset, questions_of_games(preset, settings.game_s, seed, shield)))
        content[key] = decide_times(asked[-1][1], shield, repeats)
    notice("where the time of decisions goes")
    content["stages"] = [
        {"preset": preset, **row} for preset, games in asked for row in stage_times(games, shield, repeats)
    ]
    notice("look-ups in a value table")
    content["lookups"] = lookup_times(settings.lookups, repeats, seed)
    notice("the same programs through every solver")
    programs = programs_of(asked[0][1], shield, settings.programs, seed)
    content["solvers"] = solver_times(programs, repeats)
    notice("games at once, one core")
    content["batch"] = [
        steps_per_s(settings.preset, settings.batch, policy, seed, shield if shielded else None)
        for policy, shielded in WAYS
    ]
    notice("memory")
    content["memory"] = batch_memory(settings.preset, settings.memory_games, shield)
    notice("decisions for more boats")
    content["scaling"] = [
        scaled(shield, boats, max(3, settings.scenes * min(settings.counts) // boats), seed)
        for boats in settings.counts
    ]
    goals = bench_goals(content)
    return {**head_of("bench", asdict(settings), started), **content, "goals": goals, "deprecated": {"bars": goals}}


def bench_goals(content: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Judge the figures; slowest of the policies counts for the batch."""
    decide, by_table, memory = content["decide"]["all"], content["decide_by_table"]["all"], content["memory"]
    plain, shielded = (min(row["median"] for row in content["batch"] if row["shielded"] is k) for k in (False, True))
    held = memory["games_mib"] + memory["shield_mib"]
    return [
        judged("decision p50, us", decide["p50_us"], "<=", 100.0),
        judged("decision p99.9, us", decide["p99_9_us"], "<=", 1000.0),
        judged("decision with value tables p50, us", by_table["p50_us"], "<=", 100.0),
        judged("decision with value tables p99.9, us", by_table["p99_9_us"], "<=", 1000.0),
        judged("game-steps/s, one core", plain, ">=", 250_000.0),
        judged("game-steps/s, one team shielded", shielded, ">=", 80_000.0),
        judged(f"memory of {memory['games']} games, one team shielded, MiB", held, "<=", 200e6 / 2**20),
    ]


def bench_tables(content: Mapping[str, Any]) -> list[Table]:
    """Lay out what `run_bench` measured, for the terminal and the documentation."""
    memory, lookups, batch = content["memory"], content["lookups"], content["batch"]
    quantiles = ("p50", "p99", "p99.9")

    def shown(row: Mapping[str, Any], names: Sequence[str] = tuple(QUANTILES)) -> list[str]:
        return [number_text(row[name]) for name in names]

    def decided(key: str, about: str) -> Table:
        decide = content[key]
        share = decide["share_intervening"]
        names = {"all": "all", "passes": f"passes ({1 - share:.1%})", "intervenes": f"intervenes ({share:.1%})"}
        times = f"{decide['decisions']:,} of real games, each timed {content['settings']['repeats']} times"
        rows = [[words, *shown(decide[name])] for name, words in names.items()]
        return Table(f"One decision, {about}, us ({times})", ("", *quantiles), rows)

    stages = [
        [
            f"{row['preset']}: {STAGES[row['kind']]}",
            f"{row['share']:.1%}",
            f"{row['time_share']:.1%}",
            *shown(row, PARTS),
        ]
        for row in content.get("stages", ())  # results of 0.8.0 lack them
    ]
    solvers = [
        [
            *(row["solver"], *shown(row), number_text(row["ratio"])),
            "-" if row["solved"] is None else f"{row['solved']:.1%}",
            "-" if row["differs"] is None else f"{row['differs']:.0e}",
        ]
        for row in content["solvers"]
    ]
    batches = [
        [
            f"{row['policy']}, {'one team shielded' if row['shielded'] else 'no shield'}",
            *(f"{row[name]:,.0f}" for name in ("median", "low", "high")),
        ]
        for row in batch
    ]
    sizes = [
        [f"{row['boats']} boats, {row['ours']} ours", *shown(row)[:2], number_text(row["us_per_own_boat"])]
        for row in content["scaling"]
    ]
    held = [["games", f"{memory['games_mib']:.1f}"], ["shield of one team", f"{memory['shield_mib']:.1f}"]]
    looked = [[row["what"], number_text(row["us"])] for row in lookups]
    where = f"mean of {lookups[0]['lookups']:,}, anywhere in the table"
    stage_heads = ("", "share", "of time", "mean", "check", "after it", "Python")
    return [
        decided("decide", "3 boats and 3 opponents"),
        decided("decide_by_table", "with value tables (surveyors)"),
        *([Table("Where the time of decisions goes, means in us", stage_heads, stages)] if stages else []),
        Table(f"One look-up in a value table, us ({where})", ("", "us"), looked),
        Table("The same programs through other solvers, us", ("", *quantiles, "x daqp", "solved", "differs"), solvers),
        Table(
            f"Game-steps per second, {batch[0]['games']} games at once, one core",
            ("", "median", "lowest", "highest"),
            batches,
        ),
        Table(f"Memory of {memory['games']:,} games, MiB", ("", "MiB"), held),
        Table("One decision against the number of boats, us", ("", "p50", "p99", "per own boat"), sizes),
    ]
