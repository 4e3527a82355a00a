"""Games of real Pyquaticus with its own teams on both sides, bare and shielded, as in docs/studies/mctf2026.md.

`pytest -m study tests/shield/wrappers/test_pyquaticus_study.py --log-cli-level=WARNING` where Pyquaticus is installed
beside steerclear (docs/wrappers.md). STEERCLEAR_STUDY_GAMES: seeds against each team, 5 without it; a game takes
half a minute to a minute.
"""

import copy
import importlib
import logging
import os
import random

import numpy as np
import pytest
from steerclear.shield import Shield
from steerclear.shield.wrappers import ShieldedParallelEnv

LOG = logging.getLogger(__name__)
SEEDS, TIME_S, OPPONENTS = int(os.environ.get("STEERCLEAR_STUDY_GAMES", "5")), 200.0, ("easy", "medium", "hard")
NEAR_M = (4.0, 2.5)
"""Distances from which entries are counted: the game's own collision, and that of `aamas2024`."""

COUNTED = [f"{who}, {near_m:g} m" for near_m in NEAR_M for who in ("commanded", "game-controlled")]


def new_game():
    """The environment of the branch that is installed, three boats a team, drawn starts, a move of 0.1 s a decision."""
    try:
        config, name = importlib.import_module("pyquaticus.mctf26_config"), "competition_pyquaticus:CompPyquaticusEnv"
    except ImportError:
        config, name = importlib.import_module("pyquaticus.config"), "pyquaticus:PyQuaticusEnv"
    module, name = name.split(":")
    make = getattr(importlib.import_module(f"pyquaticus.envs.{module}"), name)
    settings = copy.deepcopy(config.config_dict_std)
    settings |= {"default_init": False, "sim_speedup_factor": 1, "max_time": TIME_S}
    size = {} if name == "CompPyquaticusEnv" else {"team_size": 3}
    return make(action_space="continuous", config_dict=settings, **size)


def begun(env, seed):
    """Observations and infos of a start that the seed alone says: starts and policies draw from these generators."""
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002
    return env.reset(seed=seed)


def entries_in(seed, opponent, shielded):
    """(5,): entries of our boats, commanded and game-controlled, at each distance; our captures less theirs."""
    agent = importlib.import_module("pyquaticus.base_policies.base_combined").Heuristic_CTF_Agent
    env = game = new_game()
    begun(game, seed)  # its agents read a game that has begun
    modes = {name: "hard" if k < 3 else opponent for k, name in enumerate(game.possible_agents)}
    boats = {name: agent(name, game, continuous=True, mode=mode) for name, mode in modes.items()}
    if shielded:
        env = ShieldedParallelEnv(game, Shield.for_game(game), team="blue")
    observations, infos = begun(env, seed)
    counts, was_inside = np.zeros((2, 2)), None
    while env.agents:
        driven = np.array([bool(boat.is_tagged or boat.oob) for boat in game.players.values()])
        driven |= np.array([bool(getattr(boat, "is_disabled", False)) for boat in game.players.values()])
        actions = {name: boat.compute_action(observations, infos) for name, boat in boats.items()}
        observations, _, terminated, truncated, infos = env.step(actions)
        place = np.array([boat.pos for boat in game.players.values()])
        gap = np.linalg.norm(place[:, None] - place, axis=-1)[:3]
        gap[:, :3][np.tril_indices(3)] = np.inf
        inside = gap < np.array(NEAR_M)[:, None, None]
        entered = inside & ~(inside if was_inside is None else was_inside)
        by_game = driven[:3, None] & (driven[None, :] | (np.arange(6) >= 3))  # none of ours in the pair was commanded
        counts += np.stack([(entered & ~by_game).sum((1, 2)), (entered & by_game).sum((1, 2))], axis=-1)
        was_inside = inside
        if any(terminated.values()) or any(truncated.values()):
            break
    captures = game.state["captures"]
    return np.append(counts, captures[0] - captures[1])


@pytest.mark.study
@pytest.mark.filterwarnings("ignore")  # of code that is not ours
def test_its_own_teams_bare_and_shielded():
    pytest.importorskip("pyquaticus")
    found = {}
    for opponent in OPPONENTS:
        for shielded in (False, True):
            rows = np.array([entries_in(seed, opponent, shielded) for seed in range(SEEDS)])
            found[opponent, shielded] = rows
            told = ", ".join(f"{name}: {n:g}" for name, n in zip(COUNTED, rows[:, :4].sum(0), strict=True))
            how = "shielded" if shielded else "bare"
            LOG.warning("%s %s: %s; net captures %.2f", opponent, how, told, rows[:, 4].mean())
    bare, shielded = (sum(found[opponent, on][:, 0].sum() for opponent in OPPONENTS) for on in (False, True))
    assert bare >= SEEDS
    assert shielded <= 0.02 * bare
