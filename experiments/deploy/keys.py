"""Figures of a run: their keys in JSON, meanings, and how the terminal shows them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple


class Figure(NamedTuple):
    """One figure of a run."""

    key: str  # in results
    meaning: str  # with its unit, without a full stop
    label: str = ""  # text in the terminal's table; empty: not shown there
    factor: float = 1.0  # to the shown unit
    unit: str = ""  # the shown unit
    digits: int = 0  # digits shown


FIGURES = (
    Figure("ticks", "turns of the loop", "turns"),
    Figure("decided", "of those, with a decision"),
    Figure(
        "changed_share",
        "share of own boats' commands that the shield changed, 0 to 1",
        *("commands changed by the shield", 100.0, "%", 1),
    ),
    Figure("best_effort_commands", "own boats' commands for which no manoeuvre kept the required distance"),
    Figure(
        "ticks_with_actions",
        "turns in which a declared response, an override or STOP ALL did something",
        "turns with a declared response",
    ),
    Figure(
        "closest_m",
        "closest approach of an own boat to any other, as believed, m",
        *("closest approach of our boats, as believed", 1.0, "m", 2),
    ),
    Figure("least_safety_margin_m", "smallest safety margin of an own boat, m"),
    Figure("missed_turns", "turns skipped because the loop was late", "turns skipped"),
    Figure("jitter_p50_s", "turns begun after they were due, median, s"),
    Figure("jitter_p999_s", "the same, 999 of 1000, s", "turn began late, 999 of 1000 within", 1000.0, "ms", 1),
    Figure("jitter_max_s", "the same, the worst, s"),
    Figure("read_to_sent_p50_s", "from reading telemetry to the last command sent, median, s"),
    Figure(
        "read_to_sent_p99_s",
        "the same, 99 of 100, s",
        *("telemetry read to command sent, 99 of 100 within", 1000.0, "ms", 1),
    ),
    Figure("read_to_sent_max_s", "the same, the worst, s"),
    Figure("decide_p99_s", "the shield's decision alone, 99 of 100, s"),
)
"""Figures of a run, in the order of the table."""


def figure_rows(figures: Mapping[str, float]) -> list[tuple[str, str]]:
    """Return the rows of the terminal's table: label and value; inf: nobody else was there."""
    rows = [(one, figures[one.key]) for one in FIGURES if one.label]
    return [
        (one.label, "no other boat" if math.isinf(value) else f"{one.factor * value:.{one.digits}f} {one.unit}".strip())
        for one, value in rows
    ]
