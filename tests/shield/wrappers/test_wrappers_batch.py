"""Vector environments: one team's boats in many games as a flat batch of learners, the shield inside."""

import sys

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.shield import Reason, wrappers
from steerclear.shield.exceptions import ConfigError, PolicyError
from steerclear.shield.wrappers import MctfVectorEnv, TeamBatch, games_shield
from steerclear.shield.wrappers.actions import DISCRETE

GAMES = 4


def batch(shielded=False, opponent=None, team="blue", actions="discrete", interval=1, **rules):
    config = GameConfig.preset("aamas2024", **rules)
    core = BatchedMctf(config, n_games=GAMES, seed=0)
    shield = games_shield(core, team=team) if shielded else None
    other = None if opponent is None else policies.make_batch(opponent)
    return TeamBatch(core, other, team, shield, actions, seed=5, interval=interval)


def closest_mates(games, steps=150):
    """Closest distance of two learners of one game while they act at random, m."""
    random, closest = np.random.default_rng(1), np.inf
    games.reset()
    for step in range(steps):
        if step % 10 == 0:
            actions = random.integers(8, size=games.learners)
        games.step(actions)
        place = games.core.state[:, games.boats, :2]
        gap = np.linalg.norm(place[:, :, None] - place[:, None], axis=-1)
        closest = min(closest, gap[:, ~np.eye(3, dtype=bool)].min())
    return closest


def test_the_shield_keeps_learners_apart_that_act_at_random():
    assert closest_mates(batch()) < 2.5 <= closest_mates(batch(shielded=True))


@pytest.mark.parametrize("team", ["blue", "red"])
def test_a_boat_is_kept_off_its_own_flag_whether_that_is_home_or_not(team):
    """The game throws out who is inside when the flag comes home, onto whoever is there."""
    core = BatchedMctf("aamas2024", n_games=2, seed=0)
    number = ("blue", "red").index(team)
    shield = games_shield(core, team=team)
    command_filter = shield.filter_for(number)
    boat, home = np.flatnonzero(core.team == number)[0], core.flag_home[number]
    core.state[:, :, 1] = np.where(core.team == number, home[1] + 20.0, -500.0)  # all others are far away
    core.state[:, boat, :4] = home[0], home[1] - 12.0, 0.0, 2.0  # due south of the flag, bound for it
    core.flag_taken[1, number] = True
    nearest = np.full(2, np.inf)
    for _ in range(90):
        commands = np.zeros((2, core.n_boats, 2))
        commands[:, boat, 0] = 2.0
        core.step(commands, command_filter)
        gap = np.linalg.norm(core.state[:, boat, :2] - home, axis=1)
        nearest = np.minimum(nearest, gap)
    stopped_m = core.config.flag_keepout_m + float(np.max(core.config.agent_radius_m))
    assert (nearest > stopped_m).all()
    assert (nearest < stopped_m + 3.0).all()


def test_a_shield_for_games_takes_their_step_and_can_leave_the_flag_out():
    core = BatchedMctf(GameConfig.preset("aamas2024", dt_s=0.2), n_games=1, seed=0)
    assert games_shield(core).config.dt_s == 0.2
    home, boat = core.flag_home[0], np.flatnonzero(core.team == 0)[0]
    core.state[:, :, 1] = -500.0 - 20.0 * np.arange(core.n_boats)
    core.state[:, boat, :5] = home[0], home[1] - 5.0, 0.0, 2.0, 100.0  # bound for the flag
    commands = np.zeros((1, core.n_boats, 2))
    commands[:, boat, 0] = 2.0
    ours = np.arange(core.n_boats)[None] == boat
    with_flag, without = games_shield(core), games_shield(core, keep_out=False)
    with_flag.decide(core.state, commands, ours)
    without.decide(core.state, commands, ours)
    assert with_flag.reason[0, boat] != Reason.PASSED
    assert without.reason[0, boat] == Reason.PASSED
    with pytest.raises(ConfigError, match="build another for team 1"):
        with_flag.filter_for(1)


