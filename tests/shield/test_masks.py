"""Masks: what a shield would let pass, asked of all candidates at once, and remembered nowhere."""

from copy import deepcopy

import numpy as np
import pytest
from steerclear import policies
from steerclear.env import mctf_v0
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.shield import Commands, Fleet, Shield
from steerclear.shield.exceptions import ConfigError, FleetError
from steerclear.shield.wrappers import MctfVectorEnv, ShieldedParallelEnv, TeamBatch, games_shield
from steerclear.shield.wrappers.actions import DISCRETE

ACTIONS, ACTIONS_OF_TWO = (
    [Commands.game_deg(np.tile(pair * (2.0, 1.0), (boats, 1))) for pair in DISCRETE] for boats in (3, 2)
)


def fleet_at(second):
    """A boat with a teammate beside it, and an opponent that comes towards both."""
    return Fleet.of(
        position_m=[(2.0 * second, 0.0), (2.0 * second, 4.0), (6.0 - 2.0 * second, 0.5)],
        heading_rad=[0.0, 0.0, np.pi],
        speed_mps=[2.0, 2.0, 2.0],
        team=[0, 0, 1],
        platforms="heron",
    )


def alone_at(second):
    """A boat, and an opponent that comes towards it."""
    both = fleet_at(second)
    return Fleet.of(
        position_m=both.state[[0, 2], :2],
        heading_rad=[0.0, np.pi],
        speed_mps=[2.0, 2.0],
        team=[0, 1],
        platforms="heron",
    )


@pytest.mark.parametrize("settings", [{}, {"coordination": "per_boat"}, {"delay_s": 0.3}], ids=str)
def test_what_passes_for_a_boat_alone_is_sent_as_it_is_and_nothing_is_remembered_of_it(settings):
    asked, other = Shield(**settings), Shield(**settings)
    passing = []
    for step in range(0, 16, 3):
        fleet = alone_at(0.1 * step)
        masks = asked.safe_actions(fleet, ACTIONS_OF_TWO)
        for k in np.flatnonzero(masks[0]):
            assert not deepcopy(other).decide(fleet, ACTIONS_OF_TWO[k]).intervened[0]
        assert masks[1].all(), "an opponent's commands are not ours to refuse"
        passing.append(masks[0].mean())
        one, two = (shield.decide(fleet, ACTIONS_OF_TWO[4]) for shield in (asked, other))
        assert one.filtered.values.tobytes() == two.filtered.values.tobytes()
        assert one.safety_margin_m.tobytes() == two.safety_margin_m.tobytes()
    assert min(passing) < 1.0
    assert max(passing) > 0.0


def test_what_are_no_candidates_is_one_error():
    for actions in ([], ACTIONS[0]):
        with pytest.raises(FleetError, match="give a list of them, one for each candidate"):
            Shield().safe_actions(fleet_at(0.0), actions)


def team_of(**options):
    core = BatchedMctf(GameConfig.preset("aamas2024", default_start=False), n_games=3, seed=5)
    return TeamBatch(core, policies.make_batch("medium"), shield=games_shield(core, team="blue"), **options)


def test_masks_of_a_batch_foretell_what_its_shield_lets_pass_and_change_nothing():
    """Teammates choose otherwise than a mask takes for granted: rarely that decides."""
    batch, other = team_of(), team_of()
    rng = np.random.default_rng(0)
    batch.reset(5), other.reset(5)
    foretold = np.zeros((2, 2))
    for _ in range(40):
        masks = batch.action_masks().reshape(3, 3, 17)
        told = masks.any(axis=2) & ~masks.all(axis=2)  # a boat of which none passes may do anything
        for k in range(0, 17, 4):
            trial, wanted = deepcopy(other.shield), np.zeros((3, 6, 2))
            wanted[:, :3] = DISCRETE[k] * (other.core.max_speed_mps[0], 1.0)
            trial.filter_for(0)(deepcopy(other.core), wanted)
            passed = np.isin(trial.reason[:, :3], (0, 6))[told]
            np.add.at(foretold, (masks[..., k][told].astype(int), passed.astype(int)), 1)
        actions = rng.integers(0, 17, 9)
        one, two = batch.step(actions), other.step(actions)
        assert one.observations.tobytes() == two.observations.tobytes()
    assert foretold.sum() > 20
    assert foretold[1, 1] / foretold[1].sum() > 0.95, "what passes is sent as it is"
    assert foretold[0].sum() > 0


def test_environments_give_masks_in_the_forms_that_learners_take():
    envs = MctfVectorEnv(team_of())
    envs.reset(seed=1)
    assert envs.action_masks().shape == (9, 17)
    with pytest.raises(ConfigError, match="give actions='discrete'"):
        team_of(actions="normalised").action_masks()
    game = mctf_v0.parallel_env("aamas2024")
    env = ShieldedParallelEnv(game, Shield.for_game(game), masks=True)
    _, infos = env.reset(seed=1)
    *_, after = env.step(dict.fromkeys(env.agents, 4))
    for told in (infos, after):
        masks = [told[agent]["action_mask"] for agent in env.possible_agents[:3]]
        assert {(mask.shape, mask.dtype) for mask in masks} == {((17,), np.dtype(np.int8))}
        assert "action_mask" not in told[env.possible_agents[5]]
    assert all(agent in infos for agent in env.possible_agents)


def test_maskable_ppo_takes_them():
    pytest.importorskip("sb3_contrib", reason="the extra [train]")
    from sb3_contrib.common.maskable.utils import get_action_masks, is_masking_supported
    from steerclear.shield.wrappers import MctfVecEnv

    envs = MctfVecEnv(team_of())
    envs.reset()
    assert is_masking_supported(envs)
    np.testing.assert_array_equal(get_action_masks(envs), envs.action_masks())
    assert len(envs.env_method("action_masks", indices=[0, 2])) == 2
