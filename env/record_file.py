"""The record of a game: all arrays for a replay, a picture or an analysis, in one ``.npz`` file.

A record is a plain dict of numpy arrays. With ``n`` boats (blue team first) and ``T`` steps:

===================  ==============  =======================================================================
array                shape           contents
===================  ==============  =======================================================================
``meta``             ()              JSON text, see ``META_KEYS``
``position``         (T+1, n, 2)     m, state before step t at index t
``heading_deg``      (T+1, n)        deg, clockwise from north
``speed_mps``        (T+1, n)        m/s
``has_flag``         (T+1, n)        bool; likewise ``is_tagged`` and ``oob`` (out of bounds)
``is_disabled``      (T+1, n)        bool, stopped by a power play; older files have none
``flag_position``    (T+1, 2, 2)     m, flag of team 0 and of team 1
``captures``         (T+1, 2)        captures made by each team so far
``nominal``          (T, n, 2)       nominal command: speed m/s, absolute heading deg
``filtered``         (T, n, 2)       command that the boat received
``reason``           (T, n)          shield reason code; ``NOT_COVERED`` where no shield decided
``intervened``       (T, n)          bool, the two commands differ
``safety_margin_m``  (T, n)          float32, NaN where there is none
``violations``       (K, 4)          index of the first state inside, boat a, boat b, closest distance m
===================  ==============  =======================================================================

Files of 0.9.0 and before, which are read, say ``wanted``, ``sent`` and ``breaches`` for the last words above.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.shield.exceptions import TraceError
from steerclear.shield.renamed import Renamed, current_keys

from .whole_file import check_finite, check_shapes, read_arrays, save_arrays

Record = dict[str, np.ndarray]

NOT_COVERED = 6
"""Reason code of a boat for which no shield decided (``Reason.NOT_COVERED``)."""

LAYOUT: dict[str, tuple[tuple[str | int, ...], Any]] = {
    "position": (("T+1", "n", 2), np.float64),
    "heading_deg": (("T+1", "n"), np.float64),
    "speed_mps": (("T+1", "n"), np.float64),
    "has_flag": (("T+1", "n"), np.bool_),
    "is_tagged": (("T+1", "n"), np.bool_),
    "oob": (("T+1", "n"), np.bool_),
    "is_disabled": (("T+1", "n"), np.bool_),
    "flag_position": (("T+1", 2, 2), np.float64),
    "captures": (("T+1", 2), np.int64),
    "nominal": (("T", "n", 2), np.float64),
    "filtered": (("T", "n", 2), np.float64),
    "reason": (("T", "n"), np.uint8),
    "intervened": (("T", "n"), np.bool_),
    "safety_margin_m": (("T", "n"), np.float32),
    "violations": (("K", 4), np.float64),
}
"""Per array: its axes (T steps, n boats, K separation violations) and its type."""

ARRAYS = tuple(LAYOUT)
"""Names of the arrays besides ``meta``."""

LATER = ("is_disabled",)
"""Arrays that files of older versions lack; `load` and `make_record` fill them in."""

FARTHEST_M = 1e6
"""Limit for the distance of a boat, flag or field edge from the origin."""

LONGEST_STEP_S = 10.0
MOST_BOATS = 1000
MOST_LETTERS = 1000
"""Longest name, in characters."""

_AGAIN = "Record a game with `steerclear play --save game.npz`, or in Python with GameRecorder and save()."


def read_meta(record: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Decode the record's ``meta``.

    Returns:
        The settings of the game, keyed by at least ``META_KEYS``.

    Raises:
        TraceError: ``meta`` is missing, no JSON object, or lacks a key.
    """
    if "meta" not in record:
        raise TraceError(f"the record has no 'meta'. {_AGAIN}")
    try:
        meta = json.loads(str(record["meta"]))
    except (ValueError, RecursionError) as error:
        raise TraceError(f"the record's meta is not JSON ({error}). {_AGAIN}") from None
    missing = [key for key in META_KEYS if not isinstance(meta, dict) or key not in meta]
    if missing:
        raise TraceError(f"the record's meta lacks {', '.join(missing)}. Pass them to GameRecorder.start().")
    return dict(meta)


