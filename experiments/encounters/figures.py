"""Every figure of a cell of encounters: named, computed, labelled and documented here; and `measure`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import BoolArray
from steerclear.shield.renamed import Renamed, takes_old_keywords

from ..baselines.own_filters import check_maker
from ..baselines.registry import SHIELD, FilterMaker
from ..statistics import upper_bound
from .outcomes import SIDES, Columns, chunk_size, measure_chunk
from .scenarios import check_whole, draw
from .scene import Conditions

QUANTILES = np.linspace(0.0, 1.0, 101)


class Marks:
    """What is true of each of a cell's encounters, (n,) bool."""

    def __init__(self, c: Columns) -> None:
        self.any = np.ones(len(c["closest_m"]), np.bool_)
        self.violated = (c["violations_teammate"] + c["violations_opponent"]) > 0
        self.bare_violated = (c["unshielded_violations_teammate"] + c["unshielded_violations_opponent"]) > 0
        self.avoidable = c["avoidable"] > 0
        self.not_judged = self.violated & (c["not_judged"] > 0) & ~self.avoidable
        settled = self.violated & ~self.avoidable & ~self.not_judged
        self.unavoidable, self.inside = settled & (c["unavoidable"] > 0), settled & ~(c["unavoidable"] > 0)
        self.outside = c["start_safety_margin_m"] >= 0.0
        self.deadlocked = c["deadlocks"] > 0


def _upper(events: BoolArray, of: BoolArray) -> float:
    return upper_bound(int(events.sum()), int(of.sum()))


def _ratio(part: Any, whole: Any, times: float = 1.0) -> float | None:
    """Of totals; None of nothing."""
    return times * float(part.sum() / whole.sum()) if whole.sum() > 0.0 else None


def _mean_change(c: Columns, column: str) -> float | None:
    """Mean over the changed steps of all encounters; None without any."""
    some = c["changed_share"] > 0.0
    return float(np.average(c[column][some], weights=c["changed_share"][some])) if some.any() else None


class Figure(NamedTuple):
    """A figure: label in the report's table (empty: not shown there), from marks and columns to it, and meaning."""

    label: str
    of: Callable[[Marks, Columns], Any]
    meaning: str


