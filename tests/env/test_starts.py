import numpy as np
import pytest
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.randomness import next_uniform, seed_states
from steerclear.env.trace import load_trace
from steerclear.shield.exceptions import GameError
from steerclear.shield.platforms import layout as L


def test_default_starts_are_those_of_the_recorded_games(traces):
    checked = 0
    for path in traces.values():
        trace = load_trace(path)
        if not trace.meta["config"]["default_init"] or "captures" in path.stem or "random" not in path.stem:
            continue
        core = BatchedMctf(trace.config)
        np.testing.assert_allclose(core.state[0, :, :2], trace.arrays["position"][0])
        np.testing.assert_allclose(core.state[0, :, L.HEADING], trace.arrays["heading"][0])
        assert not core.state[0, :, L.SPEED].any()
        checked += 1
    assert checked >= 4


def test_a_default_place_that_is_taken_is_replaced_on_the_own_side():
    config = GameConfig.preset("aamas2024", team_size=1, obstacles={"circle": [(2.0, (25.0, 20.0))]})
    core = BatchedMctf(config, seed=4)
    assert np.hypot(*(core.state[0, 0, :2] - (25.0, 20.0))) > 3.25
    assert core.state[0, 0, L.X] <= 40.0


@pytest.mark.parametrize("own_side", [True, False])
def test_random_starts_are_legal(own_side):
    islands = {"circle": [(3.0, (40.0, 20.0))]}
    config = GameConfig.preset("aamas2024", default_start=False, on_side_start=own_side, obstacles=islands)
    core = BatchedMctf(config, n_games=200, seed=3)
    place, radius = core.state[..., :2], 1.25
    assert ((place > radius) & (place < np.array([80.0, 40.0]) - radius)).all()
    gaps = np.linalg.norm(place[:, :, None] - place[:, None], axis=-1) + 99.0 * np.eye(6)
    assert gaps.min() > 2.5
    assert np.linalg.norm(place - (40.0, 20.0), axis=-1).min() > 4.25
    assert np.linalg.norm(place[:, :, None] - core.flag_home, axis=-1).min() > 3.0
    assert core.on_side.all() == own_side
    assert (core.state[..., L.SPEED] <= 2.0).all()
    assert core.state[..., L.SPEED].std() > 0.4
    assert np.abs(core.state[..., L.HEADING]).max() <= 180.0


def test_a_field_too_small_for_its_boats_is_an_error_not_a_hang():
    config = GameConfig.preset("aamas2024", env_bounds_m=(12.0, 12.0), default_start=False, team_size=10)
    with pytest.raises(GameError, match="use a larger field, fewer boats"):
        BatchedMctf(config)


def test_random_numbers_are_uniform_and_each_games_own():
    states = seed_states(1, 3)
    numbers = np.array([[next_uniform(states, b) for _ in range(4000)] for b in range(3)])
    assert ((numbers >= 0.0) & (numbers < 1.0)).all()
    np.testing.assert_allclose(numbers.mean(axis=1), 0.5, atol=0.02)
    np.testing.assert_allclose(numbers.std(axis=1), np.sqrt(1 / 12), atol=0.02)
    assert np.abs(np.corrcoef(numbers) - np.eye(3)).max() < 0.06


def test_splitmix64_gives_its_published_first_numbers():
    state = np.array([1234567], dtype=np.uint64)
    expected = (6457827717110365317, 3203168211198807973, 9817491932198370423)
    for number in expected:
        assert next_uniform(state, 0) == (number >> 11) / 2**53


def test_the_first_game_of_a_batch_has_the_seed_of_a_single_game():
    assert seed_states(9, 1)[0] == seed_states(9, 5)[0]
    assert (seed_states(9, 5)[:3] == seed_states(9, 3)).all()
    assert seed_states(None, 1)[0] != seed_states(None, 1)[0]
