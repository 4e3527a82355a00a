"""Somebody else at the helm is noticed and named."""

import math
import time

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.autopilot import SAY_AGAIN_S, Autopilot
from steerclear.shield.bridge.mavlink.connection import ECHO_S, Codec

OURS, MODE = (255, 191), mavlink.MAV_CMD_DO_SET_MODE
BEAT = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3)


class Wire:
    """An endpoint that sends nothing."""

    def __init__(self, codec):
        self.codec = codec

    def send(self, system_id, message):
        return True


class Watch(Autopilot):
    """Says of each message which fault it is and what is told."""

    def __init__(self):
        self.ours = Codec(*OURS, None)
        super().__init__("blue_1", Wire(self.ours), 1, FieldFrame(42.0, -71.0), ManualClock(), 10.0)
        self.expects_guided = True

    def _said(self):
        texts = self.dialogue.take_texts()
        return next(iter(self.take_faults()), ""), texts[0] if texts else ""

    def hear_foreign(self, message, now_s, system=252, component=190):
        message._header.srcSystem, message._header.srcComponent = system, component
        self.on_foreign(message, now_s)
        return self._said()

    def hear_frame(self, frame, now_s):
        self.on_foreign(Codec(*OURS, None).decode(frame)[0], now_s)
        return self._said()

    def hear_answer(self, asked_s, now_s, command=MODE, asked_by=OURS):
        self.dialogue._asked_s[command] = asked_s
        self._hear_answer(mavlink.MAVLink_command_ack_message(command, 0, 0, 0, *asked_by), now_s)
        return self._said()


def command(number, target=1):
    return mavlink.MAVLink_command_long_message(target, 1, number, 0, 0, 0, 0, 0, 0, 0, 0)


STEERING = [
    mavlink.MAVLink_set_attitude_target_message(0, 1, 1, 7, [1, 0, 0, 0], 0, 0, 0, 0.5),
    mavlink.MAVLink_set_mode_message(1, 1, 0),
    mavlink.MAVLink_rc_channels_override_message(1, 1, 1500, 0, 0, 0, 0, 0, 0, 0),
    mavlink.MAVLink_param_set_message(1, 1, b"WP_SPEED", 5.0, 9),
    command(MODE),
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
def test_whoever_steers_our_boat_is_a_second_commander_and_our_own_frames_coming_back_are_an_echo(message):
    watch = Watch()
    fault, text = watch.hear_foreign(message, 5.0)
    assert fault == "second_commander"
    assert "blue_1: a second commander (system 252, component 190)" in text
    assert "end it" in text
    assert watch.commanded_s == 5.0
    assert "(system 252, component 190) sends " in watch.commander
    watch = Watch()
    frame, stranger = watch.ours.encode(message), Codec(*OURS, None)
    said = [watch.hear_frame(frame, now_s) for now_s in (5.0, 5.1, 5.0 + SAY_AGAIN_S)]
    assert [fault for fault, _ in said] == ["echo"] * 3
    assert ["reflects them" in text for _, text in said] == [True, False, True], "said once in a while"
    assert watch.commanded_s == -math.inf
    for _ in range(3):  # the same command of another program with our ids, numbered by it: a frame we never sent
        frame = stranger.encode(message)
    assert watch.hear_frame(frame, 6.0)[0] == "second_commander"
    assert watch.commanded_s == 6.0


def test_our_own_commands_played_again_later_are_somebody_elses(monkeypatch):
    watch = Watch()
    frame, later = watch.ours.encode(STEERING[0]), time.monotonic() + ECHO_S + 0.01
    monkeypatch.setattr(time, "monotonic", lambda: later)
    assert watch.hear_frame(frame, 9.0)[0] == "second_commander"


@pytest.mark.parametrize(
    "message",
    [
        command(MODE, target=2),
        mavlink.MAVLink_manual_control_message(2, 0, 0, 0, 0, 0),
        command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL),
        mavlink.MAVLink_param_request_read_message(1, 1, b"WP_SPEED", -1),
        mavlink.MAVLink_heartbeat_message(11, 3, 1, 0, 4, 3),
    ],
    ids=lambda m: m.get_type(),
)
def test_what_is_for_another_boat_or_asks_for_nothing_is_left(message):
    assert Watch().hear_foreign(message, 1.0) == ("", "")


def test_another_ground_station_is_named_once_in_a_while():
    watch = Watch()
    assert watch.hear_foreign(BEAT, 0.0) == (
        "",
        "blue_1: another ground station (system 252, component 190) is on this link; see that it does not command",
    )
    assert watch.hear_foreign(BEAT, 1.0) == ("", "")
    assert watch.hear_foreign(BEAT, SAY_AGAIN_S + 1.0)[1]
    assert watch.stations == {(252, 190)}


@pytest.mark.parametrize(
    ("answer", "fault"),
    [
        ({"asked_s": 0.5, "now_s": 1.0}, ""),
        ({"asked_s": -math.inf, "now_s": 1.0, "asked_by": (0, 0)}, ""),  # older firmware names nobody
        ({"asked_s": -math.inf, "now_s": 1.0, "command": 511, "asked_by": (252, 190)}, ""),  # an interval
        ({"asked_s": 0.5, "now_s": 1.0, "asked_by": (252, 190)}, "second_commander"),
        ({"asked_s": -math.inf, "now_s": 100.0}, "second_commander"),  # our own ids, and we did not ask
        ({"asked_s": 50.0, "now_s": 100.0}, "second_commander"),
    ],
)
def test_an_answer_to_somebody_else_gives_him_away(answer, fault):
    assert Watch().hear_answer(**answer)[0] == fault


def test_a_crowd_of_stations_does_not_fill_memory():
    watch = Watch()
    for i in range(5000):
        watch.hear_foreign(BEAT, float(i), i % 255, i // 255)
    assert len(watch._said_s) <= 300
    assert len(watch.stations) <= 64
