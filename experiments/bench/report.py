"""The benchmark's figures as tables, for the terminal and the documentation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..tables import number_text


@dataclass(frozen=True)
class BenchTable:
    """A title, the heads of its columns and its rows, all text."""

    title: str
    heads: tuple[str, ...]
    rows: list[list[str]]


def bench_tables(content: Mapping[str, Any]) -> list[BenchTable]:
    """Lay out what `run.run_bench` measured."""
    decisions = [
        _decide(content, "decide", "3 boats and 3 opponents"),
        _decide(content, "decide_by_table", "with value tables (surveyors)"),
    ]
    return [*decisions, _lookups(content), _solvers(content), _batch(content), _memory(content), _scaling(content)]


def _decide(content: Mapping[str, Any], key: str, about: str) -> BenchTable:
    decide = content[key]
    share = decide["share_intervening"]
    names = {"all": "all", "passes": f"passes ({1 - share:.1%})", "intervenes": f"intervenes ({share:.1%})"}
    rows = [[words, *_quantiles(decide[name])] for name, words in names.items()]
    times = f"each timed {content['settings']['repeats']} times"
    title = f"One decision, {about}, us ({decide['decisions']:,} of real games, {times})"
    return BenchTable(title, ("", "p50", "p99", "p99.9"), rows)


def _lookups(content: Mapping[str, Any]) -> BenchTable:
    rows = [[row["what"], number_text(row["us"])] for row in content["lookups"]]
    title = f"One look-up in a value table, us (mean of {content['lookups'][0]['lookups']:,}, anywhere in the table)"
    return BenchTable(title, ("", "us"), rows)


def _solvers(content: Mapping[str, Any]) -> BenchTable:
    rows = [
        [
            row["solver"],
            *_quantiles(row),
            number_text(row["ratio"]),
            "-" if row["solved"] is None else f"{row['solved']:.1%}",
            "-" if row["differs"] is None else f"{row['differs']:.0e}",
        ]
        for row in content["solvers"]
    ]
    heads = ("", "p50", "p99", "p99.9", "x daqp", "solved", "differs")
    return BenchTable("The same programs through other solvers, us", heads, rows)


def _batch(content: Mapping[str, Any]) -> BenchTable:
    rows = [
        [
            f"{row['policy']}, {'one team shielded' if row['shielded'] else 'no shield'}",
            *(f"{row[name]:,.0f}" for name in ("median", "low", "high")),
        ]
        for row in content["batch"]
    ]
    title = f"Game-steps per second, {content['batch'][0]['games']} games at once, one core"
    return BenchTable(title, ("", "median", "lowest", "highest"), rows)


def _memory(content: Mapping[str, Any]) -> BenchTable:
    memory = content["memory"]
    rows = [["games", f"{memory['games_mib']:.1f}"], ["shield of one team", f"{memory['shield_mib']:.1f}"]]
    return BenchTable(f"Memory of {memory['games']:,} games, MiB", ("", "MiB"), rows)


def _scaling(content: Mapping[str, Any]) -> BenchTable:
    rows = [
        [f"{row['boats']} boats, {row['ours']} ours", *_quantiles(row)[:2], number_text(row["us_per_own_boat"])]
        for row in content["scaling"]
    ]
    return BenchTable("One decision against the number of boats, us", ("", "p50", "p99", "per own boat"), rows)


def _quantiles(row: Mapping[str, Any]) -> Sequence[str]:
    return [number_text(row[name]) for name in ("p50_us", "p99_us", "p99_9_us")]
