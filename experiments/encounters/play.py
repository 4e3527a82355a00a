"""Playing a batch of scenes: wants, decisions and moves, every state kept."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from steerclear.shield.exceptions import FleetError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.tracking.tracks import whole_steps

from .guards import Guard, GuardMaker, build_guard
from .motion import move, observe, reach_goals
from .scenes import DT_S, Conditions, Scenes
from .steering import Roles, want


@dataclass(frozen=True)
class Film:
    """What happened in B games of T steps.

    Attributes:
        scenes: what was played.
        conditions: under which.
        state: (T+1, B, n, N_STATE) true states, index 0 the start.
        wanted: (T, B, n, 2) speed m/s, relative heading deg.
        sent: (T, B, n, 2) likewise; those of other boats are what they wanted.
        reason: (T, B, n) reason codes of the guard.
        certificate_m: (T, B, n) float32.
        first_goal_s: (B, n) when the first goal was reached, NaN where it was not.
        decision_us: (T,) time of the guard's call for a step, per game.
    """

    scenes: Scenes
    conditions: Conditions
    state: Array
    wanted: Array
    sent: Array
    reason: NDArray[np.int8]
    certificate_m: NDArray[np.float32]
    first_goal_s: Array
    decision_us: Array


def play(scenes: Scenes, guard: str | GuardMaker | Guard, conditions: Conditions) -> Film:
    """Play scenes with a guard for the own boats.

    Args:
        scenes: the games.
        guard: a name, what makes a guard, or a guard made for just these games.
        conditions: delay, noise and current.

    Returns:
        Everything that happened. The same scenes, guard and conditions give the same film, and a game's film does
        not depend on what else is in the batch.

    Raises:
        SteerclearError: the guard cannot be made, or what it sends is not finite.
    """
    keeper = build_guard(guard, scenes, conditions) if isinstance(guard, str) or not hasattr(guard, "decide") else guard
    stage = _Stage(scenes, conditions)
    film = _blank(scenes, conditions)
    film.state[0] = stage.state
    for step in range(scenes.steps):
        stage.advance(keeper, film, step)
    film.first_goal_s[:] = stage.first_goal_s
    return film


def _blank(scenes: Scenes, conditions: Conditions) -> Film:
    steps, shape = scenes.steps, (scenes.games, len(scenes.team))
    return Film(
        scenes=scenes,
        conditions=conditions,
        state=np.empty((steps + 1, *shape, L.N_STATE)),
        wanted=np.empty((steps, *shape, 2)),
        sent=np.empty((steps, *shape, 2)),
        reason=np.zeros((steps, *shape), np.int8),
        certificate_m=np.full((steps, *shape), np.nan, np.float32),
        first_goal_s=np.full(shape, np.nan),
        decision_us=np.zeros(steps),
    )


class _Stage:
    """Arrays that change while the games are played."""

    def __init__(self, scenes: Scenes, conditions: Conditions) -> None:
        shape = (scenes.games, len(scenes.team))
        self.scenes, self.conditions = scenes, conditions
        self.params = np.array([get_platform(name).pack() for name in scenes.platforms])
        self.state, self.seen = scenes.state.copy(), scenes.state.copy()
        self.ours = np.broadcast_to(scenes.own, shape).copy()
        self.goal_at, self.phase_at = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
        self.first_goal_s = np.full(shape, np.nan)
        self.error, self.seeds = np.zeros((*shape, 2)), scenes.noise_seed.copy()
        self.current = scenes.current * conditions.current_mps
        delayed = delay_steps(conditions)
        held = scenes.state[:, :, [L.SPEED, L.HEADING]]
        self.queue = np.tile(held, (delayed, 1, 1, 1)).reshape(delayed, *shape, 2)

    def advance(self, keeper: Guard, film: Film, step: int) -> None:
        """One step of all games."""
        scenes, wanted = self.scenes, film.wanted[step]
        observe(self.state, self.error, self.seeds, self.conditions.noise_m, step == 0, DT_S, self.seen)
        roles = Roles(self.params, scenes.team, scenes.script, scenes.goals)
        want(self.state, self.seen, roles, self.goal_at, self.phase_at, step * DT_S, DT_S, wanted)
        started = time.perf_counter()
        sent = keeper.decide(self.seen, wanted, self.ours)
        film.decision_us[step] = (time.perf_counter() - started) / scenes.games * 1e6
        film.sent[step] = wanted
        np.copyto(film.sent[step], sent, where=self.ours[..., None])
        _check(film.sent[step], step)
        film.reason[step], film.certificate_m[step] = keeper.reason, keeper.certificate_m
        slot = step % max(1, len(self.queue))
        move(self.state, self.seen, self.params, scenes.team, film.sent[step], self.queue, slot, self.current, DT_S)
        reach_goals(self.state, scenes.script, scenes.goals, (step + 1) * DT_S, self.goal_at, self.first_goal_s)
        film.state[step + 1] = self.state


def _check(sent: Array, step: int) -> None:
    if not np.isfinite(sent).all():
        b, i, _ = np.argwhere(~np.isfinite(sent))[0]
        raise FleetError(f"step {step}: the command for boat {i} of game {b} is not finite: {sent[b, i]}")


def delay_steps(conditions: Conditions) -> int:
    """Steps from a command of an own boat to its effect."""
    return whole_steps(conditions.delay_s, DT_S)
