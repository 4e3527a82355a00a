"""All simulated boats on one water, step by step: weather, the game, the feed, and what really happened."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.env.record import DEFAULT_SEPARATION_M, GameRecorder, Record, find_violations, meta_of
from steerclear.experiments.verdicts import StateLog, judge_game
from steerclear.shield.bridge.feed_packets import FeedSender, Fix
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L

from .boat import Boat
from .game import Game
from .hull import STEP_S, Bear, Keep, Order, Steer, Turn, Weather
from .sensing import Snapshot

RECENT_S = 5.0  # a fault is reported with a separation violation up to this long after it acted, s
LEFT_S = 2.0
"""A run left its boat in order if the boat is in HOLD within this time after its last obeyed command, s.

Runners request HOLD for 4 s and the command times out after 3 s. A boat whose runner died stays in GUIDED, or its
failsafe holds it later."""


@dataclass(frozen=True)
class Mark:
    """State of one boat at one step."""

    steered: bool  # whether a policy, or a commander that it obeys, steers the boat
    faults: tuple[str, ...] = ()  # kinds of the active faults
    commanded: bool = False  # whether the boat obeys a commander
    held: bool = False  # whether its autopilot is in HOLD, as a run leaves it at its end


Marks = Sequence[Sequence[Mark]]  # marks of all boats, step by step


def last_commanded(marks: Marks) -> list[int]:
    """Return the step at which each boat last obeyed a commander; the first step is 1, and 0 means never."""
    steps = range(len(marks), 0, -1)
    return [next((step for step in steps if marks[step - 1][i].commanded), 0) for i in range(len(marks[0]))]


def circumstances(marks: Marks, last: Sequence[int], step: int, boats: Sequence[int]) -> dict[str, Any]:
    """Return what held two boats at a separation violation, see `docs.KEYS`.

    Args:
        marks: of the whole run.
        last: step at which each boat was last commanded, see `last_commanded`.
        step: step of the violation; the first is 1.
        boats: numbers of the two boats.
    """
    recent, soon = marks[max(0, step - round(RECENT_S / STEP_S)) : step], round(LEFT_S / STEP_S)
    until = marks[:step][::-1]
    unsteered = [next((k for k, row in enumerate(until) if row[boat].steered), len(until)) for boat in boats]
    left = [not last[boat] or any(row[boat].held for row in marks[last[boat] :][:soon]) for boat in boats]
    return {
        "unsteered_s": [round(steps * STEP_S, 3) for steps in unsteered],
        "faults": sorted({kind for row in recent for boat in boats for kind in row[boat].faults}),
        "after_run": 0 < max(last) < step and all(left),
    }


@dataclass(frozen=True)
class Approach:
    """Closest approach of two boats' centres: names, distance in m and simulated time in s."""

    first: str
    second: str
    distance_m: float
    time_s: float


class ClosestApproaches:
    """Closest approach of each pair of boats so far."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = list(names)
        self._pairs = np.triu_indices(len(self._names), k=1)
        self._distance_m = np.full(self._pairs[0].size, np.inf)
        self._time_s = np.zeros(self._pairs[0].size)

    def see(self, position_m: Array, time_s: float) -> None:
        """Update with the boats' positions (n, 2), m."""
        first, second = self._pairs
        apart = np.hypot(*(position_m[first] - position_m[second]).T)
        closer = apart < self._distance_m
        self._distance_m[closer], self._time_s[closer] = apart[closer], time_s

    def all(self) -> list[Approach]:
        """Return one approach for each pair, closest first."""
        order = np.argsort(self._distance_m, kind="stable")
        pairs = [(self._names[self._pairs[0][k]], self._names[self._pairs[1][k]]) for k in order]
        figures = zip(self._distance_m[order].tolist(), self._time_s[order].tolist(), strict=True)
        return [Approach(*pair, *row) for pair, row in zip(pairs, figures, strict=True)]