@pytest.mark.parametrize(
    ("games", "words"),
    [
        (BatchedMctf("mctf2025", n_games=GAMES), "boats surveyor, .*the games have heron"),
        (BatchedMctf("aamas2024", n_games=2), "number of games 2, the games have 4"),
        (BatchedMctf(GameConfig.preset("aamas2024", dt_s=0.2), n_games=GAMES), "step, s, 0.2, the games have 0.1"),
    ],
)
def test_the_shield_of_other_games_is_refused(games, words):
    """It would predict_game_controlled other boats than are there, and keep nobody apart."""
    core, shield = BatchedMctf("aamas2024", n_games=GAMES), games_shield(games)
    with pytest.raises(ConfigError, match=words):
        TeamBatch(core, shield=shield)
    with pytest.raises(ConfigError, match="build the shield of these games with games_shield"):
        core.step(np.zeros((GAMES, core.n_boats, 2)), shield.filter_for(0))


@pytest.mark.parametrize("team", ["blue", "red"])
def test_a_step_is_the_step_of_the_games(team):
    games, core = batch(opponent="medium", team=team), BatchedMctf("aamas2024", n_games=GAMES, seed=0)
    other = policies.make_batch("medium")
    own, others = ([0, 1, 2], [3, 4, 5]) if team == "blue" else ([3, 4, 5], [0, 1, 2])
    seen = games.reset()
    core.reset(seed=5)
    other.reset(core, 1 if team == "blue" else 0, 5)
    assert seen.tobytes() == core.observations[:, own].reshape(12, -1).tobytes()
    random = np.random.default_rng(2)
    for _ in range(30):
        actions = random.integers(17, size=12)
        out = games.step(actions)
        commands = np.zeros((GAMES, 6, 2))
        commands[:, own] = DISCRETE[actions].reshape(GAMES, 3, 2) * [core.max_speed_mps[0], 1.0]
        commands[:, others] = other.act(core, 1 if team == "blue" else 0)
        observations, rewards, *_ = core.step(commands)
        assert games.core.state.tobytes() == core.state.tobytes()
        assert out.observations.tobytes() == observations[:, own].reshape(12, -1).tobytes()
        np.testing.assert_array_equal(out.rewards, rewards[:, own].ravel())


@pytest.mark.parametrize("shielded", [False, True])
def test_ended_games_start_anew_and_show_how_they_ended(shielded):
    games = batch(shielded, opponent="easy", max_time_s=1.0)
    games.reset()
    for step in range(1, 26):
        out = games.step(np.full(games.learners, 4))
        ended = out.terminated | out.truncated
        assert ended.all() == (step % 10 == 0)
        assert ended.any() == ended.all()
        changed = (out.observations != out.final_observations).any(axis=1)
        assert (changed == ended).all()
    assert games.core.time_s == pytest.approx(0.5)


@pytest.mark.parametrize("seed", [[1] * 12, -1, True, 1.5])
def test_resets_with_options_or_many_seeds_are_refused(seed):
    env = MctfVectorEnv(batch(opponent="medium"))
    with pytest.raises(ConfigError, match="unknown reset options init_dict; how games start is in their GameConfig"):
        env.reset(options={"init_dict": {}})
    with pytest.raises(ConfigError, match="give one whole number from 0 for all games, or None"):
        env.reset(seed=seed)


def test_chosen_games_start_anew_and_the_others_go_on():
    drawn = {"max_time_s": 60.0, "default_start": False}
    games, other = (batch(True, "medium", **drawn) for _ in range(2))
    for one in (games, other):
        one.reset(1)
        for _ in range(12):
            seen = one.step(np.full(12, 4)).observations
    mask = np.isin(np.arange(GAMES), (1, 3))
    boats = np.repeat(mask, 3)
    assert games.restart(mask)[~boats].tobytes() == seen[~boats].tobytes()
    assert games.core.time_s.tolist() == pytest.approx([1.2, 0.0, 1.2, 0.0])
    for _ in range(10):
        mine, theirs = (one.step(np.full(12, 4)).observations for one in (games, other))
        assert mine[~boats].tobytes() == theirs[~boats].tobytes()
        assert (mine[boats] != theirs[boats]).any(axis=1).all()


def test_options_set_by_stable_baselines_are_refused_once():
    pytest.importorskip("stable_baselines3")
    from steerclear.shield.wrappers import MctfVecEnv

    env = MctfVecEnv(batch())
    env.set_options({"init_dict": {}})
    with pytest.raises(ConfigError, match="unknown reset options init_dict"):
        env.reset()
    assert env.reset().shape == (12, env.observation_space.shape[0])


