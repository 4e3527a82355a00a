"""`MavlinkLink`: one ArduPilot boat by the contract of `messages.Link`: heard, made to obey, left in HOLD."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...exceptions import LinkError, LinkRefused
from ..autopilot_parameters import ASKED, FENCE_ASKED
from ..clock import Clock
from ..frame import FieldFrame
from ..messages import NEVER_S, BoatReading, Link, Sent, check_finite, never
from .autopilot import Autopilot
from .commands import (
    GUIDED,
    HOLD,
    TOP_SPEED,
    AttitudeRoute,
    Encoded,
    Patience,
    check_route,
    choose_route,
    command,
    mode_request,
)
from .connection import Endpoint
from .fence import FenceZone, Point

LOG = logging.getLogger(__name__)

STILL_MPS = 0.3
STOP_S, HOLD_S = 12.0, 4.0  # a boat at 3 m/s that is left alone needs 5.6 s to stop
_RESEND_S, _LEARN_S, _TRY_AGAIN_S, _FENCE_S = 0.1, 10.0, 2.0, 5.0


@dataclass(frozen=True)
class LinkHealth:
    """State of one link at one moment."""

    rates_hz: Mapping[str, float]  # arrivals of each message asked for, by name
    missing: str  # needed messages that do not arrive at the rate asked for, in words; empty: all do
    round_trips_s: tuple[float, ...]  # of the last TIMESYNC answers, s, newest last
    shortest_delay_s: float  # what the quickest telemetry took, s; 0 while no round trip is known
    clock_starts: int  # how often the boat's clock began anew
    wall_ahead_s: float  # this machine's wall clock less the boat's GPS time, s; NaN: not heard
    fix_type: int  # GPS_FIX_TYPE of the best receiver; -1: not heard
    version: tuple[int, int, int] | None  # of the firmware; None: not heard
    parameters: Mapping[str, float]  # read so far
    signs: bool  # whether signing is on
    stations: frozenset[tuple[int, int]]  # other ground stations heard, as (system, component)
    other_commander_s: float  # when somebody else was last seen commanding the boat, s; -inf: never
    faults: Mapping[str, int]  # of the whole wire since it was opened, by kind
    commander: str = ""  # who that was, in words; empty: nobody
    fix_fault: str = ""  # why its positions are not believed for want of a fix, in words; empty: they may be
    # zones of the autopilot's own fence; None: not heard, or not asked for because the fence is off
    fence: tuple[FenceZone, ...] | None = None
    home_deg: Point | None = None  # latitude and longitude of its home, deg; None: not heard


class MavlinkLink(Link):
    """One boat. `connect`, `prepare`, then `read` and `send` at the loop's rate, then `close`; see `messages.Link`.

    Signing is the endpoint's: all boats on a wire have one key.

    Attributes:
        autopilot: what the boat said.
        endpoint, system_id: as given.

    Args:
        boat: its name.
        endpoint: the wire it answers on; may be shared with other boats.
        system_id: its autopilot's.
        frame: of the field.
        clock: the loop's.
        rate_hz: of the telemetry asked for, at most 40.
        route: "auto", or the name of a command message; see `commands`.

    Raises:
        LinkError: the rate, the route or the system id is none.
    """

    def __init__(
        self,
        boat: str,
        endpoint: Endpoint,
        system_id: int,
        frame: FieldFrame,
        clock: Clock,
        *,
        rate_hz: float = 20.0,
        route: str = "auto",
    ) -> None:
        self.boat, self.endpoint, self.system_id = boat, endpoint, system_id
        self.autopilot = Autopilot(boat, endpoint, system_id, frame, clock, rate_hz)
        self._chosen_route = check_route(route)
        self._frame, self._clock = frame, clock
        self._attached, self._last_rad, self._started_s = False, math.nan, clock.now_s()

    def connect(self, timeout_s: float) -> None:
        """Open the wire, hear the boat's heartbeat, get its streams at the rate asked for, all of it in time."""
        patience = Patience(self._clock, timeout_s)
        boat, dialogue = self.autopilot, self.autopilot.dialogue
        self.endpoint.attach(boat.system_id, boat)
        self._attached = True
        if not dialogue.wait(lambda: boat.heartbeat is not None, patience):
            raise LinkError(self._silence(timeout_s))
        if boat.heartbeat is not None and boat.heartbeat.unfit:
            raise LinkError(f"boat {self.boat} (system id {boat.system_id}): {boat.heartbeat.unfit}; correct the file")
        if not dialogue.wait(lambda: not boat.streams.missing(self._clock.now_s()), patience):
            missing = boat.streams.missing(self._clock.now_s())
            raise LinkError(
                f"boat {self.boat} sends {missing} after {timeout_s:g} s; give a lower rate_hz, or a faster link"
            )

    def learn(self, timeout_s: float) -> None:
        """Ask what the autopilot can do and for the parameters that checks look at; what it does not answer is left."""
        patience, dialogue, fence = Patience(self._clock, timeout_s), self.autopilot.dialogue, self.autopilot.fence
        dialogue.learn(TOP_SPEED, ASKED, patience)
        if dialogue.parameters.get("FENCE_ENABLE", 0.0) == 0.0:
            return
        dialogue.learn(TOP_SPEED, FENCE_ASKED, patience)
        patience = Patience(self._clock, _FENCE_S)
        while not fence.is_known and not patience.is_over:
            fence.ask()
            dialogue.wait(lambda: fence.is_known, patience.part(_RESEND_S))

    def prepare(self, timeout_s: float, is_off: Callable[[], bool] = never) -> None:
        """Read what the autopilot can do and choose the route; GUIDED; arm, all checks on.

        `LinkError` also where somebody took the boat meanwhile.
        """
        boat, dialogue, patience = self.autopilot, self.autopilot.dialogue, Patience(self._clock, timeout_s, is_off)
        if boat.heartbeat is None:
            raise LinkError(f"boat {self.boat}: not connected; call connect first")
        dialogue.learn(TOP_SPEED, ASKED, patience.part(_LEARN_S))
        boat.route = choose_route(self.boat, self._chosen_route, dialogue.abilities)
        self._reach(mode_request(boat.target, GUIDED), lambda: boat.mode == GUIDED, "GUIDED", patience)
        arm = command(boat.target, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)  # all checks on
        self._reach(arm, lambda: boat.is_armed, "arming", patience)
        with dialogue.changed:  # ours from now on, unless a pilot took it since, or nobody wants it any more
            taken = boat.released, boat.released_by
            self._check_still_taken(patience)
            if boat.mode != GUIDED or not boat.is_armed:
                state = "armed" if boat.is_armed else "disarmed"
                raise LinkError(f"boat {self.boat}: {state} in {boat.mode} again; see who else commands it")
            boat.expects_guided, boat.released, boat.released_by = True, "", ""
        if not dialogue.wait(lambda: not boat.why_not(self._clock.now_s()), patience):
            with dialogue.changed:
                text = boat.why_not(self._clock.now_s())
                if not boat.released:
                    boat.released, boat.released_by = taken
            raise LinkError(f"boat {self.boat}: {text}; put that right, then start again")

    def read(self) -> BoatReading:
        """The latest of everything; never waits."""
        boat = self.autopilot
        with boat.dialogue.changed:
            now_s, seen, why_not = self._clock.now_s(), boat.telemetry, boat.why_not(self._clock.now_s())
            heading_rad, heading_s = seen.heading
            heard_s = -NEVER_S if boat.heartbeat is None else boat.heartbeat.received_s
            return BoatReading(
                boat=self.boat,
                read_s=now_s,
                position_m=seen.position_m,
                position_age_s=max(0.0, now_s - seen.position_s),
                heading_rad=self._frame.heading_to_field_rad(heading_rad),
                heading_age_s=max(0.0, now_s - heading_s),
                speed_mps=seen.speed_mps,
                course_rad=self._frame.heading_to_field_rad(seen.course_rad),
                velocity_age_s=max(0.0, now_s - seen.velocity_s),
                turn_rate_rads=seen.turn_rate_rads,
                turn_rate_age_s=max(0.0, now_s - seen.turn_rate_s),
                mode=boat.mode,
                ready=not why_not,
                why_not=why_not,
                released=bool(boat.released),
                released_by=boat.released_by,
                failsafe_over=boat.failsafe_over,
                heartbeat_age_s=max(0.0, now_s - heard_s),
                commander=boat.commander,
                texts=boat.dialogue.take_texts(),
                faults=boat.take_faults(),
            )

    def send(self, heading_rad: float, speed_mps: float) -> Sent:
        """Send a command as it is; never waits. `LinkError` where a value is not finite."""
        check_finite(self.boat, heading_rad, speed_mps)
        route = self.autopilot.route
        if route is None:
            return Sent(self.boat, self._clock.now_s(), heading_rad, speed_mps, "none: the boat is not prepared", False)
        true_rad = self._frame.heading_to_true_rad(heading_rad)
        return self._send(route.name, route.encode(self.autopilot.target, self._boot_ms(), true_rad, speed_mps))

    def stop(self) -> Sent:
        """Speed 0 on the present heading, on the last one sent, or straight on; never waits, never raises."""
        boat = self.autopilot
        route = boat.route or AttitudeRoute(1.0)
        with boat.dialogue.changed:
            heading_rad = boat.telemetry.heading[0]
        heading_rad = heading_rad if math.isfinite(heading_rad) else self._last_rad
        if not math.isfinite(heading_rad) and isinstance(route, AttitudeRoute):
            sent = boat.send(route.straight_stop(boat.target, self._boot_ms()))
            return Sent(self.boat, self._clock.now_s(), math.nan, 0.0, f"{route.name}, turn rate 0", sent)
        heading_rad = heading_rad if math.isfinite(heading_rad) else 0.0
        return self._send(route.name, route.encode(boat.target, self._boot_ms(), heading_rad, 0.0))

    def close(self) -> str:
        """Stop the boat, put it in HOLD, verify both, give the link back; may be called again."""
        if not self._attached:
            return f"{self.boat}: not connected; nothing was sent"
        try:
            return self._leave()
        finally:
            self.release()

    def release(self) -> None:
        """Give the link back without a word to the boat: for one that was only listened to."""
        if self._attached:
            self._attached = False
            self.endpoint.detach(self.system_id)

    def health(self) -> LinkHealth:
        """What the link knows of itself: rates, round trips, the boat's clock, other commanders."""
        boat = self.autopilot
        with boat.dialogue.changed:
            now_s, seen, dialogue = self._clock.now_s(), boat.telemetry, boat.dialogue
            return LinkHealth(
                rates_hz=boat.streams.rates_hz(now_s),
                missing=boat.streams.missing(now_s),
                round_trips_s=tuple(boat.trips_s),
                shortest_delay_s=seen.clock.shortest_delay_s,
                clock_starts=seen.clock.starts,
                wall_ahead_s=seen.wall_ahead_s,
                fix_type=seen.fix.fix_type,
                version=dialogue.version,
                parameters=dict(dialogue.parameters),
                signs=self.endpoint.codec.signs,
                stations=frozenset(boat.stations),
                other_commander_s=boat.commanded_s,
                faults=dict(self.endpoint.faults),
                commander=boat.commander,
                fix_fault=seen.fix.fault(now_s)[1],
                fence=boat.fence.zones,
                home_deg=boat.fence.home_deg,
            )

    def _send(self, route: str, encoded: Encoded) -> Sent:
        delivered = self.autopilot.send(encoded.message)
        self._last_rad = encoded.heading_rad
        heading_rad, now_s = self._frame.heading_to_field_rad(encoded.heading_rad), self._clock.now_s()
        return Sent(self.boat, now_s, heading_rad, encoded.speed_mps, route, delivered, encoded.limit_mps)

    def _boot_ms(self) -> int:
        return int((self._clock.now_s() - self._started_s) * 1000.0) & 0xFFFFFFFF

    def _reach(self, request: Any, holds: Callable[[], bool], what: str, patience: Patience) -> None:
        """Ask until the heartbeat shows it: an acknowledgement alone is not believed."""
        dialogue, result = self.autopilot.dialogue, None
        while not holds():
            answer = dialogue.command(request, patience.part(_TRY_AGAIN_S))
            result = result if answer is None else answer
            if dialogue.wait(holds, patience.part(_TRY_AGAIN_S)):
                return
            if patience.is_over:
                break
        else:
            return
        self._check_still_taken(patience)
        if result is None:
            raise LinkError(f"boat {self.boat}: no answer to the request for {what}; check the radio, then start again")
        if result == mavlink.MAV_RESULT_ACCEPTED:
            raise LinkError(f"boat {self.boat}: accepted {what} and did not do it; check who else commands it")
        entry = mavlink.enums["MAV_RESULT"].get(result)
        name = f"result {result}" if entry is None else str(entry.name)
        why = name.removeprefix("MAV_RESULT_").lower().replace("_", " ")
        raise LinkRefused(
            f"boat {self.boat} refuses {what} ({why}): {dialogue.said()}; put that right, then start again"
        )

    def _check_still_taken(self, patience: Patience) -> None:
        if patience.is_off():
            raise LinkError(f"boat {self.boat}: taking it was called off; it is left alone")

    def _leave(self) -> str:
        """Stop the boat and put it in HOLD; what it was left doing, in words. Never raises."""
        boat, name, seen = self.autopilot, self.boat, self.autopilot.telemetry
        ours, boat.expects_guided = boat.expects_guided and not boat.released, False
        if boat.heartbeat is None:
            return f"{name}: never heard; nothing was sent, see where it is"
        if not (ours and boat.mode == GUIDED and boat.is_armed):
            state = "armed" if boat.is_armed else "disarmed"
            return f"{name}: left alone, {state} in {boat.mode}: it was not under our command"

        def is_still() -> bool:
            is_fresh = self._clock.now_s() - seen.velocity_s < 1.0
            return is_fresh and math.hypot(*seen.velocity_mps) < STILL_MPS

        patience, stopped, held = Patience(self._clock, STOP_S), False, False
        while not (stopped or patience.is_over):
            self.stop()
            stopped = boat.dialogue.wait(is_still, patience.part(_RESEND_S))
        patience = Patience(self._clock, HOLD_S)
        while not (held or patience.is_over):
            boat.dialogue.command(mode_request(boat.target, HOLD), patience.part(1.0))
            held = boat.dialogue.wait(lambda: boat.mode == HOLD, patience.part(1.0))
        is_known = self._clock.now_s() - seen.velocity_s < 5.0
        speed = f"speed {math.hypot(*seen.velocity_mps):.1f} m/s" if is_known else "speed unknown"
        if held:
            return f"{name}: in HOLD, {speed}" + ("" if stopped else "; it was not seen to stop: watch it")
        if stopped:
            return f"{name}: {speed}, HOLD not confirmed; its own time-out keeps it stopped, take it over by hand"
        return f"{name}: NOT seen to stop ({speed}); its own time-out stops it 3 s after the last command: take it over"

    def _silence(self, timeout_s: float) -> str:
        boat = self.autopilot
        refused = ", ".join(f"{count} {kind}" for kind, count in sorted(boat.refused().items()))
        start = f"boat {self.boat}: no heartbeat of system id {boat.system_id} on {self.endpoint.address}"
        start += f" in {timeout_s:g} s"
        if boat.others:
            start += f"; heard system ids {', '.join(map(str, sorted(boat.others)))} there"
        if not refused:
            return f"{start}; check power, radio, address and SYSID_THISMAV"
        same_key = "give both sides the same key and check their clocks"
        return f"{start}; refused: {refused}; {same_key if self.endpoint.codec.signs else 'check the radio'}"
