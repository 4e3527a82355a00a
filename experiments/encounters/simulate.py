"""Playing a batch of scenes, every state kept: what boats want, what they see, how they move. Compiled."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any, NamedTuple
from warnings import warn

import numpy as np
from numpy.typing import NDArray
from steerclear.shield.exceptions import FleetError
from steerclear.shield.jit import Array, IntArray, kernel
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms import step_boat
from steerclear.shield.platforms.actuator import command_for_turn
from steerclear.shield.platforms.usv import wrap_degrees
from steerclear.shield.renamed import takes_old_keywords

from ..baselines.own_filters import check_account, check_answer, check_decide, is_filter
from ..baselines.registry import FilterMaker, SafetyFilter, build_filter
from ..play.conditions import observe
from . import scene as S
from .scene import DT_S, Conditions, Scenes

LONGEST_LEAD_S = 20.0
"""A hunter looks no further ahead than this, s."""


class World(NamedTuple):
    """What changes and what stays while B games of n boats are played.

    ``params`` (n, N_PARAM) and ``team`` (n,) of the boats, ``scripts`` (B, n, N_SCRIPT), ``goals`` (B, n, G, 2) m and
    ``current_mps`` (B, 2) stay. ``state`` (B, n, N_STATE) is true, ``seen`` what the own team knows of it, off by
    ``error`` (B, n, 2) m, drawn from the games' ``seeds`` (B,); ``goal_at`` and ``phase_at`` (B, n) are where boats are
    in their goals and scripts, ``first_goal_s`` (B, n) when they reached the first, ``queue`` (D, B, n, 2) commands of
    own boats as absolute headings that wait for their effect.
    """

    params: Array
    team: IntArray
    scripts: Array
    goals: Array
    current_mps: Array
    state: Array
    seen: Array
    error: Array
    seeds: NDArray[np.uint64]
    goal_at: IntArray
    phase_at: IntArray
    first_goal_s: Array
    queue: Array


@kernel
def meeting_s(px: float, py: float, vx: float, vy: float, speed_mps: float) -> float:
    """Time until a pursuer can meet a target at relative place p that moves with v, or the longest lead, s."""
    a = vx * vx + vy * vy - speed_mps * speed_mps
    b = px * vx + py * vy
    c = px * px + py * py
    best = LONGEST_LEAD_S
    if abs(a) < 1e-9:
        return min(best, -c / (2.0 * b)) if b < 0.0 else best
    square = b * b - a * c
    if square >= 0.0:
        for sign in (-1.0, 1.0):
            time_s = (-b + sign * math.sqrt(square)) / a
            if 0.0 < time_s < best:
                best = time_s
    return best


@kernel
def hunted_of(state: Array, team: IntArray, i: int, target: int) -> tuple[int, float]:
    """The boat that boat i hunts, the nearest of another team where no ``target`` is named, or -1; its distance, m."""
    found, best = -1, math.inf
    for j in range(state.shape[0]):
        if j == target or (target < 0 and team[j] != team[i]):
            gap = math.hypot(state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y])
            if gap < best:
                found, best = j, gap
    return found, best


@kernel
def hunt_deg(me: Array, target: Array, lead: float, standoff_m: float, speed_mps: float) -> float:
    """Bearing of a point ahead of the target's bow, moved on by ``lead`` of the way to where it will be."""
    course = math.radians(target[L.HEADING])
    east, north = math.sin(course), math.cos(course)
    x, y = target[L.X] + standoff_m * east, target[L.Y] + standoff_m * north
    vx, vy = target[L.SPEED] * east, target[L.SPEED] * north
    ahead_s = lead * meeting_s(x - me[L.X], y - me[L.Y], vx, vy, speed_mps)
    return math.degrees(math.atan2(x + vx * ahead_s - me[L.X], y + vy * ahead_s - me[L.Y]))


