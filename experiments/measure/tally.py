"""What happened in a game, as numbers, computed from its record alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.env.record import NOT_COVERED, Record, read_meta

from .breaches import PairDistances, count_breaches, team_pairs
from .deadlocks import count_deadlocks
from .reversals import count_reversals, heading_change_deg

RADII_M = (2.5, 4.0)
"""Radii at which breaches are always counted: the shield's default and the `mctf2025` game's own."""


def tally(record: Record, side: int, radii_m: Sequence[float] = RADII_M) -> dict[str, Any]:
    """Count for one team.

    Args:
        record: a game.
        side: the team in question, 0 blue or 1 red.
        radii_m: radii at which to count breaches.

    Returns:
        Flat columns: ``breaches_teammate_2.5m`` and so on, ``closest_*_m`` (None without such a pair),
        ``collisions`` (what the game's score counts), the columns of `shield_columns` and ``deadlocks``.
    """
    meta = read_meta(record)
    distances = PairDistances.of(record["position"])
    own, dt_s = np.asarray(meta["team"]) == side, float(meta["dt_s"])
    return {
        **_breach_columns(distances, meta, side, radii_m),
        "collisions": scored_collisions(_when_looked(record, meta), meta, side),
        **shield_columns(record, own, dt_s),
        "deadlocks": count_deadlocks(record["speed_mps"][1:], record["wanted"][..., 0], own, dt_s),
    }


def scored_collisions(distances: PairDistances, meta: Mapping[str, Any], side: int) -> int:
    """Count collisions as the game does: per entry into the sum of the agent radii, for each boat of the team.

    Two team-mates that collide thus count twice.
    """
    own_radius_m = np.broadcast_to(np.asarray(meta["agent_radius_m"], dtype=np.float64), len(meta["team"]))
    total = 0
    for kind, boats_in_it in (("teammate", 2), ("opponent", 1)):
        pairs = distances.of_pairs(team_pairs(meta["team"], side, kind))
        total += boats_in_it * count_breaches(pairs, own_radius_m[pairs.pairs].sum(axis=1))
    return total


def _when_looked(record: Record, meta: Mapping[str, Any]) -> PairDistances:
    """Distances when the game looks for collisions: after every decision, whose steps of motion are recorded each."""
    return PairDistances.of(record["position"][:: int(meta.get("decision_steps", 1))])


def shield_columns(record: Record, own: NDArray[np.bool_], dt_s: float) -> dict[str, Any]:
    """Describe what the shield did to the boats ``own`` (n,): shares, mean changes, reversals.

    A changed step is one boat's command in one step that was sent otherwise than wanted. Means are over the
    changed steps, None where there are none.
    """
    wanted, sent = record["wanted"][:, own], record["sent"][:, own]
    covered = int((record["reason"][:, own] != NOT_COVERED).sum())
    changed = record["intervened"][:, own]
    turned_deg = np.abs(heading_change_deg(sent[..., 1], wanted[..., 1]))[changed]
    slowed_mps = np.abs(sent[..., 0] - wanted[..., 0])[changed]
    minutes = len(wanted) * own.sum() * dt_s / 60.0
    reversals = count_reversals(sent[..., 1], record["heading_deg"][:-1, own])
    return {
        "covered_steps": covered,
        "changed_steps": int(changed.sum()),
        "changed_share": float(changed.sum() / covered) if covered else None,
        "mean_heading_change_deg": float(turned_deg.mean()) if turned_deg.size else None,
        "mean_speed_change_mps": float(slowed_mps.mean()) if slowed_mps.size else None,
        "reversals_per_boat_minute": float(reversals / minutes) if minutes else None,
    }


def reason_counts(record: Record, side: int) -> dict[str, int]:
    """Count boat-steps per reason name, for the boats of one team that a shield decided for."""
    meta = read_meta(record)
    codes = record["reason"][:, np.asarray(meta["team"]) == side]
    names = meta["reason_names"]
    return {name: int((codes == code).sum()) for code, name in enumerate(names) if code != NOT_COVERED}


def _breach_columns(
    distances: PairDistances, meta: Mapping[str, Any], side: int, radii_m: Sequence[float]
) -> dict[str, Any]:
    columns: dict[str, Any] = {}
    for kind in ("teammate", "opponent"):
        pairs = distances.of_pairs(team_pairs(meta["team"], side, kind))
        for radius_m in radii_m:
            columns[breach_column(kind, radius_m)] = count_breaches(pairs, radius_m)
        closest_m = pairs.closest_m()
        columns[f"closest_{kind}_m"] = closest_m if np.isfinite(closest_m) else None
    found = [columns[f"closest_{kind}_m"] for kind in ("teammate", "opponent")]
    columns["closest_m"] = min((value for value in found if value is not None), default=None)
    return columns


def breach_column(kind: str, radius_m: float) -> str:
    """Name the column of a count: `breaches_opponent_2.5m`."""
    return f"breaches_{kind}_{float(radius_m)}m"
