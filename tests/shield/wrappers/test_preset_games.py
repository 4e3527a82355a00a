"""Shielded games of both presets by the hundred: entries, captures, changed commands, as in docs/studies/core.md.

`pytest -m study tests/shield/wrappers/test_preset_games.py --log-cli-level=WARNING`, a quarter of an hour.
"""

import logging

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.shield import Reason, ShieldConfig
from steerclear.shield.wrappers import games_shield
from steerclear.shield.wrappers.game_facts import facts_of_games

LOG = logging.getLogger(__name__)
KEPT_M, GAMES = 2.5, 100


def played(preset, opponent, games, longest=np.inf, own="medium"):
    """(games, 5): entries of teammates and of opponents, captures for and against, share of commands changed."""
    core = BatchedMctf(GameConfig.preset(preset, default_start=False), games, 0)
    core.reset(seed=0)
    teams = [policies.make_batch(own), policies.make_batch(opponent)]
    for number, team in enumerate(teams):
        team.reset(core, number, number)
    settings = {**facts_of_games(core).settings(), "separation_m": KEPT_M}
    shield = games_shield(core, ShieldConfig.of(**settings), team="blue")
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
