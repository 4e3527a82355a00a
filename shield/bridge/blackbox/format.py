"""A `Tick` as a record of the log and back, every float bit for bit.

JSON has no word for numbers that are not finite. A field that is not finite is left out, so that viewers show a gap;
in a list of numbers 0 stands in its place, and a list of nothing else is empty. ``odd`` of the tick says where each
was and what it is, to the last bit.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import msgspec
import numpy as np
from msgspec import UNSET

from ...commands import Commands
from ...decision import Decisions, Reason
from ...exceptions import LogError, SteerclearError
from ...fleet import Fleet
from ...jit import Array
from ...platforms import PLATFORMS, Gains, Platform
from ...platforms import layout as L
from ...surroundings import Surroundings
from ..messages import BoatReading, Contact, Sent, Tick
from .records import BoatRecord, ReadingRecord, SurroundingsRecord, TickRecord

_PLAIN_NAN = struct.pack(">d", math.nan)
_WORDS = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


def to_text(value: float) -> str:
    """A float that is not finite as text: "inf", "-inf", "nan", and for a NaN with other bits "nan:" and 16 digits."""
    if math.isinf(value):
        return "inf" if value > 0.0 else "-inf"
    packed = struct.pack(">d", value)
    return "nan" if packed == _PLAIN_NAN else f"nan:{packed.hex()}"


def from_text(text: Any) -> float:
    """The float that `to_text` was given.

    Raises:
        LogError: it is none.
    """
    if isinstance(text, str) and text in _WORDS:
        return _WORDS[text]
    try:
        value = float(struct.unpack(">d", bytes.fromhex(str(text).removeprefix("nan:")))[0])
    except (ValueError, struct.error):
        value = 0.0
    if not math.isnan(value):
        raise LogError(f"the log holds {text!r} where a number belongs; it is damaged or of another version")
    return value


def plain(value: Any) -> Any:
    """Nested settings as JSON can hold them: tuples and arrays as lists, floats that are not finite as texts.

    Raises:
        TypeError: something else than texts, numbers, None, mappings and sequences.
    """
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    if isinstance(value, float):
        return value if math.isfinite(value) else to_text(value)
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    raise TypeError(f"a {type(value).__name__} has no place in a log")


def restored(value: Any) -> Any:
    """Settings that `plain` was given, lists staying lists; texts that mean a float become it."""
    if isinstance(value, dict):
        return {key: restored(item) for key, item in value.items()}
    if isinstance(value, list):
        return [restored(item) for item in value]
    if isinstance(value, str) and (value in _WORDS or value.startswith("nan:")):
        return from_text(value)
    return value


def take_odd(node: Any, at: str = "") -> list[dict[str, str]]:
    """Take numbers that are not finite out of a message, in place; where each was, dots between, and its text."""
    found: list[dict[str, str]] = []
    entries = list(node.items()) if isinstance(node, dict) else list(enumerate(node))
    odd = [key for key, value in entries if type(value) is float and not math.isfinite(value)]
    found += [{"at": f"{at}{key}", "value": to_text(node[key])} for key in odd]
    for key in odd:
        if isinstance(node, dict):
            del node[key]
        else:
            node[key] = 0.0
    if isinstance(node, list) and odd and len(odd) == len(node):
        node.clear()
    for key, value in entries:
        if type(value) is dict or type(value) is list:
            found += take_odd(value, f"{at}{key}.")
    return found


def put_back(message: Any, entries: Any) -> None:
    """Put numbers that `take_odd` listed back where they were, in place.

    Raises:
        LogError: an entry is none, or its place is not there.
    """
    try:
        for entry in entries:
            *path, last = entry["at"].split(".")
            node, value = message, from_text(str(entry["value"]))
            for part in path:
                node = node[int(part)] if isinstance(node, list) else node[part]
            if isinstance(node, dict):
                node[last] = value
            elif int(last) == len(node):
                node.append(value)
            else:
                node[int(last)] = value
    except LogError:
        raise
    except (KeyError, IndexError, TypeError, ValueError, AttributeError):
        raise LogError("the log's list of odd numbers does not fit; it is damaged or of another version") from None


def tick_to_json(tick: Tick, platforms: Mapping[str, Platform]) -> dict[str, Any]:
    """The tick as its message; nominal commands without a fleet mean nothing and are left out.

    Args:
        tick: the tick.
        platforms: those the header holds; others are written out in full.
    """
    fleet, decisions = tick.fleet, tick.decisions
    message: dict[str, Any] = {
        "number": tick.number,
        "due_s": float(tick.due_s),
        "began_s": float(tick.began_s),
        "sent_s": float(tick.sent_s),
        "policy_age_s": float(tick.policy_age_s),
        "shield_reset": tick.shield_reset,
        "has_fleet": fleet is not None,
        "has_wanted": fleet is not None and tick.wanted is not None,
        "has_decisions": decisions is not None,
        "wanted_relative": tick.wanted is not None and tick.wanted.relative,
        "sent_relative": decisions is not None and decisions.filtered.relative,
        "solve_time_s": 0.0 if decisions is None else float(decisions.solve_time_s),
        "boats": [] if fleet is None else _boats(fleet, tick.wanted, decisions, platforms),
        "surroundings": [] if tick.surroundings is None else [_surroundings(tick.surroundings)],
        "readings": [_reading(reading) for reading in tick.readings.values()],
        "contacts": [_floats(contact) for contact in tick.contacts],
        "sent": [_floats(sent) for sent in tick.sent.values()],
        "actions": [dict(vars(action)) for action in tick.actions],
        "game": json.dumps(dict(tick.game), default=_any) if tick.game else "",
    }
    message["odd"] = take_odd(message)
    return message


def _boats(
    fleet: Fleet, wanted: Commands | None, decisions: Decisions | None, platforms: Mapping[str, Platform]
) -> list[dict[str, Any]]:
    columns: dict[str, Any] = {
        "name": fleet.names,
        "platform": [_platform_text(kind, platforms) for kind in fleet.platforms],
        "team": fleet.team.tolist(),
        "controlled": fleet.controlled.tolist(),
        "state": fleet.state.tolist(),
    }
    for name in ("age_s", "position_error_m"):
        if getattr(fleet, name) is not None:
            columns[name] = getattr(fleet, name).tolist()
    if wanted is not None:
        columns["wanted"] = wanted.values.tolist()
    if decisions is not None:
        columns["sent"] = decisions.filtered.values.tolist()
        columns["why"] = [Reason(int(reason)).name for reason in decisions.reason]
        columns["certificate_m"] = decisions.safety_margin_m.tolist()  # the name that logs have had since 0.2.0
        for name in ("intervened", "reason", "slack_m", "bound", "cut_short", "solver"):
            if getattr(decisions, name) is not None:
                columns[name] = getattr(decisions, name).tolist()
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _platform_text(kind: str | Platform, known: Mapping[str, Platform]) -> str:
    """The name where the header tells the rest, else the parameters as JSON."""
    platform = kind if isinstance(kind, Platform) else PLATFORMS.get(kind)
    if platform is None or known.get(platform.name) == platform:
        return kind if isinstance(kind, str) else kind.name
    return json.dumps(plain(asdict(platform)), allow_nan=False)


def _surroundings(fixed: Surroundings) -> dict[str, Any]:
    circles = {
        name: [{"x_m": x, "y_m": y, "radius_m": radius} for x, y, radius in getattr(fixed, name)]
        for name in ("circles", "keep_out", "stops")
    }
    polygons = [{"x_m": [x for x, _ in line], "y_m": [y for _, y in line]} for line in fixed.polygons]
    return {"field": list(fixed.field or ()), **circles, "polygons": polygons}


def _floats(entry: Contact | Sent | BoatReading) -> dict[str, Any]:
    row: dict[str, Any] = {n: float(value) if isinstance(value, float) else value for n, value in vars(entry).items()}
    if "position_m" in row:
        row["position_m"] = [float(value) for value in row["position_m"]]
    return row


def _reading(reading: BoatReading) -> dict[str, Any]:
    faults = [{"kind": kind, "count": count} for kind, count in reading.faults.items()]
    return {**_floats(reading), "faults": faults, "texts": list(reading.texts)}


def _any(value: Any) -> Any:
    """What a game's state may hold besides JSON: arrays as lists, anything else as its text."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


