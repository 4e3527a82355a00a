"""Labels in plots beside points that lie close together: each a line above the last, so that all can be read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

LETTER, LINE = 0.6, 1.2
"""Width of a letter and height of a line, of the letters' size."""
GAP_POINTS = 3.0


def label_points(axis: Any, points: Sequence[tuple[float, float]], texts: Sequence[str], size: float = 7.0) -> None:
    """Write a text beside each point, above those that stand there already; the axis's limits must be settled.

    Args:
        axis: of matplotlib.
        points: x, y in its data.
        texts: one a point.
        size: of letters, points.
    """
    if not points:
        return
    to_points = 72.0 / axis.figure.dpi
    places = axis.transData.transform(np.array(points, dtype=float)) * to_points
    for point, text, offset in zip(points, texts, offsets_of(places, texts, size), strict=True):
        axis.annotate(text, point, fontsize=size, xytext=offset, textcoords="offset points")


def offsets_of(places: Any, texts: Sequence[str], size: float) -> list[tuple[float, float]]:
    """How far right of and above its point each label goes, points, so that none covers another.

    Args:
        places: (n, 2) of the labelled points, points.
        texts: the labels.
        size: of letters, points.
    """
    taken: list[tuple[float, float, float]] = []  # left, right, bottom
    offsets = []
    for (x, y), text in zip(places, texts, strict=True):
        left, right, bottom = x + GAP_POINTS, x + GAP_POINTS + LETTER * size * len(text), y + GAP_POINTS
        for other_left, other_right, other_bottom in sorted(taken, key=lambda label: label[2]):
            if left < other_right and other_left < right and abs(bottom - other_bottom) < LINE * size:
                bottom = other_bottom + LINE * size
        taken.append((left, right, bottom))
        offsets.append((GAP_POINTS, float(bottom - y)))
    return offsets
