"""The `Tick` that a message of a log holds."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ...commands import Commands
from ...decision import Decisions
from ...exceptions import LogError, SteerclearError
from ...fleet import Fleet
from ...jit import Array
from ...platforms import PLATFORMS, Platform
from ...platforms import layout as L
from ...surroundings import Surroundings
from ..messages import Action, BoatReading, Contact, Sent, Tick
from .header import platform_from
from .numbers import from_json, row_from_json
from .odd import put_back


def tick_from_json(message: Mapping[str, Any], platforms: Mapping[str, Platform]) -> Tick:
    """The tick that `encode.tick_to_json` was given.

    Args:
        message: of the log.
        platforms: those of the log's header.

    Raises:
        LogError: something is missing or of the wrong kind.
    """
    try:
        put_back(message, message.get("odd", ()))  # logs of version 1 have texts in their place
        return _tick(message, platforms)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        if isinstance(error, LogError):
            raise
        name = "it does not fit" if isinstance(error, SteerclearError) else type(error).__name__
        raise LogError(
            f"tick {message.get('number')!r} of the log cannot be read ({name}: {error}); it is damaged or of another "
            "version"
        ) from None


def _tick(message: Mapping[str, Any], platforms: Mapping[str, Platform]) -> Tick:
    rows = message["boats"]
    fleet = _fleet(rows, platforms) if message["has_fleet"] else None
    wanted = Commands(_table(rows, "wanted", 2), message["wanted_relative"]) if message["has_wanted"] else None
    around = _surroundings(message["surroundings"][0]) if message["surroundings"] else None
    return Tick(
        number=int(message["number"]),
        due_s=from_json(message["due_s"]),
        began_s=from_json(message["began_s"]),
        sent_s=from_json(message["sent_s"]),
        readings={row["boat"]: BoatReading(**_reading(row)) for row in message["readings"]},
        contacts=tuple(Contact(**_floats(row, _CONTACT)) for row in message["contacts"]),
        fleet=fleet,
        wanted=wanted,
        surroundings=around,
        decisions=_decisions(message, fleet, wanted, around),
        shield_reset=bool(message["shield_reset"]),
        sent={row["boat"]: Sent(**_floats(row, _SENT)) for row in message["sent"]},
        policy_age_s=from_json(message["policy_age_s"]),
        actions=tuple(Action(**row) for row in message["actions"]),
        game=json.loads(message["game"]) if message["game"] else {},
    )


def _decisions(
    message: Mapping[str, Any], fleet: Fleet | None, wanted: Commands | None, around: Surroundings | None
) -> Decisions | None:
    if not message["has_decisions"] or fleet is None or wanted is None:
        return None
    rows = message["boats"]
    return Decisions(
        fleet=fleet,
        wanted=wanted,
        sent=Commands(_table(rows, "sent", 2), message["sent_relative"]),
        intervened=_column(rows, "intervened", bool).astype(np.bool_),
        reason=_column(rows, "reason", int).astype(np.int64),
        certificate_m=_column(rows, "certificate_m", from_json),
        slack_m=_column(rows, "slack_m", from_json),
        bound=_column(rows, "bound", int).astype(np.int64),
        cut_short=_column(rows, "cut_short", bool).astype(np.bool_) if rows and "cut_short" in rows[0] else None,
        solve_time_s=from_json(message["solve_time_s"]),
        area=None if around is None else around.field,
    )


def _fleet(rows: list[dict[str, Any]], platforms: Mapping[str, Platform]) -> Fleet:
    return Fleet(
        state=_table(rows, "state", L.N_STATE),
        team=_column(rows, "team", int).astype(np.int64),
        platforms=tuple(_platform(row["platform"], platforms) for row in rows),
        controlled=_column(rows, "controlled", bool).astype(np.bool_),
        names=tuple(str(row["name"]) for row in rows),
        age_s=_column(rows, "age_s", from_json) if rows and "age_s" in rows[0] else None,
        position_error_m=(
            _column(rows, "position_error_m", from_json) if rows and "position_error_m" in rows[0] else None
        ),
    )


def _platform(text: str, known: Mapping[str, Platform]) -> str | Platform:
    """By name where this version's platform is the log's, else with the log's parameters."""
    kind = platform_from(json.loads(text)) if text.startswith("{") else known.get(text)
    if kind is None:
        return text
    return kind.name if PLATFORMS.get(kind.name) == kind else kind


def _table(rows: list[dict[str, Any]], name: str, width: int) -> Array:
    values = [row_from_json(row[name], width) for row in rows]
    return np.array(values, dtype=np.float64).reshape(len(rows), width)


def _column(rows: list[dict[str, Any]], name: str, kind: Callable[[Any], Any]) -> Any:
    return np.array([kind(row[name]) for row in rows])


def _surroundings(row: Mapping[str, Any]) -> Surroundings:
    known = {"stops": (), **row}  # logs of before there were stops have none
    circles = {
        name: [(entry["x_m"], entry["y_m"], entry["radius_m"]) for entry in known[name]]
        for name in ("circles", "keep_out", "stops")
    }
    polygons = [list(zip(line["x_m"], line["y_m"], strict=True)) for line in row["polygons"]]
    return Surroundings(field=tuple(row["field"]) or None, polygons=polygons, **circles)


_CONTACT = ("heading_rad", "speed_mps", "fixed_s", "error_m")
_SENT = ("sent_s", "heading_rad", "speed_mps", "limit_mps")
_READING = tuple(name for name in BoatReading.__dataclass_fields__ if name.endswith(("_s", "_rad", "_mps", "_rads")))


def _floats(row: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    values = dict(row)
    for name in names:
        if name in values or name != "limit_mps":  # which logs of version 1 do not know
            values[name] = from_json(values[name])
    if "position_m" in values:
        x_m, y_m = row_from_json(values["position_m"], 2)
        values["position_m"] = (x_m, y_m)
    return values


def _reading(row: Mapping[str, Any]) -> dict[str, Any]:
    values = _floats(row, _READING)
    values["faults"] = {entry["kind"]: int(entry["count"]) for entry in values["faults"]}
    values["texts"] = tuple(values["texts"])
    return values