def validate(record: Mapping[str, np.ndarray]) -> None:
    """Check that a record is complete and that its shapes fit together.

    Raises:
        TraceError: An array is missing, has the wrong shape, or holds a value that cannot be drawn.
    """
    meta = read_meta(record)
    missing = [name for name in ARRAYS if name not in record and name not in LATER]
    if missing:
        raise TraceError(f"the record lacks {', '.join(missing)}. {_AGAIN}")
    _check_settings(meta)
    layout = {name: entry for name, entry in LAYOUT.items() if name in record}
    if not all(record[name].ndim == len(axes) for name, (axes, _) in layout.items()):
        raise TraceError(f"the record's arrays have other shapes than a record's. {_AGAIN}")
    for name, (_, kind) in layout.items():
        if not np.can_cast(record[name].dtype, kind, "same_kind"):
            raise TraceError(f"the record's {name} holds {record[name].dtype}, expected {np.dtype(kind)}")
    n, steps, violations = len(meta["agent_ids"]), len(record["nominal"]), record["violations"]
    sizes = {"T": steps, "T+1": steps + 1, "n": n, "K": len(violations)}
    check_shapes(record, {name: axes for name, (axes, _) in layout.items()}, sizes, "the record's ", _AGAIN)
    finite = ("position", "heading_deg", "speed_mps", "flag_position", "violations")
    check_finite(record, finite, "the record's ", _AGAIN)
    for name in ("position", "flag_position"):
        if np.abs(record[name]).max(initial=0.0) > FARTHEST_M:
            raise TraceError(f"the record's {name} is over {FARTHEST_M / 1e3:g} km away; give positions in m")
    if not ((violations[:, :3] >= 0).all() and (violations[:, 0] <= steps).all() and (violations[:, 1:3] < n).all()):
        raise TraceError(f"the record's violations name a step beyond {steps} or a boat beyond {n - 1}. {_AGAIN}")
    if len(meta["team"]) != n or len(meta["platforms"]) != n:
        raise TraceError(f"meta's team and platforms must have one entry for each of the {n} boats. {_AGAIN}")


def make_record(meta: Mapping[str, Any], **arrays: Any) -> Record:
    """Build a validated record from a game's settings and whole arrays, cast to the types of ``LAYOUT``.

    Raises:
        TraceError: An array is missing, unknown, or does not fit the others.
    """
    arrays = current_keys(arrays)
    unknown = sorted(set(arrays) - set(ARRAYS))
    if unknown:
        raise TraceError(f"a record has no array {', '.join(unknown)}; it has {', '.join(ARRAYS)}.")
    record = {name: np.asarray(values, dtype=LAYOUT[name][1]) for name, values in arrays.items()}
    record["meta"] = np.array(json.dumps(dict(meta), default=plain))
    validate(record)
    return _filled(record)


def save(record: Mapping[str, np.ndarray], path: str | os.PathLike[str]) -> Path:
    """Write a record to an ``.npz`` file. An interrupted write leaves no partial file and does not damage an older one.

    Returns:
        The path written; ``.npz`` is added if the ending is missing.

    Raises:
        TraceError: The record is incomplete, or the folder cannot be written to.
    """
    record = current_keys(record)
    validate(record)
    target = Path(path)
    if target.suffix != ".npz":
        target = target.with_name(target.name + ".npz")
    save_arrays(target, record)
    return target


def load(path: str | os.PathLike[str]) -> Record:
    """Read and check a record that ``save`` wrote.

    Raises:
        TraceError: The file is missing, cut, not a record, or lacks an array.
    """
    record = current_keys(read_arrays(path, "record", _AGAIN))
    try:
        validate(record)
    except TraceError as error:
        raise TraceError(f"{path}: {error}") from None
    return _filled(record)


