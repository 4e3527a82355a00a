"""What really happened to simulated boats: closest approaches always, every state when a record is wanted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.env.record import GameRecorder, Record, find_breaches
from steerclear.env.record_meta import DEFAULT_SEPARATION_M, meta_of
from steerclear.experiments.verdicts import StateLog, judge_game
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L

from .game import Game
from .hull import STEP_S, Bear, Order, Steer, Turn

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


class Marks:
    """The marks of all boats, step by step."""

    def __init__(self) -> None:
        self._rows: list[tuple[Mark, ...]] = []
        self._last_commanded: dict[int, int] = {}
        self._kept: dict[Mark, Mark] = {}

    def add(self, marks: Sequence[Mark]) -> None:
        """Those of the step that was just moved."""
        self._rows.append(tuple(self._kept.setdefault(mark, mark) for mark in marks))
        self._last_commanded |= {boat: len(self._rows) for boat, mark in enumerate(marks) if mark.commanded}

    def commanded(self, n_boats: int) -> Array:
        """(T, n) bool: whether each boat obeyed a commander."""
        rows = [[mark.commanded for mark in row] for row in self._rows]
        return np.array(rows, dtype=np.bool_).reshape(-1, n_boats)

    def of(self, step: int, boats: Sequence[int]) -> dict[str, Any]:
        """Entries of a breach at a step (1 the first that was moved) between boats, see `docs_keys.SIM_BOATS`."""
        recent = self._rows[max(0, step - round(RECENT_S / STEP_S)) : step]
        faults = {kind for row in recent for boat in boats for kind in row[boat].faults}
        return {
            "unsteered_s": [self._unsteered_s(step, boat) for boat in boats],
            "faults": sorted(faults),
            "after_run": self._is_over(step) and all(map(self._is_left, boats)),
        }

    def _is_over(self, step: int) -> bool:
        """Whether boats had been commanded, and none is at that step or later."""
        return 0 < max(self._last_commanded.values(), default=0) < step

    def _is_left(self, boat: int) -> bool:
        """Whether a boat was left in order by whoever commanded it; also one that nobody ever commanded."""
        last = self._last_commanded.get(boat)
        return last is None or any(row[boat].held for row in self._rows[last : last + round(LEFT_S / STEP_S)])

    def _unsteered_s(self, step: int, boat: int) -> float:
        for back, row in enumerate(reversed(self._rows[:step])):
            if row[boat].steered:
                return round(back * STEP_S, 3)
        return round(step * STEP_S, 3)


@dataclass(frozen=True)
class Approach:
    """Closest approach of two boats' centres.

    Attributes:
        first, second: their names.
        distance_m: m.
        time_s: when, simulated s.
    """

    first: str
    second: str
    distance_m: float
    time_s: float


class ClosestApproaches:
    """The closest approach of each pair so far.

    Args:
        names: of the boats.
    """

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
        self._distance_m[closer] = apart[closer]
        self._time_s[closer] = time_s

    def all(self) -> list[Approach]:
        """One for each pair, closest first."""
        first, second = self._pairs
        order = np.argsort(self._distance_m, kind="stable")
        return [
            Approach(self._names[first[k]], self._names[second[k]], float(self._distance_m[k]), float(self._time_s[k]))
            for k in order
        ]


class TruthRecord:
    """Records a game of simulated boats.

    Args:
        game: the game; begun.
        separation_m: radius for breaches.
        seed: for the record.
    """

    def __init__(self, game: Game, separation_m: float = DEFAULT_SEPARATION_M, seed: int = 0) -> None:
        self._game = game
        self._separation_m = separation_m
        self._recorder = GameRecorder()
        self._log = StateLog()
        self._marks = Marks()
        players = game.players
        names = {side: _policy_of(players, game.core.team, side) for side in (0, 1)}
        self._recorder.start(
            game.core.view(),
            meta_of(
                game.core.config,
                separation_m=separation_m,
                policies={"blue": names[0], "red": names[1]},
                seed=seed,
                title="simulated boats",
            ),
        )
        self._log.start(game.core)

    def step(self, orders: Sequence[Order], headings_deg: Array, marks: Sequence[Mark]) -> None:
        """Boats have moved by a step under these orders from these headings; what held them is marked."""
        told = np.array([_told(order, heading) for order, heading in zip(orders, headings_deg, strict=True)])
        self._recorder.step(self._game.core.view(), told, told)
        self._log.step(self._game.core)
        self._marks.add(marks)

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
        return {**record, "state": self._log.states, "commanded": self._marks.commanded(record["position"].shape[1])}

    def judge(self, team: int = 0) -> list[dict[str, Any]]:
        """What the oracle says of the breaches that a team's boats were in, see `docs_keys.BREACH`.

        With what held the boats then, see `Marks.of`.
        """
        ids = list(self._game.core.config.agent_ids)
        found = judge_game(self._log, self._game.core.params, self.record(), team)
        return [
            {**breach, **self._marks.of(breach["step"], [ids.index(boat) for boat in breach["boats"]])}
            for breach in found
        ]


def record_of(truth: TruthRecord | None) -> TruthRecord:
    """The record.

    Raises:
        ConfigError: there is none.
    """
    if truth is None:
        raise ConfigError("nothing was recorded; build SimFleet with record=True, with as many red boats as blue ones")
    return truth


def _policy_of(players: Mapping[int, str], team: Array, side: int) -> str:
    named = list(dict.fromkeys(name for i, name in players.items() if team[i] == side))
    return ",".join(named) or "mavlink"


def _told(order: Order, heading_deg: float) -> tuple[float, float]:
    """Speed m/s and absolute heading deg of an order."""
    heading, speed = heading_deg, 0.0
    if isinstance(order, Steer):
        heading, speed = float(np.degrees(order.heading_rad)), order.speed_mps
    elif isinstance(order, Bear):
        heading, speed = heading_deg + order.error_deg, order.speed_mps
    elif isinstance(order, Turn):
        heading, speed = heading_deg + float(np.degrees(order.rate_rads)), order.speed_mps
    return speed, (heading + 180.0) % 360.0 - 180.0


def positions(states: Sequence[Array]) -> Array:
    """Positions (n, 2), m, of state rows."""
    return np.array([(row[L.X], row[L.Y]) for row in states])
