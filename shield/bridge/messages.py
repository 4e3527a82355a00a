"""What passes between the parts of a run on boats: readings, contacts, commands, ticks, and who gives and takes them.

All times and ages are of one monotonic clock; positions m in the field's frame, headings rad clockwise from its y axis.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Protocol, runtime_checkable

import numpy as np

from ..commands import Commands
from ..compat import Self
from ..decision import Decisions
from ..exceptions import LinkError
from ..fleet import Fleet
from ..jit import Array
from ..surroundings import Surroundings
from .fleet_settings import BoatSettings

LOG = logging.getLogger(__name__)
NEVER_S = math.inf  # age of what was never received
TELEMETRY = "telemetry"  # source of contacts that a boat's own link reported; no other source may use this name
PILOT, FAILSAFE = "pilot", "failsafe"  # who may have taken a boat: a person, or the autopilot's own fail-safe


@dataclass(frozen=True)
class BoatReading:
    """What one boat's own telemetry says, taken at one moment; each field with its own age. NaN: never received."""

    boat: str
    read_s: float  # time of this reading, s
    position_m: tuple[float, float] = (math.nan, math.nan)  # x, y
    position_age_s: float = NEVER_S  # since the position was true as far as the link can tell, s
    heading_rad: float = math.nan  # in [0, 2 pi)
    heading_age_s: float = NEVER_S
    speed_mps: float = math.nan  # along the heading, over ground; negative astern, m/s
    course_rad: float = math.nan  # of the velocity over ground; NaN below 0.1 m/s
    velocity_age_s: float = NEVER_S
    turn_rate_rads: float = math.nan  # clockwise, rad/s
    turn_rate_age_s: float = NEVER_S
    mode: str = ""  # name of the autopilot's mode
    ready: bool = False  # whether commands of heading and speed would be obeyed now (armed, in the right mode)
    why_not: str = "nothing heard yet"  # why not, in words; empty when ready
    # whether somebody took the boat and nobody of ours took it back yet; in whatever mode it is now
    released: bool = False
    released_by: str = ""  # who took it: `PILOT`, `FAILSAFE` (the autopilot said so itself), or empty
    failsafe_over: bool = False  # whether the autopilot said that what made it fail safe is over
    heartbeat_age_s: float = NEVER_S
    commander: str = ""  # who else was last seen commanding it, in words; empty: nobody
    texts: tuple[str, ...] = ()  # what the autopilot said since the last reading
    # what the link refused since the last reading (bad signature, bad checksum, impossible value), by kind
    faults: dict[str, int] = field(default_factory=dict)

    @property
    def age_s(self) -> float:
        """Age of the oldest of position, heading and velocity, s."""
        return max(self.position_age_s, self.heading_age_s, self.velocity_age_s)

    @property
    def silent_s(self) -> float:
        """Time since anything came from the boat, s: heartbeats alone are too rare to tell."""
        ages = (self.position_age_s, self.heading_age_s, self.velocity_age_s, self.turn_rate_age_s)
        return min(self.heartbeat_age_s, *ages)


@dataclass(frozen=True)
class Sent:
    """What left for the boat."""

    boat: str
    sent_s: float  # time, s
    heading_rad: float  # as encoded
    speed_mps: float  # as encoded and limited by the autopilot's own limit, m/s
    route: str  # name of the message used, or why nothing was sent
    delivered: bool  # whether bytes left this machine
    # speeds beyond it, either way, are cut by the link to what the autopilot would do; inf: none are
    limit_mps: float = math.inf


