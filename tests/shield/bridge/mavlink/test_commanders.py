"""Somebody else at the helm is noticed and named."""

import math
import time

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.autopilot import SAY_AGAIN_S, Autopilot
from steerclear.shield.bridge.mavlink.connection import ECHO_S, Codec

OURS = (255, 191)


class Wire:
    """An endpoint that sends nothing."""

    def __init__(self, codec):
        self.codec = codec

    def send(self, system_id, message):
        return True


class Watch(Autopilot):
    """Says of each message which fault it is and what is told."""

    def __init__(self, codec):
        super().__init__("blue_1", Wire(codec), 1, FieldFrame(42.0, -71.0), ManualClock(), 10.0)
        self.expects_guided = True

    def _said(self):
        texts = self.dialogue.take_texts()
        return next(iter(self.take_faults()), ""), texts[0] if texts else ""

    def hear_foreign(self, message, now_s):
        self.on_foreign(message, now_s)
        return self._said()

    def hear_answer(self, message, asked_s, now_s):
        self.dialogue._asked_s[message.command] = asked_s
        self._hear_answer(message, now_s)
        return self._said()

    @property
    def heard_s(self):
        return self.commanded_s


def of(message, system=252, component=190):
    message._header.srcSystem, message._header.srcComponent = system, component
    return message


def watching():
    return Watch(Codec(*OURS, None))


def command(number, target=1):
    return mavlink.MAVLink_command_long_message(target, 1, number, 0, 0, 0, 0, 0, 0, 0, 0)


STEERING = [
    mavlink.MAVLink_set_attitude_target_message(0, 1, 1, 7, [1, 0, 0, 0], 0, 0, 0, 0.5),
    mavlink.MAVLink_set_mode_message(1, 1, 0),
    mavlink.MAVLink_rc_channels_override_message(1, 1, 1500, 0, 0, 0, 0, 0, 0, 0),
    mavlink.MAVLink_param_set_message(1, 1, b"WP_SPEED", 5.0, 9),
    command(mavlink.MAV_CMD_DO_SET_MODE),
    command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM),
    command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, target=0),
    command(mavlink.MAV_CMD_DO_SET_REVERSE),
    command(mavlink.MAV_CMD_GUIDED_CHANGE_SPEED),
    command(mavlink.MAV_CMD_DO_AUX_FUNCTION),
    mavlink.MAVLink_set_mode_message(0, 1, 0),
    mavlink.MAVLink_rc_channels_override_message(0, 0, 1500, 0, 0, 0, 0, 0, 0, 0),
    mavlink.MAVLink_manual_control_message(1, 0, 0, 0, 0, 0),
]


@pytest.mark.parametrize("message", STEERING, ids=lambda m: m.get_type())
def test_whoever_steers_our_boat_is_a_second_commander(message):
    watch = watching()
    fault, text = watch.hear_foreign(of(message), 5.0)
    assert fault == "second_commander"
    assert "blue_1: a second commander (system 252, component 190)" in text
    assert "end it" in text
    assert watch.heard_s == 5.0


def test_what_is_for_another_boat_or_asks_for_nothing_is_left():
    watch = watching()
    for message in (
        command(mavlink.MAV_CMD_DO_SET_MODE, target=2),
        mavlink.MAVLink_manual_control_message(2, 0, 0, 0, 0, 0),
        command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL),
        mavlink.MAVLink_param_request_read_message(1, 1, b"WP_SPEED", -1),
        mavlink.MAVLink_heartbeat_message(11, 3, 1, 0, 4, 3),
    ):
        assert watch.hear_foreign(of(message), 1.0) == ("", "")


def test_another_ground_station_is_named_once_in_a_while():
    watch, beat = watching(), mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3)
    assert watch.hear_foreign(of(beat), 0.0) == (
        "",
        "blue_1: another ground station (system 252, component 190) is on this link; see that it does not command",
    )
    assert watch.hear_foreign(of(beat), 1.0) == ("", "")
    assert watch.hear_foreign(of(beat), SAY_AGAIN_S + 1.0)[1]
    assert watch.stations == {(252, 190)}


def test_an_answer_to_somebody_else_gives_him_away():
    watch = watching()

    def answer(command, system, component):
        return mavlink.MAVLink_command_ack_message(command, 0, 0, 0, system, component)

    mode = mavlink.MAV_CMD_DO_SET_MODE
    never = -math.inf
    assert watch.hear_answer(answer(mode, *OURS), 0.5, 1.0) == ("", "")
    assert watch.hear_answer(answer(mode, 0, 0), never, 1.0) == ("", ""), "older firmware names nobody"
    assert watch.hear_answer(answer(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 252, 190), never, 1.0) == ("", "")
    assert watch.hear_answer(answer(mode, 252, 190), 0.5, 1.0)[0] == "second_commander"


def test_another_program_with_our_own_ids_is_given_away_by_answers_we_did_not_ask_for():
    answer = mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_DO_SET_MODE, 0, 0, 0, *OURS)
    assert watching().hear_answer(answer, -math.inf, 100.0)[0] == "second_commander"
    assert watching().hear_answer(answer, 50.0, 100.0)[0] == "second_commander"


def test_a_crowd_of_stations_does_not_fill_memory():
    watch, beat = watching(), mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3)
    for i in range(5000):
        watch.hear_foreign(of(beat, i % 255, i // 255), float(i))
    assert len(watch._said_s) <= 300


def own_and_watch(key=None):
    ours = Codec(*OURS, key)
    return ours, Watch(ours)


def heard(frame):
    return Codec(*OURS, None).decode(frame)[0]


@pytest.mark.parametrize("message", STEERING, ids=lambda m: m.get_type())
def test_our_own_frames_coming_back_are_an_echo_and_no_second_commander(message):
    ours, watch = own_and_watch()
    frame = ours.encode(message)
    for now_s in (5.0, 5.1):
        fault, text = watch.hear_foreign(heard(frame), now_s)
        assert fault == "echo"
    assert text == "", "said once in a while"
    assert "reflects them" in watch.hear_foreign(heard(frame), 5.0 + SAY_AGAIN_S)[1]
    assert watch.heard_s == -math.inf


@pytest.mark.parametrize("message", STEERING, ids=lambda m: m.get_type())
def test_another_program_with_our_ids_is_found_by_frames_we_never_sent(message):
    ours, watch = own_and_watch()
    ours.encode(message)
    stranger = Codec(*OURS, None)
    for _ in range(3):  # the same command, numbered by somebody else
        frame = stranger.encode(message)
    assert watch.hear_foreign(heard(frame), 5.0)[0] == "second_commander"
    assert watch.heard_s == 5.0


def test_our_own_commands_played_again_later_are_somebody_elses(monkeypatch):
    ours, watch = own_and_watch()
    frame = ours.encode(STEERING[0])
    later = time.monotonic() + ECHO_S + 0.01
    monkeypatch.setattr(time, "monotonic", lambda: later)
    assert watch.hear_foreign(heard(frame), 9.0)[0] == "second_commander"
