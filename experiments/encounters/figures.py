"""Every figure of a cell of encounters: the one place where it is named, computed, labelled and documented."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from steerclear.shield.jit import Array, BoolArray

from ..statistics import upper_bound
from .outcomes import SIDES, Columns

QUANTILES = np.linspace(0.0, 1.0, 101)


class Figure(NamedTuple):
    """A figure of a cell, named here and nowhere else.

    Attributes:
        key: in results.
        meaning: what it is, in a sentence without a full stop.
        of: from the columns of the cell's encounters to the figure.
        label: words of the report's table; empty: it is not shown there.
    """

    key: str
    meaning: str
    of: Callable[[Columns], Any]
    label: str = ""


def _breached(c: Columns) -> BoolArray:
    return (c["breaches_teammate"] + c["breaches_opponent"]) > 0


def _open(c: Columns) -> BoolArray:
    """Breached, nothing avoidable found, and not all judged."""
    return np.asarray(_breached(c) & (c["not_judged"] > 0) & ~(c["avoidable"] > 0))


def _settled(c: Columns) -> BoolArray:
    """Breached, all judged, nothing avoidable."""
    return np.asarray(_breached(c) & ~(c["avoidable"] > 0) & ~_open(c))


def _outside(c: Columns) -> BoolArray:
    return np.asarray(c["start_certificate_m"] >= 0.0)


def _count(mask: Array) -> int:
    return int(mask.sum())


def _percent_of(column: str) -> Callable[[Columns], float]:
    return lambda c: 100.0 * float(c[column].mean())


def _mean_change(column: str) -> Callable[[Columns], float | None]:
    """Mean over the changed steps of all encounters; None without any."""

    def mean(c: Columns) -> float | None:
        chosen = c["changed_share"] > 0.0
        return float(np.average(c[column][chosen], weights=c["changed_share"][chosen])) if chosen.any() else None

    return mean


def _ratio(part: str, whole: str, times: float) -> Callable[[Columns], float | None]:
    """Of totals; None of nothing."""
    return lambda c: times * float(c[part].sum() / c[whole].sum()) if c[whole].sum() > 0.0 else None


def _quantiles(column: str) -> Callable[[Columns], list[float]]:
    return lambda c: [float(value) for value in np.quantile(c[column], QUANTILES)]


FIGURES = (
    Figure("encounters", "encounters played", lambda c: len(c["closest_m"]), "n"),
    Figure(
        "breached",
        "encounters in which an own boat came within the radius of any boat",
        lambda c: _count(_breached(c)),
        "breached",
    ),
    Figure(
        "breached_upper",
        "95 % upper limit of the probability of that (Clopper-Pearson, one-sided)",
        lambda c: upper_bound(_count(_breached(c)), len(c["closest_m"])),
    ),
    Figure(
        "unshielded_breached",
        "the same scenes without a guard: how many were breached",
        lambda c: _count(c["unshielded_breaches_teammate"] + c["unshielded_breaches_opponent"] > 0),
    ),
    Figure(
        "avoidable",
        "encounters with a breach that an own boat could have avoided, by the oracle",
        lambda c: _count(c["avoidable"] > 0),
        "avoidable",
    ),
    Figure(
        "avoidable_upper",
        "95 % upper limit of the probability of that; what was not judged counts as avoidable",
        lambda c: upper_bound(_count((c["avoidable"] > 0) | _open(c)), len(c["closest_m"])),
        "≤ at 95 %, %",
    ),
    Figure(
        "unavoidable",
        "encounters with breaches of which none was avoidable",
        lambda c: _count(_settled(c) & (c["unavoidable"] > 0)),
        "unavoidable",
    ),
    Figure(
        "started_inside",
        "encounters whose breaches were under way at the start",
        lambda c: _count(_settled(c) & ~(c["unavoidable"] > 0)),
    ),
    Figure(
        "not_judged",
        "encounters with breaches that the oracle was not asked about, and no avoidable one",
        lambda c: _count(_open(c)),
    ),
    Figure(
        "responsible.*",
        "encounters by whose command let the last chance pass: own, opponent, both, neither, start",
        lambda c: {name: _count(c["responsible"] == k) for k, name in enumerate(SIDES)},
    ),
    Figure(
        "started_outside",
        "encounters in which the shield's certificate at the first decision was at least 0",
        lambda c: _count(_outside(c)),
    ),
    Figure(
        "breaches_outside",
        "of those, how many were breached",
        lambda c: _count(_breached(c) & _outside(c)),
        "breached, started outside",
    ),
    Figure(
        "breaches_outside_upper",
        "95 % upper limit of the probability of that",
        lambda c: upper_bound(_count(_breached(c) & _outside(c)), _count(_outside(c))),
    ),
    Figure(
        "breaches_teammate",
        "entries of two own boats into the radius, all encounters",
        lambda c: _count(c["breaches_teammate"]),
    ),
    Figure(
        "breaches_opponent",
        "entries of an own boat and another, all encounters",
        lambda c: _count(c["breaches_opponent"]),
    ),
    Figure("closest_m", "least distance of all encounters, m", lambda c: float(c["closest_m"].min()), "closest, m"),
    Figure(
        "closest_quantiles_m[]",
        "quantiles 0, 0.01, ..., 1 of the closest distance of an encounter, m",
        _quantiles("closest_m"),
    ),
    Figure("unshielded_closest_quantiles_m[]", "the same without a guard, m", _quantiles("unshielded_closest_m")),
    Figure(
        "changed_percent",
        "share of the own boats' steps whose command was changed, %",
        _percent_of("changed_share"),
        "changed, %",
    ),
    Figure(
        "inactive_percent",
        "of sampled states that are safe by the value tables, how many commands pass, %",
        _ratio("left_alone", "sampled_safe", 100.0),
        "left alone when safe, %",
    ),
    Figure(
        "heading_change_deg",
        "mean change of the commanded heading over changed steps, deg",
        _mean_change("heading_change_deg"),
        "changed by, deg",
    ),
    Figure(
        "speed_change_mps",
        "mean change of the commanded speed over changed steps, m/s",
        _mean_change("speed_change_mps"),
        "changed by, m/s",
    ),
    Figure(
        "goal_time_ratio",
        "time to the first goal over that without a guard; never there counts as the whole length",
        _ratio("goal_s", "unshielded_goal_s", 1.0),
        "time to goal, ×",
    ),
    Figure("reached_percent", "own boats that reached their first goal, %", _percent_of("reached"), "goal reached, %"),
    Figure(
        "never_arrived_percent",
        "own boats that had not reached their first goal by the end but do without a guard, %",
        _percent_of("never_arrived"),
        "never arrived, %",
    ),
    Figure(
        "deadlocked",
        "encounters in which two team-mates that want to move stood still for over 10 s",
        lambda c: _count(c["deadlocks"] > 0),
        "deadlocked",
    ),
    Figure(
        "reversals_per_min",
        "flips of the commanded side per own boat and minute",
        lambda c: float(c["reversals_per_min"].mean()),
        "reversals/min",
    ),
    Figure(
        "unshielded_reversals_per_min",
        "the same without a guard",
        lambda c: float(c["unshielded_reversals_per_min"].mean()),
    ),
    Figure("outside_m", "how far an own boat left the field at most, m", lambda c: float(c["outside_m"].max())),
    Figure(
        "decision_us",
        "median time of a decision per game and step, in batches, us",
        lambda c: float(np.median(c["decision_us"])),
        "decision, µs",
    ),
    Figure(
        "decision_p999_us",
        "99.9th percentile of the same, worst chunk, us",
        lambda c: float(c["decision_p999_us"].max()),
    ),
)


def summarise(columns: Columns) -> dict[str, Any]:
    """Figures over encounters, JSON-ready."""
    return {one.key.removesuffix("[]").removesuffix(".*"): one.of(columns) for one in FIGURES}


WORST = {
    "guard": ("guard", "guard"),
    "own": ("own", "platform of the own boats"),
    "other": ("other", "platform of the others"),
    "family": ("family", "family"),
    "number": ("number", "number of the encounter: with family, platforms and seed it gives the scene"),
    "variant": ("variant", "which of its variants (sudden turns) was the worst"),
    "closest_m": ("closest, m", "closest distance, m"),
    "breaches": ("breaches", "entries into the radius"),
    "avoidable": ("avoidable", "of those judged, how many were avoidable"),
    "last_preventable_s": (
        "until, s before",
        "how long before the breach an own boat could still avoid it, s; null when never",
    ),
    "responsible": ("last chance let pass by", "whose command let the last chance pass; null when not judged"),
    "start_certificate_m": (
        "certificate at the start, m",
        "the shield's certificate at the first decision, m; null when nobody was near",
    ),
}
"""Words of the report's table, and meaning, of every key of the worst encounters."""
KEYS = {
    "complete": "false when interrupted or something could not be played",
    "encounters_played": "encounters in the results, over all cells",
    "encounters_resumed": "of those, how many an earlier run had played",
    "failed[].*": "cell, first encounter and error of a chunk that could not be played",
    "cells[].guard": "what stood between policy and boats",
    "cells[].own": "platform of the own boats",
    "cells[].other": "platform of the others",
    "cells[].family": "kind of encounter",
    **{f"cells[].{one.key}": one.meaning for one in FIGURES},
    **{f"worst[].{name}": meaning for name, (_, meaning) in WORST.items()},
    "files.*": "what was written, relative to the folder",
}
"""Keys of the JSON that ``steerclear encounters`` writes, with meaning and unit."""
