"""Parity: replay a recorded game of the reference simulator and measure every deviation."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from steerclear.shield.exceptions import GameError, TraceError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L

from .actions import discrete_commands
from .core import BatchedMctf
from .infos import InfoWriter
from .trace import Trace, load_trace

BOAT_EVENTS = {
    "is_tagged": "is_tagged",
    "has_flag": "has_flag",
    "oob": "oob",
    "on_side": "on_side",
    "agent_collisions": "collisions",
    "is_disabled": "is_disabled",
    "contacts": "contacts",
}
TEAM_EVENTS = {"flag_taken": "flag_taken", "captures": "captures", "grabs": "grabs", "tags": "tags"}
"""Arrays of the trace -> arrays of `BatchedMctf`, compared exactly at every step."""


def replay_trace(path: str | os.PathLike[str]) -> ParityReport:
    """Replay a recorded game, an npz file, from its first state under its actions, over its whole length.

    Raises:
        TraceError: the file cannot be read, lacks an array or starts from a state that the rules do not allow.
    """
    return compare(load_trace(path))


def compare(trace: Trace) -> ParityReport:
    """Replay a loaded trace, see `replay_trace`.

    Raises:
        TraceError: the rules do not allow the trace's start or an action.
    """
    core = BatchedMctf(trace.config, n_games=1, seed=0)
    writer = InfoWriter(core)
    _check_keys(trace, writer)
    largest = dict.fromkeys(asdict(Tolerances()), 0.0)
    mismatches: list[EventMismatch] = []
    try:
        core.reset_game(0, _first_state(trace))
        for step in range(trace.steps + 1):
            for name, difference in (*_motion(trace, core, step), *_views(trace, core, writer, step)):
                found = float(np.max(np.abs(difference), initial=0.0))
                largest[name] = max(largest[name], np.inf if np.isnan(found) else found)
            mismatches += _compare_events(trace, core, step)
            if step < trace.steps:
                core.step(_commands(trace, core, step)[np.newaxis])
    except (GameError, ValueError, OverflowError) as error:  # a state or an action that no game has
        raise TraceError(f"{trace.path}: {error}") from error
    return ParityReport(str(trace.path), trace.steps, mismatches=tuple(mismatches), **largest)


def _check_keys(trace: Trace, writer: InfoWriter) -> None:
    for name, ours in (("obs_keys", writer.observation.keys), ("global_state_keys", writer.global_state.keys)):
        if tuple(trace.meta[name]) != tuple(ours):
            raise TraceError(f"{trace.path}: {name} in meta are not those of this game; check team_size and obstacles")


def _first_state(trace: Trace) -> dict[str, np.ndarray]:
    names = ("position", "speed", "heading", "has_flag", "is_tagged", "tagging_cooldown")
    init = {f"agent_{name}": trace.arrays[name][0] for name in names}
    init["agent_collisions"] = trace.arrays["agent_collisions"][0]
    init |= _power_plays(trace.meta)
    return init | {name: trace.arrays[name][0] for name in ("captures", "tags", "grabs")}


def _power_plays(meta: dict[str, Any]) -> dict[str, Any]:
    """Return when the game's power plays began and which boats they disabled, as far as the trace contains it."""
    plays = meta.get("power_play")
    if not plays:
        return {}
    starts, size = (plays["blue_start"], plays["red_start"]), int(meta["team_size"])
    drawn: tuple[list[int], list[int]] = ([], [])
    for decision, function, _, value in meta["draws"]:
        if decision >= 0 and function == "randint":
            # slots do not overlap: the power play that began last is the one that draws
            team = max((0, 1), key=lambda side: starts[side] if starts[side] <= decision + 1 else -1)
            drawn[team].append(team * size + int(value))
    boats = [([*drawn[team], team * size] * 2)[:2] if len(drawn[team]) < 2 else drawn[team][:2] for team in (0, 1)]
    return {"power_play_start": starts, "power_play_boats": boats}


def _commands(trace: Trace, core: BatchedMctf, step: int) -> Array:
    """Return the commands (n, 2) of a step; discrete runs hold (action number, nan)."""
    action = trace.arrays["action"][step]
    if np.isnan(action[:, 1]).all():
        return discrete_commands(action[:, 0].astype(np.int64), core.max_speed_mps)
    return action


