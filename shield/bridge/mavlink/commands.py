"""What is said to an autopilot: heading and speed by the routes seen to work, and questions that wait for answers.

Velocity with yaw drives boats backwards on every southward course, body-frame yaw is relative at receipt, and
MAV_CMD_NAV_SET_YAW_SPEED was removed: none of them is here.
"""

from __future__ import annotations

import math
import struct
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...exceptions import LinkError, LinkRefused
from ..clock import Clock
from ..messages import never

ATTITUDE_MASK, YAW_RATE_MASK, VELOCITY_MASK = 7, 3, 3527
"""The quaternion and the thrust count; the yaw rate counts instead; only the velocity counts."""
CREEP_MPS = 1e-3  # a velocity of length zero has no direction: so slow a one keeps the heading
OLDEST = (4, 0)
TOP_SPEED = "WP_SPEED"

MODES = {
    0: "MANUAL", 1: "ACRO", 3: "STEERING", 4: "HOLD", 5: "LOITER", 6: "FOLLOW", 7: "SIMPLE", 8: "DOCK", 9: "CIRCLE",
    10: "AUTO", 11: "RTL", 12: "SMART_RTL", 15: "GUIDED", 16: "INITIALISING",
}  # fmt: skip
"""Of ArduPilot Rover, by number."""
GUIDED, HOLD = "GUIDED", "HOLD"

ASK_AGAIN_S, LEARN_AGAIN_S = 0.7, 0.4
_ROUND_S = 0.15  # rounds of questions are at least this far apart, so that one gap in the radio does not cost all tries
_TRIES = 3  # a parameter asked for so often and never answered is one this firmware lacks
SAID_S = 15.0  # what an autopilot said so recently belongs to a refusal
_PIECE, _MOST_PIECES = 50, 20


@dataclass(frozen=True)
class Encoded:
    """A message and what it says after rounding: heading rad clockwise from true north, speed m/s, cut to a limit."""

    message: Any
    heading_rad: float
    speed_mps: float
    limit_mps: float = math.inf


@dataclass(frozen=True)
class AttitudeRoute:
    """SET_ATTITUDE_TARGET: yaw of the quaternion, thrust as a share of WP_SPEED (``top_mps``, > 0), negative astern."""

    top_mps: float
    name: ClassVar[str] = "SET_ATTITUDE_TARGET"

    def encode(self, target: tuple[int, int], boot_ms: int, heading_rad: float, speed_mps: float) -> Encoded:
        """The message for a heading (rad clockwise from true north) and a speed (m/s)."""
        w, z = _float32(math.cos(0.5 * heading_rad)), _float32(math.sin(0.5 * heading_rad))
        thrust = _float32(min(1.0, max(-1.0, speed_mps / self.top_mps)))
        message = self._message(target, boot_ms, ATTITUDE_MASK, w, z, thrust)
        return Encoded(message, 2.0 * math.atan2(z, w) % (2.0 * math.pi), thrust * self.top_mps, self.top_mps)

    def straight_stop(self, target: tuple[int, int], boot_ms: int) -> Any:
        """Stop without turning, for a boat whose heading nobody knows."""
        return self._message(target, boot_ms, YAW_RATE_MASK, 1.0, 0.0, 0.0)

    def _message(self, target: tuple[int, int], boot_ms: int, mask: int, w: float, z: float, thrust: float) -> Any:
        return mavlink.MAVLink_set_attitude_target_message(
            boot_ms, *target, mask, [w, 0.0, 0.0, z], 0.0, 0.0, 0.0, thrust
        )


@dataclass(frozen=True)
class VelocityRoute:
    """SET_POSITION_TARGET_LOCAL_NED, velocity only; cannot go astern. None: WP_SPEED cannot be read."""

    top_mps: float | None
    name: ClassVar[str] = "SET_POSITION_TARGET_LOCAL_NED"

    def encode(self, target: tuple[int, int], boot_ms: int, heading_rad: float, speed_mps: float) -> Encoded:
        """The message for a heading (rad clockwise from true north) and a speed (m/s)."""
        top = math.inf if self.top_mps is None else self.top_mps
        speed = min(top, max(CREEP_MPS, speed_mps))
        north, east = _float32(speed * math.cos(heading_rad)), _float32(speed * math.sin(heading_rad))
        message = mavlink.MAVLink_set_position_target_local_ned_message(
            boot_ms, *target, mavlink.MAV_FRAME_LOCAL_NED, VELOCITY_MASK,
            0.0, 0.0, 0.0, north, east, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        )  # fmt: skip
        return Encoded(message, math.atan2(east, north) % (2.0 * math.pi), math.hypot(north, east), top)


