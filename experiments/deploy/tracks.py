"""Tracks of a log: every boat's state at even time steps, and the game record made of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.env.config import GameConfig
from steerclear.env.record import Record, find_violations, make_record
from steerclear.shield.bridge.blackbox import LogHeader
from steerclear.shield.bridge.messages import Tick
from steerclear.shield.bridge.tracker import GHOST
from steerclear.shield.decision import Reason
from steerclear.shield.exceptions import ConfigError, LogError
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.tracks import fill_memory

Array = NDArray[np.float64]
GONE_S = 1.5  # a boat further than this from any fix in time counts as absent, s
OFF_M = 1e6  # position of absent boats, m; also the distance between them
MOST_STEPS = 10_000_000  # longest plausible log in steps, over ten days at 10 Hz; a longer one counts as damaged
_MATCH_S = 1e-6
_SEEN = L.SPEED + 1
_DECIDED = np.dtype(
    [("nominal", "f8", 2), ("filtered", "f8", 2), ("reason", "i8"), ("intervened", "?"), ("safety_margin_m", "f8")]
)
"""Decision for one boat at one tick."""
_NOTHING = ((math.nan, math.nan), (math.nan, math.nan), int(Reason.NOT_COVERED), False, math.nan)


@dataclass(frozen=True)
class Tracks:
    """Trajectories and decisions at even time steps."""

    names: tuple[str, ...]  # of the n boats, in the header's order; then others in order of appearance
    team: NDArray[np.int64]  # (n,) 0 blue, 1 red, 2 outside the game
    ours: NDArray[np.bool_]  # (n,) bool, boats that this process commanded and its shield decided for
    platforms: tuple[str, ...]  # names
    params: Array  # (n, N_PARAM) platform rows
    time_s: Array  # (T+1,) since the log began, s
    states: Array  # (T+1, n, N_STATE) with estimated controller memory; NaN where a boat was absent
    # nominal and filtered command (T, n, 2): speed m/s and absolute heading rad in [0, 2 pi); NaN: nothing was decided
    nominal: Array
    filtered: Array
    reason: NDArray[np.int64]  # (T, n); NOT_COVERED where nothing was decided
    intervened: NDArray[np.bool_]  # (T, n) bool
    safety_margin_m: Array  # (T, n); NaN where nothing was decided
    games: Sequence[Mapping[str, Any]]  # (T,) state of the game at each step
    dt_s: float  # step, s

    def marked(self, key: str) -> NDArray[np.bool_]:
        """Return (T, n): whether the referee's game state set this flag of a boat, such as "driven"."""
        boats = [_mapping(game.get("boats")) for game in self.games]
        return np.array([[bool(_mapping(row.get(name)).get(key)) for name in self.names] for row in boats])


def _mapping(value: Any) -> Mapping[str, Any]:
    """Return the value, or nothing where a log has another one."""
    return value if isinstance(value, Mapping) else {}


