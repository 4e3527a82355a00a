"""`Obedience`: a boat that says it obeys and does not: somebody else steers it unseen, or its steering failed.

SET_* messages are never acknowledged, and another ground station's are not seen on our wire; what remains is to watch
what the boat does.
"""

from __future__ import annotations

import math

ASIDE_RAD = math.radians(30.0)
"""Only a heading this far from the one told says anything."""
AWAY_RADS = math.radians(4.0)
"""Turning faster than this to the wrong side is turning away."""
STEERS_MPS = 0.3
"""A boat told to go slower than this may not steer."""
PATIENCE_S = 2.0
"""A boat that was told otherwise until now is given so long to turn back."""
AWAY_S = 1.5
"""Turning away for so long is disobedience; turning rightly for as long makes it good."""
STEADY_RAD = math.radians(20.0)
"""Only while the heading told stays within this does turning away say anything: an autopilot answers a heading that
sweeps by its derivative, against it."""
STOP_S = 10.0
STOP_MPS = 0.8
"""Told to stop for so long, and still faster than this."""
SLOWED, LONGEST_STOP_S = 0.75, 30.0
"""A boat that has come down to this share of the speed it had then is stopping, for up to so long."""


class Obedience:
    """Compares what a boat is told with what it does; angles rad clockwise from true north."""

    def __init__(self) -> None:
        self._told_rad, self._told_mps = math.nan, math.nan
        self._stop_since_s, self._stop_from_mps = math.inf, math.nan
        self._side, self._side_since_s, self._side_told_rad = 0, math.inf, math.nan
        self._away_s, self._seen_s = 0.0, math.nan

    def told(self, heading_rad: float, speed_mps: float, now_s: float) -> None:
        """A command left that the boat should obey."""
        self._told_rad, self._told_mps = heading_rad, speed_mps
        if abs(speed_mps) > 0.01:
            self._stop_since_s, self._stop_from_mps = math.inf, math.nan
        else:
            self._stop_since_s = min(self._stop_since_s, now_s)

    def forget(self) -> None:
        """The boat is not expected to obey now."""
        self.__dict__.update(Obedience().__dict__)

    def fault(self, heading_rad: float, rate_rads: float, speed_mps: float, now_s: float) -> str:
        """What is wrong with what the boat does, in words; mostly empty. Told once, then the watch begins anew."""
        text = self._turns_away(heading_rad, rate_rads, now_s) or self._runs_on(speed_mps, now_s)
        if text:
            self.forget()
        return text

    def _turns_away(self, heading_rad: float, rate_rads: float, now_s: float) -> str:
        dt_s = now_s - self._seen_s if math.isfinite(self._seen_s) else 0.0
        self._seen_s = now_s
        error = _half_turn(self._told_rad - heading_rad)
        side = 0 if not abs(error) > ASIDE_RAD or not abs(self._told_mps) >= STEERS_MPS else (1 if error > 0.0 else -1)
        if side != self._side or not abs(_half_turn(self._told_rad - self._side_told_rad)) <= STEADY_RAD:
            self._side, self._side_since_s, self._side_told_rad = side, now_s, self._told_rad
            self._away_s = 0.0
        if side == 0 or now_s - self._side_since_s < PATIENCE_S:
            return ""
        away = rate_rads * side < -AWAY_RADS
        self._away_s = max(0.0, self._away_s + (dt_s if away else -dt_s))
        if self._away_s < AWAY_S:
            return ""
        return f"it turns away from the heading it is told, {math.degrees(abs(error)):.0f} deg off"

    def _runs_on(self, speed_mps: float, now_s: float) -> str:
        told_s = now_s - self._stop_since_s
        if math.isnan(self._stop_from_mps) and told_s >= 0.0:
            self._stop_from_mps = abs(speed_mps)
        if told_s < STOP_S or not abs(speed_mps) > STOP_MPS:
            return ""
        if abs(speed_mps) < SLOWED * self._stop_from_mps and told_s < LONGEST_STOP_S:
            return ""
        return f"it was told to stop {told_s:.0f} s ago and makes {abs(speed_mps):.1f} m/s"


def _half_turn(angle_rad: float) -> float:
    """The angle in [-pi, pi), rad."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi
