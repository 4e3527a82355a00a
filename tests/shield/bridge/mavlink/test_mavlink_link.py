"""`MavlinkLink` against a boat of the tests' own: connect, prepare, command, leave, and what can go wrong at each."""

import contextlib
import math
import threading

import pytest
from fake_boat import FakeBoat
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.connection import Endpoint
from steerclear.shield.bridge.mavlink.signing import Signing
from steerclear.shield.bridge.mavlink.vehicle import MavlinkLink
from steerclear.shield.bridge.messages import NEVER_S
from steerclear.shield.exceptions import LinkError, LinkRefused
from waiting import until

FRAME = FieldFrame(42.0, -71.0, 30.0)
TURN = 2.0 * math.pi
SPEED = 4.0


@contextlib.contextmanager
def linked(*, prepared=True, signing=None, boat_key=None, rate_hz=10.0, route="auto", **boat):
    """A boat and its link, connected and prepared if asked for; four times as fast as real time."""
    clock = MonotonicClock(SPEED)
    endpoint = Endpoint("udpin:127.0.0.1:0", clock, signing=signing)
    endpoint.open()
    with FakeBoat(endpoint.port, key=boat_key, speed=SPEED) as fake:
        for name, value in boat.items():
            setattr(fake, name, value)
        link = MavlinkLink("blue_1", endpoint, 1, FRAME, clock, rate_hz=rate_hz, route=route)
        try:
            if prepared:
                link.connect(20.0)
                link.prepare(20.0)
            yield fake, link
        finally:
            link.release()
            endpoint.close()


def test_from_nothing_to_steering_to_hold():
    with linked() as (boat, link):
        reading = link.read()
        assert reading.ready, reading.why_not
        assert (boat.mode, boat.armed, reading.mode) == (15, True, "GUIDED")
        assert math.isfinite(reading.position_m[0])
        sent = link.send(1.0, 1.5)
        assert (sent.delivered, sent.route) == (True, "SET_ATTITUDE_TARGET")
        assert sent.heading_rad == pytest.approx(1.0, abs=1e-6)
        assert sent.speed_mps == pytest.approx(1.5, abs=1e-6)
        assert until(lambda: boat.targets)
        assert boat.yaw == pytest.approx(1.0 + math.radians(30.0), abs=1e-6), "headings are the field's, courses true"
        assert until(lambda: link.read().speed_mps > 1.4)
        assert link.read().course_rad == pytest.approx(1.0, abs=0.02)
        assert link.close() == "blue_1: in HOLD, speed 0.0 m/s"
        assert boat.mode == 4
        assert "not connected" in link.close()


def test_nothing_is_sent_that_is_no_number_and_nothing_before_prepare():
    with linked(prepared=False) as (boat, link):
        with pytest.raises(LinkError, match="call connect first"):
            link.prepare(1.0)
        assert (link.read().age_s, link.read().why_not) == (NEVER_S, "nothing heard yet")
        assert "not connected" in link.close()
        assert not link.stop().delivered
        link.connect(20.0)
        sent = link.send(1.0, 1.0)
        assert (sent.delivered, "not prepared" in sent.route) == (False, True)
        for heading, speed in ((math.nan, 1.0), (1.0, math.inf), (-math.inf, 0.0)):
            with pytest.raises(LinkError, match="give finite numbers"):
                link.send(heading, speed)
        assert not boat.targets


@pytest.mark.parametrize(
    ("boat", "seconds", "words"),
    [
        ({"speaks": False}, 0.3, r"no heartbeat of system id 1 on udpin.*check power, radio, address"),
        ({"signing": Signing(bytes(32))}, 0.6, r"refused: .* unsigned; give both sides the same key"),
        ({"own_id": 42}, 2.0, r"no heartbeat of system id 1 .*heard system ids 42 there; check .*SYSID"),
        ({"vehicle": mavlink.MAV_TYPE_QUADROTOR}, 20.0, "it is a MAV_TYPE_QUADROTOR, not a boat"),
        ({"autopilot": mavlink.MAV_AUTOPILOT_PX4}, 20.0, "its autopilot is MAV_AUTOPILOT_PX4, not ArduPilot"),
        ({"rates_given": False}, 1.0, r"sends GLOBAL_POSITION_INT at 0.0 of 10 Hz, ATTITUDE .*lower rate_hz"),
    ],
)
def test_a_boat_that_cannot_be_connected_to_is_refused_with_the_reason(boat, seconds, words):
    own_id = boat.pop("own_id", 1)
    with linked(prepared=False, **boat) as (fake, link):
        fake.mav.srcSystem = own_id
        with pytest.raises(LinkError, match=words):
            link.connect(seconds)
        assert link.read().why_not