def test_without_stable_baselines_the_remedy_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.vec_env", None)
    monkeypatch.delitem(sys.modules, "steerclear.shield.wrappers.vector_sb3", raising=False)
    with pytest.raises(ImportError, match=r"pip install .*\[train\]"):
        _ = wrappers.MctfVecEnv
    with pytest.raises(AttributeError, match="no attribute 'Nonsense'"):
        _ = wrappers.Nonsense


def test_stable_baselines_gets_what_it_asks_for():
    pytest.importorskip("stable_baselines3")
    from steerclear.shield.wrappers import MctfVecEnv

    env = MctfVecEnv(batch(actions="continuous", max_time_s=0.5))
    env.seed(3)
    first = env.reset()
    again = MctfVecEnv(batch(actions="continuous", max_time_s=0.5))
    again.seed(3)
    assert first.tobytes() == again.reset().tobytes()
    assert env.observation_space.contains(first[0])
    assert env.action_space.high.tolist() == pytest.approx([env.batch.top_speed_mps, 180.0])
    for _ in range(5):
        _, rewards, done, infos = env.step(np.zeros((12, 2)))
    assert done.all()
    assert rewards.dtype == np.float32
    assert infos[0]["TimeLimit.truncated"]
    assert infos[0]["terminal_observation"].shape == env.observation_space.shape
    assert env.get_attr("num_envs", [0, 3]) == [12, 12]
    assert env.env_is_wrapped(object) == [False] * 12
    assert env.env_method("reset", 3, indices=0)[0].tobytes() == first.tobytes()


def drawn(seconds=1.0, games=2, **settings):
    core = BatchedMctf(GameConfig.preset("aamas2024", max_time_s=seconds, default_start=False), n_games=games)
    return TeamBatch(core, policies.make_batch("medium"), "blue", **settings)


@pytest.mark.parametrize("value", [True, np.False_])
@pytest.mark.parametrize("actions", ["normalised", "continuous", "discrete"])
def test_true_and_false_are_no_actions(actions, value):
    game = drawn(actions=actions)
    game.reset(seed=1)
    shape = (game.learners,) if actions == "discrete" else (game.learners, 2)
    for given in (np.full(shape, value), np.full(shape, value).tolist(), np.full(shape, value, object)):
        with pytest.raises(PolicyError, match="of learner 0 is not usable"):
            game.step(given)


def test_normalised_actions_are_the_same_commands():
    one, two = drawn(actions="normalised"), drawn(actions="continuous")
    one.reset(3), two.reset(3)
    for _ in range(5):
        left = one.step(np.tile([[0.0, 0.5]], (6, 1)))
        right = two.step(np.tile([[0.5 * two.top_speed_mps, 90.0]], (6, 1)))
        np.testing.assert_array_equal(left.observations, right.observations)


def test_a_held_decision_steers_a_course():
    from steerclear.shield.platforms import layout as L

    games = drawn(60.0, interval=100, actions="continuous")
    games.reset(1)
    begun = games.core.state[:, :3, L.HEADING].copy()
    games.step(np.tile([[2.0, 90.0]], (6, 1)))
    turned = (games.core.state[:, :3, L.HEADING] - begun + 180.0) % 360.0 - 180.0
    assert games.core.time_s[0] == pytest.approx(10.0)
    free = ~games.core.driven[:, :3]
    assert free.any()
    np.testing.assert_allclose(turned[free], 90.0, atol=10.0)


def test_a_game_that_ends_in_a_held_decision_ends_there():
    games = drawn(1.0, interval=7)
    games.reset(1)
    assert not games.step(np.zeros(6, int)).truncated.any()
    out = games.step(np.zeros(6, int))
    assert out.truncated.all()
    np.testing.assert_array_equal(out.episodes["l"], 2)
    assert (out.observations != out.final_observations).any()
    np.testing.assert_array_equal(games.core.time_s, 0.0)


def test_infos_tell_how_a_game_ended_and_the_next_goes_on():
    envs = MctfVectorEnv(drawn(0.2))
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
