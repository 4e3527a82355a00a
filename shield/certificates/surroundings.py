"""Things that do not move: field edge, obstacles, keep-out circles."""

from __future__ import annotations

import math

from ..jit import Array, kernel
from .clearance import FAR, MARGIN, NORMAL_X, NORMAL_Y, SAMPLE


@kernel
def _lower(out: Array, margin: float, k: int, nx: float, ny: float) -> None:
    if margin < out[MARGIN]:
        out[MARGIN], out[SAMPLE], out[NORMAL_X], out[NORMAL_Y] = margin, k, nx, ny


@kernel
def _edges(x: float, y: float, k: int, field: Array, out: Array) -> None:
    """Distance inside a rectangle (xmin, ymin, xmax, ymax); infinite sides are none."""
    _lower(out, x - field[0], k, 1.0, 0.0)
    _lower(out, y - field[1], k, 0.0, 1.0)
    _lower(out, field[2] - x, k, -1.0, 0.0)
    _lower(out, field[3] - y, k, 0.0, -1.0)


@kernel
def _away_from(x: float, y: float, px: float, py: float, radius: float, k: int, out: Array) -> None:
    dx, dy = x - px, y - py
    distance = math.sqrt(dx * dx + dy * dy)
    if distance > 1e-9:
        _lower(out, distance - radius, k, dx / distance, dy / distance)
    else:
        _lower(out, -radius, k, 1.0, 0.0)


@kernel
def clear_of_surroundings(
    path: Array,
    near_samples: int,
    samples: int,
    field: Array,
    circles: Array,
    segments: Array,
    hull_m: float,
    out: Array,
) -> None:
    """Least clearance, m, of a path from field edge, circles and wall segments.

    The edge is looked at only until a half turn could be over, since every straight run ends beyond it; the others over
    the whole path.

    Args:
        path: positions, m, shape (>= samples + 1, 2).
        near_samples: last sample at which the edge counts.
        samples: last sample.
        field: (xmin, ymin, xmax, ymax), m.
        circles: shape (c, 3): centre x, y and radius, m.
        segments: shape (s, 4): ends x0, y0, x1, y1, m.
        hull_m: distance the boat's centre keeps from segments, m.
        out: clearance row.
    """
    out[MARGIN] = FAR
    for k in range(near_samples + 1):
        _edges(path[k, 0], path[k, 1], k, field, out)
    if circles.shape[0] + segments.shape[0] == 0:
        return
    for k in range(samples + 1):
        x, y = path[k, 0], path[k, 1]
        for c in range(circles.shape[0]):
            _away_from(x, y, circles[c, 0], circles[c, 1], circles[c, 2], k, out)
        for s in range(segments.shape[0]):
            dx, dy = segments[s, 2] - segments[s, 0], segments[s, 3] - segments[s, 1]
            length = dx * dx + dy * dy
            part = 0.0
            if length > 0.0:
                part = min(1.0, max(0.0, ((x - segments[s, 0]) * dx + (y - segments[s, 1]) * dy) / length))
            _away_from(x, y, segments[s, 0] + part * dx, segments[s, 1] + part * dy, hull_m, k, out)
