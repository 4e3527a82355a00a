"""A log as tracks: every boat's state at even steps of time, and what was wanted and sent in each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.shield.bridge.blackbox import LogHeader
from steerclear.shield.bridge.messages import Tick
from steerclear.shield.bridge.tracker import GHOST
from steerclear.shield.decision import Reason
from steerclear.shield.exceptions import LogError
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.tracking.tracks import fill_memory

Array = NDArray[np.float64]
GONE_S = 1.5
"""A boat that nothing was heard of for longer than this is not there, s."""
_MATCH_S = 1e-6
MOST_STEPS = 10_000_000
"""Ten days at 10 Hz: more is damage."""


@dataclass(frozen=True)
class Tracks:
    """What happened, at even steps of time.

    Attributes:
        names: of the n boats: in the header's order, then others as they were met.
        team: (n,) 0 blue, 1 red, 2 outside the game.
        ours: (n,) bool, boats this process commanded and its shield decided for.
        platforms: names.
        params: (n, N_PARAM) platform rows.
        time_s: (T+1,) since the log began, s.
        states: (T+1, n, N_STATE) rows, memory filled in; NaN where a boat was not there.
        wanted, sent: (T, n, 2) speed m/s and absolute heading rad in [0, 2 pi); NaN where nothing was decided.
        reason: (T, n); NOT_COVERED where nothing was decided.
        intervened: (T, n) bool.
        certificate_m: (T, n); NaN where nothing was decided.
        driven: (T, n) bool, the game steered the boat.
        games: (T,) state of the game at each step.
        dt_s: step, s.
    """

    names: tuple[str, ...]
    team: NDArray[np.int64]
    ours: NDArray[np.bool_]
    platforms: tuple[str, ...]
    params: Array
    time_s: Array
    states: Array
    wanted: Array
    sent: Array
    reason: NDArray[np.int64]
    intervened: NDArray[np.bool_]
    certificate_m: Array
    driven: NDArray[np.bool_]
    games: list[Mapping[str, Any]]
    dt_s: float

    @property
    def positions(self) -> Array:
        """(T+1, n, 2) m; NaN where a boat was not there."""
        return self.states[:, :, : L.Y + 1]


@dataclass(frozen=True)
class _Decided:
    """One boat's part of one tick."""

    wanted: tuple[float, float]
    sent: tuple[float, float]
    reason: int
    intervened: bool
    certificate_m: float


_NOTHING = _Decided((math.nan, math.nan), (math.nan, math.nan), int(Reason.NOT_COVERED), False, math.nan)