class TrackBuilder:
    """Collects the ticks of a log."""

    def __init__(self, header: LogHeader) -> None:
        self._header = header
        self._team = {boat.name: boat.team for boat in header.boats}
        self._kind: dict[str, Any] = {boat.name: boat.platform for boat in header.boats}
        self._mine = {boat.name for boat in header.boats if boat.ours}
        self._ours: set[str] = set()
        self._fixes: dict[str, list[tuple[float, Array]]] = {boat.name: [] for boat in header.boats}
        self._times: list[float] = []
        self._decided: list[dict[str, Any]] = []
        self._games: list[Mapping[str, Any]] = []

    def add(self, tick: Tick) -> None:
        """Add one tick."""
        time_s, fleet = tick.began_s - self._header.clock_s, tick.fleet
        self._times.append(time_s)
        self._games.append(tick.game)
        self._decided.append(self._decisions(tick))
        if fleet is None:
            return
        for i, name in enumerate(fleet.names):
            if GHOST in name:
                continue  # a position that was rejected for a boat, not a boat
            fixed_s = time_s - (0.0 if fleet.age_s is None else float(fleet.age_s[i]))
            fixes = self._fixes.setdefault(name, [])
            self._team.setdefault(name, int(fleet.team[i]))
            self._kind[name] = fleet.platforms[i]
            if not fixes or fixed_s > fixes[-1][0] + _MATCH_S:
                fixes.append((fixed_s, fleet.state[i].copy()))

    def finish(self) -> Tracks:
        """Return the tracks; `LogError` where the log has fewer than two ticks, no boats, or implausible times."""
        names = tuple(name for name, fixes in self._fixes.items() if fixes)
        if len(self._times) < 2 or not names:
            raise LogError("the log holds no two ticks with boats; there is nothing to draw or judge")
        dt_s = self._header.config.dt_s
        span = (self._times[-1] - self._times[0]) / dt_s + 0.5
        if not 1.0 <= span < MOST_STEPS:
            raise LogError(f"the times of the log's ticks span {span:g} steps; there is nothing to draw or judge")
        time_s: Array = self._times[0] + dt_s * np.arange(int(span) + 1, dtype=np.float64)
        kinds: list[Any] = [self._kind[name] for name in names]
        platforms = [get_platform(self._header.platforms.get(kind, kind)) for kind in kinds]
        params = np.array([platform.pack() for platform in platforms])
        states = np.stack([_states(self._fixes[name], time_s) for name in names], axis=1)
        for i in range(len(names)):  # memory that telemetry does not report: thrust that holds the speed, no rudder
            there = np.isfinite(states[:, i, L.X])
            rows = np.ascontiguousarray(states[there, i])
            fill_memory(rows, np.repeat(params[i : i + 1], len(rows), axis=0))
            states[there, i] = rows
        at = np.searchsorted(np.array(self._times) - _MATCH_S, time_s[:-1], side="right") - 1
        decided = np.array([[self._decided[k].get(name, _NOTHING) for name in names] for k in at], dtype=_DECIDED)
        return Tracks(
            names=names,
            team=np.array([self._team[name] for name in names], dtype=np.int64),
            ours=np.array([name in self._ours for name in names]),
            platforms=tuple(platform.name for platform in platforms),
            params=params,
            time_s=time_s,
            states=states,
            games=[self._games[k] for k in at],
            dt_s=dt_s,
            **{column: decided[column] for column in decided.dtype.names or ()},
        )

    def _decisions(self, tick: Tick) -> dict[str, Any]:
        found, decisions = {}, tick.decisions
        if decisions is None:
            return {}
        for i in map(int, np.flatnonzero(decisions.fleet.controlled)):
            name, own_rad = decisions.fleet.names[i], float(decisions.fleet.heading_rad[i])
            if self._header.boats and name not in self._mine:
                continue  # teammates with a shield of their own are steered by another process
            self._ours.add(name)
            found[name] = (
                decisions.nominal.absolute(i, own_rad),
                decisions.filtered.absolute(i, own_rad),
                int(decisions.reason[i]),
                bool(decisions.intervened[i]),
                float(decisions.safety_margin_m[i]),
            )
        return found


def _states(fixes: list[tuple[float, Array]], time_s: Array) -> Array:
    """Interpolate a boat's position, heading and speed between its fixes; other columns are the last fix's."""
    known_s, rows = np.array([fix[0] for fix in fixes]), np.array([fix[1] for fix in fixes])
    before = np.clip(np.searchsorted(known_s - _MATCH_S, time_s, side="right") - 1, 0, len(rows) - 1)
    states = rows[before].copy()
    for column in (L.X, L.Y, L.SPEED, L.HEADING):
        values = rows[:, column]
        turned = np.degrees(np.unwrap(np.radians(values))) if column == L.HEADING else values
        states[:, column] = np.interp(time_s, known_s, turned)
    states[:, L.HEADING] = _wrapped(states[:, L.HEADING])
    after = np.minimum(before + 1, len(rows) - 1)
    away_s = np.minimum(np.abs(time_s - known_s[before]), np.abs(known_s[after] - time_s))
    states[away_s > GONE_S] = np.nan
    return states


def _wrapped(degrees: Any) -> Any:
    return (degrees + 180.0) % 360.0 - 180.0