@pytest.mark.parametrize(
    ("boat", "words"),
    [
        ({"refuses_arming": "PreArm: Compass"}, r"blue_1 refuses arming \(failed\): .*PreArm: Compass; put that"),
        ({"refuses_mode": "GUIDED failed: requires position"}, r"refuses GUIDED .*requires position"),
        ({"parameters": {"WP_SPEED": 0.0}}, "WP_SPEED is 0"),
    ],
)
def test_a_refusal_to_be_prepared_carries_the_boats_own_words(boat, words):
    with linked(prepared=False, **boat) as (fake, link):
        link.connect(20.0)
        with pytest.raises(LinkRefused, match=words):
            link.prepare(1.5)
        assert not fake.armed
        arms = [m for m in fake.heard if m.get_type() == "COMMAND_LONG" and m.command == 400]
        assert bool(arms) == ("refuses_arming" in boat)
        assert all(m.param2 == 0 for m in arms), "never forced"


@pytest.mark.parametrize(
    "changes", [{"rate_hz": 0.0}, {"rate_hz": 41.0}, {"rate_hz": math.nan}, {"route": "BODY_NED"}, {"system_id": 0}]
)
def test_settings_that_are_none_are_refused(changes):
    clock = MonotonicClock()
    endpoint = Endpoint("udpin:127.0.0.1:0", clock)
    system_id = changes.pop("system_id", 1)
    with pytest.raises(LinkError, match="give"):
        MavlinkLink("blue_1", endpoint, system_id, FRAME, clock, **changes)


def test_a_hand_that_takes_over_is_noticed_told_once_and_not_fought():
    with linked() as (boat, link):
        link.read()
        boat.mode = 0
        faults, texts = {}, []

        def seen():
            reading = link.read()
            faults.update(reading.faults)
            texts.extend(reading.texts)
            return "mode_changed" in faults and not reading.ready

        assert until(seen)
        assert faults["mode_changed"] == 1
        assert any("switched it to MANUAL" in text for text in texts)
        for _ in range(3):
            assert "it is in MANUAL" in link.read().why_not
        assert "left alone, armed in MANUAL" in link.close()
        assert boat.mode == 0


@pytest.mark.parametrize("taken", ["mode", "disarmed"])
def test_a_boat_given_back_is_ours_again_only_when_it_is_prepared_again(taken):
    with linked() as (boat, link):
        link.read()
        boat.mode, boat.armed = (0, True) if taken == "mode" else (15, False)
        assert until(lambda: not link.read().ready)
        boat.mode, boat.armed = 15, True
        assert until(lambda: "given back" in link.read().why_not)
        assert not until(lambda: link.read().ready, 0.5), "never by itself"
        assert link.read().released
        link.prepare(20.0)
        assert link.read().ready
        assert not link.read().released


def retaken(boat, link):
    """What taking back a boat that its pilot has in MANUAL, disarmed, comes to; given back it is in GUIDED, armed."""
    boat.mode, boat.armed = 0, False
    assert until(lambda: "it is in MANUAL" in link.read().why_not)
    with pytest.raises(LinkError) as error:
        link.prepare(3.0)
    boat.mode, boat.armed = 15, True
    assert until(lambda: link.autopilot.mode == "GUIDED" and link.autopilot.is_armed)
    return str(error.value), link.read()


def test_a_pilot_who_takes_the_boat_again_while_it_is_taken_back_keeps_it():
    with linked() as (boat, link):

        def arm_and_take(arm, force):
            boat.armed, boat.mode = True, 4
            threading.Timer(0.2, setattr, (boat, "mode", 15)).start()  # and gives it back: nobody here may use that
            return mavlink.MAV_RESULT_ACCEPTED

        boat._arm = arm_and_take
        text, reading = retaken(boat, link)
        assert "HOLD" in text
        assert reading.released
        assert "given back" in reading.why_not


def test_a_boat_that_is_not_reached_in_the_end_is_not_taken_back(monkeypatch):
    with linked() as (boat, link):
        plain = link.autopilot.why_not
        monkeypatch.setattr(
            link.autopilot, "why_not", lambda now_s: plain(now_s) or ("" if link.autopilot.released else "no heartbeat")
        )
        text, reading = retaken(boat, link)
        assert "no heartbeat" in text
        assert reading.released


def test_a_changed_top_speed_is_used_at_once():
    with linked() as (boat, link):
        assert link.send(0.0, 1.0).speed_mps == pytest.approx(1.0)
        boat.parameters |= {"WHATEVER": 1.0, "WP_SPEED": 4.0}
        boat.send_parameter("WHATEVER")
        boat.send_parameter("WP_SPEED")
        assert until(lambda: link.autopilot.route.top_mps == 4.0)
        assert "WHATEVER" not in link.health().parameters, "nobody asked for it"
        boat.targets.clear()
        link.send(0.0, 1.0)
        assert until(lambda: boat.targets)
        assert boat.targets[-1].thrust == pytest.approx(0.25)
        boat.parameters["WP_SPEED"] = 0.0
        boat.send_parameter("WP_SPEED")
        assert until(lambda: not link.read().ready)
        assert not link.send(0.0, 1.0).delivered


