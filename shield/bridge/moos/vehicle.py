"""`MoosLink`: one boat that runs MOOS-IvP, by the contract of `messages.Link`."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import replace

from ...exceptions import LinkError, LinkRefused
from ..clock import Clock
from ..frame import TWO_PI, FieldFrame
from ..messages import NEVER_S, PILOT, BoatReading, Link, Sent, check_finite, never
from . import drivers, state
from .client import Health, MoosClient
from .drivers import Drivers
from .gates import Gate, Nominal
from .state import MoosContacts, Navigation
from .wire import Message, WireError

LOG = logging.getLogger(__name__)

REPORT = "NODE_REPORT"
ALIVE_S = 1.5  # a MOOSDB whose last echo is no older answers, real s
REST_MPS, REST_S = 0.3, 3.0  # a boat this slow lies still; how long `close` waits for it, real s
POLL_S = 0.05
HANGS_S = 1.0
"""Without a command of ours for so long, MOOS s, thrust is taken off actuators that would keep the last one."""
MOST_TEXTS = 32
SAY_AGAIN_S, ALIKE = 10.0, 40
"""A text is repeated after this long, s of the loop's clock; texts that begin alike are one."""


def client_name(boat: str) -> str:
    """Name of our client in a boat's community."""
    return f"steerclear_{boat}"


