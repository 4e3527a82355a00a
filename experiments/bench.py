"""The benchmark: measurements, goals, and tables of the results."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from steerclear.shield import ShieldConfig

from .bench_measures import (
    PAIR,
    PARTS,
    QUANTILES,
    STAGES,
    BatchRun,
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

POLICIES = ("random", "easy", "medium", "hard")
"""Policies of timed decisions and batched games, from those with many conflicts to those with few."""


HEADS = ("p50", "p99", "p99.9")
PART_HEADS = ("check", "after it", "Python")
LARGE_MS = {100: 15.0, 1000: 300.0}
"""Longest decision by number of boats, ms."""


@dataclass(frozen=True)
class BenchSettings:
    """Extent of the benchmark.

    Attributes:
        preset: rules of the games.
        table_preset: rules of games whose boats use value tables; they are timed as well.
        seed: of all random draws.
        repeats: how often each decision and program is timed; the median counts.
        game_s: length of the games that states are taken from, s.
        lookups: look-ups in a value table.
        programs: programs for the solvers, at most.
        batch: size of the batched runs.
        games: simultaneous games in the runs of each policy.
        games_at_once: numbers of simultaneous games, timed with one thread and with ``threads``.
        threads: threads of the shield, compared with one.
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
    games: int = 256
    games_at_once: tuple[int, ...] = (64, 256, 1024, 4096)
    threads: int = 2
    memory_games: int = 4096
    scenes: int = 200
    counts: tuple[int, ...] = (6, 12, 50, 100, 500, 1000)

    def __post_init__(self) -> None:
        check_seed(self.seed)

    @property
    def presets(self) -> tuple[str, ...]:
        """Both presets, or one if they are the same."""
        return tuple(dict.fromkeys((self.preset, self.table_preset)))

    def small(self) -> BenchSettings:
        """Return a version that takes seconds instead of minutes; its figures are rough."""
        fewer = replace(self, repeats=1, game_s=20.0, lookups=20_000, programs=30, scenes=10, counts=self.counts[:2])
        return replace(fewer, batch=BatchSize(game_steps=640, repeats=2), games=32, games_at_once=(32, 64))

    def batch_runs(self) -> list[BatchRun]:
        """Return the distinct batch runs: policies with and without shield, numbers of games, and threads."""
        found = [
            BatchRun(preset, policy, shielded, self.games)
            for preset in self.presets
            for policy in POLICIES
            for shielded in (False, True)
        ]
        for preset in self.presets:
            found += [BatchRun(preset, "medium", True, games) for games in self.games_at_once]
            found += [BatchRun(preset, "medium", True, games, self.threads) for games in self.games_at_once]
        return list(dict.fromkeys(found))


