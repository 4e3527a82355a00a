"""The contract of a link to one boat, whatever it speaks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from types import TracebackType
from typing import Protocol

from ..compat import Self

NEVER_S = math.inf
"""Age of what was never received."""


def never() -> bool:
    """What is not called off."""
    return False


@dataclass(frozen=True)
class BoatReading:
    """What one boat's own telemetry says, taken at one moment; each field with its own age. NaN: never received.

    Attributes:
        boat: its name.
        read_s: time of this reading on the link's clock, s.
        position_m: x, y in the field, m.
        position_age_s: since the position was true as far as the link can tell, s.
        heading_rad: clockwise from the field's y axis, rad in [0, 2 pi).
        heading_age_s: s.
        speed_mps: along the heading, over ground; negative astern, m/s.
        course_rad: of the velocity over ground, rad in the field's frame; NaN below 0.1 m/s.
        velocity_age_s: s.
        turn_rate_rads: clockwise, rad/s.
        turn_rate_age_s: s.
        mode: name of the autopilot's mode.
        ready: whether commands of heading and speed would be obeyed now (armed, in the right mode).
        why_not: why not, in words; empty when ready.
        released: whether somebody took the boat and nobody of ours took it back yet; in whatever mode it is now.
        heartbeat_age_s: s.
        texts: what the autopilot said since the last reading.
        faults: what the link refused since the last reading (bad signature, bad checksum, impossible value), by kind.
    """

    boat: str
    read_s: float
    position_m: tuple[float, float] = (math.nan, math.nan)
    position_age_s: float = NEVER_S
    heading_rad: float = math.nan
    heading_age_s: float = NEVER_S
    speed_mps: float = math.nan
    course_rad: float = math.nan
    velocity_age_s: float = NEVER_S
    turn_rate_rads: float = math.nan
    turn_rate_age_s: float = NEVER_S
    mode: str = ""
    ready: bool = False
    why_not: str = "nothing heard yet"
    released: bool = False
    heartbeat_age_s: float = NEVER_S
    texts: tuple[str, ...] = ()
    faults: dict[str, int] = field(default_factory=dict)

    @property
    def age_s(self) -> float:
        """Age of the oldest of position, heading and velocity, s."""
        return max(self.position_age_s, self.heading_age_s, self.velocity_age_s)


@dataclass(frozen=True)
class Sent:
    """What left for the boat.

    Attributes:
        boat: its name.
        sent_s: time on the link's clock, s.
        heading_rad: as encoded, rad clockwise from the field's y axis.
        speed_mps: as encoded and limited by the autopilot's own limit, m/s.
        route: name of the message used, or why nothing was sent.
        delivered: whether bytes left this machine.
        limit_mps: speeds beyond it, either way, are cut by the link to what the autopilot would do; inf: none are.
    """

    boat: str
    sent_s: float
    heading_rad: float
    speed_mps: float
    route: str
    delivered: bool
    limit_mps: float = math.inf


class Link(Protocol):
    """One boat. A context manager: leaving it leaves the boat stopped or holding, verified.

    Attributes:
        boat: its name.
    """

    boat: str

    def connect(self, timeout_s: float) -> None:
        """Open, hear the boat, get the streams needed.

        Raises:
            LinkError: no boat answers in time, or the address cannot be used.
        """

    def prepare(self, timeout_s: float, is_off: Callable[[], bool] = never) -> None:
        """Bring the boat to where it obeys: mode and arming, each step checked.

        Also one that somebody took from us, which is left alone until then, whatever mode it comes back to. When that
        fails it is left alone as before.

        Args:
            timeout_s: how long to try, s.
            is_off: true once it is not to be done any more; it then ends at once.

        Raises:
            LinkRefused: the autopilot says no; its own words are in the text.
            LinkError: no answer in time, or called off.
        """

    def read(self) -> BoatReading:
        """The latest of everything; never waits."""

    def send(self, heading_rad: float, speed_mps: float) -> Sent:
        """Send a command as it is; never waits, raises only on values that are not finite.

        Raises:
            LinkError: heading or speed is not finite; nothing is sent.
        """

    def stop(self) -> Sent:
        """Tell the boat to stop, by the surest way the link has; never waits, never raises."""

    def close(self) -> str:
        """Stop or hold the boat, verify by its telemetry, give the link back; may be called again.

        Returns:
            What the boat was left doing, in words.
        """

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
