"""`Dialogue`: questions to one autopilot and its answers: commands, parameters, what it can do, what it says."""

from __future__ import annotations

import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..clock import Clock
from ..messages import never
from .routes import Abilities
from .texts import Texts

ASK_AGAIN_S = 0.7
LEARN_AGAIN_S = 0.4
_ROUND_S = 0.15
"""Rounds of questions are at least this far apart, so that one gap in the radio does not cost all tries."""
_TRIES = 3
"""A parameter asked for so often and never answered is one this firmware lacks."""
SAID_S = 15.0
"""What an autopilot said so recently belongs to a refusal."""
_TOP = "WP_SPEED"


class Patience:
    """A deadline on the loop's clock that real time also ends, so that a clock that stands still cannot hang a start.

    Args:
        clock: the loop's.
        timeout_s: s.
        is_off: true once what is waited for is not wanted any more.
    """

    def __init__(self, clock: Clock, timeout_s: float, is_off: Callable[[], bool] = never) -> None:
        self._clock = clock
        self.is_off = is_off
        self._end_s = clock.now_s() + timeout_s
        self._real_end_s = time.monotonic() + timeout_s

    @property
    def is_over(self) -> bool:
        """Whether the time is up, or it was called off."""
        return self.is_off() or self._clock.now_s() >= self._end_s or time.monotonic() >= self._real_end_s

    def part(self, timeout_s: float) -> Patience:
        """A shorter one that is over with this one."""
        left = min(self._end_s - self._clock.now_s(), self._real_end_s - time.monotonic())
        return Patience(self._clock, max(0.0, min(timeout_s, left)), self.is_off)


class Dialogue:
    """Answers are taken in on the link's thread; questions are asked, and waited for, on the caller's.

    Args:
        target: system and component of the autopilot.
        send: sends a message, never waits.
        clock: the loop's.

    Attributes:
        changed: notified whenever something came in; its lock guards all a link knows of its boat.
        parameters: by name, as last heard.
        version, capabilities: of AUTOPILOT_VERSION.
    """

    def __init__(self, target: tuple[int, int], send: Callable[[Any], bool], clock: Clock) -> None:
        self.changed = threading.Condition(threading.RLock())
        self.parameters: dict[str, float] = {}
        self.version: tuple[int, int, int] | None = None
        self.capabilities = 0
        self._target, self._send, self._clock = target, send, clock
        self._texts = Texts()
        self._said: deque[tuple[float, str]] = deque(maxlen=50)
        self._results: dict[int, int] = {}
        self._tries: Counter[str] = Counter()
        self._answers: Counter[str] = Counter()
        self._asked_s: dict[int, float] = {}
        self._unread: deque[str] = deque(maxlen=100)

    @property
    def abilities(self) -> Abilities:
        """What is known of the autopilot."""
        return Abilities(self.version, self.capabilities, self.parameters.get(_TOP))

    def asked_s(self, command: int) -> float:
        """When that command was given last, s; -inf: never."""
        return self._asked_s.get(command, -math.inf)

    def hear(self, message: Any, now_s: float) -> None:
        """Take an answer in; the caller holds the lock."""
        name = message.get_type()
        if name == "COMMAND_ACK":
            self._results[message.command] = message.result
        elif name == "PARAM_VALUE":
            self._hear_parameter(str(message.param_id), message.param_value)
        elif name == "AUTOPILOT_VERSION":
            packed = message.flight_sw_version
            self.version = (packed >> 24, packed >> 16 & 0xFF, packed >> 8 & 0xFF)
            self.capabilities = message.capabilities
        elif name == "STATUSTEXT":
            for text in self._texts.hear(message):
                self.say(text, now_s)

    def say(self, text: str, now_s: float) -> None:
        """Keep a text for the next reading and for refusals."""
        if text:
            self._said.append((now_s, text))
            self._unread.append(text)

    def take_texts(self) -> tuple[str, ...]:
        """Texts since this was last asked."""
        texts = tuple(self._unread)
        self._unread.clear()
        return texts

    def said(self) -> str:
        """What the autopilot said lately, each text once, for a refusal."""
        now_s = self._clock.now_s()
        recent = dict.fromkeys(text for at, text in self._said if now_s - at <= SAID_S)
        return "; ".join(recent) or "it gave no reason"

    def wait(self, holds: Callable[[], bool], patience: Patience) -> bool:
        """Wait until something holds; False when the time is up first."""
        with self.changed:
            while not holds():
                if patience.is_over:
                    return False
                self.changed.wait(0.02)
            return True

    def command(self, message: Any, patience: Patience) -> int | None:
        """Send a command again and again until it is answered.

        Returns:
            MAV_RESULT, or None when no answer came in time.
        """
        with self.changed:
            self._results.pop(message.command, None)
        while not patience.is_over:
            self._asked_s[message.command] = self._clock.now_s()
            self._send(message)
            if self.wait(lambda: self._is_answered(message.command), patience.part(ASK_AGAIN_S)):
                return self._results[message.command]
        return None

    def _is_answered(self, command: int) -> bool:
        return self._results.get(command, mavlink.MAV_RESULT_IN_PROGRESS) != mavlink.MAV_RESULT_IN_PROGRESS

    def learn(self, needed: str, others: tuple[str, ...], patience: Patience) -> None:
        """Ask for parameters and for what the autopilot can do; waits for the needed one, others get a few tries.

        The needed one is asked for last in each round: once that is answered, what firmware lacks is waited for no
        longer.
        """
        while not patience.is_over:
            with self.changed:
                unknown = [name for name in others if self._is_worth_asking(name)]
                if not unknown and needed in self.parameters and self.version is not None:
                    return
            self._ask_once((*unknown, needed), patience)
            self.wait(lambda: self._knows((needed, *others)), patience.part(_ROUND_S))

    def _ask_once(self, names: tuple[str, ...], patience: Patience) -> None:
        """One round of questions; it is over when the last is answered, and the version known."""
        last = names[-1]
        with self.changed:
            answers = self._answers[last]
        if self.version is None:
            self._send(self._version_request())
        for name in names:
            self.ask_parameter(name)
        self.wait(lambda: self.version is not None and self._answers[last] > answers, patience.part(LEARN_AGAIN_S))

    def _is_worth_asking(self, name: str) -> bool:
        return name not in self.parameters and self._tries[name] < _TRIES

    def _knows(self, names: tuple[str, ...]) -> bool:
        return self.version is not None and all(name in self.parameters for name in names)

    def ask_parameter(self, name: str) -> None:
        """Ask for one parameter."""
        self._tries[name] += 1
        self._send(mavlink.MAVLink_param_request_read_message(*self._target, name.encode(), -1))

    def _version_request(self) -> Any:
        return mavlink.MAVLink_command_long_message(
            *self._target, mavlink.MAV_CMD_REQUEST_MESSAGE, 0,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION, 0, 0, 0, 0, 0, 0,
        )  # fmt: skip

    def _hear_parameter(self, name: str, value: float) -> None:
        name = name.rstrip("\x00")
        if not self._tries[name]:
            return  # nobody asked: others' parameters must not fill memory
        self._answers[name] += 1
        if math.isfinite(value):
            self.parameters[name] = float(value)
        elif name in self.parameters:
            del self.parameters[name]  # what it was is not known any more
