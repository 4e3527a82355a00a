"""All simulated boats on one water, step by step: weather, the game, what really happened, the position feed."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np
from steerclear.shield.bridge.feed import FeedSender
from steerclear.shield.bridge.feed_packets import Fix
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L

from .boat import Boat
from .game import Game
from .hull import STEP_S, Keep, Weather
from .sensing import Snapshot
from .truth import ClosestApproaches, Mark, TruthRecord

SENDER = "gps_hub"
_KEPT = 100
_ERROR_M, _ERROR_PER_NOISE_M = 0.05, 0.25
"""Bound of a fix's error: what rounding makes, and three times the sensors' spread."""
_PLAY_AFTER_S = 5.0
"""Scripted players begin when every boat of the game with a link has been commanded for this long."""


class PositionHub:
    """Sends the positions of boats to the feed's listeners, HOST:PORT each; sealed where there is a key.

    Raises:
        ConfigError: an address of another form.
    """

    def __init__(self, to: Iterable[str], frame: FieldFrame, noise: float, key: bytes | None = None) -> None:
        self._sender, self._frame = FeedSender(SENDER, to, key), frame
        self._error_m = _ERROR_M + _ERROR_PER_NOISE_M * noise
        self._past: dict[str, deque[Snapshot]] = {}

    def send(self, boats: Iterable[Boat], now_s: float) -> None:
        """Send where they are now; boats whose faults hide them are left out."""
        fixes = []
        for boat in boats:
            past = self._past.setdefault(boat.spec.name, deque(maxlen=_KEPT))
            past.append(boat.faults.sensed(boat.seen, now_s))
            until_s = now_s - boat.faults.feed_late_s
            seen = next((old for old in reversed(past) if old.time_s <= until_s), None)
            if seen is not None and not boat.faults.is_hidden:
                heading_deg = math.degrees(self._frame.heading_to_true_rad(seen.heading_rad))
                place, age_s = (seen.latitude_deg, seen.longitude_deg), max(0.0, now_s - seen.time_s)
                fixes.append(Fix(boat.spec.name, *place, heading_deg, seen.speed_mps, age_s, self._error_m))
        self._sender.send_positions(fixes)

    def close(self) -> None:
        """Give the sockets back."""
        self._sender.close()


class World:
    """Moves all boats.

    Args:
        boats: all of them.
        weather: what drifts them.
        game: the game some of them play, or None.
        players: those, in the game's order.
        hub: sends positions, or None.
        waits: whether scripted players wait until the others are commanded.
        record_radius_m: radius for breaches in the record; None: nothing is recorded.
    """

    def __init__(
        self,
        boats: Sequence[Boat],
        weather: Weather,
        game: Game | None,
        players: Sequence[Boat],
        hub: PositionHub | None,
        waits: bool,
        record_radius_m: float | None,
    ) -> None:
        self._boats, self._players = list(boats), list(players)
        self._weather, self._game, self._hub, self._waits = weather, game, hub, waits
        self._record_radius_m, self._commanded_s, self.is_playing = record_radius_m, 0.0, False
        self.closest = ClosestApproaches([boat.spec.name for boat in boats])
        self.truth: TruthRecord | None = None
        if game is not None:
            game.start(self._states())

    def warm_up(self) -> None:
        """Compile everything now, so that no step takes longer than the others."""
        self._boats[0].hull.warm_up()
        if self._game is not None and not self.is_playing:
            self._game.orders()
            self._game.follow(self._states())
            self._game.start(self._states())

    def play(self) -> None:
        """Let the scripted players and the record begin, now."""
        if self._game is None or self.is_playing:
            return
        self._game.start(self._states())
        self.is_playing = True
        if self._record_radius_m is not None:
            self.truth = TruthRecord(self._game, self._record_radius_m)

    def step(self, time_s: float) -> None:
        """Move all boats by one step, to ``time_s``."""
        self._look_for_play()
        game = self._game if self.is_playing else None
        orders = {} if game is None else {self._players[i]: order for i, order in game.orders().items()}
        headings_deg, drift = self._states()[:, L.HEADING], self._weather.drift_mps()
        for boat in self._boats:
            boat.hull.drift_mps = drift
            if boat.is_commanded or (boat.has_link and not boat.spec.policy):
                boat.step(time_s)  # somebody who commands a boat by its link takes it from its policy
            else:
                boat.step(time_s, orders.get(boat, Keep()))
        self.closest.see(np.array([boat.hull.position_m for boat in self._boats]), time_s)
        if game is not None:
            game.follow(self._states())
        if self.truth is not None:
            self.truth.step([boat.order for boat in self._players], headings_deg, list(map(_mark, self._players)))
        if self._hub is not None:
            self._hub.send(self._boats, time_s)

    def _states(self) -> Array:
        """State rows of the boats that play."""
        return np.array([boat.hull.state for boat in self._players]).reshape(-1, L.N_STATE)

    def _look_for_play(self) -> None:
        """Begin once every boat of the game that has a link obeys somebody, and goes on doing so."""
        if self.is_playing or self._game is None:
            return
        obeys = [boat.is_commanded for boat in self._players if not boat.spec.policy and boat.has_link]
        self._commanded_s = self._commanded_s + STEP_S if all(obeys) else 0.0
        if not self._waits or self._commanded_s >= _PLAY_AFTER_S:
            self.play()


def _mark(boat: Boat) -> Mark:
    commanded = boat.is_commanded
    return Mark(commanded or bool(boat.spec.policy), tuple(boat.faults.active), commanded, boat.is_held)
