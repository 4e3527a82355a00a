"""Which of the policy's commands can be used, and how old the last usable one of each boat is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from ..commands import Commands
from .fleet_file import FleetFile
from .link import NEVER_S

SPEED_SHARE, SPEED_MORE_MPS = 1.5, 0.5
"""Speeds beyond this share of the platform's top plus this much are no commands of anybody who knows the boat."""

MOST_TURNS_RAD = 100.0
"""Headings beyond this are no headings."""


class PolicyWatch:
    """Holds answers against what a command can be.

    Attributes:
        usable: boats whose command can be used now.
        fault: what is wrong, for a person; empty: nothing.

    Args:
        fleet: the file.
        boats: names of the boats this process commands.
    """

    def __init__(self, fleet: FleetFile, boats: Sequence[str]) -> None:
        self._rows = {name: fleet.names.index(name) for name in boats}
        self._fastest = {name: SPEED_SHARE * fleet.platform_of[name].max_speed_mps + SPEED_MORE_MPS for name in boats}
        self._boats = len(fleet.names)
        self._good_s: dict[str, float] = {}
        self.usable: frozenset[str] = frozenset()
        self.fault = ""

    def update(self, now_s: float, commands: Commands | None, age_s: float, fault: str) -> None:
        """Take the latest answer and its age, s."""
        problem = "" if commands is None else self._shape_problem(commands)
        if commands is None or problem or not age_s >= 0.0:
            self.usable, self.fault = frozenset(), fault or problem
            return
        unusable = {name for name in self._rows if not self._is_command(name, commands)}
        self.usable = frozenset(self._rows) - unusable
        for name in self.usable:
            self._good_s[name] = now_s - age_s
        self.fault = fault or (f"no command for {', '.join(sorted(unusable))}" if unusable else "")

    def ages(self, now_s: float) -> Mapping[str, float]:
        """Age of the last usable command of each boat, s; inf: none yet."""
        return {name: now_s - self._good_s[name] if name in self._good_s else NEVER_S for name in self._rows}

    def _shape_problem(self, commands: Commands) -> str:
        if commands.relative:
            return "its commands are relative to headings that have changed since"
        if len(commands) != self._boats:
            return f"it answers for {len(commands)} boats of {self._boats}"
        return ""

    def _is_command(self, name: str, commands: Commands) -> bool:
        speed, heading = (float(value) for value in commands.values[self._rows[name]])
        return abs(heading) <= MOST_TURNS_RAD and abs(speed) <= self._fastest[name] and math.isfinite(speed)
