"""Faults planned for a moment of a run: ``BOAT:KIND@TIME[+DURATION][,OPTION=VALUE...]``."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from steerclear.shield.exceptions import ConfigError

from .faults import KINDS
from .fleet import SimFleet

_FORM = re.compile(
    r"(?P<boat>[^:@,]+):(?P<kind>\w+)@(?P<at>[\d.]+)(?:\+(?P<lasts>[\d.]+))?(?P<options>(?:,\w+=[^,]+)*)"
)


@dataclass(frozen=True)
class Incident:
    """One fault to come.

    Attributes:
        boat: its name.
        kind: see `faults.KINDS`.
        at_s: simulated time, s.
        lasts_s: s; inf: to the end.
        options: of the fault.
    """

    boat: str
    kind: str
    at_s: float
    lasts_s: float = math.inf
    options: dict[str, Any] = field(default_factory=dict)


def parse_incident(text: str) -> Incident:
    """One planned fault, such as ``blue_1:jump@60+10,distance_m=30``.

    Raises:
        ConfigError: it is of another form, or of an unknown kind.
    """
    found = _FORM.fullmatch(text.strip())
    if found is None:
        raise ConfigError(f"cannot read the fault {text!r}; give BOAT:KIND@SECONDS or BOAT:KIND@SECONDS+DURATION")
    if found["kind"] not in KINDS:
        raise ConfigError(f"unknown fault {found['kind']!r}; faults are {', '.join(KINDS)}")
    try:
        at_s, lasts_s = float(found["at"]), float(found["lasts"] or math.inf)
        pairs = (pair.partition("=") for pair in found["options"].split(",") if pair)
        options = {name: json.loads(value) for name, _, value in pairs}
    except ValueError:
        raise ConfigError(f"the fault {text!r} holds something that is not a number") from None
    return Incident(found["boat"], found["kind"], at_s, lasts_s, options)


class Plan:
    """Faults to come, in order of time.

    Args:
        incidents: all of them.
        fleet: the boats.

    Raises:
        ConfigError: a boat that is not simulated.
    """

    def __init__(self, incidents: Iterable[Incident], fleet: SimFleet) -> None:
        self._waiting = sorted(incidents, key=lambda incident: incident.at_s)
        self._fleet = fleet
        for incident in self._waiting:
            fleet.boat(incident.boat)

    def look(self) -> list[Incident]:
        """Begin those whose time has come, and say which.

        Raises:
            ConfigError: an option the fault does not have.
        """
        begun = []
        while self._waiting and self._waiting[0].at_s <= self._fleet.time_s:
            incident = self._waiting.pop(0)
            self._fleet.fault(incident.boat, incident.kind, duration_s=incident.lasts_s, **incident.options)
            begun.append(incident)
        return begun
