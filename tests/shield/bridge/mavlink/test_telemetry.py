"""One boat's messages: true values pass with their ages, impossible ones are refused and named; late is late.

A position without a fix is none: by the receivers' word, by the filter's, by their silence; and back again.
"""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.telemetry import BELIEVED_AFTER, FIX_SILENT_S, BoatClock, Streams, Telemetry

FRAME = FieldFrame(42.0, -71.0)
OFFSET = 500.0
DT = 0.05


class Boat:
    """Feeds a `Telemetry` with what a boat would send; ``now`` is its time since boot."""

    def __init__(self, speed=0.0, rate=0.0):
        self.telemetry = Telemetry(FRAME)
        self.now, self.x, self.y = 20.0, 10.0, 10.0
        self.speed, self.yaw, self.rate = speed, 1.0, rate
        self.delay, self.number, self.texts = 0.01, 0, []

    def hear(self, message):
        self.number = (self.number + 1) % 256
        message._header.seq = self.number
        text = self.telemetry.hear(message, self.now + OFFSET + self.delay)
        self.texts += [text] if text else []

    def position(self, **changes):
        latitude, longitude = FRAME.to_geodetic_deg(self.x, self.y)
        fields = {
            "time_boot_ms": round(self.now * 1000),
            "lat": round(latitude * 1e7),
            "lon": round(longitude * 1e7),
            "alt": 0,
            "relative_alt": 0,
            "vx": round(100 * self.speed * math.cos(self.yaw)),
            "vy": round(100 * self.speed * math.sin(self.yaw)),
            "vz": 0,
            "hdg": round(math.degrees(self.yaw) * 100) % 36000,
        }
        return mavlink.MAVLink_global_position_int_message(**fields | changes)

    def attitude(self, **changes):
        fields = {"time_boot_ms": round(self.now * 1000), "roll": 0.0, "pitch": 0.0, "yaw": self.yaw}
        fields |= {"rollspeed": 0.0, "pitchspeed": 0.0, "yawspeed": self.rate}
        return mavlink.MAVLink_attitude_message(**fields | changes)

    def run(self, seconds, *extra):
        """Run on and say so, whatever it knows; twice a second with further messages."""
        for k in range(round(seconds / DT)):
            self.now += DT
            self.yaw = (self.yaw + self.rate * DT) % (2 * math.pi)
            self.x += self.speed * math.sin(self.yaw) * DT
            self.y += self.speed * math.cos(self.yaw) * DT
            self.hear(self.position())
            self.hear(self.attitude())
            for message in extra if k % 10 == 0 else ():
                self.hear(message)
        return self

    def age(self):
        return self.now + OFFSET + self.delay - self.telemetry.position_s


@pytest.mark.parametrize("speed", [1.5, -0.8])
def test_what_a_boat_says_is_what_is_read(speed):
    boat = Boat(speed, rate=0.1).run(3.0)
    seen = boat.telemetry
    assert seen.position_m == pytest.approx((boat.x, boat.y), abs=0.02)
    assert seen.heading[0] == pytest.approx(boat.yaw, abs=1e-6)
    assert seen.speed_mps == pytest.approx(speed, abs=0.01), "negative astern"
    astern = math.pi if speed < 0.0 else 0.0
    assert math.remainder(seen.course_rad - boat.yaw - astern, 2.0 * math.pi) == pytest.approx(0.0, abs=0.02)
    assert seen.turn_rate_rads == pytest.approx(0.1)
    assert boat.age() == pytest.approx(0.0, abs=0.011)
    assert not seen.faults


def test_older_messages_never_replace_newer_ones_and_the_same_packet_twice_is_counted():
    boat = Boat(1.0).run(2.0)
    late = boat.position()
    boat.run(0.5)
    place = boat.telemetry.position_m
    boat.hear(late)
    assert boat.telemetry.position_m == place
    assert boat.telemetry.faults == {"out_of_order": 1}
    boat.now += DT
    packet = boat.position()
    boat.hear(packet)
    boat.number -= 1
    boat.hear(packet)
    boat.hear(boat.position())  # the same instant again under a new number is no fault
    assert boat.telemetry.faults == {"out_of_order": 1, "duplicate": 1}


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"lat": 0, "lon": 0}, "no_position"),
        ({"lat": 899_999_999}, "impossible_position"),
        ({"lat": -2_147_483_648}, "impossible_position"),
        ({"lon": 1_900_000_000}, "impossible_position"),
        ({"lat": 500_000_000}, "impossible_position"),
        ({"vx": 32_767}, "impossible_speed"),
        ({"vy": -32_768}, "impossible_speed"),
        ({"yaw": math.nan}, "impossible_attitude"),
        ({"yaw": 1e9}, "impossible_attitude"),
        ({"yawspeed": math.inf}, "impossible_attitude"),
        ({"yawspeed": -50.0}, "impossible_attitude"),
    ],
)
def test_impossible_values_are_refused_and_named(changes, fault):
    boat = Boat().run(1.0)
    seen = boat.telemetry
    before = (seen.position_m, seen.velocity_mps, seen.heading)
    boat.now += DT
    boat.hear(boat.attitude(**changes) if fault == "impossible_attitude" else boat.position(**changes))
    assert seen.faults == {fault: 1}
    assert (seen.position_m, seen.velocity_mps, seen.heading) == before


