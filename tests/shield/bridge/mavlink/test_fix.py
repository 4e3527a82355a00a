"""A position without a fix is none: by the receivers' word, by the filter's, by their silence; and back again."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.telemetry import FIX_SILENT_S, FixWatch, Streams, Telemetry

FRAME = FieldFrame(42.0, -71.0)
OFFSET = 500.0
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


class Boat:
    """Runs north at 1.5 m/s and says so, whatever it knows; ``says`` gives further messages by time."""

    def __init__(self):
        self.telemetry = Telemetry(FRAME)
        self.now, self.y, self.number = 20.0, 0.0, 0
        self.texts = []

    def hear(self, message):
        self.number = (self.number + 1) % 256
        message._header.seq = self.number
        text = self.telemetry.hear(message, self.now + OFFSET)
        self.texts += [text] if text else []

    def run(self, seconds, *extra):
        for k in range(round(seconds * 20)):
            self.now += 0.05
            self.y += 0.075
            latitude, longitude = FRAME.to_geodetic_deg(0.0, self.y)
            self.hear(
                mavlink.MAVLink_global_position_int_message(
                    round(self.now * 1e3), round(latitude * 1e7), round(longitude * 1e7), 0, 0, 150, 0, 0, 0
                )
            )
            if k % 10 == 0:
                for message in extra:
                    self.hear(message)
        return self

    @property
    def age_s(self):
        return self.now + OFFSET - self.telemetry.position_s


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
    assert boat.age_s < 0.06
    boat.run(20.0, bad, *([] if bad.get_type() == "GPS_RAW_INT" else [gps()]))
    assert set(boat.telemetry.faults) == {kind}
    assert boat.telemetry.faults[kind] > 350
    assert 19.0 < boat.age_s < 20.1, "position and speed alike"
    assert boat.now + OFFSET - boat.telemetry.velocity_s > 19.0
    assert words in boat.telemetry.fix.fault(boat.now + OFFSET)[1]
    assert len(boat.texts) == 1, "said once"
    assert "dead reckoning and not believed" in boat.texts[0]
    boat.run(3.0, gps(), estimate())
    assert boat.age_s < 0.06
    assert boat.telemetry.fix.fault(boat.now + OFFSET)[1] == ""
    assert "its fix is back; its position is believed again" in boat.texts


def test_a_receiver_that_falls_silent_has_lost_its_fix():
    boat = Boat().run(5.0, gps()).run(FIX_SILENT_S + 2.0)
    assert set(boat.telemetry.faults) == {"fix_silent"}
    assert 1.0 < boat.age_s < 2.6
    assert "nothing heard of the GPS fix" in boat.texts[0]
    assert boat.run(0.2, gps()).age_s < 0.06


def test_a_receiver_that_never_spoke_is_not_missed_here():
    assert Boat().run(30.0).age_s < 0.06
    assert Boat().telemetry.fix.fix_type == -1


def test_a_gap_of_the_whole_link_is_no_silence_of_the_receiver():
    boat = Boat().run(3.0, gps())
    boat.now += 30.0
    boat.run(1.0)
    assert boat.age_s < 0.06
    assert boat.run(FIX_SILENT_S).telemetry.faults["fix_silent"]


def test_one_receiver_with_a_fix_is_enough():
    boat = Boat().run(5.0, gps(1), second())
    assert boat.telemetry.fix.fix_type == 3
    boat.telemetry.faults.clear()
    assert boat.run(5.0, gps(1), second()).age_s < 0.06
    assert not boat.telemetry.faults
    boat.run(5.0, gps(1), second(1))
    assert boat.telemetry.faults["no_fix"]
    assert "GPS has no fix (fix type 1), GPS 2 has no fix (fix type 1)" in boat.texts[-1]


def test_what_is_not_available_is_no_fault():
    watch = FixWatch()
    watch.hear(gps(3, eph=65_535, h_acc=0), 1.0)
    assert watch.fault(1.0) == ("", "")


def test_a_restart_forgets_what_was_said_of_the_fix():
    boat = Boat().run(5.0, gps(1))
    boat.telemetry.forget()
    assert boat.telemetry.fix.fix_type == -1


def test_a_heading_that_is_not_available_is_none():
    boat = Boat().run(1.0, gps())
    assert boat.telemetry.heading[0] == pytest.approx(0.0)
    blind = Telemetry(FRAME)
    blind.hear(
        mavlink.MAVLink_global_position_int_message(20_000, 420_000_000, -710_000_000, 0, 0, 0, 0, 0, 65_535), 1.0
    )
    assert math.isnan(blind.heading[0])
    assert blind.position_s == 1.0


@pytest.mark.parametrize("place", [(910_000_000, 0), (0, 1_810_000_000), (2**31 - 1, 2**31 - 1)])
def test_a_place_that_is_not_available_is_none(place):
    blind = Telemetry(FRAME)
    blind.hear(mavlink.MAVLink_global_position_int_message(20_000, *place, 0, 0, 0, 0, 0, 0), 1.0)
    assert dict(blind.faults) == {"impossible_position": 1}


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
