"""A `Tick` as a record of the log and back, every float bit for bit, and the JSON Schemas that the log carries."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType

from ...commands import Commands
from ...decision import Decisions, Reason
from ...exceptions import LogError, SteerclearError
from ...fleet import Fleet
from ...platforms import PLATFORMS, Gains, Platform
from ...platforms import layout as L
from ...surroundings import Surroundings
from ..messages import Action, BoatReading, Contact, Sent, Tick
from .nonfinite import plain, put_back, restored, take_nonfinite

Number = float | UnsetType
Schema = dict[str, Any]


class Record(msgspec.Struct, kw_only=True):
    """An object of the log; its docstring describes it in the schema."""


class CircleRecord(Record):
    """A circle, m."""

    x_m: float
    y_m: float
    radius_m: float


class CornersRecord(Record):
    """Corners of a polygon, m."""

    x_m: list[float]
    y_m: list[float]


class SurroundingsRecord(Record):
    """Static constraints given with this decision; field: xmin, ymin, xmax, ymax, m."""

    field: list[float]
    circles: list[CircleRecord]
    keep_out: list[CircleRecord]
    polygons: list[CornersRecord]
    stops: list[CircleRecord] = []


class BoatRecord(Record):
    """One boat as the shield saw it, its nominal command and what was decided.

    state: x m, y m, heading deg, speed m/s, thrust %, rudder %, speed error m/s and integral, heading error deg and
    integral, turn rate deg/s. wanted, sent (the names that logs have had since 0.2.0): nominal and filtered
    command, speed m/s; heading rad from the y axis, or deg from the boat's own where
    wanted_relative.
    """

    name: str
    platform: str
    team: int
    controlled: bool
    state: list[float]
    age_s: Number = UNSET
    position_error_m: Number = UNSET
    wanted: list[float] | UnsetType = UNSET
    sent: list[float] | UnsetType = UNSET
    intervened: bool | UnsetType = UNSET
    reason: int | UnsetType = UNSET
    why: str | UnsetType = UNSET
    certificate_m: Number = UNSET
    slack_m: Number = UNSET
    bound: int | UnsetType = UNSET
    cut_short: bool | UnsetType = UNSET
    solver: int | UnsetType = UNSET


class NonFiniteRecord(Record):
    """A number that is not finite: its place, and nan, inf, -inf or nan:BITS."""

    at: str
    value: str


class TickRecord(Record):
    """One turn of the loop. A number that is not finite is left out, 0 in a list, and listed in odd."""

    number: int
    due_s: float
    began_s: float
    sent_s: float
    policy_age_s: float
    shield_reset: bool
    has_fleet: bool
    has_wanted: bool
    has_decisions: bool
    wanted_relative: bool
    sent_relative: bool
    solve_time_s: float
    boats: list[BoatRecord]
    surroundings: list[SurroundingsRecord]
    readings: list[BoatReading]
    contacts: list[Contact]
    sent: list[Sent]
    actions: list[Action]
    game: str
    odd: list[NonFiniteRecord] = []


COLUMNS: dict[str, tuple[type, str, type, tuple[int, ...]]] = {
    "team": (Fleet, "team", np.int64, ()),
    "controlled": (Fleet, "controlled", np.bool_, ()),
    "state": (Fleet, "state", np.float64, (L.N_STATE,)),
    "age_s": (Fleet, "age_s", np.float64, ()),
    "position_error_m": (Fleet, "position_error_m", np.float64, ()),
    "wanted": (Commands, "values", np.float64, (2,)),
    "sent": (Commands, "values", np.float64, (2,)),
    "intervened": (Decisions, "intervened", np.bool_, ()),
    "reason": (Decisions, "reason", np.int64, ()),
    "certificate_m": (Decisions, "safety_margin_m", np.float64, ()),  # the name that logs have had since 0.2.0
    "slack_m": (Decisions, "slack_m", np.float64, ()),
    "bound": (Decisions, "active_constraint", np.int64, ()),  # as above
    "cut_short": (Decisions, "cut_short", np.bool_, ()),
    "solver": (Decisions, "solver", np.int64, ()),
}
"""Values of a `BoatRecord` that are a row of an array: whose, its name there, its kind and shape."""
NOBODY_NEAR_M = 1e6
"""Margin in logs of 0.9.0 and before where nobody can come near; it is infinite."""
_LATER = {"released", "released_by", "failsafe_over", "commander"}  # parts of a reading that older versions lack
_READING = {entry.name for entry in dataclasses.fields(BoatReading)} - _LATER


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
        "has_wanted": fleet is not None and tick.nominal is not None,
        "has_decisions": decisions is not None,
        "wanted_relative": tick.nominal is not None and tick.nominal.relative,
        "sent_relative": decisions is not None and decisions.filtered.relative,
        "solve_time_s": 0.0 if decisions is None else float(decisions.solve_time_s),
        "boats": [] if fleet is None else _boats(fleet, tick.nominal, decisions, platforms),
        "surroundings": [] if tick.surroundings is None else [_surroundings(tick.surroundings)],
        "readings": [_floats(reading) for reading in tick.readings.values()],
        "contacts": [_floats(contact) for contact in tick.contacts],
        "sent": [_floats(sent) for sent in tick.sent.values()],
        "actions": [dict(vars(action)) for action in tick.actions],
        "game": json.dumps(dict(tick.game), default=_any) if tick.game else "",
    }
    message["odd"] = take_nonfinite(message)
    return message


def _boats(
    fleet: Fleet, nominal: Commands | None, decisions: Decisions | None, platforms: Mapping[str, Platform]
) -> list[dict[str, Any]]:
    columns: dict[str, Any] = {
        "name": fleet.names,
        "platform": [_platform_text(kind, platforms) for kind in fleet.platforms],
    }
    if decisions is not None:
        columns["why"] = [Reason(int(reason)).name for reason in decisions.reason]
    sent = None if decisions is None else decisions.filtered
    for name, (kind, attribute, _, _) in COLUMNS.items():
        owner = {Fleet: fleet, Decisions: decisions, Commands: nominal if name == "wanted" else sent}[kind]
        values = getattr(owner, attribute, None)
        if values is not None:
            columns[name] = values.tolist()
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _platform_text(kind: str | Platform, known: Mapping[str, Platform]) -> str:
    """The name where the header tells the rest, else the parameters as JSON."""
    platform = kind if isinstance(kind, Platform) else PLATFORMS.get(kind)
    if platform is None or known.get(platform.name) == platform:
        return kind if isinstance(kind, str) else kind.name
    return json.dumps(plain(dataclasses.asdict(platform)), allow_nan=False)


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
    if "faults" in row:
        row["faults"] = [{"kind": kind, "count": count} for kind, count in row["faults"].items()]
        row["texts"] = list(row["texts"])
    return row


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
        readings = []
        for row in message["readings"]:
            if not row.keys() >= _READING:
                raise KeyError("a reading without all its parts")
            readings.append({**row, "faults": {entry["kind"]: entry["count"] for entry in row["faults"]}})
        return _tick(msgspec.convert({**message, "readings": readings}, TickRecord), platforms)
    except LogError:
        raise
    except (msgspec.ValidationError, KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        name = "it does not fit" if isinstance(error, SteerclearError) else type(error).__name__
        number = message.get("number") if isinstance(message, dict) else None
        raise LogError(
            f"tick {number!r} of the log cannot be read ({name}: {error}); it is damaged or of another version"
        ) from None


def _tick(record: TickRecord, platforms: Mapping[str, Platform]) -> Tick:
    rows, fleet, decisions, nominal = record.boats, None, None, None
    around = _surroundings_of(record.surroundings[0]) if record.surroundings else None
    if record.has_fleet:
        names, kinds = tuple(row.name for row in rows), tuple(_platform(row.platform, platforms) for row in rows)
        fleet = Fleet(names=names, platforms=kinds, **_arrays(rows, Fleet))
    if record.has_wanted:
        nominal = Commands(_array(rows, "wanted"), record.wanted_relative)
    if record.has_decisions and fleet is not None and nominal is not None:
        decisions = Decisions(
            fleet=fleet,
            nominal=nominal,
            filtered=Commands(_array(rows, "sent"), record.sent_relative),
            solve_time_s=record.solve_time_s,
            area=None if around is None else around.field,
            **_arrays(rows, Decisions),
        )
        decisions.safety_margin_m[decisions.safety_margin_m == NOBODY_NEAR_M] = math.inf
        for reason in decisions.reason:
            Reason(int(reason))
    same = ("number", "due_s", "began_s", "sent_s", "shield_reset", "policy_age_s")
    return Tick(
        **{name: getattr(record, name) for name in same},
        readings={row.boat: dataclasses.replace(row) for row in record.readings},  # with what an old log lacks
        contacts=tuple(record.contacts),
        fleet=fleet,
        nominal=nominal,
        surroundings=around,
        decisions=decisions,
        sent={row.boat: dataclasses.replace(row) for row in record.sent},
        actions=tuple(record.actions),
        game=json.loads(record.game) if record.game else {},
    )


def _arrays(rows: list[BoatRecord], owner: type) -> dict[str, Any]:
    """Arrays of a `Fleet` or of `Decisions`, as far as the log has them."""
    return {
        attribute: _array(rows, name)
        for name, (whose, attribute, _, _) in COLUMNS.items()
        if whose is owner and not (rows and getattr(rows[0], name) is UNSET)
    }


def _array(rows: list[BoatRecord], name: str) -> Any:
    _, _, kind, shape = COLUMNS[name]
    values = [getattr(row, name) for row in rows]
    if UNSET in values or any(shape and len(value) != shape[0] for value in values):
        raise LogError(f"a boat lacks its {name}, or some of its numbers; the log is damaged or of another version")
    return np.array(values, dtype=kind).reshape(len(rows), *shape)


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


def _surroundings_of(row: SurroundingsRecord) -> Surroundings:
    circles = {
        name: [(entry.x_m, entry.y_m, entry.radius_m) for entry in getattr(row, name)]
        for name in ("circles", "keep_out", "stops")
    }
    polygons = [list(zip(line.x_m, line.y_m, strict=True)) for line in row.polygons]
    return Surroundings(field=tuple(row.field) or None, polygons=polygons, **circles)  # type: ignore[arg-type]


_PLAIN = {float: "number", int: "integer", str: "string", bool: "boolean"}


def schema_of(kind: type[Any], title: str = "") -> Schema:
    """JSON Schema of a record, or of a message kept as it is, in the forms that log viewers understand."""

    def of(hint: Any) -> Schema:
        if hint in _PLAIN:
            return {"type": _PLAIN[hint]}
        if get_origin(hint) in (list, tuple):
            return {"type": "array", "items": of(get_args(hint)[0])}
        if get_origin(hint) is dict:  # as a list of its entries
            return {"type": "array", "items": object_schema("", "Refused since the last reading", kind=str, count=int)}
        if isinstance(hint, type) and (issubclass(hint, Record) or dataclasses.is_dataclass(hint)):
            return schema_of(hint)
        return of(next(entry for entry in get_args(hint) if entry is not UnsetType))

    description = " ".join((kind.__doc__ or "").partition("Attributes:")[0].split())
    found = object_schema(title, description)
    return {**found, "properties": {name: of(hint) for name, hint in get_type_hints(kind).items()}}


def object_schema(title: str, description: str, **properties: type) -> Schema:
    """JSON Schema of an object with such plain properties."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title} if title else {}
    parts = {name: {"type": _PLAIN[kind]} for name, kind in properties.items()}
    return {**head, "type": "object", "description": description, "properties": parts}


TICK = schema_of(TickRecord, "steerclear.Tick")
