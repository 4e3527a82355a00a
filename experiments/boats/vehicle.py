"""The autopilot's logic without its messages: boot, arming, modes, targets, time-out and ground-station failsafe."""

from __future__ import annotations

import math
from collections import deque

from .modes import NEEDS_POSITION, NOT_OFFERED, Mode
from .orders import Coast, Keep, Order, Reach, Steer, Turn
from .parameters import Parameters
from .settings import AutopilotSettings

WARNING, CRITICAL, INFO = 4, 2, 6
"""Severities of texts."""

_BOOT_S = 42.0
_POSITION_SHARE = 9.0 / _BOOT_S
_ATTITUDE_SHARE = 1.0 / _BOOT_S

NO_ARMING = "Arm: AHRS: not using configured AHRS type"


class Vehicle:
    """One boat's autopilot from power on.

    Attributes:
        parameters: kept over a restart, as on a real boat.
        mode, armed: present ones.
        texts: (severity, text) not yet sent.
        target: what the commander asked for; None when there is none or it timed out.
    """

    def __init__(self, settings: AutopilotSettings, parameters: Parameters) -> None:
        self.settings = settings
        self.parameters = parameters
        self.texts: deque[tuple[int, str]] = deque(maxlen=100)
        self.boot(0.0)

    def boot(self, now_s: float) -> None:
        """Start, or start again: everything but the parameters is forgotten."""
        self.booted_s = now_s
        self.armed = False
        self.mode = Mode(int(self.parameters["INITIAL_MODE"]))
        self.target: Steer | Turn | Reach | None = None
        self._target_s = -math.inf
        self._timed_out = False
        self._gcs_s = math.inf
        self.texts.clear()
        self.say(INFO, "ArduPilot Ready")

    def say(self, severity: int, text: str) -> None:
        """Queue a text for the ground."""
        self.texts.append((severity, text))

    def uptime_s(self, now_s: float) -> float:
        """Since power on, s."""
        return now_s - self.booted_s

    def has_position(self, now_s: float) -> bool:
        """Whether it knows where it is."""
        return self.uptime_s(now_s) >= self.settings.boot_s * _POSITION_SHARE

    def has_attitude(self, now_s: float) -> bool:
        """Whether its attitude is to be believed."""
        return self.uptime_s(now_s) >= self.settings.boot_s * _ATTITUDE_SHARE

    def can_arm(self, now_s: float) -> bool:
        """Whether all checks pass."""
        return self.uptime_s(now_s) >= self.settings.boot_s

    def arm(self, now_s: float, force: bool = False) -> bool:
        """Arm; refusals are explained in a text."""
        checks = self.parameters["ARMING_CHECK"] != 0.0 and not force
        if not self.armed and checks and not self.can_arm(now_s):
            self.say(CRITICAL, NO_ARMING)
            return False
        self.armed = True
        return True

    def disarm(self) -> None:
        """Motors off."""
        self.armed = False

    def set_mode(self, number: int, now_s: float) -> bool:
        """Change mode; refusals are explained in a text."""
        if number not in list(Mode):
            self.say(WARNING, f"No such mode {number}")
            return False
        mode = Mode(number)
        if mode == self.mode:
            return True
        if mode in NOT_OFFERED or (mode in NEEDS_POSITION and not self.has_position(now_s)):
            self.say(WARNING, "Flight mode change failed")
            return False
        self.mode = mode
        self.target, self._timed_out = None, False
        return True

    def take(self, target: Steer | Turn | Reach, now_s: float) -> bool:
        """Obey a target from now on; in any other mode than GUIDED it is ignored."""
        if self.mode is not Mode.GUIDED:
            return False
        self.target, self._target_s, self._timed_out = target, now_s, False
        return True

    def hear_ground(self, now_s: float) -> None:
        """A heartbeat of the ground station came."""
        self._gcs_s = now_s

    def tick(self, now_s: float) -> None:
        """Look at the clocks: targets that grew old, ground stations gone silent."""
        limit = self._timeout_s()
        if isinstance(self.target, (Steer, Turn)) and now_s - self._target_s > limit:
            self.say(WARNING, f"target not received last {limit:g}secs, stopping")
            self.target, self._timed_out = None, True
        patience = self.parameters["FS_GCS_TIMEOUT"] + self.parameters["FS_TIMEOUT"]
        watched = self.parameters["FS_GCS_ENABLE"] != 0.0 and self.armed and self.mode is not Mode.HOLD
        if watched and now_s - self._gcs_s > patience:
            self.say(CRITICAL, "Radio Failsafe")
            self.set_mode(Mode.HOLD, now_s)

    def order(self) -> Order:
        """What the hull is to do now."""
        if not self.armed or self.mode in (Mode.MANUAL, Mode.ACRO, Mode.STEERING, Mode.HOLD):
            return Coast()
        if self.mode is Mode.GUIDED and self.target is not None:
            return self.target
        return Keep(self.settings.back_up_m if self._timed_out else 0.0)

    def _timeout_s(self) -> float:
        return self.parameters.get("GUID_TIMEOUT", self.settings.timeout_s)
