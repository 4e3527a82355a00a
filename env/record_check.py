"""Whether what a record's file holds can be a game: kinds of arrays, and every setting that is drawn or counted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from steerclear.shield.exceptions import TraceError

FARTHEST_M = 1e6
"""No boat, flag or edge of a field is further from the origin."""
LONGEST_STEP_S = 10.0
MOST_BOATS = 1000
MOST_LETTERS = 1000
"""Of a name."""

Test = Callable[[Any], bool]


def check_meta(meta: Mapping[str, Any]) -> None:
    """Refuse settings that no game has.

    Raises:
        TraceError: names the setting, and what it should be.
    """
    for name, (is_right, words) in _SETTINGS.items():
        if name in meta and not is_right(meta[name]):
            raise TraceError(f"the record's {name} is {_short(meta[name])}; it should be {words}")
    strangers = set(meta["shielded"]) - set(meta["agent_ids"])
    if strangers:
        raise TraceError(f"the record's shielded names {', '.join(sorted(map(_short, strangers)))}, no boat of it")


def check_kinds(record: Mapping[str, np.ndarray], kinds: Mapping[str, Any]) -> None:
    """Refuse arrays of another kind than is written, such as text for numbers.

    Raises:
        TraceError: there is one.
    """
    for name, kind in kinds.items():
        if not np.can_cast(record[name].dtype, kind, "same_kind"):
            raise TraceError(f"the record's {name} holds {record[name].dtype}, expected {np.dtype(kind)}")


def check_places(record: Mapping[str, np.ndarray]) -> None:
    """Refuse positions that are in no field.

    Raises:
        TraceError: there is one further than `FARTHEST_M`.
    """
    for name in ("position", "flag_position"):
        if record[name].size and float(np.abs(record[name]).max()) > FARTHEST_M:
            raise TraceError(f"the record's {name} is over {FARTHEST_M / 1e3:g} km away; give positions in m")


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _number(low: float, high: float, above: bool = False) -> Test:
    def is_right(value: Any) -> bool:
        if isinstance(value, bool) or not isinstance(value, int | float):
            return False
        return (low < value if above else low <= value) and value <= high

    return is_right


def _list_of(test: Test, low: int = 0, high: int = MOST_BOATS) -> Test:
    return lambda value: isinstance(value, list) and low <= len(value) <= high and all(map(test, value))


def _text(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= MOST_LETTERS


def _maybe(test: Test) -> Test:
    return lambda value: value is None or test(value)


def _seed(value: Any) -> bool:
    return value is None or (isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**64)


def _policies(value: Any) -> bool:
    return isinstance(value, dict) and all(_text(value.get(side) or "") for side in ("blue", "red"))


def _circle(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and _radius(value[0]) and _point(value[1])


def _obstacles(value: Any) -> bool:
    if not isinstance(value, dict):
        return False
    return _list_of(_circle)(value.get("circle", [])) and _list_of(_list_of(_point, 3))(value.get("polygon", []))


_place = _number(-FARTHEST_M, FARTHEST_M)
_radius = _number(0.0, FARTHEST_M)
_point = _list_of(_place, 2, 2)
_team = _list_of(lambda side: side in (0, 1) and not isinstance(side, bool))

_SETTINGS: dict[str, tuple[Test, str]] = {
    "dt_s": (_number(1e-3, LONGEST_STEP_S), f"a step of 0.001 to {LONGEST_STEP_S:g} s"),
    "env_bounds_m": (_list_of(_number(0.0, FARTHEST_M, above=True), 2, 2), "a width and a height above 0, m"),
    "team_size": (_number(1, MOST_BOATS), "a number of boats"),
    "agent_ids": (_list_of(_text, 1), "a list of names"),
    "team": (_team, "0 or 1 for each boat"),
    "flag_home": (_list_of(_point, 2, 2), "two points, m"),
    "scrimmage": (_maybe(_list_of(_point, 2, 2)), "two points, m"),
    "catch_radius_m": (_radius, "a radius, m"),
    "decision_steps": (_number(1, MOST_BOATS * 10), "a whole number of steps"),
    "corner_radius_m": (_radius, "a radius, m"),
    "flag_keepout_m": (_radius, "a radius, m"),
    "agent_radius_m": (lambda value: _radius(value) or _list_of(_radius)(value), "a radius, or one for each boat, m"),
    "separation_m": (_number(0.0, FARTHEST_M, above=True), "a radius above 0, m"),
    "preset": (_maybe(_text), "a name"),
    "title": (_maybe(_text), "a name"),
    "policies": (_policies, "names for blue and red"),
    "shielded": (_list_of(_text), "a list of names"),
    "seed": (_seed, "a whole number"),
    "reason_names": (_list_of(_text), "a list of names"),
    "platforms": (_list_of(_text), "a list of names"),
    "obstacles": (_maybe(_obstacles), "circles and polygons"),
}
"""Setting: what makes it right, and words for it."""
