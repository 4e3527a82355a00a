"""`Commanders`: notices somebody else who commands the boat."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .own_frames import Source

_STEERS = {
    "SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_MODE",
    "MANUAL_CONTROL", "RC_CHANNELS_OVERRIDE", "MISSION_SET_CURRENT", "MISSION_ITEM", "MISSION_ITEM_INT", "PARAM_SET",
    "SET_ACTUATOR_CONTROL_TARGET",
}  # fmt: skip
_ORDERS = {
    int(mavlink.MAV_CMD_DO_SET_MODE), int(mavlink.MAV_CMD_COMPONENT_ARM_DISARM), int(mavlink.MAV_CMD_DO_CHANGE_SPEED),
    int(mavlink.MAV_CMD_NAV_SET_YAW_SPEED), int(mavlink.MAV_CMD_DO_REPOSITION), int(mavlink.MAV_CMD_MISSION_START),
    int(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH), int(mavlink.MAV_CMD_NAV_LOITER_UNLIM), int(mavlink.MAV_CMD_DO_SET_SERVO),
    int(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN), int(mavlink.MAV_CMD_DO_MOTOR_TEST),
    int(mavlink.MAV_CMD_DO_SET_REVERSE), int(mavlink.MAV_CMD_DO_PAUSE_CONTINUE), int(mavlink.MAV_CMD_DO_AUX_FUNCTION),
    int(mavlink.MAV_CMD_DO_FLIGHTTERMINATION), int(mavlink.MAV_CMD_GUIDED_CHANGE_SPEED),
    int(mavlink.MAV_CMD_GUIDED_CHANGE_HEADING), int(mavlink.MAV_CMD_DO_GUIDED_LIMITS),
    int(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT), int(mavlink.MAV_CMD_DO_FENCE_ENABLE),
}  # fmt: skip
SAY_AGAIN_S = 10.0
ANSWER_S = 10.0
"""An answer to a command of our own comes within this time."""
_MOST_STATIONS = 64
EVERYBODY = 0
"""Target of what all autopilots on a wire obey."""


class Commanders:
    """Watches what others send and what the boat answers to others.

    Args:
        boat: its name.
        system_id: the boat's.
        ours: our own system and component; as a `Source` it also knows our own frames when they come back.

    Attributes:
        heard_s: when somebody else was last seen commanding, s; -inf: never.
        stations: other ground stations heard, as (system, component).
    """

    def __init__(self, boat: str, system_id: int, ours: tuple[int, int]) -> None:
        self.heard_s = -float("inf")
        self.stations: set[tuple[int, int]] = set()
        self._boat, self._system_id = boat, system_id
        self._ours = ours if isinstance(ours, Source) else Source(*ours)
        self._said_s: dict[tuple[str, int, int], float] = {}

    def hear_foreign(self, message: Any, now_s: float) -> tuple[str, str]:
        """A message that is not the boat's.

        Returns:
            Kind of fault and a text for the operator; each may be empty.
        """
        source = (message.get_srcSystem(), message.get_srcComponent())
        name = message.get_type()
        if source == self._ours and self._is_echo(message):
            return self._hear_echo(message, now_s)
        if name == "HEARTBEAT" and message.type == mavlink.MAV_TYPE_GCS:
            return "", self._hear_station(source, now_s)
        if _target_of(message) not in (EVERYBODY, self._system_id):
            return "", ""
        if name in _STEERS or (name in ("COMMAND_LONG", "COMMAND_INT") and message.command in _ORDERS):
            return self._fault(source, now_s, f"sends {name}")
        return "", ""

    def hear_answer(self, message: Any, asked_s: float, now_s: float) -> tuple[str, str]:
        """A COMMAND_ACK of the boat; see `hear_foreign`.

        Args:
            message: the answer.
            asked_s: when we gave that command last, s; -inf: never.
            now_s: s.
        """
        asked = (getattr(message, "target_system", 0), getattr(message, "target_component", 0))
        ours = asked == self._ours and now_s - asked_s <= ANSWER_S
        if asked[0] == 0 or ours or message.command not in _ORDERS:
            return "", ""
        return self._fault(asked, now_s, f"gave it command {message.command}")

    def _is_echo(self, message: Any) -> bool:
        frame = message.get_msgbuf()
        return frame is not None and self._ours.sent_lately(bytes(frame))

    def _hear_echo(self, message: Any, now_s: float) -> tuple[str, str]:
        if _target_of(message) not in (-1, EVERYBODY, self._system_id):
            return "", ""
        text = "our own packets come back: a radio or router on this link reflects them; stop that, it costs bandwidth"
        return "echo", self._say("echo", self._ours, now_s, text)

    def _hear_station(self, source: tuple[int, int], now_s: float) -> str:
        """Another station; one with our own ids is a process of ours for another boat until it commands this."""
        if source == self._ours:
            return ""
        if len(self.stations) < _MOST_STATIONS:
            self.stations.add(source)
        text = f"another ground station {_who(source)} is on this link; see that it does not command"
        return self._say("station", source, now_s, text)

    def _fault(self, source: tuple[int, int], now_s: float, what: str) -> tuple[str, str]:
        self.heard_s = now_s
        text = f"a second commander {_who(source)} {what}: end it, two commanders undo each other's safety"
        return "second_commander", self._say(what, source, now_s, text)

    def _say(self, what: str, source: tuple[int, int], now_s: float, text: str) -> str:
        key = (what, *source)
        if now_s - self._said_s.get(key, -float("inf")) < SAY_AGAIN_S:
            return ""
        if len(self._said_s) > 256:
            self._said_s.clear()
        self._said_s[key] = now_s
        return f"{self._boat}: {text}"


def _target_of(message: Any) -> int:
    """System a message is for; -1: it names none."""
    return int(getattr(message, "target_system", getattr(message, "target", -1)))


def _who(source: tuple[int, int]) -> str:
    return f"(system {source[0]}, component {source[1]})"
