"""Learned policies: one game as one of a batch, as learned; raids as undertow where the network says nothing."""

from dataclasses import astuple, replace
from itertools import pairwise

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.policies.entrants.learned import LearnedBatch, RaidsBatch, batch_of
from steerclear.policies.entrants.learned.network import Features, Network, joined, read_weights, write_weights
from steerclear.policies.entrants.learned.raids import SEEN
from steerclear.policies.entrants.undertow.shape import LIMITS, NAMES, SCRIPTED, Shape
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.platforms import layout as L
from steerclear.shield.wrappers import TeamBatch


def network(roles=1, interval=5, kind="discrete", n_obs=61, seed=0):
    rng = np.random.default_rng(seed)
    features = Features(np.array([0, 2, 4]), np.array([1, 3]), 4.0)
    sizes = (features.size(n_obs), 16, 17 if kind == "discrete" else 2)
    weights = [rng.normal(size=(roles, a, b)).astype(np.float32) for a, b in pairwise(sizes)]
    biases = [rng.normal(size=(roles, b)).astype(np.float32) for b in sizes[1:]]
    return Network(weights, biases, features, "tanh", kind, interval, n_obs, {"note": "test"})


def test_files_that_are_no_weights_are_refused_in_one_line(tmp_path):
    whole = write_weights(network(), tmp_path / "w.npz").read_bytes()
    bad = {"cut": whole[: len(whole) // 2], "text": b"hello", "empty": b""}
    for name, content in bad.items():
        (tmp_path / f"{name}.npz").write_bytes(content)
        with pytest.raises(PolicyError, match="no usable weights") as caught:
            policies.make(f"weights:{tmp_path / name}.npz")
        assert "\n" not in str(caught.value)
    np.savez(tmp_path / "objects.npz", about=np.array([{}], dtype=object))
    with pytest.raises(PolicyError, match="no usable weights"):
        policies.make_batch(f"weights:{tmp_path / 'objects.npz'}")
    np.savez(tmp_path / "other.npz", about=np.array('{"format": "x"}'))
    with pytest.raises(PolicyError, match="another kind of file"):
        read_weights(tmp_path / "other.npz")
    write_weights(network(n_obs=30), tmp_path / "short.npz")
    with pytest.raises(PolicyError, match="takes observations of 30 numbers, this game makes 61"):
        policies.make_batch(f"weights:{tmp_path / 'short.npz'}").reset(BatchedMctf("aamas2024", 1), 0, 0)
    with pytest.raises(PolicyError, match="there are no weights"):
        policies.make("weights:none.npz")


def test_one_game_plays_as_one_of_a_batch(tmp_path):
    path = write_weights(network(3), tmp_path / "w.npz")
    config = GameConfig.preset("aamas2024", max_time_s=3.0, default_start=False)
    env, core = MctfEnv(config, action_kind="continuous"), BatchedMctf(config, n_games=1)
    observations, infos = env.reset(seed=3)
    core.reset(seed=3)
    single, batch = policies.make(f"weights:{path}"), policies.make_batch(f"weights:{path}")
    single.reset(env, list(config.agent_ids[:3]), 0)
    batch.reset(core, 0, 0)
    commands = np.zeros((1, 6, 2))
    for _ in range(20):
        actions = single.act(observations, infos)
        commands[:, :3] = batch.act(core, 0)
        np.testing.assert_allclose(list(actions.values()), commands[0, :3], atol=1e-9)
        observations, _, _, _, infos = env.step(actions)
        core.step(commands)


def test_a_second_network_takes_over_where_the_flag_is_held(tmp_path):
    one, two = network(3, seed=1), network(1, seed=2)
    pair = read_weights(write_weights(joined(one, two, np.array([8, 9])), tmp_path / "pair.npz"))
    seen = np.random.default_rng(1).uniform(-1, 1, (50, 61)).astype(np.float32)
    roles = np.arange(50) % 3
    held = (seen[:, 8] > 0) | (seen[:, 9] > 0)
    assert 0 < held.sum() < 50
    expected = np.where(held[:, None], two.outputs(seen, roles), one.outputs(seen, roles))
    np.testing.assert_allclose(pair.outputs(seen, roles), expected, atol=1e-5)  # sums in another order
    with pytest.raises(ValueError, match="interval 4, not 5"):
        joined(one, network(interval=4), np.array([8]))
    with pytest.raises(ValueError, match="no numbers of the observation"):
        joined(one, two, np.array([61]))
    with pytest.raises(ValueError, match="a pair already"):
        joined(pair, two, np.array([8]))


def test_a_team_plays_as_it_learned(tmp_path):
    """Also where a decision asks for straight astern: 180 deg, not -180, which turns the other way."""
    config = GameConfig.preset("aamas2024", max_time_s=30.0, default_start=False)
    learned, played = BatchedMctf(config, n_games=2, seed=4), BatchedMctf(config, n_games=2, seed=4)
    one = network(3, interval=10)
    astern = np.zeros(17, np.float32)
    astern[0] = 20.0  # the first action: full speed, 180 deg
    one = replace(one, biases=[one.biases[0], one.biases[1] + astern])
    batch = TeamBatch(learned, interval=10, seed=4)
    seen = batch.reset(4)
    played.reset(seed=4)
    team = LearnedBatch(one)
    team.reset(played, 0, 4)
    commands, asked = np.zeros((2, 6, 2)), 0
    for _ in range(6):
        actions = np.argmax(one.outputs(seen, np.tile(np.arange(3), 2)), axis=1)
        asked += int((actions == 0).sum())
        seen = batch.step(actions).observations
        for _ in range(10):
            commands[:, :3] = team.act(played, 0)
            played.step(commands)
    assert asked
    np.testing.assert_allclose(played.state, learned.state, atol=1e-9)


NONE = Features(np.zeros(0, np.int64), np.zeros(0, np.int64), 0.0)


def raids_network(scale=0.5, interval=10, seed=0):
    rng = np.random.default_rng(seed)
    sizes = ((SEEN, 8), (8, len(NAMES)))
    weights = [(scale * rng.normal(size=(1, *size))).astype(np.float32) for size in sizes]
    biases = [np.zeros((1, size[1]), np.float32) for size in sizes]
    return Network(weights, biases, NONE, "tanh", "raids", interval, SEEN, {"preset": "aamas2024"})


@pytest.fixture
def config():
    return GameConfig.preset("aamas2024", max_time_s=40.0, default_start=False)


def test_a_shape_moves_by_units_and_stays_within_limits():
    assert set(LIMITS) == set(NAMES)
    for name in NAMES:
        unit, low, high = LIMITS[name]
        assert unit > 0.0
        assert low <= getattr(SCRIPTED, name) <= high
    units = np.zeros(len(NAMES))
    assert SCRIPTED.moved(units) == SCRIPTED == Shape()
    units[NAMES.index("gap_m")] = -0.5
    assert SCRIPTED.moved(units) == replace(SCRIPTED, gap_m=SCRIPTED.gap_m - 0.5 * LIMITS["gap_m"][0])
    highest = astuple(SCRIPTED.moved(np.full(len(NAMES), 1e6)))
    assert highest == tuple(LIMITS[name][2] for name in NAMES)


def test_one_game_plays_as_one_of_a_batch_on_either_side(config, tmp_path):
    path = write_weights(raids_network(), tmp_path / "w.npz")
    for team in (0, 1):
        env, core = MctfEnv(config, action_kind="continuous"), BatchedMctf(config, n_games=1)
        observations, infos = env.reset(seed=3)
        core.reset(seed=3)
        single, batch = policies.make(f"weights:{path}"), policies.make_batch(f"weights:{path}")
        ids = [agent for agent, side in zip(config.agent_ids, core.team, strict=True) if side == team]
        single.reset(env, ids, 1)
        batch.reset(core, team, 1)
        boats = np.flatnonzero(core.team == team)
        for _ in range(150):
            commands = np.zeros((1, core.n_boats, 2))
            commands[:, boats] = batch.act(core, team)
            observations, _, _, _, infos = env.step(single.act(observations, infos))
            core.step(commands)
            np.testing.assert_allclose(env.core.state, core.state, rtol=0.0, atol=1e-6)


def test_a_network_that_says_nothing_sails_as_undertow(config):
    env, core = MctfEnv(config, action_kind="continuous"), BatchedMctf(config, n_games=1)
    observations, infos = env.reset(seed=4)
    core.reset(seed=4)
    script, batch = policies.make("undertow"), batch_of(raids_network(0.0, interval=1))
    script.reset(env, config.agent_ids[:3], 1)
    batch.reset(core, 0, 1)
    for _ in range(300):
        commands = np.zeros((1, core.n_boats, 2))
        commands[:, :3] = batch.act(core, 0)
        observations, _, _, _, infos = env.step(script.act(observations, infos))
        core.step(commands)
    np.testing.assert_allclose(env.core.state, core.state, rtol=0.0, atol=1e-6)


def test_what_is_seen_is_the_same_from_both_sides_and_edges(config):
    core = BatchedMctf(config, n_games=3, seed=1)
    core.reset(seed=1)
    width_m, height_m = config.env_bounds_m
    state = core.games.state
    state[1:] = state[0]
    state[1, :, L.Y] = height_m - state[0, :, L.Y]
    state[1, :, L.HEADING] = 180.0 - state[0, :, L.HEADING]
    state[2] = np.roll(state[0], 3, axis=0)
    state[2, :, L.X], state[2, :, L.Y] = width_m - state[2, :, L.X], height_m - state[2, :, L.Y]
    state[2, :, L.HEADING] += 180.0
    teams = [RaidsBatch(raids_network()) for _ in range(2)]
    for team, one in enumerate(teams):
        one.reset(core, team, 1)
    teams[0].raids[1].upper = False
    games = np.arange(3)
    upper, lower, _ = teams[0].seen(games)
    assert upper.shape == (SEEN,)
    np.testing.assert_allclose(upper, lower, atol=1e-6)
    np.testing.assert_allclose(upper, teams[1].seen(games)[2], atol=1e-6)


def test_a_team_whose_boats_are_all_tagged_waits(config):
    core = BatchedMctf(config, n_games=1, seed=1)
    core.games.is_tagged[0, :3] = True
    core.games.on_side[0, 3:] = False
    team = RaidsBatch(raids_network())
    team.reset(core, 0, 1)
    np.testing.assert_array_equal(team.act(core, 0), 0.0)


def test_weights_of_other_games_files_or_ways_to_play_are_refused(config, tmp_path):
    path = write_weights(raids_network(), tmp_path / "w.npz")
    assert read_weights(path).kind == "raids"
    with pytest.raises(PolicyError, match="no probabilities"):
        policies.make_batch(f"weights:{path}", sample=True)
    batch = policies.make_batch(f"weights:{path}")
    with pytest.raises(PolicyError, match="team_size 3"):
        batch.reset(BatchedMctf(GameConfig.preset("aamas2024", team_size=2), n_games=1), 0, 1)
    core = BatchedMctf(config, n_games=1)
    core.reset(seed=1)
    with pytest.raises(PolicyError, match="call reset first"):
        batch.act(core, 0)
    with pytest.raises(PolicyError, match="train it anew"):
        RaidsBatch(replace(raids_network(), n_obs=61))
    wrong = replace(raids_network(), kind="discrete")
    with pytest.raises(PolicyError, match="outputs are no discrete actions"):
        read_weights(write_weights(wrong, tmp_path / "wrong.npz"))
