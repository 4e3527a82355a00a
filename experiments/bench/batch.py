"""Speed and memory of thousands of games at once, on one core."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf, CommandFilter
from steerclear.policies import make_batch
from steerclear.shield import ShieldConfig
from steerclear.shield.wrappers import games_shield

from .timing import memory_mib

SPREAD_STEPS = 100
"""Steps played before timing: boats leave their start places and get in each other's way."""


@dataclass(frozen=True)
class BatchSize:
    """How much to run: games at once, steps per repeat, repeats."""

    games: int = 512
    steps: int = 100
    repeats: int = 5


def steps_per_s(
    preset: str, size: BatchSize, policy: str, seed: int = 0, shield: ShieldConfig | None = None
) -> dict[str, Any]:
    """Game-steps per second with observations and rewards; the policies' own time is left out.

    Args:
        preset: rules of the game.
        size: how much to run.
        policy: batch policy of both teams.
        seed: of starts and policies.
        shield: shield of the blue team; None for none.

    Returns:
        `policy`, `shielded`, `games`, `median`, `low` and `high` over the repeats, per second.
    """
    core = BatchedMctf(GameConfig.preset(preset, default_start=False, max_time_s=1e6), size.games, seed)
    teams = [make_batch(policy), make_batch(policy)]
    for number, team in enumerate(teams):
        team.reset(core, number, seed + number)
    command_filter = None if shield is None else games_shield(core, shield).filter_for(0)
    _time_steps(core, teams, SPREAD_STEPS, command_filter)  # compiles, too
    rates = [
        size.games * size.steps / _time_steps(core, teams, size.steps, command_filter) for _ in range(size.repeats)
    ]
    spread = {"median": float(np.median(rates)), "low": min(rates), "high": max(rates)}
    return {"policy": policy, "shielded": shield is not None, "games": size.games, **spread}


def _time_steps(core: BatchedMctf, teams: list[Any], steps: int, command_filter: CommandFilter | None) -> float:
    actions = np.zeros((core.n_games, core.n_boats, 2))
    spent_s = 0.0
    for _ in range(steps):
        for number, team in enumerate(teams):
            actions[:, core.team == number] = team.act(core, number)
        begin = time.perf_counter()
        core.step(actions, command_filter)
        spent_s += time.perf_counter() - begin
    return spent_s


def batch_memory(preset: str, games: int, shield: ShieldConfig) -> dict[str, Any]:
    """Memory of that many games with observations and rewards, and of one team's shield for them, MiB."""
    small = BatchedMctf(preset, 1, 0)  # compiles: that memory belongs to no game
    games_shield(small, shield)
    core = BatchedMctf(preset, games, 0)
    return {
        "games": games,
        "games_mib": memory_mib(lambda: BatchedMctf(preset, games, 0)),
        "shield_mib": memory_mib(lambda: games_shield(core, shield)),
    }