class TrackBuilder:
    """Collects ticks.

    Args:
        header: of the log.
    """

    def __init__(self, header: LogHeader) -> None:
        self._header = header
        self._team = {boat.name: boat.team for boat in header.boats}
        self._kind: dict[str, Any] = {boat.name: boat.platform for boat in header.boats}
        self._mine = {boat.name for boat in header.boats if boat.ours}
        self._ours: set[str] = set()
        self._fixes: dict[str, list[tuple[float, Array]]] = {boat.name: [] for boat in header.boats}
        self._times: list[float] = []
        self._decided: list[dict[str, _Decided]] = []
        self._games: list[Mapping[str, Any]] = []

    def add(self, tick: Tick) -> None:
        """Add one tick."""
        time_s = tick.began_s - self._header.clock_s
        self._times.append(time_s)
        self._games.append(tick.game)
        self._decided.append(self._decisions(tick))
        fleet = tick.fleet
        if fleet is None:
            return
        for i, name in enumerate(fleet.names):
            if GHOST in name:
                continue  # a place the boat was kept from, not a boat
            age_s = 0.0 if fleet.age_s is None else float(fleet.age_s[i])
            fixes = self._fixes.setdefault(name, [])
            self._team.setdefault(name, int(fleet.team[i]))
            self._kind[name] = fleet.platforms[i]
            if not fixes or time_s - age_s > fixes[-1][0] + _MATCH_S:
                fixes.append((time_s - age_s, fleet.state[i].copy()))

    def finish(self) -> Tracks:
        """The tracks.

        Raises:
            LogError: no tick, or none with boats.
        """
        names = tuple(name for name, fixes in self._fixes.items() if fixes)
        if len(self._times) < 2 or not names:
            raise LogError("the log holds no two ticks with boats; there is nothing to replay without the shield")
        dt_s = self._header.config.dt_s
        span = (self._times[-1] - self._times[0]) / dt_s + 0.5
        if not 1.0 <= span < MOST_STEPS:
            raise LogError(f"the times of the log's ticks span {span:g} steps; there is nothing to replay")
        steps = int(span)
        time_s = self._times[0] + dt_s * np.arange(steps + 1)
        kinds = [self._header.platforms.get(self._kind[name], self._kind[name]) for name in names]
        params = np.array([get_platform(kind).pack() for kind in kinds])
        states = np.stack([_states(self._fixes[name], time_s) for name in names], axis=1)
        _fill(states, params)
        at = np.searchsorted(np.array(self._times) - _MATCH_S, time_s[:-1], side="right") - 1
        rows = [[self._decided[k].get(name, _NOTHING) for name in names] for k in at]
        return Tracks(
            names=names,
            team=np.array([self._team[name] for name in names], dtype=np.int64),
            ours=np.array([name in self._ours for name in names]),
            platforms=tuple(get_platform(kind).name for kind in kinds),
            params=params,
            time_s=time_s,
            states=states,
            driven=np.array([[_driven(self._games[k], name) for name in names] for k in at]),
            games=[self._games[k] for k in at],
            dt_s=dt_s,
            **_columns(rows),
        )

    def _decisions(self, tick: Tick) -> dict[str, _Decided]:
        decisions = tick.decisions
        if decisions is None:
            return {}
        found = {}
        for i, name in enumerate(decisions.fleet.names):
            if not decisions.fleet.controlled[i] or (self._header.boats and name not in self._mine):
                continue  # team-mates with a shield of their own are steered by another process
            own_rad = float(decisions.fleet.heading_rad[i])
            self._ours.add(name)
            found[name] = _Decided(
                decisions.wanted.absolute(i, own_rad),
                decisions.sent.absolute(i, own_rad),
                int(decisions.reason[i]),
                bool(decisions.intervened[i]),
                float(decisions.certificate_m[i]),
            )
        return found


def _columns(rows: list[list[_Decided]]) -> dict[str, Any]:
    return {
        "wanted": np.array([[entry.wanted for entry in row] for row in rows]),
        "sent": np.array([[entry.sent for entry in row] for row in rows]),
        "reason": np.array([[entry.reason for entry in row] for row in rows], dtype=np.int64),
        "intervened": np.array([[entry.intervened for entry in row] for row in rows]),
        "certificate_m": np.array([[entry.certificate_m for entry in row] for row in rows]),
    }


def _driven(game: Mapping[str, Any], name: str) -> bool:
    boats = game.get("boats")
    boat = boats.get(name) if isinstance(boats, Mapping) else None
    return isinstance(boat, Mapping) and bool(boat.get("driven"))


def _states(fixes: list[tuple[float, Array]], time_s: Array) -> Array:
    """One boat's rows (T+1, N_STATE) from its fixes: places, headings and speeds between them, memory as it was."""
    known_s = np.array([fix[0] for fix in fixes])
    rows = np.array([fix[1] for fix in fixes])
    before = np.clip(np.searchsorted(known_s - _MATCH_S, time_s, side="right") - 1, 0, len(rows) - 1)
    states = rows[before].copy()
    turned_deg = np.degrees(np.unwrap(np.radians(rows[:, L.HEADING])))
    for column, values in ((L.X, rows[:, L.X]), (L.Y, rows[:, L.Y]), (L.SPEED, rows[:, L.SPEED])):
        states[:, column] = np.interp(time_s, known_s, values)
    heading_deg = np.interp(time_s, known_s, turned_deg)
    states[:, L.HEADING] = (heading_deg + 180.0) % 360.0 - 180.0
    after = np.minimum(before + 1, len(rows) - 1)
    away_s = np.minimum(np.abs(time_s - known_s[before]), np.abs(known_s[after] - time_s))
    states[away_s > GONE_S] = np.nan
    return states


def _fill(states: Array, params: Array) -> None:
    """Memory nobody told: thrust that holds the speed, no rudder; in place, boats that are not there left out."""
    for i in range(states.shape[1]):
        there = np.isfinite(states[:, i, L.X])
        rows = np.ascontiguousarray(states[there, i])
        fill_memory(rows, np.repeat(params[i : i + 1], len(rows), axis=0))
        states[there, i] = rows
