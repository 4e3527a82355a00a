"""From the columns of many encounters to the figures of a cell."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..statistics import upper_bound
from .tally import Columns
from .verdicts import SIDES

QUANTILES = np.linspace(0.0, 1.0, 101)


def summarise(columns: Columns) -> dict[str, Any]:
    """Figures over encounters.

    Returns:
        JSON-ready; `keys.CELL_KEYS` describes them.
    """
    return {
        "encounters": len(columns["closest_m"]),
        **_breach_figures(columns),
        **_distance_figures(columns),
        **_change_figures(columns),
        **_course_figures(columns),
        "decision_us": float(np.median(columns["decision_us"])),
        "decision_p999_us": float(columns["decision_p999_us"].max()),
    }


def _breach_figures(columns: Columns) -> dict[str, Any]:
    """How many encounters were breached, what the oracle says of them, and how many of these started outside."""
    n = len(columns["closest_m"])
    breached = (columns["breaches_teammate"] + columns["breaches_opponent"]) > 0
    bare = columns["unshielded_breaches_teammate"] + columns["unshielded_breaches_opponent"] > 0
    avoidable, unjudged = columns["avoidable"] > 0, breached & (columns["not_judged"] > 0)
    open_, outside = unjudged & ~avoidable, columns["start_certificate_m"] >= 0.0
    settled = breached & ~avoidable & ~open_
    unavoidable = settled & (columns["unavoidable"] > 0)
    return {
        "breached": int(breached.sum()),
        "breached_upper": upper_bound(int(breached.sum()), n),
        "unshielded_breached": int(bare.sum()),
        "avoidable": int(avoidable.sum()),
        "avoidable_upper": upper_bound(int((avoidable | open_).sum()), n),
        "unavoidable": int(unavoidable.sum()),
        "started_inside": int((settled & ~unavoidable).sum()),
        "not_judged": int(open_.sum()),
        "responsible": {name: int((columns["responsible"] == k).sum()) for k, name in enumerate(SIDES)},
        "started_outside": int(outside.sum()),
        "breaches_outside": int((breached & outside).sum()),
        "breaches_outside_upper": upper_bound(int((breached & outside).sum()), int(outside.sum())),
        "breaches_teammate": int(columns["breaches_teammate"].sum()),
        "breaches_opponent": int(columns["breaches_opponent"].sum()),
    }


def _distance_figures(columns: Columns) -> dict[str, Any]:
    return {
        "closest_m": float(columns["closest_m"].min()),
        "closest_quantiles_m": np.quantile(columns["closest_m"], QUANTILES).tolist(),
        "unshielded_closest_quantiles_m": np.quantile(columns["unshielded_closest_m"], QUANTILES).tolist(),
    }


def _change_figures(columns: Columns) -> dict[str, Any]:
    return {
        "changed_percent": 100.0 * float(columns["changed_share"].mean()),
        "inactive_percent": _share_percent(columns["left_alone"], columns["sampled_safe"]),
        "heading_change_deg": _mean(columns["heading_change_deg"], columns["changed_share"]),
        "speed_change_mps": _mean(columns["speed_change_mps"], columns["changed_share"]),
    }


def _course_figures(columns: Columns) -> dict[str, Any]:
    """What became of the way to the goal: time, arrival, deadlock, reversals, leaving the field."""
    goal, bare = columns["goal_s"].sum(), columns["unshielded_goal_s"].sum()
    return {
        "goal_time_ratio": float(goal / bare) if bare > 0 else None,
        "reached_percent": 100.0 * float(columns["reached"].mean()),
        "never_arrived_percent": 100.0 * float(columns["never_arrived"].mean()),
        "deadlocked": int((columns["deadlocks"] > 0).sum()),
        "reversals_per_min": float(columns["reversals_per_min"].mean()),
        "unshielded_reversals_per_min": float(columns["unshielded_reversals_per_min"].mean()),
        "outside_m": float(columns["outside_m"].max()),
    }


def _share_percent(part: np.ndarray, whole: np.ndarray) -> float | None:
    """Percentage over all encounters; None of nothing."""
    return 100.0 * float(part.sum() / whole.sum()) if whole.sum() > 0.0 else None


def _mean(values: np.ndarray, weights: np.ndarray) -> float | None:
    """Mean over the changed steps of all encounters; None without any."""
    chosen = weights > 0.0
    return float(np.average(values[chosen], weights=weights[chosen])) if chosen.any() else None
