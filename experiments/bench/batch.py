"""Speed and memory of thousands of games at once, on one core."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.env.actions import STOP, discrete_commands
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf, CommandFilter
from steerclear.shield.jit import Array

from .timing import memory_mib, rate_per_s

HOLD_STEPS = 20
"""Steps between new actions: boats spread over the field instead of turning on the spot."""


@dataclass(frozen=True)
class BatchSize:
    """How much to run: games at once, steps per repeat, repeats."""

    games: int = 512
    steps: int = 200
    repeats: int = 5


def random_actions(core: BatchedMctf, count: int, seed: int) -> Array:
    """Draw actions (count, B, n, 2), speed m/s and relative heading deg, from the discrete ones."""
    indices = np.random.default_rng(seed).integers(0, STOP + 1, size=(count, core.n_games, core.n_boats))
    return discrete_commands(indices, core.max_speed_mps)


def steps_per_s(
    preset: str, size: BatchSize, seed: int = 0, command_filter: CommandFilter | None = None
) -> dict[str, float]:
    """Game-steps per second with observations and rewards, every boat acting at random.

    Args:
        preset: rules of the game.
        size: how much to run.
        seed: of starts and actions.
        command_filter: a shield; None for none.
    """
    config = GameConfig.preset(preset, default_start=False, max_time_s=1e6)
    core = BatchedMctf(config, size.games, seed)
    actions = random_actions(core, 1 + size.steps // HOLD_STEPS, seed)

    def run() -> None:
        for step in range(size.steps):
            core.step(actions[step // HOLD_STEPS], command_filter)

    core.step(actions[0], command_filter)  # compiles
    run()  # spreads the boats
    return rate_per_s(run, size.games * size.steps, size.repeats)


def games_memory_mib(preset: str, games: int = 4096) -> float:
    """Memory that the arrays of that many games hold, MiB, observations and rewards included."""
    BatchedMctf(preset, 1, 0)  # compiles
    return memory_mib(lambda: BatchedMctf(preset, games, 0))


def core_summary(preset: str, size: BatchSize, seed: int = 0) -> dict[str, Any]:
    """Figures without a shield."""
    return {"preset": preset, "games": size.games, "steps_per_s": steps_per_s(preset, size, seed)}
