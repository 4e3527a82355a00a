"""The benchmark: what it measures, what it is judged by, and its figures as tables."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from steerclear.shield import Shield, ShieldConfig
from steerclear.shield.decide import begin, decide_all, take_up
from steerclear.shield.workspace import Scene

from .bench_measures import (
    COUNTS,
    BatchSize,
    Question,
    batch_memory,
    decide_times,
    lookup_times,
    programs_of,
    questions_of_games,
    scaling,
    solver_times,
    steps_per_s,
)
from .jit import kernel
from .metrics import RADII_M, judged
from .play.spec import check_seed
from .provenance import head_of
from .tables import number_text

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
    counts: tuple[int, ...] = COUNTS

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
        JSON-ready, see `docs_keys.BENCH`.
    """
    started = time.perf_counter()
    shield = ShieldConfig(separation_m=RADII_M[0])  # in every game the same shield
    preset, seed, repeats = settings.preset, settings.seed, settings.repeats
    content: dict[str, Any] = {}
    notice("one decision, 3 boats and 3 opponents")
    asked = questions_of_games(preset, settings.game_s, seed, shield)
    content["decide"] = decide_times(asked, shield, repeats)
    notice("one decision with value tables")
    looking_up = questions_of_games(settings.table_preset, settings.game_s, seed, shield)
    content["decide_by_table"] = decide_times(looking_up, shield, repeats)
    notice("where the time of decisions goes")
    content["stages"] = [
        {"preset": rules, **row}
        for rules, questions in ((preset, asked), (settings.table_preset, looking_up))
        for row in stage_times(questions, shield, repeats)
    ]
    notice("look-ups in a value table")
    content["lookups"] = lookup_times(settings.lookups, repeats, seed)
    notice("the same programs through every solver")
    content["solvers"] = solver_times(programs_of(asked, shield, settings.programs, seed), repeats)
    notice("games at once, one core")
    content["batch"] = [
        steps_per_s(preset, settings.batch, policy, seed, shield if shielded else None) for policy, shielded in WAYS
    ]
    notice("memory")
    content["memory"] = batch_memory(preset, settings.memory_games, shield)
    notice("decisions for more boats")
    content["scaling"] = scaling(shield, settings.scenes, seed, settings.counts)
    goals = bench_goals(content)
    head = head_of("bench", asdict(settings), started)
    return {**head, **content, "goals": goals, "deprecated": {"bars": goals}}


