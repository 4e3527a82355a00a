"""The records of a log as typed structs, and the JSON Schemas that the log carries for them."""

from __future__ import annotations

import dataclasses
from typing import Any, get_args, get_origin, get_type_hints

import msgspec
from msgspec import UNSET, UnsetType

from ..messages import Action, Contact, Sent

Number = float | UnsetType
Numbers = list[float]
Schema = dict[str, Any]

DIALECT = "https://json-schema.org/draft/2020-12/schema"


class Record(msgspec.Struct, kw_only=True):
    """An object of the log; its docstring describes it in the schema."""


class CircleRecord(Record):
    """A circle, m."""

    x_m: float
    y_m: float
    radius_m: float


class CornersRecord(Record):
    """Corners of a polygon, m."""

    x_m: Numbers
    y_m: Numbers


class SurroundingsRecord(Record):
    """Static constraints given with this decision; field: xmin, ymin, xmax, ymax, m."""

    field: Numbers
    circles: list[CircleRecord]
    keep_out: list[CircleRecord]
    polygons: list[CornersRecord]
    stops: list[CircleRecord] = []


class BoatRecord(Record):
    """One boat as the shield saw it, what was wanted of it and what was decided.

    state: x m, y m, heading deg, speed m/s, thrust %, rudder %, speed error m/s and integral, heading error deg and
    integral, turn rate deg/s. wanted, sent: speed m/s; heading rad from the y axis, or deg from the boat's own where
    wanted_relative.
    """

    name: str
    platform: str
    team: int
    controlled: bool
    state: Numbers
    age_s: Number = UNSET
    position_error_m: Number = UNSET
    wanted: Numbers | UnsetType = UNSET
    sent: Numbers | UnsetType = UNSET
    intervened: bool | UnsetType = UNSET
    reason: int | UnsetType = UNSET
    why: str | UnsetType = UNSET
    certificate_m: Number = UNSET
    slack_m: Number = UNSET
    bound: int | UnsetType = UNSET
    cut_short: bool | UnsetType = UNSET
    solver: int | UnsetType = UNSET


class FaultRecord(Record):
    """Refused since the last reading."""

    kind: str
    count: int


class ReadingRecord(Record):
    """What a boat's own telemetry said; see `messages.BoatReading`."""

    boat: str
    read_s: float
    position_m: Numbers
    position_age_s: float
    heading_rad: float
    heading_age_s: float
    speed_mps: float
    course_rad: float
    velocity_age_s: float
    turn_rate_rads: float
    turn_rate_age_s: float
    mode: str
    ready: bool
    why_not: str
    heartbeat_age_s: float
    texts: list[str]
    faults: list[FaultRecord]
    released: bool = False
    released_by: str = ""
    failsafe_over: bool = False


class OddRecord(Record):
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
    readings: list[ReadingRecord]
    contacts: list[Contact]
    sent: list[Sent]
    actions: list[Action]
    game: str
    odd: list[OddRecord] = []


class LinkRecord(Record):
    """A link of the log's chain: the digest of the records since the last link, and of that."""

    count: int
    digest: str
    end: str
    code: str


class MendedRecord(Record):
    """The file was written from one that was cut off."""

    damage: list[str]


class HeaderRecord(Record):
    """What the shield was built with; the first message. Texts that begin with a bracket are JSON."""

    version: int
    fleet_yaml: str
    preset: str
    policy: str
    clock_s: float
    unix_ns: str
    sources: str
    machine: str
    shield: str
    surroundings: str
    platforms: str
    boats: str
    frame: str
    field_size_m: str
    notes: str
    versions: str
    tables: str
    chain: str


def schema_of(kind: type[Any], title: str = "") -> Schema:
    """JSON Schema of a record, or of a message kept as it is, in the forms that log viewers understand."""
    plain = {float: "number", int: "integer", str: "string", bool: "boolean"}

    def of(hint: Any) -> Schema:
        if get_origin(hint) in (list, tuple):
            return {"type": "array", "items": of(get_args(hint)[0])}
        if isinstance(hint, type) and (issubclass(hint, Record) or dataclasses.is_dataclass(hint)):
            return schema_of(hint)
        if hint in plain:
            return {"type": plain[hint]}
        return of(next(entry for entry in get_args(hint) if entry is not UnsetType))

    properties = {name: of(hint) for name, hint in get_type_hints(kind).items()}
    description = " ".join((kind.__doc__ or "").partition("Attributes:")[0].split())
    head = {"$schema": DIALECT, "title": title} if title else {}
    return {**head, "type": "object", "description": description, "properties": properties}


HEADER, TICK, LINK, MENDED = (
    schema_of(kind, f"steerclear.{kind.__name__.removesuffix('Record')}")
    for kind in (HeaderRecord, TickRecord, LinkRecord, MendedRecord)
)