class Closing:
    """What is closed by leaving it as a context."""

    def close(self) -> None:
        """Give back what it holds; may be called again."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def never() -> bool:
    """What is not called off."""
    return False


class Link(Protocol):
    """One boat, whatever its link speaks. A context manager: leaving it leaves the boat stopped or held, verified."""

    boat: str  # its name

    def connect(self, timeout_s: float) -> None:
        """Open, hear the boat, get the streams needed; `LinkError` where none answers in time."""

    def learn(self, timeout_s: float) -> None:
        """Ask for what checks look at and is not known yet; mostly nothing."""
        return

    def prepare(self, timeout_s: float, is_off: Callable[[], bool] = never) -> None:
        """Bring the boat to where it obeys: mode and arming, each step checked.

        Also one that somebody took from us, which is left alone until then, whatever mode it comes back to. When that
        fails it is left alone as before. Once ``is_off`` says so it ends at once.

        Raises:
            LinkRefused: the autopilot says no; its own words are in the text.
            LinkError: no answer in time, or called off.
        """

    def read(self) -> BoatReading:
        """The latest of everything; never waits."""

    def send(self, heading_rad: float, speed_mps: float) -> Sent:
        """Send a command as it is; never waits. `LinkError`, and nothing is sent, where a value is not finite."""

    def stop(self) -> Sent:
        """Tell the boat to stop, by the surest way the link has; never waits, never raises."""

    def close(self) -> str:
        """Stop or hold the boat, verify by its telemetry, give the link back; what it was left doing, in words."""

    def health(self) -> Any:
        """What the link knows of itself, of a form of its own."""

    def release(self) -> None:
        """Give the link back without a word to the boat: for one that was only listened to."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        LOG.info("%s", self.close())


class LinkMaker(Protocol):
    """Makes the links of one kind and holds what several boats share, such as a socket."""

    def link(self, boat: BoatSettings) -> Link:
        """Make a boat's link; nothing is opened yet."""

    def open(self) -> None:
        """Open all that is shared, or raise `LinkError`."""
        return

    def close(self) -> None:
        """Give it back; may be called again."""
        return

    def sources(self) -> Sequence[ContactSource]:
        """Who tells of other boats by the same way."""
        return ()


def check_finite(boat: str, heading_rad: float, speed_mps: float) -> None:
    """Check that a command is made of numbers, or raise `LinkError`."""
    if not (math.isfinite(heading_rad) and math.isfinite(speed_mps)):
        raise LinkError(
            f"boat {boat} was to be sent heading {heading_rad} rad and speed {speed_mps} m/s; give finite numbers"
        )


@dataclass(frozen=True)
class Contact:
    """The latest fix of one boat seen from outside: an opponent, or a teammate without a link of ours."""

    boat: str
    position_m: tuple[float, float]  # x, y
    heading_rad: float
    speed_mps: float  # along the heading, m/s
    fixed_s: float  # time the fix was true on the receiver's clock, s: receipt less the age the sender declared
    error_m: float  # bound of the position's error, m
    source: str  # who said so


class ContactSource(Protocol):
    """Gives the latest contacts; `read` never waits and never raises."""

    def read(self) -> Sequence[Contact]:
        """The latest contact of each boat by each of its sources, whoever is right; who was heard first comes first."""

    def close(self) -> None:
        """Give its sockets back."""


@dataclass(frozen=True)
class Alarm:
    """Something wrong with those who tell where boats are."""

    text: str  # one line a person understands
    boat: str = ""  # whose place is in doubt; empty: it is about a source as a whole
    lost: bool = False  # whether nobody can know that place, so that it cannot be kept clear of
    unlisted: bool = False  # whether the boat is not in the fleet file: then nobody keeps clear of it

    @classmethod
    def of_unlisted(cls, name: str) -> Alarm:
        """Somebody tells of a boat that the file does not have."""
        return cls(f"nobody keeps clear of {name!r}, which is not in the fleet file: add it", name, unlisted=True)


@runtime_checkable
class Alarming(Protocol):
    """A source that can say that it is not to be trusted as it was."""

    def alarms(self) -> Sequence[Alarm]:
        """What is wrong now; never waits."""


