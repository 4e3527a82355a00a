"""`MavlinkLink`: one ArduPilot boat by the contract of `bridge.link`."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from types import TracebackType

from ...compat import Self
from ...exceptions import LinkError
from ..clock import Clock
from ..frame import FieldFrame
from ..messages import NEVER_S, BoatReading, Sent, never
from .autopilot import Autopilot
from .dialogue import Patience
from .endpoint import Endpoint
from .health import LinkHealth, health_of
from .preparation import learn, leave, prepare
from .routes import AttitudeRoute, Encoded, check_route

LOG = logging.getLogger(__name__)


class MavlinkLink:
    """One boat. `connect`, `prepare`, then `read` and `send` at the loop's rate, then `close`; see `bridge.link.Link`.

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
        route: "auto", or the name of a command message; see `routes`.

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
        self.boat = boat
        self.autopilot = Autopilot(boat, endpoint, system_id, frame, clock, rate_hz)
        self._wanted_route = check_route(route)
        self.endpoint, self.system_id = endpoint, system_id
        self._frame, self._clock = frame, clock
        self._attached = False
        self._last_rad = math.nan
        self._started_s = clock.now_s()

    def connect(self, timeout_s: float) -> None:
        """Open the wire, hear the boat's heartbeat, get its streams at the rate asked for.

        Raises:
            LinkError: the wire cannot be opened, no boat answers in time, it is none of ours to drive, or its streams
                do not come at the rate asked for.
        """
        patience = Patience(self._clock, timeout_s)
        boat, dialogue = self.autopilot, self.autopilot.dialogue
        self.endpoint.attach(boat.system_id, boat)
        self._attached = True
        if not dialogue.wait(lambda: boat.heartbeat is not None, patience):
            raise LinkError(self._silence(timeout_s))
        if boat.heartbeat is not None and boat.heartbeat.unfit:
            raise LinkError(f"boat {self.boat} (system id {boat.system_id}): {boat.heartbeat.unfit}; correct the file")
        if not dialogue.wait(lambda: not boat.streams.missing(self._clock.now_s()), patience):
            raise LinkError(
                f"boat {self.boat} sends {boat.streams.missing(self._clock.now_s())} after {timeout_s:g} s; "
                "give a lower rate_hz, or a faster link"
            )

    def learn(self, timeout_s: float) -> None:
        """Ask what the autopilot can do and for the parameters that checks look at; what it does not answer is left."""
        learn(self.autopilot, Patience(self._clock, timeout_s))

    def prepare(self, timeout_s: float, is_off: Callable[[], bool] = never) -> None:
        """Read what the autopilot can do and choose the route; GUIDED; arm, all checks on.

        Raises:
            LinkRefused: the autopilot says no; its own words are in the text.
            LinkError: no answer in time, called off, or somebody took the boat meanwhile.
        """
        prepare(self.autopilot, self._wanted_route, Patience(self._clock, timeout_s, is_off))

    def read(self) -> BoatReading:
        """The latest of everything; never waits."""
        boat = self.autopilot
        with boat.dialogue.changed:
            now_s = self._clock.now_s()
            seen = boat.telemetry
            heading_rad, heading_s = seen.heading
            why_not = boat.why_not(now_s)
            return BoatReading(
                boat=self.boat,
                read_s=now_s,
                position_m=seen.position_m,
                position_age_s=_age(now_s, seen.position_s),
                heading_rad=self._frame.heading_to_field_rad(heading_rad),
                heading_age_s=_age(now_s, heading_s),
                speed_mps=seen.speed_mps,
                course_rad=self._frame.heading_to_field_rad(seen.course_rad),
                velocity_age_s=_age(now_s, seen.velocity_s),
                turn_rate_rads=seen.turn_rate_rads,
                turn_rate_age_s=_age(now_s, seen.turn_rate_s),
                mode=boat.mode,
                ready=not why_not,
                why_not=why_not,
                released=bool(boat.released),
                heartbeat_age_s=NEVER_S if boat.heartbeat is None else _age(now_s, boat.heartbeat.received_s),
                texts=boat.dialogue.take_texts(),
                faults=boat.take_faults(),
            )

    def send(self, heading_rad: float, speed_mps: float) -> Sent:
        """Send a command as it is; never waits.

        Raises:
            LinkError: heading or speed is not finite; nothing is sent.
        """
        if not (math.isfinite(heading_rad) and math.isfinite(speed_mps)):
            raise LinkError(
                f"boat {self.boat} was to be sent heading {heading_rad} rad and speed {speed_mps} m/s; "
                "give finite numbers"
            )
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
        if not math.isfinite(heading_rad):
            heading_rad = self._last_rad
        if not math.isfinite(heading_rad) and isinstance(route, AttitudeRoute):
            sent = boat.send(route.straight_stop(boat.target, self._boot_ms()))
            return Sent(self.boat, self._clock.now_s(), math.nan, 0.0, f"{route.name}, turn rate 0", sent)
        heading_rad = heading_rad if math.isfinite(heading_rad) else 0.0
        return self._send(route.name, route.encode(boat.target, self._boot_ms(), heading_rad, 0.0))

    def close(self) -> str:
        """Stop the boat, put it in HOLD, verify both, give the link back; may be called again.

        Returns:
            What the boat was left doing, in words.
        """
        if not self._attached:
            return f"{self.boat}: not connected; nothing was sent"
        try:
            return leave(self.autopilot, self.stop)
        finally:
            self._attached = False
            self.endpoint.detach(self.system_id)

    def release(self) -> None:
        """Give the link back without a word to the boat: for one that was only listened to."""
        if self._attached:
            self._attached = False
            self.endpoint.detach(self.system_id)

    def health(self) -> LinkHealth:
        """What the link knows of itself: rates, round trips, the boat's clock, other commanders."""
        return health_of(self.autopilot)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        LOG.info("%s", self.close())

    def _send(self, route: str, encoded: Encoded) -> Sent:
        boat = self.autopilot
        delivered = boat.send(encoded.message)
        now_s = self._clock.now_s()
        if delivered:
            boat.told(encoded.heading_rad, encoded.speed_mps, now_s)
        self._last_rad = encoded.heading_rad
        heading_rad = self._frame.heading_to_field_rad(encoded.heading_rad)
        return Sent(self.boat, now_s, heading_rad, encoded.speed_mps, route, delivered, encoded.limit_mps)

    def _boot_ms(self) -> int:
        return int((self._clock.now_s() - self._started_s) * 1000.0) & 0xFFFFFFFF

    def _silence(self, timeout_s: float) -> str:
        boat = self.autopilot
        refused = ", ".join(f"{count} {kind}" for kind, count in sorted(boat.refused().items()))
        start = f"boat {self.boat}: no heartbeat of system id {boat.system_id} on {self.endpoint.address}"
        start += f" in {timeout_s:g} s"
        if boat.others:
            start += f"; heard system ids {', '.join(map(str, sorted(boat.others)))} there"
        if not refused:
            return f"{start}; check power, radio, address and SYSID_THISMAV"
        remedy = (
            "give both sides the same key and check their clocks" if self.endpoint.codec.signs else "check the radio"
        )
        return f"{start}; refused: {refused}; {remedy}"


def _age(now_s: float, true_s: float) -> float:
    return max(0.0, now_s - true_s)
