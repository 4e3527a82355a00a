"""The shield around an environment: ours, with the shield inside the step, and one that looks like Pyquaticus'."""

import math

import numpy as np
import pytest
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.shield import Reason, Shield
from steerclear.shield.platforms import layout as L
from steerclear.shield.wrappers import ShieldedParallelEnv
from wrapped_games import STRAIGHT, Quaticus


def duel(gap_m=16.0):
    """One boat each, head on, blue heading east."""
    start = {"agent_position": [[25.0, 20.0], [25.0 + gap_m, 20.0]], "agent_heading": [90.0, -90.0]}
    env = MctfEnv(GameConfig.preset("aamas2024", team_size=1, catch_radius_m=0.1))
    return env, {"init_dict": {**start, "agent_speed": [1.5, 1.5]}}


def sail(env, options, steps=90, action=STRAIGHT):
    """Closest distance of the two boats, m, and all infos."""
    env.reset(seed=0, options=options)
    closest, told = math.inf, []
    for _ in range(steps):
        *_, infos = env.step(dict.fromkeys(env.agents, action))
        position = env.unwrapped.view().position
        closest = min(closest, float(np.hypot(*(position[1] - position[0]))))
        told.append(infos)
    return closest, told


def test_a_shielded_boat_keeps_clear_where_it_would_not():
    env, options = duel()
    bare, _ = sail(env, options)
    env, options = duel()
    shielded, told = sail(ShieldedParallelEnv(env, Shield()), options)
    assert bare < 2.5 <= shielded
    assert {infos["agent_0"]["shield"].intervened for infos in told} == {True, False}
    assert "shield" not in told[0]["agent_1"]


def test_two_wrappers_shield_both_teams_by_their_own_decisions():
    env, options = duel()
    inner = ShieldedParallelEnv(env, Shield(), team="red")
    closest, told = sail(ShieldedParallelEnv(inner, Shield(), team=0), options)
    assert closest >= 2.5
    for agent in ("agent_0", "agent_1"):
        assert {infos[agent]["shield"].boat for infos in told} == {agent}
        assert any(infos[agent]["shield"].intervened for infos in told)


def test_what_is_safe_passes_bit_for_bit():
    (bare, options), (env, _) = duel(35.0), duel(35.0)
    shielded = ShieldedParallelEnv(env, Shield())
    for game in (bare, shielded):
        game.reset(seed=0, options=options)
    random = np.random.default_rng(3)
    for _ in range(30):
        action = {agent: int(random.integers(17)) for agent in bare.agents}
        bare.step(action)
        shielded.step(action)
        assert bare.view().state.tobytes() == shielded.unwrapped.view().state.tobytes()
    assert shielded.decisions[0].reason == Reason.PASSED


def test_a_forgotten_boat_is_held_and_said_once_a_game(caplog):
    env, options = duel(35.0)
    env = ShieldedParallelEnv(env, Shield())
    env.reset(seed=0, options=options)
    for _ in range(3):
        env.step({"agent_1": STRAIGHT})
        assert env.decisions["agent_0"].reason == Reason.HELD
    assert [record.message for record in caplog.records] == ["no action for agent_0; boats without an action hold"]
    env.step(dict.fromkeys(env.agents, STRAIGHT))
    assert env.decisions["agent_0"].reason == Reason.PASSED
    env.reset(seed=0, options=options | {"init_dict": options["init_dict"] | {"agent_is_tagged": [1, 0]}})
    env.step({})
    assert env.decisions["agent_0"].reason == Reason.PASSED, "the game drives it"


def test_a_speed_beyond_the_boat_is_limited_as_it_is_without_a_game():
    env, options = duel(35.0)
    env = ShieldedParallelEnv(env, Shield())
    env.reset(seed=0, options=options)
    env.step({"agent_0": (500.0, 0.0), "agent_1": STRAIGHT})
    assert env.decisions["agent_0"].reason == Reason.LIMITED
    assert env.decisions["agent_0"].filtered_speed_mps == 500.0, "the game cuts it"
    assert not env.decisions["agent_0"].intervened


@pytest.mark.parametrize("autopilot", [True, False])
def test_boats_the_game_drives_are_covered_only_when_asked(autopilot):
    env, options = duel(35.0)
    env = ShieldedParallelEnv(env, Shield(), shield_autopilot=autopilot)
    env.reset(seed=0, options=options | {"init_dict": options["init_dict"] | {"agent_is_tagged": [1, 0]}})
    *_, infos = env.step(dict.fromkeys(env.agents, STRAIGHT))
    assert env.unwrapped.view().driven[0]
    assert (infos["agent_0"]["shield"].reason == Reason.NOT_COVERED) is not autopilot


def test_pyquaticus_gets_the_corrected_pair_and_everything_else_as_it_was():
    game = Quaticus(gap_m=6.0)
    env = ShieldedParallelEnv(game, Shield())
    env.reset(seed=0)
    actions = {"agent_0": STRAIGHT, "agent_1": STRAIGHT}
    *_, infos = env.step(actions)
    assert game.stepped == [actions] == [{"agent_0": STRAIGHT, "agent_1": STRAIGHT}]
    sent, decision = game.moved[0], infos["agent_0"]["shield"]
    assert sent["agent_1"].tolist() == [1.5, 0.0]
    assert decision.intervened
    assert decision.nominal_speed_mps == 1.5
    assert sent["agent_0"][0] == decision.filtered_speed_mps
    turn_deg = math.degrees(decision.filtered_heading_rad - decision.nominal_heading_rad)
    assert (sent["agent_0"][1] - turn_deg + 180.0) % 360.0 == pytest.approx(180.0)


def test_pyquaticus_boats_that_the_game_drives_are_not_decided_for():
    game = Quaticus(gap_m=6.0)
    game.players["agent_0"].is_tagged = True
    env = ShieldedParallelEnv(game, Shield())
    env.reset(seed=0)
    env.step({"agent_0": STRAIGHT})
    assert env.decisions[0].reason == Reason.NOT_COVERED
    assert game.moved[0]["agent_0"].tolist() == [1.5, 0.0]


def test_rows_of_pyquaticus_players_hold_what_is_known():
    game = Quaticus(gap_m=30.0)
    row = ShieldedParallelEnv(game, Shield()).reader.fleet(0, True).state[0]
    assert (row[L.X], row[L.Y], row[L.HEADING], row[L.SPEED], row[L.THRUST]) == (60.0, 40.0, 90.0, 1.5, 75.0)
    assert np.isnan(row[L.HEADING_ERROR])
