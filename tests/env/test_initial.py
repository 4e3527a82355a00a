import numpy as np
import pytest
from steerclear.env.compat import Team
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.shield.exceptions import GameError
from steerclear.shield.platforms import layout as L

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


def test_what_is_not_given_is_as_after_a_plain_reset():
    plain = BatchedMctf(CONFIG, seed=0)
    core = start(agent_position={"agent_1": (10.0, 30.0)})
    np.testing.assert_array_equal(core.state[0, [0, 2, 3], :2], plain.state[0, [0, 2, 3], :2])
    assert core.state[0, 1, :2].tolist() == [10.0, 30.0]


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


@pytest.mark.parametrize(
    ("init", "message"),
    [
        ({"agent_positions": {}}, "unknown init_dict key 'agent_positions'; did you mean agent_position"),
        ({"zzz": 1}, "unknown init_dict key 'zzz'; known"),
        ({"agent_position": {"agent_9": (1, 1)}}, "unknown agent 'agent_9'"),
        ({"agent_position": [(1, 1)]}, "give 4 entries in boat order"),
        ({"agent_position": {"agent_0": (20.0, float("nan"))}}, "give 2 finite number"),
        ({"agent_position": {"agent_0": 3.0}}, "give 2 finite number"),
        ({"agent_heading": {"agent_0": "north"}}, "give 1 finite number"),
        ({"agent_position": {"agent_0": (0.5, 20.0)}}, r"agent_0 at \(0.5, 20\) is not inside the field \(80, 40\)"),
        ({"agent_position": {"agent_0": (30.0, 13.0)}}, "touches an obstacle; move it away"),
        ({"agent_position": {"agent_0": (11.0, 20.0)}}, "is on a flag's home"),
        ({"agent_position": {"agent_0": (20, 30), "agent_2": (20, 30)}}, r"agent_0 and agent_2 at .* are on one point"),
        ({"agent_pos_unit": "ll"}, "only 'm'"),
        ({"agent_has_flag": [1, 1, 0, 0]}, "at most one boat of a team"),
        ({"agent_has_flag": {"agent_0": 1}, "agent_position": {"agent_0": (20, 30)}}, "is on its own side"),
        ({"captures": (1, -1)}, "counts are >= 0"),
        ({"captures": {"blue": 1}}, "unknown team 'blue'; teams are 0"),
        ({"tags": 3}, "give 2 entries"),
    ],
)
def test_impossible_states_are_refused_and_nothing_changes(init, message):
    core = BatchedMctf(CONFIG, seed=0)
    core.step(np.ones((1, 4, 2)))
    before = core.state.copy(), core.time_s.copy()
    with pytest.raises(GameError, match=message):
        core.reset_game(0, init)
    np.testing.assert_array_equal(core.state, before[0])
    np.testing.assert_array_equal(core.time_s, before[1])


def test_init_dict_must_be_a_dict():
    with pytest.raises(GameError, match="init_dict is list; give a dict"):
        MctfEnv(CONFIG).reset(options={"init_dict": [1]})
