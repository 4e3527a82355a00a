"""Time of one look-up in a value table, compiled, at places drawn over the whole table."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from steerclear.shield.jit import Array
from steerclear.shield.platforms import get_platform
from steerclear.shield.tables.files import load_table, stack_tables
from steerclear.shield.tables.lookup import WHOLE_S, Tables, table_gradient, table_range_m, table_value
from steerclear.shield.tables.settings import OtherMay

from ..jit import kernel

PAIR = ("surveyor", "heron")
"""Own boat and opponent of the table."""


@kernel
def _values(tables: Tables, places: Array, out: Array) -> None:
    for k in range(places.shape[0]):
        x, y, own, other, own_mps, other_mps = places[k]
        out[k] = table_value(tables, 0, WHOLE_S, x, y, own, other, own_mps, other_mps)


@kernel
def _gradients(tables: Tables, places: Array, out: Array) -> None:
    for k in range(places.shape[0]):
        x, y, own, other, own_mps, other_mps = places[k]
        slope = table_gradient(tables, 0, WHOLE_S, x, y, own, other, own_mps, other_mps)
        own_part = slope.own_x + slope.own_y + slope.own_heading + slope.own_speed
        out[k] = slope.value_m + own_part + slope.other_heading + slope.other_speed  # all of it is computed


def lookup_times(lookups: int, repeats: int, seed: int) -> list[dict[str, Any]]:
    """Time look-ups at random places of one table, each far from the last: caches help less than in a decision.

    Returns:
        For the ``value`` alone and for the ``value and gradient`` (`what`): `lookups` and the median over repeats of
        the mean time of one, `us`.
    """
    own, other = (get_platform(name) for name in PAIR)
    tables = stack_tables([load_table(own, other, OtherMay.WORST_CASE)])
    draw = np.random.default_rng(seed)
    bearing, range_m = draw.uniform(-np.pi, np.pi, lookups), draw.uniform(0.0, table_range_m(tables, 0), lookups)
    headings = draw.uniform(-np.pi, np.pi, (2, lookups))
    speeds = [draw.uniform(0.0, boat.max_speed_mps, lookups) for boat in (own, other)]
    places = np.column_stack([range_m * np.sin(bearing), range_m * np.cos(bearing), *headings, *speeds])
    ways: dict[str, Callable[..., None]] = {"value": _values, "value and gradient": _gradients}
    return [{"what": what, "lookups": lookups, "us": _time(way, tables, places, repeats)} for what, way in ways.items()]


def _time(way: Callable[..., None], tables: Tables, places: Array, repeats: int) -> float:
    out = np.empty(len(places))
    way(tables, places, out)  # warms up
    spent = []
    for _ in range(repeats):
        begin = time.perf_counter_ns()
        way(tables, places, out)
        spent.append((time.perf_counter_ns() - begin) / 1000.0 / len(places))
    return float(np.median(spent))
