"""What a replayed trace came out as: deviations, event mismatches, and the tolerances they are held against."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Tolerances:
    """Largest deviations a replay may have; events must be exact.

    Raw observations and the global state are recorded in single precision, which at 180 resolves 1.5e-5.
    """

    position_m: float = 1e-6
    heading_deg: float = 1e-6
    speed_mps: float = 1e-6
    cooldown_s: float = 1e-9
    flag_position_m: float = 1e-6
    observation_normalised: float = 1e-5
    observation_raw: float = 5e-5
    global_state: float = 5e-5


@dataclass(frozen=True)
class EventMismatch:
    """One event that came out differently.

    Attributes:
        step: index of the state, 0 is the start.
        event: array of the trace.
        who: agent id or team.
        expected: value in the trace.
        got: value in the replay.
    """

    step: int
    event: str
    who: str
    expected: int
    got: int


@dataclass(frozen=True)
class ParityReport:
    """Largest deviations over a whole replay, and every event mismatch. Bearings are compared on the circle."""

    path: str
    steps: int
    position_m: float
    heading_deg: float
    speed_mps: float
    cooldown_s: float
    flag_position_m: float
    observation_normalised: float
    observation_raw: float
    global_state: float
    mismatches: tuple[EventMismatch, ...] = ()

    def over(self, tolerances: Tolerances | None = None) -> dict[str, float]:
        """Deviations beyond their tolerance, by name; NaN is beyond."""
        limits = asdict(tolerances or Tolerances())
        return {name: getattr(self, name) for name, limit in limits.items() if not getattr(self, name) <= limit}

    @property
    def passed(self) -> bool:
        """Whether every deviation is within the default tolerances and every event exact."""
        return not self.over() and not self.mismatches

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON, with ``passed``."""
        return {**asdict(self), "passed": self.passed}
