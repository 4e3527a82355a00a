"""One boat's messages: true values pass with their ages, impossible ones are refused and named.

A position without a fix is none: by the receivers' word, by the filter's, by their silence; and back again.
"""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.telemetry import FIX_SILENT_S, Streams, Telemetry

FRAME = FieldFrame(42.0, -71.0)
OFFSET = 500.0
DT = 0.05


class Boat:
    """Feeds a `Telemetry` with what a boat would send; ``now`` is its time since boot."""

    def __init__(self):
        self.telemetry = Telemetry(FRAME)
        self.now, self.x, self.y = 20.0, 10.0, 10.0
        self.speed, self.yaw, self.rate = 0.0, 1.0, 0.0
        self.delay = 0.01
        self.number = 0
        self.texts = []

    def hear(self, message, delay=None):
        self.number = (self.number + 1) % 256
        message._header.seq = self.number
        text = self.telemetry.hear(message, self.now + OFFSET + (self.delay if delay is None else delay))
        self.texts += [text] if text else []
        return text

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


def test_what_a_boat_says_is_what_is_read():
    boat = Boat()
    boat.speed, boat.rate = 1.5, 0.1
    boat.run(3.0)
    seen = boat.telemetry
    assert seen.position_m == pytest.approx((boat.x, boat.y), abs=0.02)
    assert seen.heading[0] == pytest.approx(boat.yaw, abs=1e-6)
    assert seen.speed_mps == pytest.approx(1.5, abs=0.01)
    assert seen.course_rad == pytest.approx(boat.yaw, abs=0.02)
    assert seen.turn_rate_rads == pytest.approx(0.1)
    assert boat.age() == pytest.approx(0.0, abs=0.011)
    assert not seen.faults


def test_a_boat_going_astern_has_a_negative_speed():
    boat = Boat()
    boat.speed = -0.8
    boat.run(1.0)
    assert boat.telemetry.speed_mps == pytest.approx(-0.8, abs=0.01)


def test_older_messages_never_replace_newer_ones():
    boat = Boat()
    boat.speed = 1.0
    boat.run(2.0)
    late = boat.position()
    boat.run(0.5)
    place = boat.telemetry.position_m
    boat.hear(late)
    assert boat.telemetry.position_m == place
    assert boat.telemetry.faults == {"out_of_order": 1}


def test_the_same_packet_twice_is_counted_and_the_same_instant_again_is_not():
    boat = Boat()
    boat.run(1.0)
    boat.now += DT
    packet = boat.position()
    boat.hear(packet)
    boat.number -= 1
    boat.hear(packet)
    assert boat.telemetry.faults == {"duplicate": 1}
    boat.hear(boat.position())
    assert boat.telemetry.faults == {"duplicate": 1}


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
    ],
)
def test_impossible_positions_are_refused_and_named(changes, fault):
    boat = Boat()
    boat.run(1.0)
    before = (boat.telemetry.position_m, boat.telemetry.velocity_mps)
    boat.now += DT
    boat.hear(boat.position(**changes))
    assert boat.telemetry.faults == {fault: 1}
    assert (boat.telemetry.position_m, boat.telemetry.velocity_mps) == before


@pytest.mark.parametrize("changes", [{"yaw": math.nan}, {"yaw": 1e9}, {"yawspeed": math.inf}, {"yawspeed": -50.0}])
def test_impossible_attitudes_are_refused(changes):
    boat = Boat()
    boat.run(1.0)
    before = boat.telemetry.heading
    boat.now += DT
    boat.hear(boat.attitude(**changes))
    assert boat.telemetry.faults == {"impossible_attitude": 1}
    assert boat.telemetry.heading == before


def test_attitude_of_the_first_second_is_not_believed():
    boat = Boat()
    boat.now = 0.2
    boat.run(0.6)
    assert boat.telemetry.turn_rate_s == -math.inf
    assert boat.telemetry.faults["settling"] > 0
    boat.run(1.0)
    assert boat.telemetry.turn_rate_s > 0.0


def test_without_attitude_the_heading_is_the_position_messages():
    boat = Boat()
    boat.now += DT
    boat.hear(boat.position())
    assert boat.telemetry.heading[0] == pytest.approx(1.0, abs=1e-3)
    boat.now += DT
    boat.hear(boat.position(hdg=65_535))
    assert boat.telemetry.heading[1] < boat.now + OFFSET - 0.5 * DT, "an unknown heading is none"


def test_a_restart_is_told_and_nothing_old_is_kept():
    boat = Boat()
    boat.run(2.0)
    texts = []
    boat.delay += boat.now - 1.5
    boat.now = 1.5
    for _ in range(20):
        boat.now += DT
        texts.append(boat.hear(boat.position()))
    assert sum("restarted" in text for text in texts) == 1
    assert boat.telemetry.turn_rate_s == -math.inf
    assert boat.telemetry.position_m == pytest.approx((boat.x, boat.y), abs=0.02)


ints = st.integers(-(2**31), 2**31 - 1)
shorts = st.integers(-(2**15), 2**15 - 1)
floats = st.floats(width=32)


@settings(deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 2**32 - 1), ints, ints, shorts, shorts, st.integers(0, 65535), floats, floats))
)
def test_whatever_a_boat_says_what_is_read_is_finite_or_never_received(said):
    telemetry = Telemetry(FRAME)
    for i, (boot, lat, lon, vx, vy, hdg, yaw, rate) in enumerate(said):
        telemetry.hear(mavlink.MAVLink_global_position_int_message(boot, lat, lon, 0, 0, vx, vy, 0, hdg), 0.05 * i)
        telemetry.hear(mavlink.MAVLink_attitude_message(boot, 0.0, 0.0, yaw, 0.0, 0.0, rate), 0.05 * i)
    for value, true_s in (
        (telemetry.position_m[0], telemetry.position_s),
        (telemetry.velocity_mps[0], telemetry.velocity_s),
        (telemetry.turn_rate_rads, telemetry.turn_rate_s),
        telemetry.heading,
    ):
        assert math.isfinite(value) == math.isfinite(true_s)
        assert true_s <= 0.05 * len(said)


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
    boat.run(1.0)
    assert boat.age() < 0.06
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
    streams = Streams(20.0)
    gps_id = mavlink.MAVLINK_MSG_ID_GPS_RAW_INT
    others = {mavlink.MAVLINK_MSG_ID_GPS2_RAW, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT}
    assert {gps_id, *others} <= {key for key, _ in streams.requests(0.0)}
    for k in range(1, 50):
        streams.requests(2.1 * k)
    assert gps_id not in {key for key, _ in streams.requests(120.0)}, "not given, not asked for ever"
    streams.hear(gps_id, 120.0)
    assert gps_id not in {key for key, _ in streams.requests(122.5)}
    assert gps_id in {key for key, _ in streams.requests(124.0)}
