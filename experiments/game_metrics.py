"""What happened in a game, as numbers, computed from its record alone.

A separation violation is a pair of boats whose centres come within a radius of each other. It is counted
once per entry, per pair: the pair is inside after this step and was not after the one before. The start position itself
is not counted, so a pair that starts inside counts at the first step, as in the reference simulator. Distances are
sampled once per step (0.1 s).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from steerclear.env.record import NOT_COVERED, Record, find_violations, read_meta
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray, kernel

from .metrics import RADII_M, game_metrics_of, violation_column

KINDS = {"teammate": 2, "opponent": 1}
"""Kinds of pairs of a team, by how many of the two boats are its own."""


@dataclass(frozen=True)
class PairDistances:
    """Distances of every pair of boats after every step.

    Attributes:
        pairs: (p, 2) int64, the two boats, smaller index first.
        distance_m: (T, p), after steps 1..T.
    """

    pairs: NDArray[np.int64]
    distance_m: NDArray[np.float64]

    @classmethod
    def of(cls, position: ArrayLike) -> PairDistances:
        """Measure a track (T+1, n, 2) m, index 0 the start; ConfigError of another shape, or where it is not finite."""
        track = np.asarray(position, dtype=np.float64)
        if track.ndim != 3 or track.shape[2] != 2 or track.shape[0] < 1:
            raise ConfigError(f"a track has shape (steps + 1, boats, 2); got {track.shape}")
        if not np.isfinite(track).all():
            raise ConfigError("a track holds positions that are not finite; check the recorder or the file")
        first, second = np.triu_indices(track.shape[1], k=1)
        gap = track[1:, first] - track[1:, second]
        return cls(np.column_stack([first, second]).astype(np.int64), np.hypot(gap[..., 0], gap[..., 1]))

    def of_pairs(self, chosen: NDArray[np.bool_]) -> PairDistances:
        """Keep the pairs where ``chosen`` (p,) is true."""
        return PairDistances(self.pairs[chosen], self.distance_m[:, chosen])

    def closest_m(self) -> float:
        """Return the smallest distance, m; infinity where there is no pair or no step."""
        return float(self.distance_m.min(initial=np.inf))


STILL_MPS = 0.2
"""A boat slower than this stands still; one that is asked for more wants to move."""
DEADLOCK_S = 10.0
"""Two teammates that stand still for longer than this, both wanting to move, are deadlocked."""


@kernel
def deadlocks(speed_mps: Array, nominal_mps: Array, own: BoolArray, longest: int, out: Array) -> None:
    """Count pairs of own boats that both want to move and both stay below `STILL_MPS` for over ``longest`` steps.

    A pair counts once for every time that begins.

    Args:
        speed_mps: (T, B, n) speed after each step of B games.
        nominal_mps: (T, B, n) nominal speed in it, before a shield.
        own: (n,).
        longest: steps that are still no deadlock.
        out: (B,) written.
    """
    n = speed_mps.shape[2]
    for b in range(speed_mps.shape[1]):
        out[b] = 0.0
        still = np.zeros((n, n), np.int64)
        for t in range(speed_mps.shape[0]):
            for i in range(n):
                if not own[i]:
                    continue
                stuck = speed_mps[t, b, i] < STILL_MPS and nominal_mps[t, b, i] > STILL_MPS
                for j in range(i):
                    if not own[j]:
                        continue
                    if stuck and speed_mps[t, b, j] < STILL_MPS and nominal_mps[t, b, j] > STILL_MPS:
                        still[i, j] += 1
                        if still[i, j] == longest + 1:
                            out[b] += 1.0
                    else:
                        still[i, j] = 0


def count_deadlocks(speed_mps: Array, nominal_mps: Array, own: BoolArray, dt_s: float) -> int:
    """Count the deadlocks of one game's own boats (n,), from speeds after each step and nominal speeds in it (T, n)."""
    speed, nominal = (np.ascontiguousarray(one[:, None], dtype=np.float64) for one in (speed_mps, nominal_mps))
    found = np.empty(1)
    deadlocks(speed, nominal, np.ascontiguousarray(own), round(DEADLOCK_S / dt_s), found)
    return int(found[0])


DEAD_BAND_DEG = 5.0
"""Turns smaller than this are steady steering, not a side."""


def heading_change_deg(later: ArrayLike, earlier: ArrayLike) -> NDArray[np.float64]:
    """Return ``later - earlier`` in [-180, 180), deg."""
    difference = np.asarray(later, dtype=np.float64) - np.asarray(earlier, dtype=np.float64)
    return np.asarray((difference + 180.0) % 360.0 - 180.0)


def count_reversals(command_heading_deg: ArrayLike, heading_deg: ArrayLike) -> int:
    """Count the flips of the commanded side of all boats.

    A boat's commanded side is the sign of (command - heading) where that exceeds `DEAD_BAND_DEG`; between,
    the last side stays. A reversal is a change of that side.

    Args:
        command_heading_deg: (T, n) absolute heading asked of each boat.
        heading_deg: (T, n) heading each boat has at that moment.
    """
    turn = heading_change_deg(command_heading_deg, heading_deg)
    side = np.where(np.abs(turn) > DEAD_BAND_DEG, np.sign(turn), 0.0)
    total = 0
    for column in side.T:
        taken = column[column != 0.0]
        total += int(np.count_nonzero(taken[1:] != taken[:-1]))
    return total


