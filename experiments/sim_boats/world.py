"""All simulated boats on one water, step by step: weather, the game, what really happened, the position feed."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np
from steerclear.shield.bridge.feed_packets import Fix
from steerclear.shield.bridge.feed_sender import FeedSender
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L

from .boat import Boat
from .game import Game
from .hull import STEP_S, Keep, Order, Weather
from .sensing import Snapshot
from .truth import ClosestApproaches, Mark, TruthRecord, positions

SENDER = "gps_hub"
_KEPT = 100
_ERROR_M, _ERROR_PER_NOISE_M = 0.05, 0.25
"""Bound of a fix's error: what rounding makes, and three times the sensors' spread."""


class PositionHub:
    """Sends the positions of boats to the feed's listeners.

    Args:
        to: HOST:PORT of each listener.
        frame: where the field is.
        noise: of the sensors, for the declared error.
        key: the signing key, so that packets are sealed; None: they are not.

    Raises:
        ConfigError: an address of another form.
    """

    def __init__(self, to: Iterable[str], frame: FieldFrame, noise: float, key: bytes | None = None) -> None:
        self._sender = FeedSender(SENDER, to, key)
        self._frame = frame
        self._error_m = _ERROR_M + _ERROR_PER_NOISE_M * noise
        self._past: dict[str, deque[Snapshot]] = {}

    def send(self, boats: Iterable[Boat], now_s: float) -> None:
        """Send where they are now; boats whose faults hide them are left out."""
        fixes = []
        for boat in boats:
            past = self._past.setdefault(boat.spec.name, deque(maxlen=_KEPT))
            past.append(boat.faults.sensed(boat.seen, now_s))
            late = boat.faults.feed_late_s
            seen = next((old for old in reversed(past) if old.time_s <= now_s - late), None)
            if seen is not None and not boat.faults.is_hidden:
                fixes.append(self._fix(boat.spec.name, seen, now_s))
        self._sender.send_positions(fixes)

    def close(self) -> None:
        """Give the sockets back."""
        self._sender.close()

    def _fix(self, name: str, seen: Snapshot, now_s: float) -> Fix:
        return Fix(
            boat=name,
            latitude_deg=seen.latitude_deg,
            longitude_deg=seen.longitude_deg,
            heading_deg=math.degrees(self._frame.heading_to_true_rad(seen.heading_rad)),
            speed_mps=seen.speed_mps,
            age_s=max(0.0, now_s - seen.time_s),
            error_m=self._error_m,
        )


_PLAY_AFTER_S = 5.0
"""Scripted players begin when every boat of the game with a link has been commanded for this long."""


class World:
    """Moves all boats.

    Args:
        boats: all of them.
        weather: what drifts them.
        game: the game some of them play, or None.
        players: those, in the game's order.
        hub: sends positions, or None.
        waits: whether scripted players wait until the others are commanded.

    Attributes:
        record_radius_m: radius for breaches in the record; None: nothing is recorded.
        closest: closest approaches so far.
        is_playing: whether the game has begun.
        truth: the record, once the game has begun.
    """

    def __init__(
        self,
        boats: Sequence[Boat],
        weather: Weather,
        game: Game | None,
        players: Sequence[Boat],
        hub: PositionHub | None,
        waits: bool = True,
    ) -> None:
        self._boats = list(boats)
        self._weather = weather
        self._game = game
        self._players = list(players)
        self._hub = hub
        self._waits = waits
        self._commanded_s = 0.0
        self.closest = ClosestApproaches([boat.spec.name for boat in boats])
        self.record_radius_m: float | None = None
        self.is_playing = False
        self.truth: TruthRecord | None = None
        self._restart_game()

    def warm_up(self) -> None:
        """Compile everything now, so that no step takes longer than the others."""
        self._boats[0].hull.warm_up()
        if self._game is not None and not self.is_playing:
            self._game.orders()
            self._game.follow([boat.hull.state for boat in self._players])
            self._restart_game()

    def play(self) -> None:
        """Let the scripted players and the record begin, now."""
        if self._game is None or self.is_playing:
            return
        self._restart_game()
        self.is_playing = True
        if self.record_radius_m is not None:
            self.truth = TruthRecord(self._game, self.record_radius_m)

    def step(self, time_s: float) -> None:
        """Move all boats by one step, to ``time_s``."""
        self._look_for_play()
        given = self._game.orders() if self._game is not None and self.is_playing else {}
        # somebody who commands a boat by its link takes it from its policy
        free = {i: order for i, order in given.items() if not self._players[i].is_commanded}
        orders: dict[str, Order] = {self._players[i].spec.name: order for i, order in free.items()}
        headings = np.array([boat.hull.state[L.HEADING] for boat in self._players])
        drift = self._weather.drift_mps(STEP_S)
        for boat in self._boats:
            boat.hull.drift_mps = drift
            boat.step(time_s, orders.get(boat.spec.name, _otherwise(boat)))
        self._note(headings, time_s)

    def _note(self, headings_deg: Array, time_s: float) -> None:
        self.closest.see(positions([boat.hull.state for boat in self._boats]), time_s)
        if self._game is not None and self.is_playing:
            self._game.follow([boat.hull.state for boat in self._players])
        if self.truth is not None:
            marks = [
                Mark(_is_steered(boat), boat.faults.active, boat.is_commanded, boat.is_held) for boat in self._players
            ]
            self.truth.step([boat.order for boat in self._players], headings_deg, marks)
        if self._hub is not None:
            self._hub.send(self._boats, time_s)

    def _look_for_play(self) -> None:
        """Begin once every boat of the game that has a link obeys somebody, and goes on doing so."""
        if self.is_playing or self._game is None:
            return
        ready = not self._waits or all(
            boat.is_commanded for boat in self._players if not boat.spec.policy and boat.has_link
        )
        self._commanded_s = self._commanded_s + STEP_S if ready else 0.0
        if not self._waits or self._commanded_s >= _PLAY_AFTER_S:
            self.play()

    def _restart_game(self) -> None:
        if self._game is not None:
            self._game.start([boat.hull.state for boat in self._players])


def _is_steered(boat: Boat) -> bool:
    """Whether a commander or a policy steers it now."""
    return boat.is_commanded or bool(boat.spec.policy)


def _otherwise(boat: Boat) -> Order | None:
    """What a boat does that no policy drives now: its autopilot's order, or nothing without a link."""
    waits_for_policy = boat.spec.policy and not boat.is_commanded
    return None if boat.has_link and not waits_for_policy else Keep()
