"""How far ways keep from the reach of opponents, who are where their habit takes them or sail at the boat."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..plane import distance
from ..sight import Boat, Sight
from .habits import Habits, Track

AHEAD_S = 90
"""Longest time that is looked ahead, s."""
WAKES_S = 2.0
"""So long before and after a tagged opponent is free again it is kept clear of, s."""

Numbers = NDArray[np.float64]


class Waters:
    """What is known of the opponents from a moment on.

    Args:
        sight: the moment.
        habits: of the opponents.
        keep_m: how far off the reach of opponents that keep a habit a way has to be, m.
        free_m: by how much others that cut a boat off at once have to miss it, see `way.slack_m`, m.
    """

    def __init__(self, sight: Sight, habits: Habits, keep_m: float, free_m: float) -> None:
        self.sight, self._keep_m, self._free_m = sight, keep_m, free_m
        self._tracks = [habits.track(number, AHEAD_S) for number in range(len(sight.foes))]

    def room_m(self, points: Numbers, times_s: Numbers, grabs_s: Numbers) -> Numbers:
        """Room on ways: how much farther off opponents than asked for they keep, at the narrowest, m.

        Args:
            points: (W, n, 2) of each way, m.
            times_s: (W, n) after which they are reached, s.
            grabs_s: (W,) after which the flag is grabbed, s.

        Returns:
            (W,), inf for ways on the own side.
        """
        rooms = np.full(points.shape[:2], np.inf)
        for foe, track in zip(self.sight.foes, self._tracks, strict=True):
            if track is None:
                room = self._of_chaser_m(foe, points, times_s, grabs_s)
            else:
                room = self._of_track_m(track, points, times_s)
            rooms = np.minimum(rooms, room)
        nearest: Numbers = np.where(points[..., 0] > self.sight.line, rooms, np.inf).min(axis=1)
        return nearest

    def _of_track_m(self, track: Track, points: Numbers, times_s: Numbers) -> Numbers:
        """Room (W, n) from an opponent that is known ahead."""
        then = track[np.clip(np.rint(times_s).astype(int) - 1, 0, AHEAD_S - 1)]
        room_m = np.linalg.norm(points - then[..., :2], axis=-1) - self.sight.reach - self._keep_m
        found: Numbers = np.where(then[..., 2] > 0.0, room_m, np.inf)
        return found

    def _of_chaser_m(self, foe: Boat, points: Numbers, times_s: Numbers, grabs_s: Numbers) -> Numbers:
        """Room (W, n) from an opponent that may do anything."""
        at, free_s = np.array(foe.at), np.zeros_like(grabs_s) if foe.on_side else grabs_s
        if foe.tagged:
            share = max(1.0 - self.sight.reach / max(distance(foe.at, self.sight.base), 1e-9), 0.0)
            at = at + share * (np.array(self.sight.base) - at)
            free_s = np.full_like(grabs_s, distance(foe.at, (at[0], at[1])) / foe.top)
        off_m: Numbers = np.linalg.norm(points - at, axis=-1) - self.sight.reach
        room_m: Numbers = off_m - foe.top * np.maximum(times_s - free_s[:, None], 0.0) - self._free_m
        if foe.tagged:
            wakes = np.abs(times_s - free_s[:, None]) < WAKES_S
            room_m = np.minimum(room_m, np.where(wakes, off_m - self._keep_m, np.inf))
        return room_m
