"""Links on simulated boats that behave as measured: faults of a boat, each with what the link makes of it.

Boats live on a clock moved by hand, by a thread that gives the links time to listen after each step: several times
faster than real time, and no slower machine makes anything late.
"""

import math
import socket
import threading
import time

import pytest
from bridge_fakes import fleet_of
from pymavlink import mavutil
from steerclear.experiments.sim_boats import AutopilotSettings, SimBoat, SimFleet
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.fleet_settings import ModelLimit
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.connection import Endpoint
from steerclear.shield.bridge.mavlink.vehicle import MavlinkLink
from steerclear.shield.bridge.messages import Sent
from steerclear.shield.bridge.model_error import ModelErrorMonitor
from steerclear.shield.bridge.tracker import Tracker
from steerclear.shield.exceptions import LinkRefused
from steerclear.shield.platforms import layout as L

STEP_S = 0.06
LISTEN_S = 0.004
FRAME = FieldFrame(42.0, -71.0)


class Lake:
    """One simulated boat and its link."""

    def __init__(self, *, address="", boot_s=0.0, prepared=True):
        self.clock = ManualClock(1000.0)
        boat = SimBoat("blue_1", start=(40.0, 20.0, 90.0), system_id=7, address=address)
        settings = AutopilotSettings(boot_s=boot_s)
        self.fleet = SimFleet([boat], clock=self.clock, autopilot=settings, noise=1.0, seed=3)
        self.endpoint = Endpoint(self.fleet.addresses["blue_1"], self.clock)
        self.link = MavlinkLink("blue_1", self.endpoint, 7, FRAME, self.clock, rate_hz=10.0)
        self.command = None
        self.prepared = prepared
        self.working = threading.Lock()  # whoever works as the loop does takes no time, even where code is compiled
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _run(self):
        sent_s = 0.0
        while not self._ending.is_set():
            with self.working:
                self.clock.sleep_until(self.clock.now_s() + STEP_S)
                self.fleet.advance(STEP_S)
                if self.command is not None and self.clock.now_s() - sent_s >= 0.2:
                    sent_s = self.clock.now_s()
                    self.link.send(*self.command)
            time.sleep(LISTEN_S)

    def __enter__(self):
        self._thread.start()
        try:
            if self.prepared:
                self.link.connect(30.0)
                self.link.prepare(60.0)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        self.command = None
        self._ending.set()
        self._thread.join(10.0)
        self.link.release()
        self.endpoint.close()
        self.fleet.close()

    def wait(self, holds, seconds):
        """Time until something held, s of the boats' clock; None when it did not in time."""
        began, real = self.clock.now_s(), time.monotonic() + 60.0
        while self.clock.now_s() - began < seconds and time.monotonic() < real:
            if holds():
                return self.clock.now_s() - began
            time.sleep(0.005)
        return self.clock.now_s() - began if holds() else None

    def under_way(self, heading=1.0, speed=1.5, most=0.9):
        self.command = (heading, speed)
        assert self.wait(lambda: self.link.read().speed_mps > most, 20.0) is not None

    def true_speed(self):
        return float(self.fleet.states()["blue_1"][L.SPEED])

    def other(self):
        """Somebody else on the boat's wire."""
        place = self.fleet.addresses["blue_1"].removeprefix("udpout:")
        return mavutil.mavlink_connection(f"udpout:{place}", dialect="ardupilotmega", source_system=252)


@pytest.fixture
def lake():
    with Lake() as made:
        yield made


@pytest.mark.parametrize("kind", ["", "udpin", "tcp", "tcpin"])
def test_it_steers_by_what_it_is_told_over_every_kind_of_wire_and_is_left_in_hold(kind):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM if kind == "udpin" else socket.SOCK_STREAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with Lake(address=kind and f"{kind}:127.0.0.1:{port}") as lake:
        lake.under_way()
        if kind:
            assert lake.link.read().age_s < 0.4
            return
        lake.wait(lambda: False, 6.0)
        row, reading = lake.fleet.states()["blue_1"], lake.link.read()
        assert row[L.HEADING] == pytest.approx(math.degrees(1.0), abs=6.0)
        assert row[L.SPEED] == pytest.approx(1.5, abs=0.25)
        assert reading.age_s < 0.3
        assert math.dist(reading.position_m, row[[L.X, L.Y]]) < 0.7
        lake.command = None
        assert lake.link.close().startswith("blue_1: in HOLD, speed 0.")
        assert lake.true_speed() < 0.5


def test_a_boat_that_boots_is_waited_for_and_one_that_boots_too_long_refuses_in_its_own_words():
    with Lake(boot_s=8.0, prepared=False) as lake:
        lake.link.connect(30.0)
        lake.link.prepare(60.0)
        assert lake.link.read().ready
    with Lake(boot_s=1000.0, prepared=False) as lake:
        lake.link.connect(30.0)
        with pytest.raises(LinkRefused, match=r"blue_1 refuses .*: .*\w+.*; put that right"):
            lake.link.prepare(6.0)


def test_commands_that_end_stop_the_boat_by_its_own_time_out(lake):
    lake.under_way()
    lake.command = None
    assert 2.5 < lake.wait(lambda: any("stopping" in text for text in lake.link.read().texts), 8.0) < 5.0
    assert lake.wait(lambda: abs(lake.true_speed()) < 0.2, 10.0) is not None


class Tracked:
    """The loop's view of the boat of a lake: what it believes of its place, and what its model misses."""

    def __init__(self, lake):
        self.lake, fleet = lake, fleet_of(blue=1, red=0)
        self.tracker, self.monitor = Tracker(fleet, ["blue_1"]), ModelErrorMonitor(fleet, ("blue_1",))
        self.turned_s = -math.inf

    def off_s(self):
        """How long the boat has been far outside its model, after another turn if one is due, s."""
        with self.lake.working:
            now_s = self.lake.clock.now_s()
            if now_s - self.turned_s >= 0.099:
                self.turned_s = now_s
                readings = {"blue_1": self.lake.link.read()}
                self.tracker.update(now_s, readings, [])
                self.monitor.update(self.tracker.own_rows(), readings)
                sent = {"blue_1": Sent("blue_1", now_s, *self.lake.command, "", True)}
                self.tracker.sent(now_s, sent)
                self.monitor.sent(sent)
        return self.monitor.outside_s("blue_1")


def test_a_second_commander_nobody_hears_is_told_by_what_the_boat_does(lake):
    lake.under_way(heading=1.0)
    other, turn = lake.other(), 1.0

    def steer():
        nonlocal turn
        turn -= 0.02
        q = [math.cos(turn / 2.0), 0.0, 0.0, math.sin(turn / 2.0)]
        for _ in range(3):
            other.mav.set_attitude_target_send(0, 7, 1, 7, q, 0, 0, 0, 0.7)

    seen = Tracked(lake)
    try:
        took = lake.wait(lambda: (steer(), seen.off_s() >= ModelLimit().after_s)[1], 60.0)
    finally:
        other.close()
    assert took is not None, "the monitor slows it, and gives it up"
