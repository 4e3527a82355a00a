"""Boats that the games drive: a batch foresees them as a single shield does, game by game."""

import numpy as np
import pytest
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig
from steerclear.shield.batch import BatchedShield
from steerclear.shield.exceptions import FleetError
from steerclear.shield.platforms import layout as L
from steerclear.shield.wrappers import games_shield
from steerclear.shield.wrappers.driving import driven_boats
from steerclear.shield.wrappers.mctf import surroundings_of

GAMES = 3


def games(preset):
    """Games whose boats are tagged, out of bounds and (where there are power plays) disabled, some of each."""
    core = BatchedMctf(GameConfig.preset(preset, max_time_s=60.0), n_games=GAMES, seed=3)
    core.is_tagged[0, [1, 4]] = True
    core.oob[1, 3], core.state[1, 3, : L.Y + 1] = True, (-2.0, 30.0)
    core.is_tagged[2, 3] = core.oob[2, 3] = True
    if core.config.power_play_share > 0.0:
        core.power_start[2], core.is_disabled[2, [0, 5]] = 0, True
    return core


@pytest.mark.parametrize("preset", ["aamas2024", "mctf2025", "mctf2026"])
def test_a_batch_foresees_driven_boats_as_single_shields_do(preset):
    core, random = games(preset), np.random.default_rng(0)
    shield, home = games_shield(core), core.state.copy()
    around = surroundings_of(core, 0)
    for _ in range(4):
        core.state[...] = home
        core.state[:, :, : L.Y + 1] += random.uniform(-3.0, 3.0, (GAMES, core.n_boats, 2))
        wanted = np.stack([np.full(core.state.shape[:2], 1.0), random.uniform(-90, 90, core.state.shape[:2])], -1)
        rows, ours = driven_boats(core), (core.team == 0) & ~core.is_disabled
        shield.reset()  # boats are put elsewhere: nothing that is remembered holds
        sent = shield.decide(core.state, wanted, ours, ~core.on_side, rows).copy()
        for b in range(GAMES):
            fleet = Fleet(
                core.state[b].copy(),
                core.team,
                shield.platforms,
                ours[b],
                tuple("abcdef"),
                driven=rows[b],
                visiting=~core.on_side[b],
            )
            told = Shield(shield.config).decide(fleet, Commands.game_deg(wanted[b]), around)
            assert np.allclose(told.sent.values, sent[b], atol=1e-6)  # the program is solved otherwise
            assert np.array_equal(told.reason, shield.reason[b])
            assert np.allclose(told.certificate_m[ours[b]], shield.certificate_m[b, ours[b]], atol=1e-6)


def crossing(shield, driven):
    """Decision about a boat of ours before whose bow an opponent comes to cross, 12 m off."""
    state = np.zeros((1, 2, L.N_STATE))
    state[..., [L.SPEED_ERROR, L.HEADING_ERROR]] = np.nan
    state[0, 0, :5], state[0, 1, :5] = (0.0, 0.0, 0.0, 2.0, 60.0), (12.0, 14.0, 270.0, 2.0, 60.0)
    shield.reset()
    shield.decide(state, np.array([[[2.0, 0.0], [2.0, 0.0]]]), np.array([[True, False]]), driven=driven)
    return shield.certificate_m[0, 0]


def test_who_is_sure_to_lie_still_is_not_feared_as_who_may_come_near():
    shield = BatchedShield(ShieldConfig(), 1, ("heron", "heron"), (0, 1))
    driven = np.full((1, 2, 4), np.nan)
    driven[0, 1] = 0.0, np.nan, np.nan, np.inf
    feared = crossing(shield, None)
    assert crossing(shield, driven) > feared
    assert crossing(shield, None) == feared  # nothing of it is left
    driven[0, 1, 3] = 1.0  # not for long enough to count on
    assert crossing(shield, driven) == feared


def test_rows_of_another_shape_are_refused():
    core = games("aamas2024")
    shield = games_shield(core)
    with pytest.raises(FleetError, match="driven"):
        shield.decide(core.state, np.zeros((GAMES, 6, 2)), core.team == np.zeros((GAMES, 6)), driven=np.zeros((6, 4)))