_UPPER = "95 % upper limit of the probability of that"
_CLOSEST = "quantiles 0, 0.01, ..., 1 of the closest distance of an encounter, m"
_AVOIDABLE = "encounters with a violation that an own boat could have avoided, by the post-hoc analysis"
_UNJUDGED = "encounters with violations that the analysis was not asked about, and no avoidable one"
_WHO = "encounters by whose command let the last chance pass: own, opponent, both, neither, start"
_OUTSIDE = "encounters in which the shield's safety margin at the first decision was at least 0"
_SAFE = "of sampled states that are safe by the value tables, how many commands pass, %"
_TIME = "time to the first goal over that without a filter; never there counts as the whole length"
_NEVER = "own boats that had not reached their first goal by the end but do without a filter, %"
_DEAD = "encounters in which two teammates that want to move stood still for over 10 s"
_VIOLATED = "encounters in which an own boat came within the separation of any boat"
_SETTLED = "encounters with violations of which none was avoidable"
_CAUTIOUS = f"{_UPPER}; what was not judged counts as avoidable"
_CHANGED = "share of the own boats' steps whose command was changed, %"
_TURN = "mean change of the commanded heading over changed steps, deg"
_SPEED = "mean change of the commanded speed over changed steps, m/s"
_FLIPS = "flips of the commanded side per own boat and minute"
_LEFT = "how far an own boat left the field at most, m"
_DECISION = "median time of a decision per game and step, in batches, us"
FIGURES = {
    "encounters": Figure("n", lambda m, c: m.any.sum(), "encounters played"),
    "violated": Figure("with violations", lambda m, c: m.violated.sum(), _VIOLATED),
    "violated_upper": Figure("", lambda m, c: _upper(m.violated, m.any), f"{_UPPER} (Clopper-Pearson, one-sided)"),
    "unshielded_violated": Figure("", lambda m, c: m.bare_violated.sum(), "the same scenes without a filter"),
    "avoidable": Figure("avoidable", lambda m, c: m.avoidable.sum(), _AVOIDABLE),
    "avoidable_upper": Figure("≤ at 95 %, %", lambda m, c: _upper(m.avoidable | m.not_judged, m.any), _CAUTIOUS),
    "unavoidable": Figure("unavoidable", lambda m, c: m.unavoidable.sum(), _SETTLED),
    "started_inside": Figure(
        "", lambda m, c: m.inside.sum(), "encounters whose violations were under way at the start"
    ),
    "not_judged": Figure("", lambda m, c: m.not_judged.sum(), _UNJUDGED),
    "responsible": Figure("", lambda m, c: {s: int((c["responsible"] == k).sum()) for k, s in enumerate(SIDES)}, _WHO),
    "started_outside": Figure("", lambda m, c: m.outside.sum(), _OUTSIDE),
    "violations_outside": Figure(
        "with violations, started outside the unavoidable set",
        lambda m, c: (m.violated & m.outside).sum(),
        "of those, how many had violations",
    ),
    "violations_outside_upper": Figure("", lambda m, c: _upper(m.violated & m.outside, m.outside), _UPPER),
    "violations_teammate": Figure("", lambda m, c: int(c["violations_teammate"].sum()), "entries of two own boats"),
    "violations_opponent": Figure("", lambda m, c: int(c["violations_opponent"].sum()), "of an own boat and another"),
    "closest_m": Figure("closest, m", lambda m, c: c["closest_m"].min(), "least distance of all encounters, m"),
    "closest_quantiles_m": Figure("", lambda m, c: np.quantile(c["closest_m"], QUANTILES), _CLOSEST),
    "unshielded_closest_quantiles_m": Figure(
        "", lambda m, c: np.quantile(c["unshielded_closest_m"], QUANTILES), "the same without a filter, m"
    ),
    "changed_percent": Figure("changed, %", lambda m, c: 100.0 * float(c["changed_share"].mean()), _CHANGED),
    "inactive_percent": Figure(
        "left alone when safe, %", lambda m, c: _ratio(c["left_alone"], c["sampled_safe"], 100.0), _SAFE
    ),
    "heading_change_deg": Figure("changed by, deg", lambda m, c: _mean_change(c, "heading_change_deg"), _TURN),
    "speed_change_mps": Figure("changed by, m/s", lambda m, c: _mean_change(c, "speed_change_mps"), _SPEED),
    "goal_time_ratio": Figure("time to goal, ×", lambda m, c: _ratio(c["goal_s"], c["unshielded_goal_s"]), _TIME),
    "reached_percent": Figure(
        "goal reached, %", lambda m, c: 100.0 * float(c["reached"].mean()), "own boats that reached their first goal, %"
    ),
    "never_arrived_percent": Figure("never arrived, %", lambda m, c: 100.0 * float(c["never_arrived"].mean()), _NEVER),
    "deadlocked": Figure("deadlocked", lambda m, c: m.deadlocked.sum(), _DEAD),
    "reversals_per_min": Figure("reversals/min", lambda m, c: c["reversals_per_min"].mean(), _FLIPS),
    "unshielded_reversals_per_min": Figure(
        "", lambda m, c: c["unshielded_reversals_per_min"].mean(), "the same without a filter"
    ),
    "outside_m": Figure("", lambda m, c: c["outside_m"].max(), _LEFT),
    "decision_us": Figure("decision, µs", lambda m, c: np.median(c["decision_us"]), _DECISION),
    "decision_p999_us": Figure(
        "", lambda m, c: c["decision_p999_us"].max(), "99.9th percentile of the same, worst chunk, us"
    ),
}


