"""`Autopilot`: all that is known of one boat from what it sends; runs on the wire's thread under one lock."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

from ...exceptions import LinkError
from ..clock import Clock
from ..frame import FieldFrame
from .commanders import Commanders
from .dialogue import Dialogue
from .endpoint import Endpoint
from .health import RoundTrips
from .modes import GUIDED, Heartbeat, read_heartbeat
from .obedience import Obedience
from .preparation import TOP_SPEED
from .reception import AUTOPILOT
from .routes import AttitudeRoute, Route
from .streams import ATTITUDE, Streams, interval_request
from .telemetry import Telemetry

HEARTBEAT_LOST_S = 3.5
"""Without a heartbeat for so long the boat is not taken to obey."""
OLD_S = 1.0
"""Older telemetry says nothing about obedience."""
_RECHECK_S = 5.0


class Autopilot:
    """Takes in what one boat says (an `reception.Receiver`) and asks for what it should say.

    Args:
        boat: its name.
        endpoint: the wire it answers on.
        system_id: its autopilot's.
        frame: of the field.
        clock: the loop's.
        rate_hz: of the telemetry asked for, at most 40.

    Attributes:
        dialogue: questions and answers; ``dialogue.changed`` is the lock of everything here.
        heartbeat: the last; None before the first.
        route: how heading and speed are commanded; None until prepared, or when that is known no more.
        others: system ids of other vehicles heard on the wire.
        expects_guided: whether leaving GUIDED or being disarmed is somebody else's doing.
        released: what took it from us, such as a mode; empty: it is ours. Only `preparation.prepare` takes it back.

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
        self.streams = Streams(rate_hz)
        self.telemetry = Telemetry(frame)
        self.commanders = Commanders(boat, system_id, endpoint.codec.source)
        self.trips = RoundTrips()
        self.obedience = Obedience()
        self.heartbeat: Heartbeat | None = None
        self.route: Route | None = None
        self.expects_guided = False
        self.released = ""
        self.others: set[int] = set()
        self._faults: Counter[str] = Counter()
        self._recheck_s = -math.inf

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
        if beat.mode != GUIDED:
            return f"it is in {beat.mode}; commands are obeyed in GUIDED only"
        if not beat.armed:
            return "it is disarmed"
        if self.released:
            return f"it was taken from us ({self.released}) and given back; take it back by key or start again"
        return "" if self.route is not None else "not prepared"

    def send(self, message: Any) -> bool:
        """Send any message to the boat; False when it did not leave."""
        return self.endpoint.send(self.system_id, message)

    def told(self, heading_rad: float, speed_mps: float, now_s: float) -> None:
        """A command left, heading rad clockwise from true north: from now on the boat is expected to do that."""
        with self.dialogue.changed:
            if self.why_not(now_s):
                self.telemetry.told_speed(0.0, now_s)
                self.obedience.forget()
            else:
                self.telemetry.told_speed(speed_mps, now_s)
                self.obedience.told(heading_rad, speed_mps, now_s)

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
        """See `reception.Receiver`."""
        with self.dialogue.changed:
            self.streams.hear(message.get_msgId(), received_s)
            name = message.get_type()
            if name == "HEARTBEAT":
                self._hear_heartbeat(message, received_s)
            elif name == "TIMESYNC":
                self.trips.hear(message, received_s, self.telemetry.clock)
            elif name == "COMMAND_ACK":
                asked_s = self.dialogue.asked_s(message.command) if self.expects_guided else received_s
                self._note(*self.commanders.hear_answer(message, asked_s, received_s), received_s)
            elif name == "PARAM_VALUE":
                self._hear_top_speed(message, received_s)
            else:
                self._hear_telemetry(message, received_s)
            self.dialogue.hear(message, received_s)
            self.dialogue.changed.notify_all()

    def on_foreign(self, message: Any, received_s: float) -> None:
        """See `reception.Receiver`."""
        with self.dialogue.changed:
            self._note(*self.commanders.hear_foreign(message, received_s), received_s)
            if message.get_type() == "HEARTBEAT" and read_heartbeat(message, received_s) is not None:
                self.others.add(message.get_srcSystem())

    def on_refused(self, kind: str, count: int) -> None:
        """See `reception.Receiver`."""
        with self.dialogue.changed:
            self._faults[kind] += count

    def on_tick(self, now_s: float) -> None:
        """See `reception.Receiver`: streams, round trips, and whether WP_SPEED is still what it was."""
        if self.heartbeat is None:
            return
        with self.dialogue.changed:
            requests = self.streams.requests(now_s)
            ask = self.trips.ask(now_s)
        for message_id, interval_us in requests:
            self.send(interval_request(*self.target, message_id, interval_us))
        if ask is not None:
            self.send(ask)
        if self.route is not None and now_s - self._recheck_s >= _RECHECK_S:
            self._recheck_s = now_s
            self.dialogue.ask_parameter(TOP_SPEED)

    def _hear_telemetry(self, message: Any, received_s: float) -> None:
        starts = self.telemetry.clock.starts
        text = self.telemetry.hear(message, received_s)
        self._note("", f"{self.boat}: {text}" if text else "", received_s)
        if self.telemetry.clock.starts != starts:
            self.streams.restart()
        if message.get_msgId() == ATTITUDE:
            self._check_obedience(received_s)

    def _check_obedience(self, now_s: float) -> None:
        seen = self.telemetry
        if self.why_not(now_s) or now_s - min(seen.heading[1], seen.velocity_s) > OLD_S:
            self.obedience.forget()
            return
        fault = self.obedience.fault(seen.heading[0], seen.turn_rate_rads, seen.speed_mps, now_s)
        if fault:
            text = f"{self.boat}: {fault}: see who else commands it, or take it over by hand and check its steering"
            self._note("disobeys", text, now_s)

    def _hear_heartbeat(self, message: Any, received_s: float) -> None:
        beat = read_heartbeat(message, received_s)
        if beat is None:
            return
        before, self.heartbeat = self.heartbeat, beat
        if before is None or not self.expects_guided:
            return
        if before.mode == GUIDED and beat.mode != GUIDED:
            self.released = beat.mode
            text = (
                f"somebody or a failsafe switched it to {beat.mode}; it is left alone until the operator takes it back"
            )
            self._note("mode_changed", f"{self.boat}: {text}", received_s)
        if before.armed and not beat.armed:
            self.released = "disarmed"
            text = "somebody or a failsafe disarmed it; it is left alone until the operator takes it back"
            self._note("disarmed", f"{self.boat}: {text}", received_s)

    def _hear_top_speed(self, message: Any, now_s: float) -> None:
        """A changed WP_SPEED changes what a share of it means, at once."""
        if str(message.param_id).rstrip("\x00") != TOP_SPEED or not isinstance(self.route, AttitudeRoute):
            return
        top = float(message.param_value)
        if top == self.route.top_mps:
            return
        if math.isfinite(top) and top > 0.0:
            self.route, text = AttitudeRoute(top), "used from now on"
        else:
            self.route, text = None, "it can be commanded no more; set it to the boat's top speed, then start again"
        self._note("parameter_changed", f"{self.boat}: somebody set WP_SPEED to {top:g} m/s; {text}", now_s)

    def _note(self, fault: str, text: str, now_s: float) -> None:
        if fault:
            self._faults[fault] += 1
        self.dialogue.say(text, now_s)
