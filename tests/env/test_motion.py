import numpy as np
import pytest
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L

CIRCLE = {"circle": [(3.0, (40.0, 20.0))]}


@pytest.mark.parametrize("platform", ["heron", "surveyor", "large_usv", "mctf2024_sim", "si", "di"])
def test_free_boats_move_exactly_as_the_platform_model(platform):
    config = GameConfig.preset("mctf2025", platforms=platform, flag_keepout_m=0.0, tag_on_oob=False)
    core = BatchedMctf(config)
    params = get_platform(platform).pack()
    boat = core.state[0, 0].copy()
    random = np.random.default_rng(5)
    for _ in range(60):
        wanted = np.stack([random.uniform(0, 3, (1, 6)), random.uniform(-90, 90, (1, 6))], axis=-1)
        wanted = wanted + 1e-9  # in no way single precision, so that the errors are subtracted in double
        commands = core.commands(wanted)
        commands[:] = wanted
        core.advance(commands)
        step_boat(params, boat, wanted[0, 0, 0], wanted[0, 0, 1], 0.1)
        assert not core.oob.any()
        np.testing.assert_array_equal(core.state[0, 0], boat)


def test_policies_commands_reach_the_autopilot_in_single_precision(place):
    core = place({0: (20.0, 10.0)}, platforms="surveyor")
    wanted = np.zeros((1, 4, 2))
    wanted[0, 0] = 1.0 / 3.0, 10.1
    np.testing.assert_array_equal(core.commands(wanted), wanted.astype(np.float32))
    boat = fresh_state(20.0, 10.0, 90.0)
    params = get_platform("surveyor").pack()
    errors = [np.float32(10.1), np.float32(10.3), np.float32(10.30001)]
    for error in errors:
        wanted[0, 0] = 1.0, error
        core.step(wanted)
        exact = not np.isnan(boat[L.HEADING_ERROR])
        if exact:  # the derivative of the reference
            boat[L.HEADING_ERROR] = float(error) - float(error - np.float32(boat[L.HEADING_ERROR]))
        step_boat(params, boat, 1.0, float(error), 0.1)
        boat[L.HEADING_ERROR] = float(error)
        np.testing.assert_allclose(core.state[0, 0], boat, rtol=0, atol=1e-12)


def test_a_boat_that_hits_an_obstacle_goes_back_turned_round_and_stopped(place):
    core = place({0: (35.5, 20.0), 2: (75.0, 5.0)}, overrides={"obstacles": CIRCLE}, heading={"agent_0": 90.0})
    actions = np.zeros((1, 4, 2))
    actions[0, 0] = 10.0, 0.0
    core.step(actions)
    into = core.state[0, 0, :2].copy()
    assert into[0] > 35.9
    core.state[0, 0, L.THRUST] = 50.0
    core.step(actions)
    np.testing.assert_allclose(core.state[0, 0, [L.X, L.Y]], (35.5, 20.0))
    assert core.state[0, 0, L.HEADING] == -90.0
    assert core.state[0, 0, [L.SPEED, L.THRUST, L.RUDDER]].tolist() == [0.0, 0.0, 0.0]
    np.testing.assert_array_equal(core.previous_position[0, 0], into)
    assert core.driven[0, 0]
    assert not core.is_tagged.any()


def test_an_obstacle_costs_the_flag_and_tags_where_the_rules_say_so(place):
    wedge = {"polygon": [((40.0, 18.0), (44.9, 20.0), (40.0, 22.0))]}
    core = place(
        {0: (47.0, 20.0), 1: (5.0, 5.0)},
        overrides={"obstacles": wedge, "tag_on_collision": True},
        has_flag={"agent_0": True},
        heading={"agent_0": -90.0},
    )
    actions = np.zeros((1, 4, 2))
    actions[0, 0] = 10.0, 0.0
    for _ in range(3):
        core.step(actions)
    assert core.is_tagged[0, 0]
    assert not core.has_flag.any()
    assert not core.flag_taken.any()


@pytest.mark.parametrize("carrier", [None, "agent_2"])
def test_own_boats_stay_off_their_flag_only_while_it_is_home(place, carrier):
    carries = {} if carrier is None else {carrier: True}
    positions = {0: (16.0, 20.0), 1: (5.0, 5.0), 2: (30.0, 36.0)}
    core = place(positions, heading={"agent_0": -90.0}, has_flag=carries, tagging_cooldown=[0.0] * 4)
    actions = np.zeros((1, 4, 2))
    actions[0, 0] = 5.0, 0.0
    closest = np.inf
    for _ in range(20):
        core.step(actions)
        closest = min(closest, np.hypot(*(core.state[0, 0, :2] - core.flag_home[0])))
    assert core.flag_taken[0, 0] == (carrier is not None)
    assert (closest >= 4.25) == (carrier is None)


def test_opponents_may_enter_the_keepout(place):
    core = place({0: (5.0, 35.0), 1: (5.0, 5.0), 2: (16.0, 20.0)}, heading={"agent_2": -90.0}, tagging_cooldown=[0] * 4)
    actions = np.zeros((1, 4, 2))
    actions[0, 2] = 5.0, 0.0
    for _ in range(20):
        core.step(actions)
    assert np.hypot(*(core.state[0, 2, :2] - core.flag_home[0])) < 4.25