def summarise(columns: Columns) -> dict[str, Any]:
    """`FIGURES` over encounters, JSON-ready."""
    marks = Marks(columns)
    found = {key: one.of(marks, columns) for key, one in FIGURES.items()}
    return {key: value.tolist() if hasattr(value, "tolist") else value for key, value in found.items()}


@dataclass(frozen=True)
class Outcome:
    """What came of n encounters.

    Attributes:
        columns: arrays (n,) by name: see `outcomes.measure_chunk`.
        summary: `FIGURES` over all of them.
    """

    columns: Columns
    summary: dict[str, Any]


@takes_old_keywords({"guard": "safety_filter"})
def measure(
    family: str,
    safety_filter: str | FilterMaker = SHIELD,
    own: str = "heron",
    other: str = "heron",
    n: int = 200,
    seed: int = 0,
    conditions: Conditions | None = None,
    judge: bool = True,
    first: int = 0,
) -> Outcome:
    """Play encounters in this process.

    Args:
        family: name of the family.
        safety_filter: name of a safety filter (see `baselines.registry`) or what makes one from (config, games,
            platforms, team, surroundings).
        own: platform of the own boats.
        other: platform of the others.
        n: how many encounters.
        seed: of the scenes.
        conditions: radius, delay, noise, current.
        judge: ask the post-hoc analysis (seconds per violation); without, they count as not judged.
        first: number of the first encounter.

    Raises:
        SteerclearError: bad input.
    """
    check_whole("the number of encounters", n)
    if n < 1:
        raise ConfigError(f"the number of encounters is {n}; ask for at least 1")
    check_maker(safety_filter)
    asked = conditions or Conditions()
    size = chunk_size(family, own, other, asked, seed, first)
    parts = [
        measure_chunk(draw(family, own, other, asked, seed, k, min(size, first + n - k)), safety_filter, asked, judge)
        for k in range(first, first + n, size)
    ]
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return Outcome(Renamed(columns), Renamed(summarise(columns)))


WORST = {
    "filter": ("filter", "safety filter"),
    "own": ("own", "platform of the own boats"),
    "other": ("other", "platform of the others"),
    "family": ("family", "family"),
    "number": ("number", "number of the encounter: with family, platforms and seed it gives the scene"),
    "variant": ("variant", "which of its variants (sudden turns) was the worst"),
    "closest_m": ("closest, m", "closest distance, m"),
    "violations": ("violations", "entries into the separation"),
    "avoidable": ("avoidable", "of those judged, how many were avoidable"),
    "last_preventable_s": ("until, s before", "how long before it an own boat could still avoid it, s; null: never"),
    "responsible": ("last chance let pass by", "whose command let the last chance pass; null when not judged"),
    "start_safety_margin_m": (
        "safety margin at the start, m",
        "the shield's at the first decision, m; null: nobody near",
    ),
}
"""Words of the report's table, and meaning, of every key of the worst encounters."""
_NESTED = {"responsible": ".*", "closest_quantiles_m": "[]", "unshielded_closest_quantiles_m": "[]"}
KEYS = {
    "complete": "false when interrupted or something could not be played",
    "encounters_played": "encounters in the results, over all cells",
    "encounters_resumed": "of those, how many an earlier run had played",
    "failed[].*": "cell, first encounter and error of a chunk that could not be played",
    "cells[].filter": "safety filter between policy and boats",
    "cells[].own": "platform of the own boats",
    "cells[].other": "platform of the others",
    "cells[].family": "kind of encounter",
    **{f"cells[].{key}{_NESTED.get(key, '')}": one.meaning for key, one in FIGURES.items()},
    **{f"worst[].{name}": meaning for name, (_, meaning) in WORST.items()},
    "files.*": "what was written, relative to the folder",
}
"""Keys of the JSON that ``steerclear encounters`` writes, with meaning and unit."""
