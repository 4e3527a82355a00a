"""What a shield remembers of boats when others come into view or go: every boat keeps what is its own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..fleet import Fleet
from ..jit import Array, BoolArray, IntArray
from ..memory import Memory
from ..platforms import Platform
from ..scene import Boats, Tuning

_OF_OTHERS = ("threat_m", "blocked_by")
"""What is remembered of a boat and others; the rest is of it alone."""


class Known(NamedTuple):
    """Who the boats of the last decision were; two fleets that agree in this share their memory."""

    platforms: tuple[str | Platform, ...]
    names: tuple[str, ...]
    team: bytes

    @classmethod
    def of(cls, fleet: Fleet) -> Known:
        """The boats of a fleet."""
        return cls(fleet.platforms, fleet.names, fleet.team.tobytes())


class Stayed(NamedTuple):
    """Boats of a fleet that were there at the last decision: their places now and then, each (k,)."""

    now: IntArray
    then: IntArray

    @classmethod
    def between(cls, before: Known | None, fleet: Fleet) -> Stayed:
        """Boats of the same name, platform and team; none where names do not tell boats apart."""
        found: list[tuple[int, int]] = []
        if before is not None and len({*before.names}) == len(before.names) and len({*fleet.names}) == len(fleet):
            team = np.frombuffer(before.team, dtype=fleet.team.dtype)
            place = {name: k for k, name in enumerate(before.names)}
            for i, name in enumerate(fleet.names):
                k = place.get(name)
                if k is not None and before.platforms[k] == fleet.platforms[i] and team[k] == fleet.team[i]:
                    found.append((i, k))
        pairs = np.array(found, dtype=np.int64).reshape(-1, 2)
        return cls(pairs[:, 0], pairs[:, 1])


def carry_over(old: Memory, new: Memory, stayed: Stayed, met: BoolArray) -> None:
    """Copy the memory of boats that stayed, in place.

    Margins are those of the boats seen then. Of a boat that meets a new one (``met``, (n,)) none is known of them all:
    it is asked for no more than a margin of 0, and its backup is kept.
    """
    now, then = stayed
    for name, kept, found in zip(Memory._fields, new, old, strict=True):
        if name not in _OF_OTHERS:
            kept[now] = found[then]
    place = np.full(len(old.blocked_by) + 1, -1)  # the last for nobody
    place[then] = now
    new.blocked_by[now] = place[old.blocked_by[then]]
    new.margin_m[met] = np.minimum(new.margin_m[met], 0.0)
    new.threat_m[np.ix_(now, now)] = old.threat_m[np.ix_(then, then)]


def meets_new(fleet: Fleet, stayed: Stayed, boats: Boats, tuning: Tuning) -> BoolArray:
    """Boats, (n,), that one which was not there before can come near to while paths are looked at."""
    fresh = np.ones(len(fleet), np.bool_)
    fresh[stayed.now] = False
    pursued = boats.pursuit_samples + boats.thrust_samples + boats.chased_samples
    samples = np.maximum(boats.samples, pursued).max() + 1
    horizon_s = samples * boats.sample_s + tuning.tail_s
    top: Array = np.maximum(boats.fastest_mps, np.abs(fleet.speed_mps))
    apart = fleet.position_m[:, None] - fleet.position_m[None]
    gap_m = np.hypot(apart[..., 0], apart[..., 1])
    reach_m = tuning.radius_m + (top[:, None] + top[None]) * horizon_s
    return np.asarray(((gap_m <= reach_m) & fresh[None] & ~np.eye(len(fleet), dtype=np.bool_)).any(axis=1))