def test_a_silent_boat_grows_old_and_is_ready_no_more():
    with linked() as (boat, link):
        boat.speaks = False
        assert until(lambda: link.read().age_s > 0.5)
        assert until(lambda: "no heartbeat" in link.read().why_not)
        boat.speaks = True
        assert until(lambda: link.read().ready and link.read().age_s < 0.5)


def test_streams_are_asked_for_again_after_a_restart():
    with linked() as (boat, link):
        boat.reboot()
        assert until(lambda: not link.read().ready)
        texts = []
        assert until(lambda: texts.extend(link.read().texts) or any("restarted" in text for text in texts), 20.0)
        assert until(lambda: link.read().age_s < 0.5, 20.0)
        assert "MANUAL" in link.read().why_not
        link.prepare(20.0)
        assert link.read().ready


def test_stopping_never_needs_anything_and_never_raises():
    with linked(prepared=False) as (boat, link):
        link.connect(20.0)
        boat.mode, boat.armed = 15, True
        sent = link.stop()
        assert sent.delivered
        assert until(lambda: boat.targets)
        assert boat.targets[-1].thrust == 0.0
        link.endpoint.close()
        assert not link.stop().delivered


def test_a_stop_keeps_the_heading_it_has():
    with linked() as (boat, link):
        boat.obeys = False
        boat.yaw = 1.25
        assert until(lambda: abs(link.autopilot.telemetry.heading[0] - 1.25) < 1e-3)
        sent = link.stop()
        assert sent.heading_rad == pytest.approx((1.25 - math.radians(30.0)) % TURN, abs=1e-3)
        assert sent.speed_mps == 0.0


@pytest.mark.parametrize(
    ("boat", "words"),
    [
        ({"obeys": False, "speed": 1.0}, "in HOLD, speed 1.0 m/s; it was not seen to stop: watch it"),
        ({"refuses_mode": "no"}, "HOLD not confirmed; its own time-out keeps it stopped"),
        ({"obeys": False, "speed": 1.0, "refuses_mode": "no"}, "NOT seen to stop (speed 1.0 m/s)"),
    ],
)
def test_a_boat_that_does_not_stop_or_cannot_be_held_is_said_so(monkeypatch, boat, words):
    for name, seconds in (("STOP_S", 0.5), ("HOLD_S", 2.0)):
        monkeypatch.setattr(f"steerclear.shield.bridge.mavlink.vehicle.{name}", seconds)
    with linked() as (fake, link):
        for name, value in boat.items():
            setattr(fake, name, value)
        assert until(lambda: link.read().speed_mps >= 0.9 * fake.speed)
        assert words in link.close()
        assert link.endpoint.is_open is False


def test_texts_in_pieces_come_whole_and_harmless():
    with linked() as (boat, link):
        link.read()
        boat.send(mavlink.MAVLink_statustext_message(4, b"x" * 50, 7, 0))
        boat.send(mavlink.MAVLink_statustext_message(4, b" and \x1b[2J\x07 the rest", 7, 1))
        texts = []
        assert until(lambda: texts.extend(link.read().texts) or texts)
        assert texts == ["x" * 50 + " and ?[2J? the rest"]


@pytest.mark.parametrize("first", ["word", "mode"])
def test_a_fail_safes_mode_change_is_told_from_a_pilots_by_its_word(first):
    with linked() as (boat, link):
        link.read()
        acts = [lambda: boat.say("EKF failsafe"), lambda: setattr(boat, "mode", 4)]
        for act in acts if first == "word" else reversed(acts):
            act()
            boat.send_heartbeat()
        assert until(lambda: link.read().released_by == "failsafe")
        reading = link.read()
        assert "its own fail-safe: EKF failsafe" in reading.why_not
        assert not reading.failsafe_over
        boat.say("EKF failsafe cleared")
        assert until(lambda: link.read().failsafe_over)
        link.prepare(20.0)
        assert (link.read().ready, link.read().released_by) == (True, "")


def test_a_pilots_mode_change_is_his_whatever_a_fail_safe_did_before():
    with linked() as (boat, link):
        link.read()
        boat.mode = 0
        assert until(lambda: link.read().released_by == "pilot")
    with linked() as (boat, link):
        link.read()
        boat.say("Radio Failsafe")
        boat.mode = 4
        assert until(lambda: link.read().released_by == "failsafe")
        assert until(lambda: link.autopilot.clock.now_s() - link.autopilot._failed_s > 3.5)
        boat.mode = 0
        assert until(lambda: link.read().released_by == "pilot"), "a hand has it now"
        boat.say("Radio Failsafe Cleared")
        assert until(lambda: link.read().failsafe_over)
        assert link.read().released_by == "pilot"
