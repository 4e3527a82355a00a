"""`Autopilot`: all that is known of one boat from what it sends, and who else commands it."""

from __future__ import annotations

import math
import re
from collections import Counter, deque
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...exceptions import LinkError
from ..clock import Clock
from ..frame import FieldFrame
from ..messages import FAILSAFE, PILOT
from .commands import GUIDED, MODES, TOP_SPEED, AttitudeRoute, Dialogue, Route, command
from .connection import AUTOPILOT, Endpoint
from .fence import FenceReader
from .telemetry import Streams, Telemetry

HEARTBEAT_LOST_S = 3.5  # without a heartbeat for so long the boat is not taken to obey
FAILSAFE_S = 3.0  # a mode change within so long of the autopilot's word of a fail-safe, either way, is the fail-safe's
RECHECK_S = 5.0
SAY_AGAIN_S, ANSWER_S = 10.0, 10.0
"""The same fault of the same sender is said again after the first; an answer to a command of ours comes within the
second."""
OFTEN_S, SELDOM_S, OFTEN = 0.2, 1.0, 10
"""TIMESYNC is asked every so often, until it was answered so often, then every so often, s."""
EVERYBODY = 0  # target of what all autopilots on a wire obey
_MOST_STATIONS, _MOST_SAID, _OPEN = 64, 256, 16

_FAILS = re.compile(r"failsafe|fail-safe|^crash:|battery \d+ is (low|critical)|fence breach", re.IGNORECASE)
_OVER = re.compile(r"fail-?safe.*clear", re.IGNORECASE)
_BOATS = (mavlink.MAV_TYPE_SURFACE_BOAT, mavlink.MAV_TYPE_GROUND_ROVER)
_NO_VEHICLES = (
    mavlink.MAV_TYPE_GCS,
    mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
    mavlink.MAV_TYPE_GIMBAL,
    mavlink.MAV_TYPE_ADSB,
)
_STEERS = {
    "SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_MODE",
    "MANUAL_CONTROL", "RC_CHANNELS_OVERRIDE", "MISSION_SET_CURRENT", "MISSION_ITEM", "MISSION_ITEM_INT", "PARAM_SET",
    "SET_ACTUATOR_CONTROL_TARGET",
}  # fmt: skip
_ORDERS = {
    int(getattr(mavlink, f"MAV_CMD_{name}"))
    for name in (
        *("DO_SET_MODE", "COMPONENT_ARM_DISARM", "DO_CHANGE_SPEED", "NAV_SET_YAW_SPEED", "DO_REPOSITION"),
        *("MISSION_START", "NAV_RETURN_TO_LAUNCH", "NAV_LOITER_UNLIM", "DO_SET_SERVO", "PREFLIGHT_REBOOT_SHUTDOWN"),
        *("DO_MOTOR_TEST", "DO_SET_REVERSE", "DO_PAUSE_CONTINUE", "DO_AUX_FUNCTION", "DO_FLIGHTTERMINATION"),
        *("GUIDED_CHANGE_SPEED", "GUIDED_CHANGE_HEADING", "DO_GUIDED_LIMITS", "DO_SET_MISSION_CURRENT"),
        "DO_FENCE_ENABLE",
    )
}


@dataclass(frozen=True)
class Heartbeat:
    """What a boat's heartbeat says; ``unfit``: why this link cannot drive it, empty when it can."""

    mode: str
    armed: bool
    unfit: str
    received_s: float


def read_heartbeat(message: Any, received_s: float) -> Heartbeat | None:
    """What it says; None when it is no vehicle's."""
    if message.type in _NO_VEHICLES:
        return None

    def name(enum: str, number: int) -> str:
        entry = mavlink.enums[enum].get(number)
        return f"{enum} {number}" if entry is None else str(entry.name)

    unfit = (
        "" if message.type in _BOATS else f"it is a {name('MAV_TYPE', message.type)}, not a boat with ArduPilot Rover"
    )
    if message.autopilot != mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
        unfit = f"its autopilot is {name('MAV_AUTOPILOT', message.autopilot)}, not ArduPilot"
    armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
    return Heartbeat(MODES.get(message.custom_mode, f"MODE {message.custom_mode}"), armed, unfit, received_s)


