"""The fields that some families play in."""

from __future__ import annotations

import math

from .cast import STANDARD_FIELD_M, Cast

ROOMY_FOR = 20
"""Boats for which the standard field has room; more get a field with the same area for each, all starting under way."""

Box = tuple[float, float, float, float]


def field_of(cast: Cast, boats: int = 2) -> Box:
    """The field for so many boats, m: 80 x 40 for herons, 160 x 80 for surveyors, larger for large crowds."""
    size = cast.scale * math.sqrt(max(1.0, boats / ROOMY_FOR))
    return 0.0, 0.0, STANDARD_FIELD_M[0] * size, STANDARD_FIELD_M[1] * size


def within(box: Box, margin_m: float) -> Box:
    """The box so much smaller on all sides."""
    return box[0] + margin_m, box[1] + margin_m, box[2] - margin_m, box[3] - margin_m
