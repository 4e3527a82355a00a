"""Shielded games of both presets by the hundred: entries, captures, changed commands, as in docs/studies/core.md.

`pytest -m study tests/shield/wrappers/test_preset_games.py --log-cli-level=WARNING`, a quarter of an hour.
"""

import dataclasses
import logging

import numpy as np
import pytest
from steerclear import policies
from steerclear.env import mctf_v0
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.shield import Reason, Shield, ShieldConfig
from steerclear.shield.wrappers import ShieldedParallelEnv, games_shield
from steerclear.shield.wrappers.game_facts import facts_of_games

LOG = logging.getLogger(__name__)
KEPT_M, GAMES, FIRST_SEED = 2.5, 100, 0


UNLIKE = {"aamas2024": ("heron", "heron", "surveyor") * 2, "mctf2025": ("surveyor", "surveyor", "heron") * 2}
"""Teams of unlike boats, for each preset."""


def played(preset, opponent, games, longest=np.inf, own="medium", **settings):
    """(games, 5): entries of teammates and of opponents, captures for and against, share of commands changed."""
    core = BatchedMctf(GameConfig.preset(preset, default_start=False, **settings), games, FIRST_SEED)
    core.reset(seed=FIRST_SEED)
    teams = [policies.make_batch(own), policies.make_batch(opponent)]
    for number, team in enumerate(teams):
        team.reset(core, number, number)
    config = ShieldConfig.of(**{**facts_of_games(core).settings(), "separation_m": KEPT_M})
    shield = games_shield(core, config, team="blue")
    decide, ours = shield.filter_for(0), core.team == 0
    going, commands = np.ones(games, bool), np.zeros((games, core.n_boats, 2))
    counts, asked, was_inside, steps = np.zeros((games, 5)), np.zeros(games), None, 0
    while going.any() and steps < longest:
        for number, team in enumerate(teams):
            commands[:, core.team == number] = team.act(core, number)
        core.step(commands, decide)
        covered = (shield.reason != Reason.NOT_COVERED) & ours
        place = core.state[..., :2]
        gap = np.linalg.norm(place[:, :, None] - place[:, None], axis=-1)
        gap[:, np.arange(core.n_boats), np.arange(core.n_boats)] = np.inf
        inside = gap < KEPT_M
        entered = (inside & ~(inside if was_inside is None else was_inside) & covered[:, :, None])[going]
        was_inside, steps = inside, steps + 1
        counts[going, 0] += (entered & covered[going][:, None]).sum((1, 2)) / 2
        counts[going, 1] += (entered & ~ours).sum((1, 2))
        counts[going, 2:4] += core.events[going][:, :, 0]
        counts[going, 4] += (covered & (shield.reason != Reason.PASSED)).sum(1)[going]
        asked[going] += covered.sum(1)[going]
        going &= ~(core.terminated | core.truncated)
    counts[:, 4] /= np.maximum(asked, 1.0)
    return counts


def played_per_boat(preset, seeds, time_s):
    """(games, 3): entries of teammates and of opponents, share of commands changed; each boat decides for itself."""
    game = mctf_v0.parallel_env(dataclasses.replace(GameConfig.preset(preset, default_start=False), max_time_s=time_s))
    env = ShieldedParallelEnv(game, Shield.for_game(game, coordination="per_boat", separation_m=KEPT_M), team="blue")
    counts = np.zeros((len(seeds), 3))
    for row, seed in zip(counts, seeds, strict=True):
        env.reset(seed=seed)
        teams = [policies.make_batch("medium"), policies.make_batch(("easy", "medium", "hidden")[seed % 3])]
        for number, team in enumerate(teams):
            team.reset(game.core, number, seed + number)
        asked, was_inside = 0, None
        while env.agents:
            commands = np.concatenate([team.act(game.core, number)[0] for number, team in enumerate(teams)])
            env.step(dict(zip(game.possible_agents, commands.copy(), strict=True)))
            reasons = np.array([decision.reason for decision in env.decisions])[:3]
            covered, place = reasons != Reason.NOT_COVERED, game.core.state[0, :, :2]
            inside = np.linalg.norm(place[:3, None] - place, axis=-1) < KEPT_M
            inside[np.arange(3), np.arange(3)] = False
            entered = inside & ~(inside if was_inside is None else was_inside) & covered[:, None]
            was_inside, asked = inside, asked + covered.sum()
            row += entered[:, :3].sum() / 2, entered[:, 3:].sum(), (covered & (reasons != Reason.PASSED)).sum()
        row[2] /= max(asked, 1)
    return counts


def test_a_minute_of_games_of_either_preset_has_no_entry():
    for preset in ("aamas2024", "mctf2025"):
        counts = played(preset, "easy", 4, 600)
        assert (counts[:, :2] == 0.0).all()
        assert 0.0 < counts[:, 4].mean() < 0.3


@pytest.mark.study
@pytest.mark.parametrize("preset", ["aamas2024", "mctf2025"])
def test_games_by_the_hundred(preset):
    counts = np.concatenate([played(preset, opponent, GAMES) for opponent in ("easy", "medium", "hidden")])
    entries = counts[:, :2].sum(0)
    LOG.warning("%s: entries of teammates and opponents %s, means %s", preset, entries, counts.mean(0).round(4))
    assert entries[0] <= 3
    assert entries[1] <= 11


@pytest.mark.study
@pytest.mark.parametrize("preset", UNLIKE)
def test_games_of_unlike_boats_by_the_hundred(preset):
    teams = [played(preset, opponent, GAMES, platforms=UNLIKE[preset]) for opponent in ("easy", "medium", "hidden")]
    counts = np.concatenate(teams)
    entries = counts[:, :2].sum(0)
    LOG.warning("%s, unlike: entries of teammates and opponents %s, means %s", preset, entries, counts.mean(0).round(4))
    assert entries[0] <= 3


@pytest.mark.study
@pytest.mark.parametrize("preset", ["aamas2024", "mctf2025"])
def test_games_in_which_each_boat_decides_for_itself(preset):
    counts = played_per_boat(preset, range(24), 240.0)
    LOG.warning("%s, per boat: entries %s, changed %.4f", preset, counts[:, :2].sum(0), counts[:, 2].mean())
    assert counts[:, 0].sum() <= 1
    assert counts[:, 1].sum() <= 2