def contact_of(reading: BoatReading, error_m: float) -> Contact | None:
    """A boat's own telemetry as a contact; None while something of it was never received."""
    values = (*reading.position_m, reading.heading_rad, reading.speed_mps, reading.age_s)
    if not np.isfinite(values).all():
        return None
    fixed_s = reading.read_s - reading.age_s
    return Contact(
        reading.boat, reading.position_m, reading.heading_rad, reading.speed_mps, fixed_s, error_m, TELEMETRY
    )


def contacts_heard(
    sources: Iterable[ContactSource], listen_only: Mapping[str, Link], error_m: float
) -> tuple[Contact, ...]:
    """Return the contacts of all sources and of listen-only links, whose positions are off by at most ``error_m``."""
    own = [contact_of(link.read(), error_m) for link in listen_only.values()]
    heard = [contact for source in sources for contact in source.read()]
    return (*heard, *(contact for contact in own if contact is not None))


@dataclass(frozen=True)
class Snapshot:
    """The game as the loop sees it at one tick: what a policy is shown."""

    number: int  # of the tick
    taken_s: float  # time of the tick, s
    # (n, 4) of all boats of the file in its order: x m, y m, heading deg clockwise from the y axis, speed m/s, run on
    # to ``taken_s``; NaN: never seen
    seen: Array
    # state of the game as the referee last sent it; empty: none yet
    game: Mapping[str, Any] = field(default_factory=dict)
    game_age_s: float = NEVER_S  # its age, s; inf: none yet


@dataclass(frozen=True)
class Answer:
    """The latest answer of a policy."""

    # absolute commands of all boats of the file in its order, NaN where it has none; None: none yet
    commands: Commands | None = None
    age_s: float = NEVER_S  # time since the tick whose snapshot it answers, s; inf: none yet
    fault: str = ""  # what is wrong with the policy now, for a person; empty: nothing


class NominalSource(Protocol):
    """A policy somewhere else; no call ever waits or raises."""

    def offer(self, snapshot: Snapshot) -> None:
        """Show it the latest snapshot; older ones it has not looked at are dropped."""
        return

    def latest(self) -> Answer:
        """Its latest answer."""

    def close(self) -> None:
        """End it."""
        return


@dataclass(frozen=True)
class Action:
    """Something declared that took effect, for one boat or contact."""

    subject: str  # name of the boat, contact, policy or link it is about
    condition: str  # what happened, such as "telemetry", "contact", "policy", "link", "override", "stop_all"
    response: str  # what is done, such as "hold_course", "slow", "hold_station", "stop"; "none": it is only said
    text: str  # one line a person understands


@dataclass(frozen=True)
class Tick:
    """One turn of the loop: everything it took in, decided and sent; what the black box and the dashboard get."""

    number: int  # 0, 1, ... since the start
    due_s: float  # when the turn was due, began and had sent its last command, s
    began_s: float
    sent_s: float
    readings: Mapping[str, BoatReading]  # of own boats, by name
    contacts: tuple[Contact, ...]  # of others, as received
    # what the shield was given; None when no fleet could be built (then all boats are told to stop)
    fleet: Fleet | None
    nominal: Commands | None  # what the shield was given; rows in the fleet's order
    surroundings: Surroundings | None  # what the shield was given
    decisions: Decisions | None  # the shield's answer, or None
    shield_reset: bool  # whether `Shield.reset` was called before this decision
    sent: Mapping[str, Sent]  # what left, by boat
    policy_age_s: float  # age of the policy's answer, s; inf: none yet
    actions: tuple[Action, ...] = ()  # what was declared and took effect
    game: Mapping[str, Any] = field(default_factory=dict)  # state of the game as received, for the record


class TickSink(Protocol):
    """Gets every tick: the black box, the dashboard."""

    def take(self, tick: Tick) -> None:
        """Take one tick; never waits.

        `BridgeError`: ticks can no longer be kept (the disk is full, the writer died): the loop falls back as declared.
        """

    def close(self) -> None:
        """Finish what was begun."""