class TruthRecord:
    """Records a simulated game that has begun; below ``separation_m`` is a separation violation."""

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
        """Record a step: the orders, the headings before it, and the marks of all boats."""
        commands = np.array([_command_of(order, heading) for order, heading in zip(orders, headings_deg, strict=True)])
        self._recorder.step(self._game.core.view(), commands, commands)
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
        """Return the record so far, see `steerclear.env.record`, with two more arrays.

        ``state`` is (T+1, n, N_STATE); ``commanded`` (T, n) says whether each boat obeyed a commander.
        """
        record = self._recorder.finish()
        record["violations"] = find_violations(record["position"], self._separation_m)
        commanded = np.array([[mark.commanded for mark in row] for row in self._marks], dtype=np.bool_)
        commanded = commanded.reshape(-1, record["position"].shape[1])
        return {**record, "state": self._log.states, "commanded": commanded}

    def judge(self, team: int = 0) -> list[dict[str, Any]]:
        """Return a team's separation violations with the post-hoc avoidability analysis, see `docs.KEYS`.

        Each also has the entries of `circumstances`.
        """
        found = judge_game(self._log, self._game.core.params, self.record(), team)
        last = last_commanded(self._marks) if found else []
        for violation in found:
            boats = [self._game.core.config.agent_ids.index(boat) for boat in violation["boats"]]
            violation.update(circumstances(self._marks, last, violation["step"], boats))
        return found


def record_of(truth: TruthRecord | None) -> TruthRecord:
    """Return the record; `ConfigError` where nothing was recorded."""
    if truth is None:
        raise ConfigError("nothing was recorded; build SimFleet with record=True, with as many red boats as blue ones")
    return truth


def _command_of(order: Order, heading_deg: float) -> tuple[float, float]:
    """Return the speed in m/s and absolute heading in deg of an order."""
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
"""Error bound of a fix: rounding, plus three standard deviations of the sensors per unit of noise."""
_PLAY_AFTER_S = 5.0  # scripted players begin when all linked boats of the game have been commanded for this long, s


class PositionHub:
    """Sends boat positions to the feed's listeners (HOST:PORT); messages are authenticated if there is a key.

    Raises:
        ConfigError: an address is malformed.
    """

    def __init__(self, to: Iterable[str], frame: FieldFrame, noise: float, key: bytes | None = None) -> None:
        self._sender, self._frame = FeedSender(SENDER, to, key), frame
        self._error_m = _ERROR_M + _ERROR_PER_NOISE_M * noise
        self._past: dict[str, deque[Snapshot]] = {}

    def send(self, boats: Iterable[Boat], now_s: float) -> None:
        """Send current positions, except of boats whose faults hide them."""
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
        """Close the sockets."""
        self._sender.close()


class World:
    """Moves all boats, of which ``players``, in the game's order, play.

    If it ``waits``, scripted players wait until the others are commanded. Boats within ``record_radius_m``, m, count as
    a separation violation; None: nothing is recorded.
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
        """Compile all code, so that no later step is slowed by compilation."""
        self._boats[0].hull.warm_up()
        if self._game is not None and not self.is_playing:
            self._game.orders()
            self._game.follow(self._states())
            self._game.start(self._states())

    def play(self) -> None:
        """Begin the game and the record immediately."""
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
                boat.step(time_s)  # whoever commands a boat by its link replaces its policy
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
        """State rows of the players."""
        return np.array([boat.hull.state for boat in self._players]).reshape(-1, L.N_STATE)

    def _look_for_play(self) -> None:
        """Begin the game once all linked boats of the game have obeyed a commander for long enough."""
        if self.is_playing or self._game is None:
            return
        obeys = [boat.is_commanded for boat in self._players if not boat.spec.policy and boat.has_link]
        self._commanded_s = self._commanded_s + STEP_S if all(obeys) else 0.0
        if not self._waits or self._commanded_s >= _PLAY_AFTER_S:
            self.play()


def _mark(boat: Boat) -> Mark:
    commanded = boat.is_commanded
    return Mark(commanded or bool(boat.spec.policy), tuple(boat.faults.active), commanded, boat.is_held)