def bench_goals(content: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Judge the figures; slowest of the policies counts for the batch."""
    decide, by_table, memory = content["decide"]["all"], content["decide_by_table"]["all"], content["memory"]
    plain, shielded = (
        min(row["median"] for row in content["batch"] if row["shielded"] is state) for state in (False, True)
    )
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


STAGES = {"passes": "pass, backups held", "searches": "pass after a search", "changes": "do not pass"}
"""Kinds of decisions, in words: those whose nominal commands pass on the backups that are held; those that pass after a
search for others; and those in which some command is short of something, so that backups, program and exact checks
follow."""
PARTS = ("all_us", "check_us", "rest_us", "python_us")
"""Times of a decision: all, the nominal check, what follows it, and what stands round compiled code."""


class BenchTable(NamedTuple):
    """A title, the heads of its columns and its rows, all text."""

    title: str
    heads: Sequence[str]
    rows: list[list[str]]


def bench_tables(content: Mapping[str, Any]) -> list[BenchTable]:
    """Lay out what `run_bench` measured, for the terminal and the documentation."""
    quantiles, memory = ("p50", "p99", "p99.9"), content["memory"]
    lookups = f"mean of {content['lookups'][0]['lookups']:,}, anywhere in the table"
    return [
        _decide(content, "decide", "3 boats and 3 opponents"),
        _decide(content, "decide_by_table", "with value tables (surveyors)"),
        *([_stages(content)] if "stages" in content else []),  # results of 0.8.0 lack them
        BenchTable(
            f"One look-up in a value table, us ({lookups})",
            ("", "us"),
            [[row["what"], number_text(row["us"])] for row in content["lookups"]],
        ),
        BenchTable(
            "The same programs through other solvers, us",
            ("", *quantiles, "x daqp", "solved", "differs"),
            [
                [row["solver"], *_quantiles(row), number_text(row["ratio"]), *_agreement(row)]
                for row in content["solvers"]
            ],
        ),
        BenchTable(
            f"Game-steps per second, {content['batch'][0]['games']} games at once, one core",
            ("", "median", "lowest", "highest"),
            [
                [
                    f"{row['policy']}, {'one team shielded' if row['shielded'] else 'no shield'}",
                    *(f"{row[name]:,.0f}" for name in ("median", "low", "high")),
                ]
                for row in content["batch"]
            ],
        ),
        BenchTable(
            f"Memory of {memory['games']:,} games, MiB",
            ("", "MiB"),
            [["games", f"{memory['games_mib']:.1f}"], ["shield of one team", f"{memory['shield_mib']:.1f}"]],
        ),
        BenchTable(
            "One decision against the number of boats, us",
            ("", "p50", "p99", "per own boat"),
            [
                [f"{row['boats']} boats, {row['ours']} ours", *_quantiles(row)[:2], number_text(row["us_per_own_boat"])]
                for row in content["scaling"]
            ],
        ),
    ]


def _decide(content: Mapping[str, Any], key: str, about: str) -> BenchTable:
    decide = content[key]
    share = decide["share_intervening"]
    names = {"all": "all", "passes": f"passes ({1 - share:.1%})", "intervenes": f"intervenes ({share:.1%})"}
    times = f"each timed {content['settings']['repeats']} times"
    title = f"One decision, {about}, us ({decide['decisions']:,} of real games, {times})"
    rows = [[words, *_quantiles(decide[name])] for name, words in names.items()]
    return BenchTable(title, ("", "p50", "p99", "p99.9"), rows)


def _stages(content: Mapping[str, Any]) -> BenchTable:
    rows = [
        [
            f"{row['preset']}: {STAGES[row['kind']]}",
            f"{row['share']:.1%}",
            f"{row['time_share']:.1%}",
            *(number_text(row[name]) for name in ("all_us", "check_us", "rest_us", "python_us")),
        ]
        for row in content["stages"]
    ]
    heads = ("", "share", "of time", "mean", "check", "after it", "Python")
    return BenchTable("Where the time of decisions goes, means in us", heads, rows)


def _agreement(row: Mapping[str, Any]) -> list[str]:
    solved, differs = row["solved"], row["differs"]
    return ["-" if solved is None else f"{solved:.1%}", "-" if differs is None else f"{differs:.0e}"]


def _quantiles(row: Mapping[str, Any]) -> list[str]:
    return [number_text(row[name]) for name in ("p50_us", "p99_us", "p99_9_us")]


@kernel
def _check(scene: Scene) -> int:
    """The nominal check alone; how many groups of boats do not pass it."""
    take_up(0, scene)
    return begin(scene)


def stage_times(games: Sequence[Sequence[Question]], config: ShieldConfig, repeats: int) -> list[dict[str, Any]]:
    """Time the parts of every decision of real games.

    Returns:
        Per kind of decision, see `STAGES`: `kind`, `decisions`, `share` of them, `time_share` of all time; means in us
        of the whole (`all_us`), of the nominal check (`check_us`), of what follows it (`rest_us`) and of what stands
        round compiled code (`python_us`).
    """
    shield, found = Shield(config), list[tuple[int, list[float]]]()
    for game in games:
        shield.reset()
        shield.decide(game[0].fleet, game[0].wanted, game[0].surroundings)  # makes working memory for the fleet
        found += [_of_question(shield, question, repeats) for question in game[1:]]
    kinds, times = np.array([kind for kind, _ in found]), np.array([spent for _, spent in found])
    rows = []
    for number, kind in enumerate(STAGES):
        mine = times[kinds == number]
        means = mine.mean(axis=0).tolist() if len(mine) else [0.0] * len(PARTS)
        shares = {"share": len(mine) / len(times), "time_share": float(mine[:, 0].sum() / times[:, 0].sum())}
        rows.append({"kind": kind, "decisions": len(mine), **shares, **dict(zip(PARTS, means, strict=True))})
    return rows


def _of_question(shield: Shield, question: Question, repeats: int) -> tuple[int, list[float]]:
    """Number of the decision's kind, and times in us in the order of `PARTS`; the shield goes on as it does anyway."""
    live = shield.remembered
    before = {name: array.copy() for name, array in live.items()}
    scene: Scene = shield._deciders.scene  # type: ignore[union-attr]

    def timed(function: Callable[[], Any]) -> float:
        spent = []
        for _ in range(repeats):
            for name, array in live.items():
                array[...] = before[name]
            begun_ns = time.perf_counter_ns()
            function()
            spent.append((time.perf_counter_ns() - begun_ns) / 1e3)
        return float(np.median(spent))

    whole_us = timed(lambda: shield.decide(question.fleet, question.wanted, question.surroundings))
    check_us = timed(lambda: _check(scene))
    kind = 2 if (scene.group >= 0).any() else int((scene.searched >= 0).any())
    compiled_us = min(timed(lambda: decide_all(scene)), whole_us)
    check_us = min(check_us, compiled_us)
    return kind, [whole_us, check_us, compiled_us - check_us, whole_us - compiled_us]
