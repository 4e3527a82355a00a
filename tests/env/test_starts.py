"""Fields, and where games start: on fixed places, at random, or from a partial state."""

import numpy as np
import pytest
from steerclear.env.compat import Team
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.field import field_geometry, field_points
from steerclear.env.randomness import next_uniform
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


def test_splitmix64_gives_its_published_first_numbers():
    state = np.array([1234567], dtype=np.uint64)
    expected = (6457827717110365317, 3203168211198807973, 9817491932198370423)
    for number in expected:
        assert next_uniform(state, 0) == (number >> 11) / 2**53


def test_flags_one_above_the_other_turn_the_walls_with_them():
    config = GameConfig.preset("aamas2024", blue_flag_home_m=(40.0, 5.0), red_flag_home_m=(40.0, 35.0))
    field = field_geometry(config)
    np.testing.assert_allclose(sorted(field.scrimmage[:, 0]), [0.0, 80.0])
    np.testing.assert_allclose(field.scrimmage[:, 1], 20.0)
    assert (field.walls[0, 1, :, 1] == 0.0).all()
    assert (field.walls[1, 1, :, 1] == 40.0).all()


def test_a_slanting_line_is_drawn_out_to_the_edges():
    field = field_geometry(GameConfig.preset("aamas2024", scrimmage_m=((39.0, 19.0), (41.0, 21.0))))
    np.testing.assert_allclose(field.scrimmage, [[20.0, 0.0], [60.0, 40.0]])


def test_field_points_form_the_named_grid():
    points = field_points(np.array([160.0, 80.0]))
    assert len(points) == 45
    for name, place in {"SC": (80, 20), "CC": (80, 40), "PBX": (160, 60), "SSB": (0, 0), "PPFX": (140, 80)}.items():
        np.testing.assert_allclose(points[name], place)


CONFIG = GameConfig.preset("aamas2024", team_size=2, obstacles={"circle": [(2.0, (30.0, 10.0))]})


def start(**init):
    core = BatchedMctf(CONFIG, seed=0)
    core.reset_game(0, init)
    return core


def test_everything_that_is_given_is_taken_over():
    core = start(
        agent_position=[(20, 5), (20, 35), (60, 5), (60, 35)],
        agent_pos_unit="m",
        agent_speed={"agent_0": 1.5},
        agent_heading=[0.0, 90.0, 270.0, -180.0],
        agent_is_tagged={"agent_3": True},
        agent_tagging_cooldown={"agent_1": 4.0},
        agent_collisions=[1, 2, 3, 4],
        captures={Team.RED_TEAM: 2},
        tags=[3, 4],
        grabs=(5, 6),
    )
    assert core.state[0, :, L.SPEED].tolist() == [1.5, 0.0, 0.0, 0.0]
    assert core.state[0, :, L.HEADING].tolist() == [0.0, 90.0, -90.0, -180.0]
    assert core.is_tagged[0].tolist() == [False, False, False, True]
    assert core.tagging_cooldown_s[0].tolist() == [10.0, 4.0, 10.0, 10.0]
    assert core.collisions[0].tolist() == [1, 2, 3, 4]
    assert (core.captures[0].tolist(), core.tags[0].tolist(), core.grabs[0].tolist()) == ([0, 2], [3, 4], [5, 6])
    assert np.isnan(core.state[..., L.HEADING_ERROR]).all()


def test_a_carrier_without_a_place_starts_on_the_other_side_with_the_flag():
    core = start(agent_has_flag={"agent_2": 1}, agent_tagging_cooldown=[0.0] * 4)
    assert core.flag_taken[0].tolist() == [True, False]
    assert core.state[0, 2, L.X] <= 40.0
    np.testing.assert_array_equal(core.flag_position[0, 0], core.state[0, 2, :2])


def test_only_the_named_game_starts_anew():
    core = BatchedMctf(CONFIG, n_games=3, seed=0)
    core.step(np.ones((3, 4, 2)))
    before = core.state.copy()
    core.reset_game(1, {"agent_position": {"agent_0": (5.0, 5.0)}})
    np.testing.assert_array_equal(core.state[[0, 2]], before[[0, 2]])
    assert core.time_s.tolist() == [0.1, 0.0, 0.1]
    with pytest.raises(GameError, match=r"no game 3; games are 0..2"):
        core.reset_game(3, {})