@kernel
def next_phase(row: Array, now: int, time_s: float, gap_m: float) -> int:
    """The phase a script is in, given the one it was in."""
    while now + 1 < S.PHASES:
        begin = S.PHASE + (now + 1) * S.N_PHASE
        if time_s + 1e-9 < row[begin + S.AT_S] and not gap_m < row[begin + S.WITHIN_M]:
            break
        now += 1
    return now


@kernel
def want(world: World, time_s: float, nominal: Array) -> None:
    """Write commands (B, n, 2) of all boats; own boats (team 0) steer by what is seen, the others by what is true."""
    for b in range(world.state.shape[0]):
        for i in range(world.state.shape[1]):
            row, known = world.scripts[b, i], world.state[b]
            if world.team[i] == 0:
                known = world.seen[b]
            me = known[i]
            hunted, gap = hunted_of(known, world.team, i, int(row[S.TARGET]))
            now = next_phase(row, world.phase_at[b, i], time_s, gap)
            world.phase_at[b, i] = now
            begin = S.PHASE + now * S.N_PHASE
            aim, speed, heading = int(row[begin + S.AIM]), row[begin + S.SPEED_MPS], row[begin + S.ANGLE_DEG]
            if aim == S.AIM_NOWHERE or (aim == S.AIM_TARGET and hunted < 0):
                nominal[b, i, 0] = nominal[b, i, 1] = 0.0
                continue
            if aim == S.AIM_GOALS:
                goal = world.goals[b, i, world.goal_at[b, i]]
                heading += math.degrees(math.atan2(goal[0] - me[L.X], goal[1] - me[L.Y]))
            elif aim == S.AIM_TARGET:
                heading += hunt_deg(me, known[hunted], row[begin + S.LEAD], row[begin + S.STANDOFF_M], speed)
            error = wrap_degrees(heading - me[L.HEADING])
            if row[S.AUTHORITY] > 0.0:
                error = command_for_turn(world.params[i], me, speed, error, DT_S)
            nominal[b, i, 0], nominal[b, i, 1] = speed, error


@kernel
def move(world: World, filtered: Array, step: int) -> None:
    """One step of all boats, in place, and on to the next goal where one was reached.

    Commands of own boats wait in the queue for D steps; with D = 0 they are obeyed at once, bit for bit. A command is
    relative to the heading seen when it was given. The current carries all boats.
    """
    delayed, goals = world.queue.shape[0], world.goals
    for b in range(world.state.shape[0]):
        for i in range(world.state.shape[1]):
            boat, speed, error = world.state[b, i], filtered[b, i, 0], filtered[b, i, 1]
            if delayed > 0 and world.team[i] == 0:
                place = world.queue[step % delayed, b, i]
                speed, error, given = place[0], wrap_degrees(place[1] - boat[L.HEADING]), error
                place[0], place[1] = filtered[b, i, 0], world.seen[b, i, L.HEADING] + given
            step_boat(world.params[i], boat, speed, error, DT_S)
            boat[L.X] += world.current_mps[b, 0] * DT_S
            boat[L.Y] += world.current_mps[b, 1] * DT_S
            goal = goals[b, i, world.goal_at[b, i]]
            if math.hypot(goal[0] - boat[L.X], goal[1] - boat[L.Y]) <= world.scripts[b, i, S.REACHED_M]:
                world.goal_at[b, i] = (world.goal_at[b, i] + 1) % goals.shape[2]
                if math.isnan(world.first_goal_s[b, i]):
                    world.first_goal_s[b, i] = (step + 1) * DT_S


def world_of(scenes: Scenes, conditions: Conditions) -> World:
    """The start of scenes."""
    shape, delayed = (scenes.games, len(scenes.team)), conditions.delay_steps(DT_S)
    held = scenes.state[:, :, [L.SPEED, L.HEADING]]
    return World(
        params=scenes.params,
        team=scenes.team,
        scripts=scenes.script,
        goals=scenes.goals,
        current_mps=scenes.current * conditions.current_mps,
        state=scenes.state.copy(),
        seen=scenes.state.copy(),
        error=np.zeros((*shape, 2)),
        seeds=scenes.noise_seed.copy(),
        goal_at=np.zeros(shape, np.int64),
        phase_at=np.zeros(shape, np.int64),
        first_goal_s=np.full(shape, np.nan),
        queue=np.tile(held, (delayed, 1, 1, 1)).reshape(delayed, *shape, 2),
    )