def _filled(record: Record) -> Record:
    """Add the arrays that older versions did not write; no boat was disabled then."""
    return Renamed({"is_disabled": np.zeros_like(record["is_tagged"]), **record})


def plain(value: Any) -> Any:
    """Let ``json`` write numpy values."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no JSON form")


def _check_settings(meta: Mapping[str, Any]) -> None:
    """Refuse settings with impossible values."""
    for name, (is_right, words) in _SETTINGS.items():
        if name in meta and not is_right(meta[name]):
            raise TraceError(f"the record's {name} is {_short(meta[name])}; it should be {words}")
    strangers = set(meta["shielded"]) - set(meta["agent_ids"])
    if strangers:
        raise TraceError(f"the record's shielded names {', '.join(sorted(map(_short, strangers)))}, no boat of it")


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


Test = Callable[[Any], bool]


def _number(low: float, high: float) -> Test:
    return lambda value: isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high


def _list_of(test: Test, low: int = 0, high: int = MOST_BOATS) -> Test:
    return lambda value: isinstance(value, list) and low <= len(value) <= high and all(map(test, value))


def _maybe(test: Test) -> Test:
    return lambda value: value is None or test(value)


def _text(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= MOST_LETTERS


def _whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**64


def _policies(value: Any) -> bool:
    return isinstance(value, dict) and all(_text(value.get(side) or "") for side in ("blue", "red"))


def _circle(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and _radius(value[0]) and _point(value[1])


def _obstacles(value: Any) -> bool:
    if not isinstance(value, dict):
        return False
    return _list_of(_circle)(value.get("circle", [])) and _list_of(_list_of(_point, 3))(value.get("polygon", []))


_radius, _length = _number(0.0, FARTHEST_M), _number(np.nextafter(0.0, 1.0), FARTHEST_M)
_point = _list_of(_number(-FARTHEST_M, FARTHEST_M), 2, 2)

_OPTIONAL = ("scrimmage", "decision_steps", "corner_radius_m", "title", "obstacles")
_SETTINGS: dict[str, tuple[Test, str]] = {
    "dt_s": (_number(1e-3, LONGEST_STEP_S), f"a step of 0.001 to {LONGEST_STEP_S:g} s"),
    "env_bounds_m": (_list_of(_length, 2, 2), "a width and a height above 0, m"),
    "team_size": (_number(1, MOST_BOATS), "a number of boats"),
    "agent_ids": (_list_of(_text, 1), "a list of names"),
    "team": (_list_of(lambda side: _whole(side) and side in (0, 1)), "0 or 1 for each boat"),
    "flag_home": (_list_of(_point, 2, 2), "two points, m"),
    "scrimmage": (_maybe(_list_of(_point, 2, 2)), "two points, m"),
    "catch_radius_m": (_radius, "a radius, m"),
    "decision_steps": (_number(1, MOST_BOATS * 10), "a whole number of steps"),
    "corner_radius_m": (_radius, "a radius, m"),
    "flag_keepout_m": (_radius, "a radius, m"),
    "agent_radius_m": (lambda value: _radius(value) or _list_of(_radius)(value), "a radius, or one for each boat, m"),
    "separation_m": (_length, "a radius above 0, m"),
    "preset": (_maybe(_text), "a name"),
    "title": (_maybe(_text), "a name"),
    "policies": (_policies, "names for blue and red"),
    "shielded": (_list_of(_text), "a list of names"),
    "seed": (_maybe(_whole), "a whole number"),
    "reason_names": (_list_of(_text), "a list of names"),
    "platforms": (_list_of(_text), "a list of names"),
    "obstacles": (_maybe(_obstacles), "circles and polygons"),
}
"""Per setting: a test of its value, and words for what it should be."""

META_KEYS = tuple(name for name in _SETTINGS if name not in _OPTIONAL)
"""Keys that ``meta`` must have; further keys are preserved."""