def test_attitude_of_the_first_second_is_not_believed():
    boat = Boat()
    boat.now = 0.2
    boat.run(0.6)
    assert boat.telemetry.turn_rate_s == -math.inf
    assert boat.telemetry.faults["settling"] > 0
    assert boat.run(1.0).telemetry.turn_rate_s > 0.0


def test_without_attitude_the_heading_is_the_position_messages():
    boat = Boat()
    for heading in ({}, {"hdg": 65_535}):
        boat.now += DT
        boat.hear(boat.position(**heading))
        assert boat.telemetry.heading[0] == pytest.approx(1.0, abs=1e-3)
    assert boat.telemetry.heading[1] < boat.now + OFFSET - 0.5 * DT, "an unknown heading is none"


def test_a_restart_is_told_and_nothing_old_is_kept():
    boat = Boat().run(2.0)
    boat.delay += boat.now - 1.5
    boat.now = 1.5
    for _ in range(20):
        boat.now += DT
        boat.hear(boat.position())
    assert sum("restarted" in text for text in boat.texts) == 1
    assert boat.telemetry.turn_rate_s == -math.inf
    assert boat.telemetry.position_m == pytest.approx((boat.x, boat.y), abs=0.02)


GOOD = 831
"""Flags of a filter that knows everything."""


def gps(fix_type=3, eph=65_535, h_acc=0):
    return mavlink.MAVLink_gps_raw_int_message(
        0, fix_type, 0, 0, 0, eph, 65_535, 65_535, 65_535, 255, 0, h_acc, 0, 0, 0, 0
    )


def second(fix_type=3, eph=65_535):
    return mavlink.MAVLink_gps2_raw_message(0, fix_type, 0, 0, 0, eph, 65_535, 65_535, 65_535, 255, 0, 0)


def estimate(flags=GOOD):
    return mavlink.MAVLink_ekf_status_report_message(flags, 0.05, 0.05, 0.05, 0.05, 0.0)


@pytest.mark.parametrize(
    ("bad", "kind", "words"),
    [
        (gps(1), "no_fix", "GPS has no fix (fix type 1)"),
        (gps(0), "no_fix", "fix type 0"),
        (gps(2), "no_fix", "fix type 2"),
        (gps(3, eph=990), "poor_fix", "HDOP 9.9"),
        (gps(3, h_acc=30_000), "poor_fix", "good to 30 m"),
        (estimate(GOOD | mavlink.EKF_CONST_POS_MODE), "no_estimate", "no absolute position"),
        (estimate(GOOD & ~mavlink.EKF_POS_HORIZ_ABS), "no_estimate", "no absolute position"),
        (estimate(GOOD | mavlink.EKF_UNINITIALIZED), "no_estimate", "no absolute position"),
        (estimate(GOOD | 1 << 15), "no_estimate", "rejects its GPS"),
    ],
)
def test_a_position_told_without_a_fix_grows_old_and_is_believed_again_with_one(bad, kind, words):
    boat = Boat().run(5.0, gps(), estimate())
    assert not boat.telemetry.faults
    assert boat.age() < 0.06
    boat.run(20.0, bad, *([] if bad.get_type() == "GPS_RAW_INT" else [gps()]))
    assert set(boat.telemetry.faults) == {kind}
    assert boat.telemetry.faults[kind] > 350
    assert 19.0 < boat.age() < 20.1, "position and speed alike"
    assert boat.now + OFFSET - boat.telemetry.velocity_s > 19.0
    assert words in boat.telemetry.fix.fault(boat.now + OFFSET)[1]
    assert len(boat.texts) == 1, "said once"
    assert "dead reckoning and not believed" in boat.texts[0]
    boat.run(3.0, gps(), estimate())
    assert boat.age() < 0.06
    assert boat.telemetry.fix.fault(boat.now + OFFSET)[1] == ""
    assert "its fix is back; its position is believed again" in boat.texts


def test_a_receiver_that_falls_silent_has_lost_its_fix():
    boat = Boat().run(5.0, gps()).run(FIX_SILENT_S + 2.0)
    assert set(boat.telemetry.faults) == {"fix_silent"}
    assert 1.0 < boat.age() < 2.6
    assert "nothing heard of the GPS fix" in boat.texts[0]
    assert boat.run(0.2, gps()).age() < 0.06


def test_a_gap_of_the_whole_link_is_no_silence_of_the_receiver():
    boat = Boat().run(3.0, gps())
    boat.now += 30.0
    assert boat.run(1.0).age() < 0.06
    assert boat.run(FIX_SILENT_S).telemetry.faults["fix_silent"]


