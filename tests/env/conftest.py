"""Games in a chosen state, for the tests of the rules."""

from pathlib import Path

import numpy as np
import pytest
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf

TRACES = sorted((Path(__file__).parents[1] / "data" / "traces").glob("*.npz"))


@pytest.fixture
def traces():
    return {path.stem: path for path in TRACES}


@pytest.fixture
def place():
    """Builds one game of integrator boats (they stop and turn at once) in a chosen state."""

    def build(positions=None, team_size=2, platforms="si", preset="aamas2024", overrides=None, **init):
        config = GameConfig.preset(preset, team_size=team_size, platforms=platforms, **(overrides or {}))
        core = BatchedMctf(config, seed=0)
        if positions is not None:
            init["agent_position"] = {f"agent_{i}": p for i, p in positions.items()}
        core.reset_game(0, {f"agent_{k}" if k in PER_BOAT else k: v for k, v in init.items()})
        return core

    return build


PER_BOAT = ("has_flag", "is_tagged", "tagging_cooldown", "heading", "speed", "collisions")


@pytest.fixture
def hold():
    """Steps a game while every boat is told to stop; returns the outcome of the last step."""

    def run(core, steps=1):
        for _ in range(steps):
            outcome = core.step(np.zeros((core.n_games, core.n_boats, 2)))
        return outcome

    return run