def _motion(trace: Trace, core: BatchedMctf, step: int) -> Iterator[tuple[str, Array]]:
    """Yield differences in the motion of boats and flags, by name of the tolerance."""
    state, arrays = core.state[0], trace.arrays
    yield "position_m", np.hypot(*(state[:, [L.X, L.Y]] - arrays["position"][step]).T)
    yield "heading_deg", _turn(state[:, L.HEADING], arrays["heading"][step], 360.0)
    yield "speed_mps", state[:, L.SPEED] - arrays["speed"][step]
    yield "cooldown_s", core.tagging_cooldown_s[0] - arrays["tagging_cooldown"][step]
    yield "flag_position_m", core.flag_position[0] - arrays["flag_position"][step]


def _views(trace: Trace, core: BatchedMctf, writer: InfoWriter, step: int) -> Iterator[tuple[str, Array]]:
    """Yield differences in observations and global state, by name of the tolerance."""
    arrays, angles = trace.arrays, writer.global_state.is_angle
    ours = writer.global_vector().astype(np.float32)
    yield "global_state", _difference(ours, arrays["global_state"][step], angles, 360.0)
    row, rest = divmod(step, trace.observed_every)
    if rest:
        return
    angles = writer.observation.is_angle
    yield "observation_normalised", _difference(core.observations[0], arrays["obs_normalized"][row], angles, 2.0)
    ours = writer.raw_observations().astype(np.float32)
    yield "observation_raw", _difference(ours, arrays["obs"][row], angles, 360.0)


def _difference(ours: np.ndarray, theirs: np.ndarray, is_angle: np.ndarray, full_turn: float) -> Array:
    """Return differences (..., k); angles on the circle, because straight astern is +180 as well as -180."""
    plain = ours.astype(np.float64) - theirs
    return np.where(is_angle, _turn(ours.astype(np.float64), theirs, full_turn), plain)


def _turn(one: Array, two: Array, full_turn: float) -> Array:
    """Return the difference of two angles, wrapped into half a turn either way."""
    half = 0.5 * full_turn
    return (one - two + half) % full_turn - half


def _compare_events(trace: Trace, core: BatchedMctf, step: int) -> list[EventMismatch]:
    found = []
    for events, ids in ((BOAT_EVENTS, trace.config.agent_ids), (TEAM_EVENTS, ("blue", "red"))):
        for theirs_name, ours_name in events.items():
            if theirs_name not in trace.arrays:
                continue
            theirs, ours = trace.arrays[theirs_name][step], getattr(core, ours_name)[0]
            for i in np.flatnonzero(theirs != ours):
                found.append(EventMismatch(step, theirs_name, ids[i], int(theirs[i]), int(ours[i])))
    return found


@dataclass(frozen=True)
class Tolerances:
    """Largest deviations a replay may have; events must be exact.

    Raw observations and the global state are recorded in single precision, which resolves 1.5e-5 at 180.
    """

    position_m: float = 1e-6
    heading_deg: float = 1e-6
    speed_mps: float = 1e-6
    cooldown_s: float = 1e-9
    flag_position_m: float = 1e-6
    observation_normalised: float = 1e-5
    observation_raw: float = 5e-5
    global_state: float = 5e-5


@dataclass(frozen=True)
class EventMismatch:
    """An event that differs between trace and replay."""

    step: int  # index of the state, 0 is the start
    event: str  # array of the trace
    who: str  # agent id or team
    expected: int  # value in the trace
    got: int  # value in the replay


@dataclass(frozen=True)
class ParityReport:
    """Largest deviations over a whole replay, and every event mismatch. Bearings are compared on the circle."""

    path: str
    steps: int
    position_m: float
    heading_deg: float
    speed_mps: float
    cooldown_s: float
    flag_position_m: float
    observation_normalised: float
    observation_raw: float
    global_state: float
    mismatches: tuple[EventMismatch, ...] = ()

    def over(self, tolerances: Tolerances | None = None) -> dict[str, float]:
        """Return deviations beyond their tolerance, by name; NaN is beyond."""
        limits = asdict(tolerances or Tolerances())
        return {name: getattr(self, name) for name, limit in limits.items() if not getattr(self, name) <= limit}

    @property
    def passed(self) -> bool:
        """Whether every deviation is within the default tolerances and every event is exact."""
        return not self.over() and not self.mismatches

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, with ``passed``."""
        return {**asdict(self), "passed": self.passed}
