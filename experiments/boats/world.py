"""All simulated boats on one water, step by step: weather, orders, the game, what really happened, the feed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L

from .boat import Boat
from .game import Game
from .hub import PositionHub
from .hull import STEP_S
from .marks import Mark
from .orders import Keep, Order
from .truth import ClosestApproaches, TruthRecord, positions
from .weather import Weather

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