def tick_from_json(message: Any, platforms: Mapping[str, Platform]) -> Tick:
    """The tick that `tick_to_json` was given.

    Args:
        message: of the log.
        platforms: those of the log's header.

    Raises:
        LogError: something is missing or of the wrong kind.
    """
    try:
        put_back(message, message.get("odd", ()))
        return _tick(msgspec.convert(message, TickRecord), platforms)
    except LogError:
        raise
    except (msgspec.ValidationError, KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        name = "it does not fit" if isinstance(error, SteerclearError) else type(error).__name__
        number = message.get("number") if isinstance(message, dict) else None
        raise LogError(
            f"tick {number!r} of the log cannot be read ({name}: {error}); it is damaged or of another version"
        ) from None


def _tick(record: TickRecord, platforms: Mapping[str, Platform]) -> Tick:
    rows, fleet, decisions = record.boats, None, None
    around = _surroundings_of(record.surroundings[0]) if record.surroundings else None
    if record.has_fleet:
        fleet = Fleet(
            state=_table(rows, "state", L.N_STATE),
            team=np.array([row.team for row in rows], dtype=np.int64),
            platforms=tuple(_platform(row.platform, platforms) for row in rows),
            controlled=np.array([row.controlled for row in rows], dtype=np.bool_),
            names=tuple(row.name for row in rows),
            age_s=_column(rows, "age_s", np.float64),
            position_error_m=_column(rows, "position_error_m", np.float64),
        )
    wanted = Commands(_table(rows, "wanted", 2), record.wanted_relative) if record.has_wanted else None
    if record.has_decisions and fleet is not None and wanted is not None:
        floats = [_column(rows, name, np.float64) for name in ("certificate_m", "slack_m")]
        whole = [_column(rows, name, np.int64) for name in ("reason", "bound")]
        if any(column is None for column in (*floats, *whole)) and rows:
            raise LogError("a decision lacks a value; it is damaged or of another version")
        safety_margin_m, slack_m, reason, bound = (np.array([]) if c is None else c for c in (*floats, *whole))
        if not set(reason.tolist()) <= {int(known) for known in Reason}:
            raise LogError("a decision has a reason that is none; it is damaged or of another version")
        decisions = Decisions(
            fleet=fleet,
            nominal=wanted,
            filtered=Commands(_table(rows, "sent", 2), record.sent_relative),
            intervened=np.array([row.intervened is True for row in rows], dtype=np.bool_),
            reason=reason,
            safety_margin_m=safety_margin_m,
            slack_m=slack_m,
            bound=bound,
            cut_short=_column(rows, "cut_short", np.bool_),
            solver=_column(rows, "solver", np.int64),
            solve_time_s=record.solve_time_s,
            area=None if around is None else around.field,
        )
    return Tick(
        number=record.number,
        due_s=record.due_s,
        began_s=record.began_s,
        sent_s=record.sent_s,
        readings={row.boat: _reading_of(row) for row in record.readings},
        contacts=tuple(record.contacts),
        fleet=fleet,
        wanted=wanted,
        surroundings=around,
        decisions=decisions,
        shield_reset=record.shield_reset,
        sent={row.boat: row for row in record.sent},
        policy_age_s=record.policy_age_s,
        actions=tuple(record.actions),
        game=json.loads(record.game) if record.game else {},
    )


def _reading_of(record: ReadingRecord) -> BoatReading:
    values = msgspec.structs.asdict(record)
    x_m, y_m = record.position_m
    faults = {entry.kind: entry.count for entry in record.faults}
    return BoatReading(**{**values, "position_m": (x_m, y_m), "faults": faults, "texts": tuple(record.texts)})


def _platform(text: str, known: Mapping[str, Platform]) -> str | Platform:
    """By name where this version's platform is the log's, else with the log's parameters."""
    kind = platform_from(json.loads(text)) if text.startswith("{") else known.get(text)
    if kind is None:
        return text
    return kind.name if PLATFORMS.get(kind.name) == kind else kind


def platform_from(row: Mapping[str, Any]) -> Platform:
    """The platform with such parameters.

    Raises:
        LogError: they are not a platform's.
        PlatformError: a value makes no sense.
    """
    values = restored(dict(row))
    try:
        values["speed_pid"], values["heading_pid"] = Gains(**values["speed_pid"]), Gains(**values["heading_pid"])
        values["thrust_map"] = tuple((float(thrust), float(speed)) for thrust, speed in values["thrust_map"])
        return Platform(**values)
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, SteerclearError):
            raise
        raise LogError(f"the log holds a platform that does not fit this version ({error})") from None


def _table(rows: list[BoatRecord], name: str, width: int) -> Array:
    values = [getattr(row, name) for row in rows]
    if any(len(value) != width for value in values):
        raise LogError(f"{name} of a boat has not {width} numbers; the log is damaged or of another version")
    return np.array(values, dtype=np.float64).reshape(len(rows), width)


def _column(rows: list[BoatRecord], name: str, kind: Any) -> Any:
    """A value of all boats; None where the log has none."""
    values = [getattr(row, name) for row in rows]
    if not values or values[0] is UNSET:
        return None
    return np.array(values, dtype=kind)


def _surroundings_of(row: SurroundingsRecord) -> Surroundings:
    circles = {
        name: [(entry.x_m, entry.y_m, entry.radius_m) for entry in getattr(row, name)]
        for name in ("circles", "keep_out", "stops")
    }
    polygons = [list(zip(line.x_m, line.y_m, strict=True)) for line in row.polygons]
    return Surroundings(field=tuple(row.field) or None, polygons=polygons, **circles)  # type: ignore[arg-type]
