"""All simulated boats on one water, step by step: weather, the game, the feed, and what really happened."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.env.record import DEFAULT_SEPARATION_M, GameRecorder, Record, find_breaches, meta_of
from steerclear.experiments.verdicts import StateLog, judge_game
from steerclear.shield.bridge.feed import FeedSender
from steerclear.shield.bridge.feed_packets import Fix
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L

from .boat import Boat
from .game import Game
from .hull import STEP_S, Bear, Keep, Order, Steer, Turn, Weather
from .sensing import Snapshot

RECENT_S = 5.0
"""A fault counts for what happens so long after it, s."""
LEFT_S = 2.0
"""A boat is left in order when it is in HOLD so soon after the last command it obeyed, s: while HOLD is asked for, 4 s,
that may time out, after 3 s. A boat whose runner died stays in GUIDED, or its failsafe holds it later."""


@dataclass(frozen=True)
class Mark:
    """One boat at one step.

    Attributes:
        steered: whether a policy or a commander whom it obeys steers it.
        faults: kinds of faults that act on it.
        commanded: whether it obeys a commander.
        held: whether its autopilot is in HOLD, as the end of a run leaves it.
    """

    steered: bool
    faults: tuple[str, ...] = ()
    commanded: bool = False
    held: bool = False


Marks = Sequence[Sequence[Mark]]
"""Of all boats, step by step."""


def last_commanded(marks: Marks) -> list[int]:
    """Step at which each boat obeyed a commander for the last time, 1 the first that was moved; 0: never."""
    steps = range(len(marks), 0, -1)
    return [next((step for step in steps if marks[step - 1][i].commanded), 0) for i in range(len(marks[0]))]


def circumstances(marks: Marks, last: Sequence[int], step: int, boats: Sequence[int]) -> dict[str, Any]:
    """Entries of a breach at a step between boats, see `docs.KEYS`.

    Args:
        marks: of the whole run.
        last: when each boat was commanded for the last time, see `last_commanded`.
        step: 1 the first that was moved.
        boats: numbers of the two boats.
    """
    recent = marks[max(0, step - round(RECENT_S / STEP_S)) : step]
    is_over = 0 < max(last) < step
    return {
        "unsteered_s": [_unsteered_s(marks[:step], boat) for boat in boats],
        "faults": sorted({kind for row in recent for boat in boats for kind in row[boat].faults}),
        "after_run": is_over and all(not last[boat] or _is_left(marks[last[boat] :], boat) for boat in boats),
    }


def _is_left(after: Marks, boat: int) -> bool:
    """Whether a boat was left in order by whoever commanded it last."""
    return any(row[boat].held for row in after[: round(LEFT_S / STEP_S)])


def _unsteered_s(until: Marks, boat: int) -> float:
    back = next((k for k, row in enumerate(reversed(until)) if row[boat].steered), len(until))
    return round(back * STEP_S, 3)


@dataclass(frozen=True)
class Approach:
    """Closest approach of two boats' centres: their names, m, and simulated time, s."""

    first: str
    second: str
    distance_m: float
    time_s: float


class ClosestApproaches:
    """The closest approach of each pair so far."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = list(names)
        self._pairs = np.triu_indices(len(self._names), k=1)
        self._distance_m = np.full(self._pairs[0].size, np.inf)
        self._time_s = np.zeros(self._pairs[0].size)

    def see(self, position_m: Array, time_s: float) -> None:
        """Boats are at (n, 2), m."""
        first, second = self._pairs
        apart = np.hypot(*(position_m[first] - position_m[second]).T)
        closer = apart < self._distance_m
        self._distance_m[closer], self._time_s[closer] = apart[closer], time_s

    def all(self) -> list[Approach]:
        """One for each pair, closest first."""
        order = np.argsort(self._distance_m, kind="stable")
        pairs = [(self._names[self._pairs[0][k]], self._names[self._pairs[1][k]]) for k in order]
        figures = zip(self._distance_m[order].tolist(), self._time_s[order].tolist(), strict=True)
        return [Approach(*pair, *row) for pair, row in zip(pairs, figures, strict=True)]


class TruthRecord:
    """Records a game of simulated boats that has begun; ``separation_m``: radius for breaches."""

    def __init__(self, game: Game, separation_m: float = DEFAULT_SEPARATION_M) -> None:
        self._game, self._separation_m = game, separation_m
        self._recorder, self._log, self._marks = GameRecorder(), StateLog(), list[Sequence[Mark]]()
        core = game.core
        named = [dict.fromkeys(name for i, name in game.players.items() if core.team[i] == side) for side in (0, 1)]
        blue, red = (",".join(names) or "mavlink" for names in named)
        meta = meta_of(
            core.config,
            separation_m=separation_m,
            policies={"blue": blue, "red": red},
            seed=0,
            title="simulated boats",
        )
        self._recorder.start(core.view(), meta)
        self._log.start(core)

    def step(self, orders: Sequence[Order], headings_deg: Array, marks: Sequence[Mark]) -> None:
        """Boats have moved by a step under these orders from these headings; what held them is marked."""
        told = np.array([_told(order, heading) for order, heading in zip(orders, headings_deg, strict=True)])
        self._recorder.step(self._game.core.view(), told, told)
        self._log.step(self._game.core)
        self._marks.append(marks)

    @property
    def captures(self) -> list[int]:
        """Flags captured by blue and red."""
        return [int(count) for count in self._game.core.captures[0]]

    @property
    def tags(self) -> list[int]:
        """Tags made by blue and red."""
        return [int(count) for count in self._game.core.tags[0]]

    def record(self) -> Record:
        """Everything so far, see `steerclear.env.record`; with further arrays.

        These are ``state`` (T+1, n, N_STATE), and ``commanded`` (T, n) bool: whether each boat obeyed a commander.
        """
        record = self._recorder.finish()
        record["breaches"] = find_breaches(record["position"], self._separation_m)
        commanded = np.array([[mark.commanded for mark in row] for row in self._marks], dtype=np.bool_)
        commanded = commanded.reshape(-1, record["position"].shape[1])
        return {**record, "state": self._log.states, "commanded": commanded}

    def judge(self, team: int = 0) -> list[dict[str, Any]]:
        """What the oracle says of the breaches that a team's boats were in, see `docs.KEYS`.

        With what held the boats then, see `circumstances`.
        """
        found = judge_game(self._log, self._game.core.params, self.record(), team)
        last = last_commanded(self._marks) if found else []
        for breach in found:
            boats = [self._game.core.config.agent_ids.index(boat) for boat in breach["boats"]]
            breach.update(circumstances(self._marks, last, breach["step"], boats))
        return found


def record_of(truth: TruthRecord | None) -> TruthRecord:
    """The record.

    Raises:
        ConfigError: there is none.
    """
    if truth is None:
        raise ConfigError("nothing was recorded; build SimFleet with record=True, with as many red boats as blue ones")
    return truth


def _told(order: Order, heading_deg: float) -> tuple[float, float]:
    """Speed m/s and absolute heading deg of an order."""
    heading, speed = heading_deg, 0.0
    match order:
        case Steer(heading_rad, speed):
            heading = float(np.degrees(heading_rad))
        case Bear(error_deg, speed):
            heading = heading_deg + error_deg
        case Turn(rate_rads, speed):
            heading = heading_deg + float(np.degrees(rate_rads))
    return speed, (heading + 180.0) % 360.0 - 180.0


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