DEFAULT_PENALTY = 0.25
"""Weight of a collision: fits the competition's published results; its rules say 0.025. Always a setting."""


def check_penalty(penalty: float) -> float:
    """Return the weight of a collision; ConfigError where it is negative or not a finite number."""
    if not 0.0 <= penalty < float("inf"):
        raise ConfigError(f"--penalty must be a number >= 0; got {penalty}; the competition used 0.25 and 0.025")
    return penalty


def scores(counts: Mapping[str, Any], penalty: float = DEFAULT_PENALTY) -> dict[str, float]:
    """Score one team by the competition's two scores, from its counts and those (``_against``) of the other."""
    return {
        "net_captures": counts["captures"] - counts["captures_against"],
        "primary": counts["captures"] - counts["captures_against"] - penalty * counts["collisions"],
        "secondary": float(counts["grabs"] + counts["tags"] - counts["grabs_against"] - counts["tags_against"]),
    }


def tally(
    record: Record, side: int, radii_m: Sequence[float] = RADII_M, driven: NDArray[np.bool_] | None = None
) -> dict[str, Any]:
    """Count for one team, 0 blue or 1 red; ``driven`` (T, n): boats that the game drove, which obey no policy.

    Returns:
        Flat columns: ``violations_teammate_2.5m`` and so on at each radius, of them those of an own boat that was
        driven, ``violations_driven_2.5m``, ``violations_driven_teammate_2.5m``; ``closest_*_m`` (None without such a
        pair), ``clean_games`` (none at the smallest radius), ``collisions`` (what the game's score counts), the columns
        of `shield_columns`, ``deadlocks`` and what metrics measure by themselves.
    """
    meta, position = read_meta(record), record["position"]
    team, dt_s = np.asarray(meta["team"]), float(meta["dt_s"])
    own, distances = team == side, PairDistances.of(position)
    ours = own[distances.pairs].sum(axis=1)
    closest = {kind: distances.of_pairs(ours == boats).closest_m() for kind, boats in KINDS.items()}
    closest_m = {f"closest_{kind}_m": value if np.isfinite(value) else None for kind, value in closest.items()}
    columns: dict[str, Any] = {}
    for radius_m in radii_m:
        rows = find_violations(position, radius_m)[:, :3].astype(np.int64)
        boats, in_it = rows[:, 1:], own[rows[:, 1:]]
        hit = None if driven is None else (in_it & driven[rows[:, :1] - 1, boats]).any(axis=1)
        for kind, count in KINDS.items():
            of_kind = in_it.sum(axis=1) == count
            columns[violation_column(kind, radius_m)] = int(of_kind.sum())
            if hit is not None:
                columns[violation_column(f"driven_{kind}", radius_m)] = int((hit & of_kind).sum())
        if hit is not None:
            columns[violation_column("driven", radius_m)] = int(hit.sum())
    return {
        **columns,
        **closest_m,
        "closest_m": min((value for value in closest_m.values() if value is not None), default=None),
        "clean_games": not any(columns[violation_column(kind, min(radii_m))] for kind in KINDS),
        "collisions": scored_collisions(record, meta, side),
        **shield_columns(record, own, dt_s),
        "deadlocks": count_deadlocks(record["speed_mps"][1:], record["nominal"][..., 0], own, dt_s),
        **{one.column: one.measure(record, side) for one in game_metrics_of(radii_m) if one.measure is not None},
    }


def scored_collisions(record: Record, meta: Mapping[str, Any], side: int) -> int:
    """Count collisions as the game does: per entry into the sum of the agent radii, for each boat of the team in it."""
    # it looks for them after every decision, whose steps of motion are recorded each
    position, own = record["position"][:: int(meta.get("decision_steps", 1))], np.asarray(meta["team"]) == side
    radius_m, total = np.broadcast_to(np.asarray(meta["agent_radius_m"], dtype=np.float64), len(own)), 0
    for apart_m in np.unique(radius_m[:, None] + radius_m):
        boats = find_violations(position, apart_m)[:, 1:3].astype(np.int64)
        total += int(own[boats[radius_m[boats].sum(axis=1) == apart_m]].sum())
    return total


def shield_columns(record: Record, own: NDArray[np.bool_], dt_s: float) -> dict[str, Any]:
    """Describe what the shield did to the boats ``own`` (n,): shares, mean changes, reversals.

    A changed step is one boat's in which its filtered command differs from the nominal one. Means are over the changed
    steps, None where there are none.
    """
    nominal, filtered = record["nominal"][:, own], record["filtered"][:, own]
    covered = int((record["reason"][:, own] != NOT_COVERED).sum())
    changed = record["intervened"][:, own]
    turned_deg = np.abs(heading_change_deg(filtered[..., 1], nominal[..., 1]))[changed]
    slowed_mps = np.abs(filtered[..., 0] - nominal[..., 0])[changed]
    minutes = len(nominal) * own.sum() * dt_s / 60.0
    reversals = count_reversals(filtered[..., 1], record["heading_deg"][:-1, own])
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
