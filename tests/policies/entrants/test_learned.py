from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.policies.entrants.learned import LearnedBatch, read_weights
from steerclear.policies.entrants.learned.network import Features, Network, joined, write_weights
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.wrappers import TeamBatch


def network(roles=1, interval=5, kind="discrete", n_obs=61, seed=0):
    rng = np.random.default_rng(seed)
    features = Features(np.array([0, 2, 4]), np.array([1, 3]), 4.0)
    sizes = (features.size(n_obs), 16, 17 if kind == "discrete" else 2)
    weights = [rng.normal(size=(roles, a, b)).astype(np.float32) for a, b in pairwise(sizes)]
    biases = [rng.normal(size=(roles, b)).astype(np.float32) for b in sizes[1:]]
    return Network(weights, biases, features, "tanh", kind, interval, n_obs, {"note": "test"})


def test_weights_come_back_as_they_were(tmp_path):
    for kind in ("discrete", "normalised"):
        one = network(3, kind=kind)
        two = read_weights(write_weights(one, tmp_path / "w.npz"))
        seen = np.random.default_rng(1).uniform(-1, 1, (50, 61)).astype(np.float32)
        roles = np.arange(50) % 3
        np.testing.assert_array_equal(one.outputs(seen, roles), two.outputs(seen, roles))
        assert two.card == {"note": "test"}


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


def test_a_network_for_other_games_is_refused(tmp_path):
    path = write_weights(network(n_obs=30), tmp_path / "w.npz")
    with pytest.raises(PolicyError, match="takes observations of 30 numbers, this game makes 61"):
        policies.make_batch(f"weights:{path}").reset(BatchedMctf("aamas2024", 1), 0, 0)


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