@dataclass(frozen=True)
class Trajectory:
    """What happened in B games of T steps.

    Attributes:
        scenes: what was played.
        conditions: under which.
        state: (T+1, B, n, N_STATE) true states, index 0 the start.
        nominal: (T, B, n, 2) nominal commands: speed m/s, relative heading deg.
        filtered: (T, B, n, 2) filtered commands; those of other boats are the nominal ones.
        reason: (T, B, n) reason codes of the safety filter.
        safety_margin_m: (T, B, n) float32, of the safety filter.
        first_goal_s: (B, n) when the first goal was reached, NaN where it was not.
        decision_us: (T,) time of the filter's call for a step, per game.
    """

    scenes: Scenes
    conditions: Conditions
    state: Array
    nominal: Array
    filtered: Array
    reason: NDArray[np.int8]
    safety_margin_m: NDArray[np.float32]
    first_goal_s: Array
    decision_us: Array

    def __getattr__(self, name: str) -> Any:
        """Names until 0.8.0, for one more release."""
        names = {"wanted": "nominal", "sent": "filtered", "certificate_m": "safety_margin_m"}
        if name not in names:
            raise AttributeError(f"a trajectory has no {name!r}")
        warn(f"{name} of a trajectory is called {names[name]}", DeprecationWarning, stacklevel=2)
        return getattr(self, names[name])


@takes_old_keywords({"guard": "safety_filter"})
def play(scenes: Scenes, safety_filter: str | FilterMaker | SafetyFilter, conditions: Conditions) -> Trajectory:
    """Play scenes with a safety filter for the own boats: a name, what makes one, or one made for just these games.

    The same scenes, filter and conditions give the same trajectory, and that of a game does not depend on what else is
    in the batch.

    Raises:
        SteerclearError: the filter cannot be made, says no reason or margin, or what it sends is no finite command.
    """
    decider: Any = safety_filter
    if not is_filter(safety_filter):
        decider = build_filter(decider, scenes, conditions)
    check_decide(decider)
    world, steps, shape = world_of(scenes, conditions), scenes.steps, (scenes.games, len(scenes.team))
    played = Trajectory(
        scenes=scenes,
        conditions=conditions,
        state=np.empty((steps + 1, *shape, L.N_STATE)),
        nominal=np.empty((steps, *shape, 2)),
        filtered=np.empty((steps, *shape, 2)),
        reason=np.zeros((steps, *shape), np.int8),
        safety_margin_m=np.full((steps, *shape), np.nan, np.float32),
        first_goal_s=world.first_goal_s,
        decision_us=np.zeros(steps),
    )
    ours = np.broadcast_to(scenes.own, shape).copy()
    played.state[0] = world.state
    for step in range(steps):
        nominal, filtered = played.nominal[step], played.filtered[step]
        observe(world.state, world.error, world.seeds, conditions.noise_m, step == 0, DT_S, world.seen)
        want(world, step * DT_S, nominal)
        started = time.perf_counter()
        answer = decider.decide(world.seen, nominal, ours)
        played.decision_us[step] = (time.perf_counter() - started) / scenes.games * 1e6
        filtered[:] = np.where(ours[..., None], check_answer(decider, answer, shape), nominal)
        if not np.isfinite(filtered).all():
            b, i, _ = np.argwhere(~np.isfinite(filtered))[0]
            raise FleetError(
                f"step {step}: the command for boat {i} of game {b} is not finite: {filtered[b, i]}; let decide return "
                "a speed, m/s, and a turn, deg, for each boat of ours: nominal where it finds none"
            )
        played.reason[step], played.safety_margin_m[step] = check_account(decider, shape)
        move(world, filtered, step)
        played.state[step + 1] = world.state
    return played