def run_bench(settings: BenchSettings, notice: Callable[[str], None] = lambda words: None) -> dict[str, Any]:
    """Measure everything in sequence in this process, so that measurements do not share cores.

    Args:
        settings: extent of the benchmark.
        notice: called with what is being measured.

    Returns:
        JSON-ready, see ``bench`` in `docs.KEYS`.
    """
    started, content = time.perf_counter(), dict[str, Any]()
    shield = ShieldConfig(separation_m=RADII_M[0])  # the same in all games
    seed, repeats, game_s = settings.seed, settings.repeats, settings.game_s
    asked = list[tuple[str, list[list[Question]]]]()
    for key, preset in (("decide", settings.preset), ("decide_by_table", settings.table_preset)):
        notice(f"one decision, {preset}")
        asked.append((preset, questions_of_games(preset, game_s, seed, shield)))
        content[key] = decide_times(asked[-1][1], shield, repeats)
    notice("decisions of other policies")
    content["policies"] = [
        _policy_times(settings, preset, policy, shield) for preset in settings.presets for policy in POLICIES
    ]
    notice("where the time of decisions goes")
    content["stages"] = [
        {"preset": preset, **row} for preset, games in asked for row in stage_times(games, shield, repeats)
    ]
    notice("look-ups in a value table")
    content["lookups"] = lookup_times(settings.lookups, repeats, seed)
    notice("the same programs through every solver")
    content["solvers"] = solver_times(programs_of(asked[0][1], shield, settings.programs, seed), repeats)
    notice("games at once")
    content["batch"] = steps_per_s(settings.batch_runs(), settings.batch, seed, shield)
    notice("memory")
    content["memory"] = batch_memory(settings.preset, settings.memory_games, shield)
    notice("decisions for more boats")
    content["scaling"] = [
        scaled(shield, platform, boats, max(3, settings.scenes * min(settings.counts) // boats), seed)
        for platform in PAIR
        for boats in settings.counts
    ]
    content["settings"] = asdict(settings)
    goals = bench_goals(content)
    return {**head_of("bench", asdict(settings), started), **content, "goals": goals}


def _policy_times(settings: BenchSettings, preset: str, policy: str, shield: ShieldConfig) -> dict[str, Any]:
    """Time the decisions of a policy against `medium`."""
    games = questions_of_games(preset, settings.game_s, settings.seed, shield, policy, ("medium",))
    times = decide_times(games, shield, settings.repeats)
    about = {"preset": preset, "policy": policy, "decisions": times["decisions"]}
    return {**about, "share_intervening": times["share_intervening"], **times["all"]}


def bench_goals(content: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Judge the figures: without a shield by the slowest policy, with one by `medium`."""
    asked, memory = content["settings"], content["memory"]
    preset, table_preset, games = asked["preset"], asked["table_preset"], asked["games"]
    decide, by_table = content["decide"]["all"], content["decide_by_table"]["all"]
    bare = min(row["median"] for row in _rows(content["batch"], preset=preset, games=games, shielded=False))
    held = memory["games_mib"] + memory["shield_mib"]
    goals = [
        judged("decision p50, us", decide["p50_us"], "<=", 35.0),
        judged("decision p99.9, us", decide["p99_9_us"], "<=", 500.0),
        judged("decision with value tables p50, us", by_table["p50_us"], "<=", 50.0),
        judged("decision with value tables p99.9, us", by_table["p99_9_us"], "<=", 500.0),
        judged("game-steps/s, one core", bare, ">=", 250_000.0),
    ]
    for name, least in {preset: 80_000.0, table_preset: 20_000.0}.items():
        mine = _rows(content["batch"], preset=name, games=games, policy="medium", shielded=True)
        one, several = (next(r["median"] for r in mine if (r["threads"] == 1) is alone) for alone in (True, False))
        goals += [
            judged(f"game-steps/s, one team shielded, {name}", one, ">=", least),
            judged(f"{asked['threads']} threads against one, {name}", several / one, ">=", 1.8),
        ]
    for row in _rows(content["scaling"], platform=PAIR[1]):
        if row["boats"] in LARGE_MS:
            most = LARGE_MS[row["boats"]]
            goals.append(judged(f"decision for {row['boats']} boats p50, ms", row["p50_us"] / 1000.0, "<=", most))
    return [*goals, judged(f"memory of {memory['games']} games, one team shielded, MiB", held, "<=", 200e6 / 2**20)]


def _rows(rows: Sequence[Mapping[str, Any]], **fields: Any) -> list[Mapping[str, Any]]:
    """Return the rows with these field values."""
    return [row for row in rows if all(row[name] == value for name, value in fields.items())]


def bench_tables(content: Mapping[str, Any]) -> list[Table]:
    """Lay out what `run_bench` measured, for the terminal and the documentation."""
    return [*_decision_tables(content), *_part_tables(content), *_batch_tables(content), _size_table(content)]


def _shown(row: Mapping[str, Any], names: Sequence[str] = tuple(QUANTILES)) -> list[str]:
    return [number_text(row[name]) for name in names]


def _decision_tables(content: Mapping[str, Any]) -> list[Table]:
    """Return tables of decision times: by outcome, by policy, and by part."""
    made, repeats = [], content["settings"]["repeats"]
    for key, about in (("decide", "3 boats and 3 opponents"), ("decide_by_table", "with value tables (surveyors)")):
        decide, share = content[key], content[key]["share_intervening"]
        names = {"all": "all", "passes": f"passes ({1 - share:.1%})", "intervenes": f"intervenes ({share:.1%})"}
        title = f"One decision, {about}, us ({decide['decisions']:,} of real games, each timed {repeats} times)"
        made.append(Table(title, ("", *HEADS), [[words, *_shown(decide[name])] for name, words in names.items()]))
    policies = [
        [f"{row['preset']}: {row['policy']}", f"{row['share_intervening']:.1%}", *_shown(row)]
        for row in content["policies"]
    ]
    stages = [
        [
            f"{row['preset']}: {STAGES[row['kind']]}",
            *(f"{row[name]:.1%}" for name in ("share", "time_share")),
            *_shown(row, PARTS),
        ]
        for row in content["stages"]
    ]
    return [
        *made,
        Table("One decision of each policy against medium, us", ("", "intervenes", *HEADS), policies),
        Table("Where the time of decisions goes, means in us", ("", "share", "of time", "mean", *PART_HEADS), stages),
    ]


def _part_tables(content: Mapping[str, Any]) -> list[Table]:
    """Return tables of look-ups, solvers and memory."""
    memory, lookups = content["memory"], content["lookups"]
    solvers = [
        [
            *(row["solver"], *_shown(row), number_text(row["ratio"])),
            "-" if row["solved"] is None else f"{row['solved']:.1%}",
            "-" if row["differs"] is None else f"{row['differs']:.0e}",
        ]
        for row in content["solvers"]
    ]
    held = [["games", f"{memory['games_mib']:.1f}"], ["shield of one team", f"{memory['shield_mib']:.1f}"]]
    looked = [[row["what"], number_text(row["us"])] for row in lookups]
    where = f"mean of {lookups[0]['lookups']:,}, anywhere in the table"
    return [
        Table(f"One look-up in a value table, us ({where})", ("", "us"), looked),
        Table("The same programs through other solvers, us", ("", *HEADS, "x daqp", "solved", "differs"), solvers),
        Table(f"Memory of {memory['games']:,} games, MiB", ("", "MiB"), held),
    ]


def _batch_tables(content: Mapping[str, Any]) -> list[Table]:
    """Return tables of batched games: by policy, and by number of games with one and several threads."""
    asked, batch = content["settings"], content["batch"]
    policies, games = [], []
    for bare in _rows(batch, shielded=False):
        fields = {name: bare[name] for name in ("preset", "policy", "games")}
        shielded = _rows(batch, **fields, shielded=True, threads=1)[0]
        rates = [bare["median"], *(shielded[name] for name in ("median", "low", "high"))]
        cost_us = 1e6 / shielded["median"] - 1e6 / bare["median"]
        name = f"{bare['preset']}: {bare['policy']}"
        policies.append([name, *(f"{rate:,.0f}" for rate in rates), number_text(cost_us)])
    for several in (row for row in batch if row["threads"] > 1):
        fields = {name: several[name] for name in ("preset", "policy", "shielded", "games")}
        rates = [_rows(batch, **fields, threads=1)[0]["median"], several["median"]]
        name = f"{several['preset']}: {several['games']:,} games"
        games.append([name, *(f"{rate:,.0f}" for rate in rates), f"{rates[1] / rates[0]:.2f}"])
    heads = ("", "no shield", "shielded", "lowest", "highest", "shield, us a game-step")
    words = f"Game-steps per second, {asked['games']} games at once, one core, one team shielded or none"
    threads = ("", "one thread", f"{asked['threads']} threads", "ratio")
    return [
        Table(words, heads, policies),
        Table("Game-steps per second, medium, one team shielded, its games shared by threads", threads, games),
    ]


def _size_table(content: Mapping[str, Any]) -> Table:
    rows = [
        [
            f"{row['boats']} {row['platform']}s, {row['ours']} ours",
            *_shown(row, ("p50_us", "p99_us", *PARTS[1:], "us_per_own_boat")),
        ]
        for row in content["scaling"]
    ]
    return Table("One decision against the number of boats, us", ("", *HEADS[:2], *PART_HEADS, "per own boat"), rows)
