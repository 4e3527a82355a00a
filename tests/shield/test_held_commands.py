"""Commands held for several moves: what is foreseen of the next decision is what the game then does."""

from dataclasses import replace

import numpy as np
import pytest
from shield_scenes import head_on, relative
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.shield import Shield, ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import command_for_turn, full_turn
from steerclear.shield.wrappers.parallel import ShieldedParallelEnv
from steerclear.shield.wrappers.policy import ShieldedTeamPolicy
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
        foreseen, known, path = work.next_state.copy(), work.known.copy(), work.path.copy()
        changed += int(blue.decisions.intervened.any())
        places.clear()
        observations, *_, infos = env.step({**actions, **red.act(observations, infos)})
        now = env.core.state[0, :, :2]
        assert np.hypot(*(foreseen[:, :2] - now).T)[ours].max(initial=0.0) < SAME_M
        after, stride = [*places[1:], now], work.boats.stride
        upper = np.array([places[0][:, 1] > 40.0, now[:, 1] > 40.0])  # the nearer corner is driven to: it may change
        near = work.near[ours].any(axis=0)  # others matter to nobody, and are not predicted
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
    assert wrapped.shield._deciders.scene.known.tolist() == [False, True, False, False, False, False]


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
    assert shield._deciders.scene.known.tolist() == [False, False, False, True, False, False]


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
