"""What is kept by rule: the field's edge, and keep-out circles."""

from __future__ import annotations

from ..jit import Array, lean_kernel
from ..scene import Static
from .clearance import FAR, MARGIN, lower
from .obstacles import to_circle

RETURN_S = 10.0
"""How long a boat outside the field is followed straight on from the end of its path, s."""

HOME_M = 1.0
"""A path that leads so far inside by then leads back, m."""

FARTHEST_M = 100.0
"""Boats farther outside are looked at as if they were that far, m: what tells their paths apart is the same."""

RETURN_WORTH = 0.01
"""What a metre of a path outside the field counts beside a metre that the boat is outside now."""


@lean_kernel
def _inside(side: int, x: float, y: float, field: Array) -> float:
    """How far inside one side of a rectangle (left, low, right, high) a point is, m; infinite where there is none."""
    at = x if side % 2 == 0 else y
    return at - field[side] if side < 2 else field[side] - at


@lean_kernel
def _within(side: int, path: Array, samples: int, drift_m: float, field: Array, out: Array) -> None:
    """Distance inside a side along a path, less the drift until then."""
    nx, ny = _inwards(side)
    for k in range(samples + 1):
        lower(out, _inside(side, path[k, 0], path[k, 1], field) - k * drift_m, k, nx, ny)


@lean_kernel
def _inwards(side: int) -> tuple[float, float]:
    """Unit vector away from a side."""
    sign = 1.0 if side < 2 else -1.0
    return (sign, 0.0) if side % 2 == 0 else (0.0, sign)


@lean_kernel
def _way_back(side: int, here: Array, path: Array, last: int, sample_s: float, field: Array, out: Array) -> None:
    """The same of a boat that is beyond that side: how far, and a trifle for where the path leads.

    It is followed straight on from its end. One that leads back is worth most, even if it leads farther out at first:
    lying still outside is none. Of those that lead back, the one that goes out least.
    """
    x, y = path[last, 0], path[last, 1]
    after = RETURN_S / sample_s
    end_m = _inside(side, x + after * (x - path[last - 1, 0]), y + after * (y - path[last - 1, 1]), field)
    now_m, least_m = _inside(side, here[0], here[1], field), FAR
    for k in range(last + 1):
        least_m = min(least_m, _inside(side, path[k, 0], path[k, 1], field))
    farther_m = max(0.0, -now_m - FARTHEST_M)
    short_m = max(0.0, HOME_M - end_m - farther_m)
    nx, ny = _inwards(side)
    lower(out, now_m + farther_m - RETURN_WORTH * (short_m + max(0.0, now_m - least_m)), last, nx, ny)


@lean_kernel
def clear_of_rules(
    here: Array,
    path: Array,
    near_samples: int,
    samples: int,
    static: Static,
    way_m: float,
    drift_m: float,
    sample_s: float,
    out: Array,
) -> None:
    """Least clearance, m, of a path from the field edge and from circles kept by rule.

    The edge is looked at only until a half turn could be over, since every straight run ends beyond it. A boat that is
    beyond it has to come back, see `_way_back`.

    Args:
        here: where the boat is now, m, shape (>= 2,).
        path: positions, m, shape (>= samples + 1, 2).
        near_samples: last sample at which the edge counts.
        samples: last sample.
        static: the edge and the circles, as they are to be kept.
        way_m: most the boat moves through the water from sample to sample, m.
        drift_m: most a current carries it meanwhile, m.
        sample_s: time from sample to sample, s.
        out: clearance row.
    """
    out[MARGIN] = FAR
    for side in range(4):
        if _inside(side, here[0], here[1], static.field) < 0.0:
            _way_back(side, here, path, samples, sample_s, static.field, out)
        else:
            _within(side, path, near_samples, drift_m, static.field, out)
    for c in range(static.keep_out.shape[0]):
        k = 0
        while k <= samples:
            margin, nx, ny = to_circle(path[k, 0], path[k, 1], static.keep_out[c])
            margin -= k * drift_m
            lower(out, margin, k, nx, ny)
            k += max(1, int((margin - out[MARGIN]) / (way_m + drift_m)))