class Autopilot:
    """Takes in what one boat says (a `connection.Receiver`) and asks for what it should say; under one lock.

    Its arguments are those of `vehicle.MavlinkLink`.

    Attributes:
        dialogue: questions and answers; ``dialogue.changed`` is the lock of everything here.
        fence: its own fence, as far as it was asked for.
        heartbeat: the last; None before the first.
        route: how heading and speed are commanded; None until prepared, or when that is known no more.
        others: system ids of other vehicles heard on the wire.
        stations: other ground stations heard, as (system, component).
        commanded_s: when somebody else was last seen commanding, s; -inf: never.
        commander: who that was, and what it did, in words; empty: nobody.
        trips_s: round trips of the last TIMESYNC answers, s, newest last.
        expects_guided: whether leaving GUIDED or being disarmed is somebody else's doing.
        released: what took it from us, such as a mode; empty: it is ours. Only `vehicle.prepare` takes it back.
        released_by: `PILOT` or `FAILSAFE`.
        failsafe: what the autopilot said of its fail-safe last; empty: nothing.
        failsafe_over: whether it said since that this is over.

    Raises:
        LinkError: the rate or the system id is none.
    """

    def __init__(
        self, boat: str, endpoint: Endpoint, system_id: int, frame: FieldFrame, clock: Clock, rate_hz: float
    ) -> None:
        if not 0.0 < rate_hz <= 40.0:
            raise LinkError(f"boat {boat}: telemetry rate is {rate_hz} Hz; give more than 0, at most 40")
        if not 1 <= system_id <= 255:
            raise LinkError(f"boat {boat}: system id is {system_id}; give its SYSID_THISMAV, 1 to 255")
        self.boat, self.system_id, self.endpoint, self.clock = boat, system_id, endpoint, clock
        self.target = (system_id, AUTOPILOT)
        self.dialogue = Dialogue(self.target, self.send, clock)
        self.streams, self.telemetry = Streams(rate_hz), Telemetry(frame)
        self.fence = FenceReader(self.target, self.send)
        self.heartbeat: Heartbeat | None = None
        self.route: Route | None = None
        self.expects_guided, self.released, self.released_by = False, "", ""
        self.failsafe, self.failsafe_over = "", False
        self.others: set[int] = set()
        self.stations: set[tuple[int, int]] = set()
        self.commanded_s, self.commander = -math.inf, ""
        self.trips_s: deque[float] = deque(maxlen=50)
        self._failed_s = self._released_s = self._recheck_s = self._synced_s = -math.inf
        self._open: dict[int, float] = {}
        self._answered = 0
        self._said_s: dict[tuple[str, int, int], float] = {}
        self._faults: Counter[str] = Counter()

    @property
    def mode(self) -> str:
        """Name of its mode; empty before the first heartbeat."""
        return "" if self.heartbeat is None else self.heartbeat.mode

    @property
    def is_armed(self) -> bool:
        """Whether motors may turn."""
        return self.heartbeat is not None and self.heartbeat.armed

    def why_not(self, now_s: float) -> str:
        """Why a command of heading and speed would not be obeyed now; empty when it would."""
        beat = self.heartbeat
        if beat is None:
            return "nothing heard yet"
        if now_s - beat.received_s > HEARTBEAT_LOST_S:
            return f"no heartbeat for {now_s - beat.received_s:.1f} s; check its power and radio"
        if beat.unfit:
            return beat.unfit
        by = f" (its own fail-safe: {self.failsafe})" if self.released_by == FAILSAFE else ""
        if beat.mode != GUIDED:
            return f"it is in {beat.mode}{by}; commands are obeyed in GUIDED only"
        if not beat.armed:
            return f"it is disarmed{by}"
        if self.released:
            return f"it was taken from us ({self.released}) and given back; take it back by key or start again"
        return "" if self.route is not None else "not prepared"

    def send(self, message: Any) -> bool:
        """Send any message to the boat; False when it did not leave."""
        return self.endpoint.send(self.system_id, message)

    def refused(self) -> Counter[str]:
        """What was refused so far of what claimed to be this boat's, not taken."""
        return self._faults + self.telemetry.faults

    def take_faults(self) -> dict[str, int]:
        """The same, taken: the next call begins at zero; the caller holds the lock."""
        faults = dict(self.refused())
        self._faults.clear()
        self.telemetry.faults.clear()
        return faults

    def on_message(self, message: Any, received_s: float) -> None:
        """See `connection.Receiver`."""
        with self.dialogue.changed:
            self.streams.hear(message.get_msgId(), received_s)
            name = message.get_type()
            if name == "HEARTBEAT":
                self._hear_heartbeat(message, received_s)
            elif name == "TIMESYNC":
                self._hear_time(message, received_s)
            elif name == "COMMAND_ACK":
                self._hear_answer(message, received_s)
            elif name == "PARAM_VALUE":
                self._hear_top_speed(message, received_s)
            else:
                starts = self.telemetry.clock.starts
                text = self.telemetry.hear(message, received_s)
                self._note("", f"{self.boat}: {text}" if text else "", received_s)
                if self.telemetry.clock.starts != starts:
                    self.streams.restart()
                self.fence.hear(message)
            for text in self.dialogue.hear(message, received_s):
                self._hear_words(text, received_s)
            self.dialogue.changed.notify_all()

    def on_foreign(self, message: Any, received_s: float) -> None:
        """See `connection.Receiver`: somebody else on this wire, who must not command the boat.

        A station with our own ids is a process of ours for another boat until it commands this one.
        """
        source = (message.get_srcSystem(), message.get_srcComponent())
        name, is_ours = message.get_type(), source == self.endpoint.codec.source
        target = int(getattr(message, "target_system", getattr(message, "target", -1)))
        with self.dialogue.changed:
            if name == "HEARTBEAT" and read_heartbeat(message, received_s) is not None:
                self.others.add(source[0])
            if is_ours and self.endpoint.codec.is_echo(message):
                if target in (-1, EVERYBODY, self.system_id):
                    text = "our own packets come back: a radio or router on this link reflects them; stop that"
                    self._say("echo", "echo", source, received_s, f"{text}, it costs bandwidth")
            elif name == "HEARTBEAT" and message.type == mavlink.MAV_TYPE_GCS:
                if not is_ours:
                    if len(self.stations) < _MOST_STATIONS:
                        self.stations.add(source)
                    text = f"another ground station {_who(source)} is on this link; see that it does not command"
                    self._say("", "station", source, received_s, text)
            elif target in (EVERYBODY, self.system_id):
                orders = name in ("COMMAND_LONG", "COMMAND_INT") and message.command in _ORDERS
                if orders or name in _STEERS:
                    self._tell_commander(source, received_s, f"sends {name}")

    def on_refused(self, kind: str, count: int) -> None:
        """See `connection.Receiver`."""
        with self.dialogue.changed:
            self._faults[kind] += count

    def on_tick(self, now_s: float) -> None:
        """See `connection.Receiver`: streams, round trips, and whether WP_SPEED is still what it was."""
        if self.heartbeat is None:
            return
        with self.dialogue.changed:
            requests = self.streams.requests(now_s)
            stamp = int(now_s * 1e9)
            asks = now_s - self._synced_s >= (OFTEN_S if self._answered < OFTEN else SELDOM_S)
            if asks:
                self._synced_s = self._open[stamp] = now_s
                if len(self._open) > _OPEN:
                    del self._open[next(iter(self._open))]
        for message_id, interval_us in requests:
            self.send(command(self.target, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, interval_us))
        if asks:
            self.send(mavlink.MAVLink_timesync_message(0, stamp))
        if self.route is not None and now_s - self._recheck_s >= RECHECK_S:
            self._recheck_s = now_s
            self.dialogue.ask_parameter(TOP_SPEED)

    def _hear_heartbeat(self, message: Any, received_s: float) -> None:
        beat = read_heartbeat(message, received_s)
        if beat is None:
            return
        before, self.heartbeat = self.heartbeat, beat
        if before is None or not self.expects_guided:
            return
        is_failing = received_s - self._failed_s <= FAILSAFE_S
        if self.released and (beat.mode != before.mode or beat.armed != before.armed) and not is_failing:
            self.released_by = PILOT  # whatever took it first, a hand has it now
        if before.mode == GUIDED and beat.mode != GUIDED:
            self._release("mode_changed", beat.mode, f"switched it to {beat.mode}", is_failing, received_s)
        if before.armed and not beat.armed:
            self._release("disarmed", "disarmed", "disarmed it", is_failing, received_s)

    def _release(self, fault: str, what: str, did: str, is_failing: bool, now_s: float) -> None:
        """Somebody took the boat: it is left alone until it is taken back."""
        self.released, self._released_s = what, now_s
        self.released_by = FAILSAFE if is_failing else PILOT
        who = f"its own fail-safe ({self.failsafe})" if is_failing else "somebody or a failsafe"
        text = f"{self.boat}: {who} {did}; it is left alone until the operator takes it back"
        self._note(fault, text, now_s)

    def _hear_words(self, text: str, now_s: float) -> None:
        """The autopilot's word of a fail-safe tells its mode change from a pilot's, whichever is heard first."""
        if _OVER.search(text):
            self.failsafe_over = True
        elif _FAILS.search(text):
            self.failsafe, self.failsafe_over, self._failed_s = text, False, now_s
            if self.released and now_s - self._released_s <= FAILSAFE_S:
                self.released_by = FAILSAFE

    def _hear_time(self, message: Any, received_s: float) -> None:
        """An answer to TIMESYNC: one to a question of ours, once."""
        sent_s = None if message.tc1 == 0 else self._open.pop(message.ts1, None)
        if sent_s is not None:
            self._answered += 1
            self.trips_s.append(received_s - sent_s)
            self.telemetry.clock.sync(message.tc1 * 1e-9, sent_s, received_s)

    def _hear_answer(self, message: Any, received_s: float) -> None:
        """The boat answers a command: one that we did not give shows somebody else."""
        asked = (getattr(message, "target_system", 0), getattr(message, "target_component", 0))
        asked_s = self.dialogue.asked_s(message.command) if self.expects_guided else received_s
        ours = asked == self.endpoint.codec.source and received_s - asked_s <= ANSWER_S
        if asked[0] != 0 and not ours and message.command in _ORDERS:
            self._tell_commander(asked, received_s, f"gave it command {message.command}")

    def _hear_top_speed(self, message: Any, now_s: float) -> None:
        """A changed WP_SPEED changes what a share of it means, at once."""
        if str(message.param_id).rstrip("\x00") != TOP_SPEED or not isinstance(self.route, AttitudeRoute):
            return
        top = float(message.param_value)
        if top == self.route.top_mps:
            return
        is_speed = math.isfinite(top) and top > 0.0
        self.route = AttitudeRoute(top) if is_speed else None
        text = "used from now on" if is_speed else "it can be commanded no more; set it to the boat's top speed, then"
        text += "" if is_speed else " start again"
        self._note("parameter_changed", f"{self.boat}: somebody set WP_SPEED to {top:g} m/s; {text}", now_s)

    def _tell_commander(self, source: tuple[int, int], now_s: float, what: str) -> None:
        self.commanded_s, self.commander = now_s, f"{_who(source)} {what}"
        text = f"a second commander {self.commander}: end it, two commanders undo each other's safety"
        self._say("second_commander", what, source, now_s, text)

    def _say(self, fault: str, what: str, source: tuple[int, int], now_s: float, text: str) -> None:
        """Count a fault of a sender, and say it now and then."""
        key = (what, *source)
        is_said = now_s - self._said_s.get(key, -math.inf) < SAY_AGAIN_S
        if len(self._said_s) > _MOST_SAID:
            self._said_s.clear()
        if not is_said:
            self._said_s[key] = now_s
        self._note(fault, "" if is_said else f"{self.boat}: {text}", now_s)

    def _note(self, fault: str, text: str, now_s: float) -> None:
        if fault:
            self._faults[fault] += 1
        self.dialogue.say(text, now_s)


def _who(source: tuple[int, int]) -> str:
    return f"(system {source[0]}, component {source[1]})"
