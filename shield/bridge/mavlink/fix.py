"""`FixWatch`: whether an autopilot's position rests on satellites now, by its own word.

An autopilot that loses its fix goes on telling positions, with fresh time stamps: dead reckoning, which runs away from
the boat by metres within seconds. Nothing in the position itself shows it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

ENOUGH_FIX = int(mavlink.GPS_FIX_TYPE_3D_FIX)
SILENT_S = 3.0
"""A receiver that was heard and then said nothing for so long has lost its fix as far as anybody can tell."""
GAP_S = 1.0
"""A gap in the positions themselves is the link's: what is silent with them is counted from their return."""
WORST_HDOP = 5.0
WORST_ACCURACY_M = 5.0
"""Fixes as poor as this are of the right harbour, not of the right place."""
NOT_KNOWN = 65_535
"""What GPS_RAW_INT says for an ``eph`` that is not available."""

_RECEIVERS = {"GPS_RAW_INT": 1, "GPS2_RAW": 2}
_ABSOLUTE = int(mavlink.EKF_POS_HORIZ_ABS)
_NO_PLACE = int(mavlink.EKF_CONST_POS_MODE) | int(mavlink.EKF_UNINITIALIZED)
_GLITCH = 1 << 15
"""EKF_GPS_GLITCHING, which not every dialect knows."""


class _Word(NamedTuple):
    """What one receiver said last: kind of fault and words, both empty when its fix is good."""

    fix_type: int
    kind: str
    words: str
    heard_s: float


class FixWatch:
    """What GPS_RAW_INT, GPS2_RAW and EKF_STATUS_REPORT of one autopilot say; each counts once it was heard."""

    def __init__(self) -> None:
        self._receivers: dict[int, _Word] = {}
        self._estimate = ""
        self._position_s = self._resumed_s = -math.inf

    @property
    def fix_type(self) -> int:
        """GPS_FIX_TYPE of the best receiver, as last heard; -1: none was."""
        return max((word.fix_type for word in self._receivers.values()), default=-1)

    def hear(self, message: Any, now_s: float) -> None:
        """Take a message in; of other kinds than these three, and of positions more than that they come, nothing."""
        name = message.get_type()
        if name == "GLOBAL_POSITION_INT":
            if now_s - self._position_s > GAP_S:
                self._resumed_s = now_s
            self._position_s = now_s
        elif name in _RECEIVERS:
            kind, words = _fault_of(message)
            self._receivers[_RECEIVERS[name]] = _Word(int(message.fix_type), kind, words, now_s)
        elif name == "EKF_STATUS_REPORT":
            self._estimate = _estimate_fault(int(message.flags))

    def fault(self, now_s: float) -> tuple[str, str]:
        """Why a position told now is none: kind and words, both empty when it may be believed.

        One receiver with a good fix is enough. Of an autopilot that never spoke of its fix nothing is known: preflight
        refuses that.
        """
        found = [self._aged(number, word, now_s) for number, word in sorted(self._receivers.items())]
        if found and all(kind for kind, _ in found):
            return found[0][0], ", ".join(words for _, words in found)
        return ("no_estimate", self._estimate) if self._estimate else ("", "")

    def _aged(self, number: int, word: _Word, now_s: float) -> tuple[str, str]:
        receiver = "GPS" if number == 1 else f"GPS {number}"
        if now_s - max(word.heard_s, self._resumed_s) > SILENT_S:
            return "fix_silent", f"nothing heard of the {receiver} fix for {now_s - word.heard_s:.0f} s"
        return word.kind, f"{receiver} {word.words}"


def _fault_of(message: Any) -> tuple[str, str]:
    if message.fix_type < ENOUGH_FIX:
        return "no_fix", f"has no fix (fix type {message.fix_type})"
    if message.eph != NOT_KNOWN and message.eph * 0.01 > WORST_HDOP:
        return "poor_fix", f"fix is poor (HDOP {message.eph * 0.01:.1f})"
    accuracy_m = getattr(message, "h_acc", 0) * 1e-3  # 0: not told
    if math.isfinite(accuracy_m) and accuracy_m > WORST_ACCURACY_M:
        return "poor_fix", f"fix is poor (good to {accuracy_m:.0f} m)"
    return "", ""


def _estimate_fault(flags: int) -> str:
    if flags & _NO_PLACE or not flags & _ABSOLUTE:
        return "the autopilot's filter has no absolute position"
    return "the autopilot's filter rejects its GPS" if flags & _GLITCH else ""