def test_one_receiver_with_a_fix_is_enough():
    boat = Boat().run(5.0, gps(1), second())
    assert boat.telemetry.fix.fix_type == 3
    boat.telemetry.faults.clear()
    assert boat.run(5.0, gps(1), second()).age() < 0.06
    assert not boat.telemetry.faults
    boat.run(5.0, gps(1), second(1))
    assert boat.telemetry.faults["no_fix"]
    assert "GPS has no fix (fix type 1), GPS 2 has no fix (fix type 1)" in boat.texts[-1]


def test_the_messages_are_asked_for_and_asked_again_once_they_stop():
    streams, gps_id = Streams(20.0), mavlink.MAVLINK_MSG_ID_GPS_RAW_INT

    def asked(now_s):
        return {key for key, _ in streams.requests(now_s)}

    assert {gps_id, mavlink.MAVLINK_MSG_ID_GPS2_RAW, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT} <= asked(0.0)
    for k in range(1, 50):
        asked(2.1 * k)
    assert gps_id not in asked(120.0), "not given, not asked for ever"
    streams.hear(gps_id, 120.0)
    assert gps_id not in asked(122.5)
    assert gps_id in asked(124.0)


def heard(clock, boot_s, delay_s):
    """Age on arrival of what was true at ``boot_s`` and took ``delay_s``; None: it is not believed."""
    received = boot_s + OFFSET + delay_s
    true = clock.hear(boot_s, received)
    return None if true is None else received - true


def warmed(delay_s=0.02):
    clock = BoatClock()
    for i in range(40):
        heard(clock, 10.0 + 0.05 * i, delay_s + 0.001 * (i % 3))
    return clock, 12.0


def test_a_delay_there_from_the_start_is_found_by_the_round_trip():
    clock, now = warmed(delay_s=0.4)
    assert heard(clock, now, 0.4) == pytest.approx(0.0, abs=0.01)
    clock.sync(now, now + OFFSET - 0.4, now + OFFSET + 0.4)
    assert heard(clock, now + 0.05, 0.4) == pytest.approx(0.4, abs=0.01)
    assert clock.shortest_delay_s == pytest.approx(0.4, abs=0.01)
    assert clock.round_trip_s == pytest.approx(0.8)


@settings(deadline=None)
@given(st.lists(st.floats(0.0, 0.5), min_size=1, max_size=60))
def test_nothing_is_ever_younger_than_it_is_compared_with_the_quickest(delays):
    clock = BoatClock()
    for i, delay in enumerate(delays):
        quickest = min(delays[: i + 1])
        assert heard(clock, 10.0 + 5.0 * i, delay) == pytest.approx(delay - quickest, abs=5e-4 * (i + 1) + 1e-6)


def test_a_drifting_clock_is_followed():
    clock = BoatClock()
    for i in range(20_000):
        received = 0.1 * i * (1.0 + 5e-5) + OFFSET
        assert received - clock.hear(0.1 * i, received) < 0.02


def test_messages_from_the_future_change_nothing_and_a_restart_is_believed_when_enough_agree():
    clock, now = warmed()
    for far_s in (3600.0, 7200.0):
        assert clock.hear(now + far_s, now + OFFSET) is None
    assert heard(clock, now + 0.05, 0.02) == pytest.approx(0.0, abs=0.01)
    assert clock.starts == 1
    received = [now + OFFSET + 30.0 + 0.05 * i for i in range(BELIEVED_AFTER)]
    answers = [clock.hear(1.0 + 0.05 * i, at) for i, at in enumerate(received)]
    assert answers[:-1] == [None] * (BELIEVED_AFTER - 1)
    assert answers[-1] == pytest.approx(received[-1], abs=0.01)
    assert clock.starts == 2


def test_a_clock_that_lost_time_is_noticed_by_the_round_trip():
    clock, now = warmed()
    clock.sync(now, now + OFFSET - 0.01, now + OFFSET + 0.01)
    received = now + 80.0 + OFFSET
    assert received - clock.hear(now, received) == pytest.approx(80.0, abs=0.1), "until then it looks late"
    clock.sync(now, received - 0.001, received)
    assert clock.starts == 2
    assert received - clock.hear(now + 0.01, received + 0.01) < 0.1


def test_answers_from_another_clock_or_nonsense_are_left():
    clock, now = warmed()
    for boat_s, sent_s, received_s in ((1e6, 0.0, 0.01), (math.nan, 0.0, 0.01), (0.0, 1.0, 0.0), (0.0, -60.0, 0.0)):
        clock.sync(now + boat_s, now + OFFSET + sent_s, now + OFFSET + received_s)
    assert clock.starts == 1
    assert math.isnan(clock.round_trip_s)
    assert heard(clock, now, 0.02) == pytest.approx(0.0, abs=0.01)