class MoosLink(Link):
    """One boat behind its MOOSDB. `connect`, `prepare`, then `read` and `send` at the loop's rate, then `close`.

    Attributes:
        client: the connection.
        writers: who was heard writing each variable, for the checks.

    Args:
        boat: its name.
        host, port: of its MOOSDB.
        gate: where the shield sits in the community.
        frame: of the field.
        clock: the loop's; as many times faster than real time as the community's MOOSTimeWarp says.
        contacts: takes the NODE_REPORTs that reach this boat.
        corner_m: the field's corner on the boat's local grid, m.
        prefix: what the helm puts before its own DESIRED_*, for words.
    """

    def __init__(
        self,
        boat: str,
        host: str,
        port: int,
        gate: Gate,
        frame: FieldFrame,
        clock: Clock,
        contacts: MoosContacts,
        *,
        corner_m: tuple[float, float] = (0.0, 0.0),
        prefix: str = "RAW_",
    ) -> None:
        self.boat, self.gate = boat, gate
        self._clock, self._contacts = clock, contacts
        self._lock = threading.Lock()
        self._navigation = Navigation(frame, corner_m)
        self._drivers = Drivers(client_name(boat), gate.outputs, prefix)
        self._faults: Counter[str] = Counter()
        self._texts: deque[str] = deque(maxlen=MOST_TEXTS)
        self._logged_fault = ""
        self._said_s: dict[str, float] = {}
        self._last_rad, self._sent_s = 0.0, math.inf
        self._prepared = self._closed = False
        self.writers: dict[str, set[str]] = {}
        names = (*state.VARIABLES, *state.PLACE, *drivers.VARIABLES, *gate.inputs, *gate.outputs, REPORT)
        self.client = MoosClient(client_name(boat), host, port, clock, names, self._hear, self._forget)

    def connect(self, timeout_s: float) -> None:
        """Find the MOOSDB, register, and hear where the boat is.

        `LinkError` also where the MOOSDB is of another warp, or nobody posts NAV_* in it.
        """
        self.client.start()
        end_s = time.monotonic() + timeout_s
        while unheard := self._unheard():
            if time.monotonic() > end_s:
                health = self.client.health()
                what = f"nobody posts {', '.join(unheard)} in MOOSDB {self.client.address} ({health.community})"
                what = "; ".join([f"{what} within {timeout_s:g} s; start its simulator or sensors", *self._texts])
                raise LinkError(f"boat {self.boat}: {health.fault or what}")
            time.sleep(POLL_S)

    def prepare(self, timeout_s: float, is_off: Callable[[], bool] = never) -> None:
        """See that commands would be obeyed; a boat driven by hand stays so until MOOS_MANUAL_OVERRIDE is false.

        A mission starts with the override on: then the boat is left alone, and obeys from the moment it is set off.

        Raises:
            LinkRefused: asked for again while the boat is driven by hand: only who set the override may end it.
            LinkError: its MOOSDB does not answer.
        """
        if fault := self.client.health().fault:
            raise LinkError(f"boat {self.boat}: {fault}")
        with self._lock:
            why = self._drivers.why_not()
        if why and self._prepared:
            raise LinkRefused(f"boat {self.boat}: {why}")
        self._prepared = True

    def read(self) -> BoatReading:
        """The latest of everything; never waits."""
        health = self.client.health()
        with self._lock:
            now_s = self._clock.now_s()
            if health.echo_age_s < ALIVE_S:
                self._say(self._drivers.dropped(now_s), now_s)
            texts, self._texts = tuple(self._texts), deque(maxlen=MOST_TEXTS)
            counters = (self._faults, self._navigation.faults, self._drivers.faults)
            faults = {kind: count for counter in counters for kind, count in counter.items() if count}
            for counter in counters:
                counter.clear()
            why_not, hand = health.fault or self._drivers.why_not(), self._drivers.overridden
            return replace(
                self._reading(now_s),
                mode=self._drivers.state or ("override" if hand else "no helm"),
                ready=not why_not,
                why_not=why_not,
                released=bool(hand),  # his also when it is not heard any more: nothing may be sent against him
                released_by=PILOT if hand else "",
                heartbeat_age_s=NEVER_S if health.fault else max(0.0, health.echo_age_s) * self.client.warp,
                commander=self._drivers.other,
                texts=texts,
                faults=faults,
            )

    def nominal(self) -> Nominal:
        """What somebody else in the community wants of the boat, through the gate; a stop when nobody does.

        An all-stop of the helm is a stop at once.
        """
        with self._lock:
            nominal = self.gate.nominal(self._reading(self._clock.now_s()))
            allstop = self._drivers.allstop
            if allstop.lower() not in ("", "clear") and not nominal.fault:
                nominal = Nominal(0.0, nominal.heading_rad, f"the helm stopped all: {allstop}")
            if nominal.fault != self._logged_fault:
                words = f"{nominal.fault}; told to stop" if nominal.fault else "nominal commands come again"
                self._texts.append(f"{self.boat}: {words}")
                self._logged_fault = nominal.fault
            return nominal

    def send(self, heading_rad: float, speed_mps: float) -> Sent:
        """Post a command as it is; never waits. `LinkError`, and nothing is posted, where a value is not finite."""
        check_finite(self.boat, heading_rad, speed_mps)
        now_s, route = self._clock.now_s(), " and ".join(self.gate.outputs)
        with self._lock:  # also round the post: what is heard meanwhile comes after it
            why_not = self._drivers.why_not()
            if why_not and self.gate.at_rest and speed_mps != 0.0:
                return Sent(self.boat, now_s, heading_rad, speed_mps, f"none: {why_not}", False)
            delivered = self.client.post(self.gate.encode(heading_rad, speed_mps, self._reading(now_s)))
            self._last_rad = heading_rad
            if delivered:
                self._sent_s = now_s
                self._drivers.posted(now_s)
        return Sent(self.boat, now_s, heading_rad, speed_mps, route, delivered)

    def stop(self) -> Sent:
        """Speed 0 on the present heading, or the last one sent; never waits, never raises."""
        with self._lock:
            heading = self._navigation.heading_rad
        heading = heading if math.isfinite(heading) else self._last_rad
        try:
            return self.send(heading, 0.0)
        except WireError as error:  # a platform whose numbers leave the finite: the PID stops for want of commands
            return Sent(self.boat, self._clock.now_s(), heading, 0.0, f"none: {error}", False)

    def close(self) -> str:
        """Stop the boat, wait until it lies still, end the connection; may be called again."""
        if self._closed:
            return f"{self.boat}: its connection is closed"
        try:
            return f"{self.boat}: {self._leave() if self._prepared else 'not prepared; nothing was sent'}"
        finally:
            self.release()

    def release(self) -> None:
        """End the connection without a word to the boat: for one that was only listened to."""
        self._closed = True
        self.client.close()

    def health(self) -> Health:
        """What the connection knows of itself."""
        return self.client.health()

    def place_deg(self) -> tuple[float, float] | None:
        """Latitude and longitude that the boat tells beside its local grid, deg; None: none."""
        with self._lock:
            return self._navigation.place_deg()

    def other_commander(self) -> tuple[str, float]:
        """Who else was last seen commanding the boat, and when, s; -inf: nobody."""
        with self._lock:
            return self._drivers.other, self._drivers.other_s

    def _reading(self, now_s: float) -> BoatReading:
        """Where the boat is; the lock is held."""
        seen = self._navigation
        backwards = math.pi if seen.speed_mps < 0.0 else 0.0
        heading_age_s = max(0.0, now_s - seen.heading_s)
        return BoatReading(
            boat=self.boat,
            read_s=now_s,
            position_m=seen.position_m,
            position_age_s=max(0.0, now_s - seen.position_s),
            heading_rad=seen.heading_rad,
            heading_age_s=heading_age_s,
            speed_mps=seen.speed_mps,
            course_rad=(seen.heading_rad + backwards) % TWO_PI if abs(seen.speed_mps) >= 0.1 else math.nan,
            velocity_age_s=max(0.0, now_s - seen.speed_s),
            turn_rate_rads=seen.turn_rate_rads,
            turn_rate_age_s=heading_age_s if math.isfinite(seen.turn_rate_rads) else NEVER_S,
        )

    def _leave(self) -> str:
        end_s = time.monotonic() + REST_S
        while True:
            reading = self.read()
            if "override" in reading.why_not.lower():
                return f"left as it is: {reading.why_not}"
            if not self.stop().delivered:
                stops = "take it over by hand" if self.gate.at_rest else "its PID stops it 2 s after our last command"
                return f"cannot be told to stop ({reading.why_not}); {stops}"
            if abs(reading.speed_mps) < REST_MPS and reading.velocity_age_s < 1.0:
                return f"stopped; {self._let_go()}"
            if time.monotonic() > end_s:
                return f"told to stop, makes {reading.speed_mps:.1f} m/s yet; {self._let_go()}"
            time.sleep(POLL_S)

    def _let_go(self) -> str:
        """What holds thrust at 0 from now on, in words."""
        if not self.gate.at_rest:
            return "its PID gets no more commands and drops thrust by itself"
        if self.client.post(self.gate.at_rest):
            return "thrust 0 was posted last, which its actuators keep"
        return "thrust 0 was not delivered: take it over by hand, its actuators keep the last command"

    def _hear(self, message: Message, received_s: float) -> None:
        """Take mail in; in the client's thread."""
        key, true_s = message.key, self.client.clock_s(message.time_s)
        with self._lock:
            sources = self.writers.setdefault(key, set())
            if len(sources) < MOST_TEXTS:
                sources.add(message.source)
            is_place = key in state.VARIABLES or key in state.PLACE
            text = ""
            if not math.isfinite(true_s) and (is_place or key == REPORT):
                return  # MOOS time is not known yet
            if is_place:
                text = self._navigation.hear(message, true_s, received_s)
            elif key == REPORT:
                text = self._contacts.hear(message.text, self.boat, -self.client.ahead_s, received_s)
                self._faults["bad_report"] += bool(text)
            elif key in self.gate.inputs:
                self.gate.hear(message, received_s)
            else:
                obeyed = not self._drivers.why_not()
                text = self._drivers.hear(message, received_s, received_s - true_s)
                if obeyed and self._drivers.why_not():
                    self._rest()  # who takes the boat must not inherit our last thrust
            if self.gate.at_rest and received_s - self._sent_s > HANGS_S and not self._drivers.why_not():
                self._say(f"no command for {HANGS_S:g} s: the loop hangs", received_s)
                self._rest()
            self._say(text, received_s)

    def _rest(self) -> None:
        """Take thrust off actuators that would keep our last command, once; the lock is held."""
        if self.gate.at_rest and math.isfinite(self._sent_s):
            self._sent_s = math.inf
            self.client.post(self.gate.at_rest)

    def _say(self, text: str, now_s: float) -> None:
        """Keep a text for the operator, unless one like it was said lately."""
        if text and now_s - self._said_s.get(text[:ALIKE], -math.inf) >= SAY_AGAIN_S:
            if len(self._said_s) > MOST_TEXTS:
                self._said_s.clear()
            self._said_s[text[:ALIKE]] = now_s
            self._texts.append(f"{self.boat}: {text}")

    def _forget(self) -> None:
        """The connection ended: all that is known is old, and no nominal command is in force."""
        with self._lock:
            self._navigation.forget()
            self._drivers.forget()
            self.gate.forget()

    def _unheard(self) -> list[str]:
        """What of the boat was never heard."""
        with self._lock:
            seen = self._navigation
            heard = {"NAV_X and NAV_Y of one moment": seen.position_s, "NAV_HEADING": seen.heading_s}
            heard["NAV_SPEED"] = seen.speed_s
        return [name for name, time_s in heard.items() if not math.isfinite(time_s)]