def placed(states: Array) -> Array:
    """Return states (T+1, n, N_STATE) with absent boats far away from everything and from each other."""
    found, gone = states.copy(), ~np.isfinite(states[:, :, L.X])
    found[gone] = 0.0
    found[..., L.X] += gone * OFF_M * (1 + np.arange(states.shape[1]))
    found[..., L.Y] += gone * OFF_M
    return found


def record_of(header: LogHeader, tracks: Tracks) -> Record:
    """Return the game record; absent boats stay at their last position, or their first one before it."""
    import pandas as pd

    flat = pd.DataFrame(tracks.states[..., :_SEEN].reshape(len(tracks.states), -1)).ffill().bfill().fillna(0.0)
    seen = flat.to_numpy().reshape(*tracks.states.shape[:2], _SEEN)
    marks = {"has_flag": "has_flag", "is_tagged": "tagged", "oob": "oob"}
    last = [*tracks.games, tracks.games[-1]]
    return make_record(
        _meta(header, tracks),
        position=seen[:, :, : L.Y + 1],
        heading_deg=seen[:, :, L.HEADING],
        speed_mps=seen[:, :, L.SPEED],
        **{array: tracks.marked(key)[[*range(len(tracks.games)), -1]] for array, key in marks.items()},
        flag_position=np.array([_flags(game) for game in last], dtype=np.float64),
        captures=np.array([_captures(game) for game in last], dtype=np.int64),
        nominal=_in_degrees(tracks.nominal),
        filtered=_in_degrees(tracks.filtered),
        reason=tracks.reason,
        intervened=tracks.intervened,
        safety_margin_m=tracks.safety_margin_m,
        violations=find_violations(placed(tracks.states)[:, :, : L.Y + 1], header.config.separation_m),
    )


def _in_degrees(commands: Array) -> Array:
    return np.stack([commands[..., 0], _wrapped(np.degrees(commands[..., 1]))], axis=-1)


def _captures(game: Mapping[str, Any]) -> tuple[int, int]:
    values = game.get("captures")
    return (int(values[0]), int(values[1])) if isinstance(values, list | tuple) and len(values) == 2 else (0, 0)


def _flags(game: Mapping[str, Any]) -> list[tuple[float, float]]:
    flags = game.get("flags")
    if not isinstance(flags, list | tuple) or len(flags) != 2:
        return [(0.0, 0.0), (0.0, 0.0)]
    return [(float(flag["x_m"]), float(flag["y_m"])) for flag in flags]


def _meta(header: LogHeader, tracks: Tracks) -> dict[str, Any]:
    try:
        rules = GameConfig.preset(header.preset)  # for the radii to draw
    except ConfigError:
        rules = GameConfig.preset("aamas2024")  # default where the log names no known preset
    radii = rules.agent_radius_m
    flags = [_flags(game) for game in tracks.games if game.get("flags")]
    size = header.field_size_m or tuple(np.nanmax(np.abs(tracks.states[..., :2]), axis=(0, 1)).tolist())
    ours = "blue" if int(tracks.team[tracks.ours].min(initial=1)) == 0 else "red"
    return {
        "dt_s": tracks.dt_s,
        "env_bounds_m": size,
        "team_size": int(np.count_nonzero(tracks.team == 0)),
        "agent_ids": list(tracks.names),
        "team": [min(int(team), 1) for team in tracks.team],
        "flag_home": flags[0] if flags else [(size[0] / 8, size[1] / 2), (size[0] * 7 / 8, size[1] / 2)],
        "catch_radius_m": rules.catch_radius_m,
        "flag_keepout_m": rules.flag_keepout_m,
        "agent_radius_m": radii if isinstance(radii, float) else radii[0],
        "separation_m": header.config.separation_m,
        "preset": header.preset,
        "policies": {"blue": "", "red": ""} | {ours: header.policy},
        "shielded": [name for name, own in zip(tracks.names, tracks.ours, strict=True) if own],
        "seed": None,
        "reason_names": [reason.name for reason in Reason],
        "platforms": list(tracks.platforms),
        "title": "as it was, shield on",
    }
