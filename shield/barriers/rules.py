"""What is kept by rule: the field's edge, keep-out circles, and the way out of obstacles that are circles."""

from __future__ import annotations

from ..jit import Array, lean_kernel
from ..scene import Static
from .clearance import FAR, MARGIN, lower
from .obstacles import to_circle
from .way_back import straight_on, worth_of_way_back


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
def _back_within(side: int, here: Array, path: Array, last: int, sample_s: float, field: Array, out: Array) -> None:
    """The same of a boat that is beyond that side, see `way_back`."""
    least_m = FAR
    for k in range(last + 1):
        least_m = min(least_m, _inside(side, path[k, 0], path[k, 1], field))
    x, y = straight_on(path, last, sample_s)
    nx, ny = _inwards(side)
    worth_m = worth_of_way_back(_inside(side, here[0], here[1], field), least_m, _inside(side, x, y, field))
    lower(out, worth_m, last, nx, ny)


@lean_kernel
def _way_out(here: Array, path: Array, last: int, sample_s: float, circle: Array, out: Array) -> bool:
    """Whether a boat is in a circle; the clearance is then lowered to what its path is worth, see `way_back`."""
    now_m, nx, ny = to_circle(here[0], here[1], circle)
    if now_m >= 0.0:
        return False
    least_m = FAR
    for k in range(last + 1):
        least_m = min(least_m, to_circle(path[k, 0], path[k, 1], circle)[0])
    x, y = straight_on(path, last, sample_s)
    lower(out, worth_of_way_back(now_m, least_m, to_circle(x, y, circle)[0]), last, nx, ny)
    return True


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
    beyond it, in a keep-out circle or in a round obstacle has to come back, see `way_back`.

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
            _back_within(side, here, path, samples, sample_s, static.field, out)
        else:
            _within(side, path, near_samples, drift_m, static.field, out)
    for c in range(static.circles.shape[0]):
        _way_out(here, path, samples, sample_s, static.circles[c], out)
    for c in range(static.keep_out.shape[0]):
        k = samples + 1 if _way_out(here, path, samples, sample_s, static.keep_out[c], out) else 0
        while k <= samples:
            margin, nx, ny = to_circle(path[k, 0], path[k, 1], static.keep_out[c])
            margin -= k * drift_m
            lower(out, margin, k, nx, ny)
            k += max(1, int((margin - out[MARGIN]) / (way_m + drift_m)))