Route = AttitudeRoute | VelocityRoute
CAPABILITIES = {
    AttitudeRoute.name: int(mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET),
    VelocityRoute.name: int(mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED),
}
"""The capability that each route needs, as an autopilot says what it can."""
ROUTES = tuple(CAPABILITIES)  # names of the routes, best first


def _float32(value: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", value))[0])


@dataclass(frozen=True)
class Abilities:
    """What an autopilot said of itself."""

    version: tuple[int, int, int] | None = None  # major, minor, patch; None when it did not say
    capabilities: int = 0  # MAV_PROTOCOL_CAPABILITY bits; 0 when it did not say
    top_mps: float | None = None  # WP_SPEED, m/s; None when it did not say


def check_route(route: str) -> str:
    """The name of a route or "auto".

    Raises:
        LinkError: there is none of that name.
    """
    if route not in ("auto", *ROUTES):
        raise LinkError(f"there is no route {route!r}; give auto, {' or '.join(ROUTES)}")
    return route


def choose_route(boat: str, route: str, abilities: Abilities) -> Route:
    """The first way the autopilot can be commanded in.

    Raises:
        LinkRefused: the autopilot is too old, cannot do the route asked for, or would not move.
    """
    version, top = abilities.version, abilities.top_mps
    if version is not None and version[:2] < OLDEST:
        raise LinkRefused(f"boat {boat}: firmware {'.'.join(map(str, version))} is too old; install ArduPilot Rover 4")
    if top is not None and not 0.0 < top < math.inf:
        raise LinkRefused(f"boat {boat}: parameter WP_SPEED is {top:g}, so it would not move; set it to its top speed")
    asked = ROUTES if route == "auto" else (route,)
    can = [name for name in asked if abilities.capabilities & CAPABILITIES[name]]
    for name in can:
        if name == VelocityRoute.name:
            return VelocityRoute(top)
        if top is not None:
            return AttitudeRoute(top)
    why = f"it cannot do {' or '.join(name for name in asked if name not in can)}"
    why = "its WP_SPEED cannot be read" if len(can) == len(asked) else why
    why = why if abilities.capabilities else "it did not answer what it can do"
    raise LinkRefused(
        f"boat {boat}: no way to command heading and speed ({why}); give route auto, or install ArduPilot Rover 4 with "
        "guided control by MAVLink"
    )


def command(target: tuple[int, int], number: int, *values: float) -> Any:
    """COMMAND_LONG with its first parameters; the others are 0."""
    return mavlink.MAVLink_command_long_message(*target, number, 0, *values, *[0] * (7 - len(values)))


def mode_request(target: tuple[int, int], mode: str) -> Any:
    """The command that asks for a mode."""
    number = next(number for number, name in MODES.items() if name == mode)
    return command(target, mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, number)


class Patience:
    """A deadline on the loop's clock that real time also ends, so that a clock that stands still cannot hang a start.

    Args:
        clock: the loop's.
        timeout_s: s.
        is_off: true once what is waited for is no longer needed.
    """

    def __init__(self, clock: Clock, timeout_s: float, is_off: Callable[[], bool] = never) -> None:
        self._clock, self.is_off = clock, is_off
        self._end_s, self._real_end_s = clock.now_s() + timeout_s, time.monotonic() + timeout_s

    @property
    def is_over(self) -> bool:
        """Whether the time is up, or it was called off."""
        return self.is_off() or self._clock.now_s() >= self._end_s or time.monotonic() >= self._real_end_s

    def part(self, timeout_s: float) -> Patience:
        """A shorter one that is over with this one."""
        left = min(self._end_s - self._clock.now_s(), self._real_end_s - time.monotonic())
        return Patience(self._clock, max(0.0, min(timeout_s, left)), self.is_off)


class Dialogue:
    """Questions to one autopilot and its answers: commands, parameters, what it can do, what it says.

    Answers are taken in on the link's thread; questions are asked, and waited for, on the caller's.

    Attributes:
        changed: notified whenever something came in; its lock guards all a link knows of its boat.
        parameters: by name, as last heard.
        version, capabilities: of AUTOPILOT_VERSION.
    """

    def __init__(self, target: tuple[int, int], send: Callable[[Any], bool], clock: Clock) -> None:
        self.changed = threading.Condition(threading.RLock())
        self.parameters: dict[str, float] = {}
        self.version: tuple[int, int, int] | None = None
        self.capabilities = 0
        self._target, self._send, self._clock = target, send, clock
        self._pieces: dict[int, list[str]] = {}
        self._said: deque[tuple[float, str]] = deque(maxlen=50)
        self._unread: deque[str] = deque(maxlen=100)
        self._results: dict[int, int] = {}
        self._asked_s: dict[int, float] = {}
        self._tries: Counter[str] = Counter()
        self._answers: Counter[str] = Counter()

    @property
    def abilities(self) -> Abilities:
        """What is known of the autopilot."""
        return Abilities(self.version, self.capabilities, self.parameters.get(TOP_SPEED))

    def asked_s(self, command: int) -> float:
        """When that command was given last, s; -inf: never."""
        return self._asked_s.get(command, -math.inf)

    def hear(self, message: Any, now_s: float) -> list[str]:
        """Take an answer in; the caller holds the lock.

        Returns:
            What the autopilot said in words with this message.
        """
        name, said = message.get_type(), []
        if name == "COMMAND_ACK":
            self._results[message.command] = message.result
        elif name == "PARAM_VALUE":
            self._hear_parameter(str(message.param_id).rstrip("\x00"), message.param_value)
        elif name == "AUTOPILOT_VERSION":
            packed = message.flight_sw_version
            self.version = (packed >> 24, packed >> 16 & 0xFF, packed >> 8 & 0xFF)
            self.capabilities = message.capabilities
        elif name == "STATUSTEXT":
            said = self._hear_text(message)
            for text in said:
                self.say(text, now_s)
        return said

    def say(self, text: str, now_s: float) -> None:
        """Keep a text for the next reading and for refusals."""
        if text:
            self._said.append((now_s, text))
            self._unread.append(text)

    def take_texts(self) -> tuple[str, ...]:
        """Texts since this was last asked."""
        texts = tuple(self._unread)
        self._unread.clear()
        return texts

    def said(self) -> str:
        """What the autopilot said lately, each text once, for a refusal."""
        now_s = self._clock.now_s()
        recent = dict.fromkeys(text for at, text in self._said if now_s - at <= SAID_S)
        return "; ".join(recent) or "it gave no reason"

    def wait(self, holds: Callable[[], bool], patience: Patience) -> bool:
        """Wait until something holds; False when the time is up first."""
        with self.changed:
            while not holds():
                if patience.is_over:
                    return False
                self.changed.wait(0.02)
            return True

    def command(self, message: Any, patience: Patience) -> int | None:
        """Send a command again and again until it is answered.

        Returns:
            MAV_RESULT, or None when no answer came in time.
        """
        running = int(mavlink.MAV_RESULT_IN_PROGRESS)
        with self.changed:
            self._results.pop(message.command, None)
        while not patience.is_over:
            self._asked_s[message.command] = self._clock.now_s()
            self._send(message)
            if self.wait(lambda: self._results.get(message.command, running) != running, patience.part(ASK_AGAIN_S)):
                return self._results[message.command]
        return None

    def learn(self, needed: str, others: tuple[str, ...], patience: Patience) -> None:
        """Ask for parameters and for what the autopilot can do; waits for the needed one, others get a few tries.

        The needed one is asked for last in each round: once that is answered, what firmware lacks is waited for no
        longer.
        """
        while not patience.is_over:
            with self.changed:
                unknown = [name for name in others if name not in self.parameters and self._tries[name] < _TRIES]
                if not unknown and needed in self.parameters and self.version is not None:
                    return
                answers = self._answers[needed]

            def is_told(answers: int = answers) -> bool:
                return self.version is not None and self._answers[needed] > answers

            if self.version is None:
                number = mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
                self._send(command(self._target, mavlink.MAV_CMD_REQUEST_MESSAGE, number))
            for name in (*unknown, needed):
                self.ask_parameter(name)
            self.wait(is_told, patience.part(LEARN_AGAIN_S))
            self.wait(
                lambda: self.version is not None and all(name in self.parameters for name in (needed, *others)),
                patience.part(_ROUND_S),
            )

    def ask_parameter(self, name: str) -> None:
        """Ask for one parameter."""
        self._tries[name] += 1
        self._send(mavlink.MAVLink_param_request_read_message(*self._target, name.encode(), -1))

    def _hear_parameter(self, name: str, value: float) -> None:
        if not self._tries[name]:
            return  # nobody asked: others' parameters must not fill memory
        self._answers[name] += 1
        if math.isfinite(value):
            self.parameters[name] = float(value)
        else:
            self.parameters.pop(name, None)  # what it was is not known any more

    def _hear_text(self, message: Any) -> list[str]:
        """Whole texts this message completes; pieces of an older text that lost some are given as they are.

        A boat's words go to a terminal and a log: no control characters.
        """
        text = "".join(c if c.isprintable() else "?" for c in message.text)
        if message.id == 0:
            return [text] if text else []
        done = ["".join(self._pieces.pop(key)) for key in list(self._pieces) if key != message.id]
        pieces = self._pieces.setdefault(message.id, [])
        pieces.append(text)
        if len(text) < _PIECE or len(pieces) >= _MOST_PIECES:
            done.append("".join(self._pieces.pop(message.id)))
        return [entry for entry in done if entry]
