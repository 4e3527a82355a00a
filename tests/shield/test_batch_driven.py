"""Boats that the games drive: a batch foresees them as a single shield does, game by game."""

from types import SimpleNamespace

import numpy as np
import pytest
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.experiments.entries.onboard.state import GameSpec, Observation, fleet_of
from steerclear.experiments.entries.package import game_spec
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig
from steerclear.shield.batch import BatchedShield
from steerclear.shield.platforms import layout as L
from steerclear.shield.wrappers import games_shield
from steerclear.shield.wrappers.driving import driven_boats
from steerclear.shield.wrappers.mctf import surroundings_of
from steerclear.shield.wrappers.pyquaticus import driven_players

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
            assert np.allclose(told.filtered.values, sent[b], atol=1e-6)  # the program is solved otherwise
            assert np.array_equal(told.reason, shield.reason[b])
            assert np.allclose(told.safety_margin_m[ours[b]], shield.safety_margin_m[b, ours[b]], atol=1e-6)


def as_pyquaticus(core, b):
    """Game number b as a Pyquaticus env has it, as far as it says what it drives its boats by, and its boats."""
    config, rules = core.config, core.rules
    players = [
        SimpleNamespace(
            is_tagged=bool(core.is_tagged[b, i]),
            oob=bool(core.oob[b, i]),
            is_disabled=bool(core.is_disabled[b, i]),
            get_max_speed=lambda i=i: core.max_speed_mps[i],
        )
        for i in range(core.n_boats)
    ]
    env = SimpleNamespace(
        flags=[SimpleNamespace(home=home) for home in core.flag_home],
        env_size=core.field.size,
        catch_radius=config.catch_radius_m,
        tag_speed_frac=config.tag_speed_frac,
        oob_speed_frac=config.oob_speed_frac,
        blue_power_start=core.power_start[b, 0],
        red_power_start=core.power_start[b, 1],
        power_play_length=rules.power_length,
        sim_speedup_factor=config.decision_steps,
        dt=config.dt_s,
        current_time=core.time_s[b],
    )
    if config.untag_at == "own_corners":
        env.blue_untag_coords, env.red_untag_coords = rules.corner_marks
        (env.env_ul, env.env_ll), (env.env_ur, env.env_lr) = rules.corners
        env.untag_radius = config.corner_radius_m
    return env, players


@pytest.mark.parametrize("preset", ["aamas2024", "mctf2025", "mctf2026"])
def test_games_of_either_kind_and_a_zip_tell_the_same_of_the_boats_they_drive(preset):
    core = games(preset)
    rows = driven_boats(core)
    assert np.isfinite(rows[..., 0]).sum() >= 4
    for b in range(GAMES):
        env, players = as_pyquaticus(core, b)
        np.testing.assert_allclose(driven_players(env, players, core.state[b], core.team), rows[b], rtol=1e-12)
    if preset == "mctf2026":  # what a zip is told
        spec = GameSpec(**game_spec(preset, {"separation_m": 4.0}))
        nobody = np.zeros(core.n_boats, np.bool_)
        for b in range(GAMES):
            seen = Observation(core.state[b], core.is_tagged[b], core.oob[b], core.is_disabled[b], nobody)
            left_s = np.where(core.is_disabled[b], rows[b, :, 3], 0.0)
            np.testing.assert_allclose(fleet_of(spec, seen, 0, left_s).driven, rows[b], rtol=1e-12)


def crossing(shield, driven):
    """Decision about a boat of ours before whose bow an opponent comes to cross, 12 m off."""
    state = np.zeros((1, 2, L.N_STATE))
    state[..., [L.SPEED_ERROR, L.HEADING_ERROR]] = np.nan
    state[0, 0, :5], state[0, 1, :5] = (0.0, 0.0, 0.0, 2.0, 60.0), (12.0, 14.0, 270.0, 2.0, 60.0)
    shield.reset()
    shield.decide(state, np.array([[[2.0, 0.0], [2.0, 0.0]]]), np.array([[True, False]]), driven=driven)
    return shield.safety_margin_m[0, 0]


def test_who_is_sure_to_lie_still_is_not_feared_as_who_may_come_near():
    shield = BatchedShield(ShieldConfig(), 1, ("heron", "heron"), (0, 1))
    driven = np.full((1, 2, 4), np.nan)
    driven[0, 1] = 0.0, np.nan, np.nan, np.inf
    feared = crossing(shield, None)
    assert crossing(shield, driven) > feared
    assert crossing(shield, None) == feared  # nothing of it is left
    driven[0, 1, 3] = 1.0  # not for long enough to count on
    assert crossing(shield, driven) == feared
