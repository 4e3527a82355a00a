import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.shield.exceptions import ConfigError, PolicyError
from steerclear.shield.wrappers import MctfVectorEnv, TeamBatch


def batch(seconds=1.0, games=2, **settings):
    core = BatchedMctf(GameConfig.preset("aamas2024", max_time_s=seconds, default_start=False), n_games=games)
    return TeamBatch(core, policies.make_batch("medium"), "blue", **settings)


@pytest.mark.parametrize("value", [True, np.False_])
@pytest.mark.parametrize("actions", ["normalised", "continuous", "discrete"])
def test_true_and_false_are_no_actions(actions, value):
    game = batch(actions=actions)
    game.reset(seed=1)
    shape = (game.learners,) if actions == "discrete" else (game.learners, 2)
    for given in (np.full(shape, value), np.full(shape, value).tolist(), np.full(shape, value, object)):
        with pytest.raises(PolicyError, match="of learner 0 is not usable"):
            game.step(given)


def test_normalised_actions_are_the_same_commands():
    one, two = batch(actions="normalised"), batch(actions="continuous")
    one.reset(3), two.reset(3)
    for _ in range(5):
        left = one.step(np.tile([[0.0, 0.5]], (6, 1)))
        right = two.step(np.tile([[0.5 * two.top_speed_mps, 90.0]], (6, 1)))
        np.testing.assert_array_equal(left.observations, right.observations)


def test_a_held_decision_steers_a_course():
    from steerclear.shield.platforms import layout as L

    games = batch(60.0, interval=100, actions="continuous")
    games.reset(1)
    begun = games.core.state[:, :3, L.HEADING].copy()
    games.step(np.tile([[2.0, 90.0]], (6, 1)))
    turned = (games.core.state[:, :3, L.HEADING] - begun + 180.0) % 360.0 - 180.0
    assert games.core.time_s[0] == pytest.approx(10.0)
    free = ~games.core.driven[:, :3]
    assert free.any()
    np.testing.assert_allclose(turned[free], 90.0, atol=10.0)


def test_a_game_that_ends_in_a_held_decision_ends_there():
    games = batch(1.0, interval=7)
    games.reset(1)
    assert not games.step(np.zeros(6, int)).truncated.any()
    out = games.step(np.zeros(6, int))
    assert out.truncated.all()
    np.testing.assert_array_equal(out.episodes["l"], 2)
    assert (out.observations != out.final_observations).any()
    np.testing.assert_array_equal(games.core.time_s, 0.0)


def test_infos_tell_how_a_game_ended_and_the_next_goes_on():
    envs = MctfVectorEnv(batch(0.2))
    assert envs.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    envs.reset(seed=1)
    stop = np.full(6, 16)
    assert "totals" not in envs.step(stop)[-1]
    fresh, _, terminated, truncated, infos = envs.step(stop)
    assert (terminated | truncated).all()
    assert infos["_totals"].all()
    assert envs.single_observation_space.contains(infos["final_obs"][0])
    assert (infos["final_obs"] != fresh).any()
    np.testing.assert_array_equal(infos["totals"]["l"], 2)
    assert not envs.step(stop)[3].any()
    assert envs.step(stop)[3].all()


def test_no_interval_is_refused():
    with pytest.raises(ConfigError, match="interval is 0"):
        batch(interval=0)
