"""A `Tick` as JSON: every float bit for bit, arrays as one entry per boat so that log viewers can plot them.

The message fits its schema, see `odd` for numbers that are not finite.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from ...commands import Commands
from ...decision import Decisions, Reason
from ...fleet import Fleet
from ...platforms import PLATFORMS, Platform
from ...surroundings import Surroundings
from ..messages import BoatReading, Contact, Sent, Tick
from .header import platform_to_text
from .numbers import row_to_json, to_json
from .odd import take_odd


def tick_to_json(tick: Tick, platforms: Mapping[str, Platform]) -> dict[str, Any]:
    """The tick as its message; wanted commands without a fleet mean nothing and are left out.

    Args:
        tick: the tick.
        platforms: those the header holds; others are written out in full.
    """
    fleet, decisions = tick.fleet, tick.decisions
    message: dict[str, Any] = {
        "number": tick.number,
        "due_s": to_json(tick.due_s),
        "began_s": to_json(tick.began_s),
        "sent_s": to_json(tick.sent_s),
        "policy_age_s": to_json(tick.policy_age_s),
        "shield_reset": tick.shield_reset,
        "has_fleet": fleet is not None,
        "has_wanted": fleet is not None and tick.wanted is not None,
        "has_decisions": decisions is not None,
        "wanted_relative": tick.wanted is not None and tick.wanted.relative,
        "sent_relative": decisions is not None and decisions.sent.relative,
        "solve_time_s": 0.0 if decisions is None else to_json(decisions.solve_time_s),
        "boats": [] if fleet is None else _boats(fleet, tick.wanted, decisions, platforms),
        "surroundings": [] if tick.surroundings is None else [_surroundings(tick.surroundings)],
        "readings": [_reading(reading) for reading in tick.readings.values()],
        "contacts": [_contact(contact) for contact in tick.contacts],
        "sent": [_sent(sent) for sent in tick.sent.values()],
        "actions": [vars(action) for action in tick.actions],
        "game": json.dumps(dict(tick.game), default=_any) if tick.game else "",
    }
    message["odd"] = take_odd(message)
    return message


def _boats(
    fleet: Fleet, wanted: Commands | None, decisions: Decisions | None, platforms: Mapping[str, Platform]
) -> list[dict[str, Any]]:
    rows = [
        {
            "name": fleet.names[i],
            "platform": _platform(fleet.platforms[i], platforms),
            "team": int(fleet.team[i]),
            "controlled": bool(fleet.controlled[i]),
            "state": row_to_json(fleet.state[i]),
        }
        for i in range(len(fleet))
    ]
    for name in ("age_s", "position_error_m"):
        values = getattr(fleet, name)
        if values is not None:
            _spread(rows, name, row_to_json(values))
    if wanted is not None:
        _spread(rows, "wanted", [row_to_json(row) for row in wanted.values])
    if decisions is not None:
        _spread(rows, "sent", [row_to_json(row) for row in decisions.sent.values])
        _spread(rows, "intervened", decisions.intervened.tolist())
        _spread(rows, "reason", decisions.reason.tolist())
        _spread(rows, "why", [Reason(int(reason)).name for reason in decisions.reason])
        _spread(rows, "certificate_m", row_to_json(decisions.certificate_m))
        _spread(rows, "slack_m", row_to_json(decisions.slack_m))
        _spread(rows, "bound", decisions.bound.tolist())
        if decisions.cut_short is not None:
            _spread(rows, "cut_short", decisions.cut_short.tolist())
    return rows


def _spread(rows: list[dict[str, Any]], name: str, values: list[Any]) -> None:
    for row, value in zip(rows, values, strict=True):
        row[name] = value


def _platform(kind: str | Platform, known: Mapping[str, Platform]) -> str:
    """The name where the header tells the rest, else the parameters as JSON."""
    platform = kind if isinstance(kind, Platform) else PLATFORMS.get(kind)
    if platform is None or known.get(platform.name) == platform:
        return kind if isinstance(kind, str) else kind.name
    return platform_to_text(platform)


def _surroundings(fixed: Surroundings) -> dict[str, Any]:
    circles = {
        name: [{"x_m": x, "y_m": y, "radius_m": radius} for x, y, radius in getattr(fixed, name)]
        for name in ("circles", "keep_out", "stops")
    }
    polygons = [{"x_m": [x for x, _ in line], "y_m": [y for _, y in line]} for line in fixed.polygons]
    return {"field": list(fixed.field or ()), **circles, "polygons": polygons}


def _reading(reading: BoatReading) -> dict[str, Any]:
    row = {name: to_json(value) if isinstance(value, float) else value for name, value in vars(reading).items()}
    row["position_m"] = [to_json(float(value)) for value in reading.position_m]
    row["faults"] = [{"kind": kind, "count": count} for kind, count in reading.faults.items()]
    row["texts"] = list(reading.texts)
    return row


def _contact(contact: Contact) -> dict[str, Any]:
    row = {name: to_json(value) if isinstance(value, float) else value for name, value in vars(contact).items()}
    row["position_m"] = [to_json(float(value)) for value in contact.position_m]
    return row


def _sent(sent: Sent) -> dict[str, Any]:
    return {name: to_json(value) if isinstance(value, float) else value for name, value in vars(sent).items()}


def _any(value: Any) -> Any:
    """What a game's state may hold besides JSON: arrays as lists, anything else as its text."""
    return value.tolist() if hasattr(value, "tolist") else str(value)
