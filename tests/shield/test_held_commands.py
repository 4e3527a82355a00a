"""Commands held for several moves, and boats the game drives: what is foreseen is what the game then does."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from shield_scenes import head_on, relative
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.entries.onboard.state import GameSpec, Observation, fleet_of
from steerclear.experiments.entries.wrap import game_spec
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig
from steerclear.shield.batch import BatchedShield
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import command_for_turn, full_turn
from steerclear.shield.wrappers import games_shield
from steerclear.shield.wrappers.driving import driven_boats
from steerclear.shield.wrappers.mctf import surroundings_of
from steerclear.shield.wrappers.parallel import ShieldedParallelEnv
from steerclear.shield.wrappers.policy import ShieldedTeamPolicy
from steerclear.shield.wrappers.pyquaticus import driven_players
from steerclear.shield.wrappers.readers import reader_of

BLUE, RED = ("agent_0", "agent_1", "agent_2"), ("agent_3", "agent_4", "agent_5")

SAME_M = 1e-6


def held(platform, moves=10):
    return np.append(get_platform(platform).pack(), 1.0 / moves)


def under_way(platform, speed_mps, thrust):
    row = fresh_state(0.0, 0.0, 20.0, speed_mps)
    row[L.THRUST], row[L.HEADING_ERROR] = thrust, 12.0
    return row


@pytest.mark.parametrize("platform", ["heron", "surveyor", "large_usv", "si", "di"])
def test_a_step_of_several_moves_is_those_moves(platform):
    one, many = under_way(platform, 1.0, 50.0), under_way(platform, 1.0, 50.0)
    step_boat(held(platform), one, 2.0, 25.0, 1.0)
    for _ in range(10):
        step_boat(get_platform(platform).pack(), many, 2.0, 25.0, 0.1)
    np.testing.assert_array_equal(one, many)


@pytest.mark.parametrize("platform", ["heron", "surveyor", "large_usv"])
@pytest.mark.parametrize("turn_deg", [-15.0, -2.0, 0.0, 0.5, 9.0])
def test_the_command_for_a_turn_makes_that_turn_in_the_whole_step(platform, turn_deg):
    params, row = held(platform), under_way(platform, 1.0, 60.0)
    full = full_turn(params, row, 2.0, 1.0)
    error = command_for_turn(params, row, 2.0, turn_deg, 1.0)
    step_boat(params, row, 2.0, error, 1.0)
    turned = (row[L.HEADING] - 20.0 + 180.0) % 360.0 - 180.0
    assert turned == pytest.approx(max(-full, min(full, turn_deg)), abs=2.5 if abs(turn_deg) > full else 1e-6)


@pytest.mark.parametrize(("steps", "platform"), [(10, "surveyor"), (4, "heron")])
def test_the_place_foreseen_is_where_the_game_puts_the_boat(steps, platform):
    """Own boats at the end of the decision, boats near them that the game drives at every sample until then."""
    rules = {"decision_steps": steps, "platforms": platform, "power_play_share": 0.0, "max_time_s": 150.0}
    env = MctfEnv(GameConfig.preset("mctf2026", default_start=False, on_side_start=False, **rules), seed=4)
    blue, red = (
        ShieldedTeamPolicy(policies.make("medium"), Shield.for_game(env, profile="ramming")),
        policies.make("medium"),
    )
    observations, infos = env.reset(seed=4)
    blue.reset(env, BLUE, 1)
    red.reset(env, RED, 2)
    places, changed, driven = [], 0, 0
    env.command_filter = lambda core, commands: places.append(core.state[0, :, :2].copy()) or commands
    while env.agents:
        actions = blue.act(observations, infos)
        work, ours = blue.shield._deciders.scene, blue.decisions.fleet.controlled
        foreseen, known, path = work.next_state.copy(), work.predicted.copy(), work.path.copy()
        changed += int(blue.decisions.intervened.any())
        places.clear()
        observations, *_, infos = env.step({**actions, **red.act(observations, infos)})
        now = env.core.state[0, :, :2]
        assert np.hypot(*(foreseen[:, :2] - now).T)[ours].max(initial=0.0) < SAME_M
        after, stride = [*places[1:], now], work.boats.stride
        upper = np.array([places[0][:, 1] > 40.0, now[:, 1] > 40.0])  # the nearer corner is driven to: it may change
        near = work.neighbours[ours].any(axis=0)  # others matter to nobody, and are not predicted
        for j in np.flatnonzero(known & near & (upper[0] == upper[1])):
            driven += 1
            for k in range((steps - 1) // stride + 1):
                assert np.hypot(*(path[j, k] - after[k * stride][j])) < SAME_M
    assert changed > 20
    assert driven > 0


def test_a_disabled_boat_is_foreseen_to_coast_and_no_shield_decides_for_it():
    env = MctfEnv(GameConfig.preset("mctf2026", max_time_s=200.0), seed=0)
    places = {f"agent_{i}": (40.0, 20.0 * i + 20.0) for i in range(3)}
    places |= {f"agent_{i + 3}": (120.0, 20.0 * i + 20.0) for i in range(3)}
    speeds = dict.fromkeys(places, 2.0)
    init = {"agent_position": places, "agent_speed": speeds, "power_play_start": (0, 100), "power_play_boats": (1, 3)}
    wrapped = ShieldedParallelEnv(env, Shield.for_game(env))
    wrapped.reset(options={"init_dict": init})
    wrapped.step({agent: (3.0, 10.0) for agent in places})
    assert wrapped.decisions.fleet.controlled.tolist() == [True, False, True, False, False, False]
    speed, x, y, time_s = wrapped.decisions.fleet.driven[1]
    assert (speed, np.isnan(x), np.isnan(y)) == (0.0, True, True)
    assert time_s == pytest.approx(40.0)
    assert wrapped.shield._deciders.scene.predicted.tolist() == [False, True, False, False, False, False]


def test_a_boat_that_is_nearly_free_is_feared_as_any_other():
    env = MctfEnv("mctf2026", seed=0)
    env.reset()
    core = env.core
    core.is_tagged[0, 3] = core.is_tagged[0, 4] = True
    core.state[0, 3, :2] = 80.0, 40.0
    core.state[0, 4, :2] = 142.0, 62.0
    shield = Shield.for_game(env)
    reader = reader_of(env)
    shield.decide(reader.fleet(0, False), __import__("steerclear").shield.Commands.game_deg(np.zeros((6, 2))))
    assert shield._deciders.scene.predicted.tolist() == [False, False, False, True, False, False]


def test_shields_for_moves_and_for_decisions_are_told_apart():
    env = MctfEnv("mctf2026", seed=0)
    config = ShieldConfig(dt_s=1.0, move_s=0.1, separation_m=4.0)
    assert (config.moves, config.model_s, ShieldConfig().moves) == (10, 0.1, 1)
    with pytest.raises(ConfigError, match="decides once for 10 moves"):
        ShieldedParallelEnv(env, Shield(config))
    wrapped = ShieldedTeamPolicy(policies.make("medium"), Shield(config))
    wrapped.reset(env, BLUE, 0)
    assert wrapped.shield.config is config
    for other in (ShieldConfig(dt_s=0.2), ShieldConfig(dt_s=0.5, move_s=0.1)):
        with pytest.raises(ConfigError, match=r"the game moves its boats 10 time\(s\) by 0.1 s"):
            ShieldedTeamPolicy(policies.make("medium"), Shield(other)).reset(env, BLUE, 0)


def test_a_drive_that_says_no_way_makes_nobody_harmless():
    """Such a boat is feared as any other; one whose drive is whole is not."""

    def decided(*drive):
        fleet = replace(head_on(6.5), driven=np.array([[np.nan] * 4, drive]))
        told = Shield(profile="ramming").decide(fleet, relative((2.0, 0.0), (2.0, 0.0)))
        return told.filtered.values.tolist(), told.safety_margin_m.tolist()

    none = np.nan
    feared = decided(none, none, none, none)
    for row in ((2.0, 5.0, none, 100.0), (2.0, none, 5.0, 100.0), (2.0, np.inf, 5.0, 100.0)):
        assert decided(*row) == feared
    for speed_mps in (-1.0, np.inf, 1e3):
        assert decided(speed_mps, none, none, 100.0) == feared
    for time_s in (none, 0.5):
        assert decided(0.0, none, none, time_s) == feared
    assert decided(2.0, 60.0, 6.5, 100.0) != feared


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
