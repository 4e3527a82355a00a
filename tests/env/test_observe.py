import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.infos import InfoWriter
from steerclear.env.mctf import MctfEnv
from steerclear.env.observation_layout import boat_slots, observation_keys
from steerclear.env.trace import load_trace


def test_keys_are_those_of_the_recorded_games(traces):
    for path in traces.values():
        trace = load_trace(path)
        writer = InfoWriter(BatchedMctf(trace.config))
        assert list(writer.observation.keys) == trace.meta["obs_keys"]
        assert list(writer.global_state.keys) == trace.meta["global_state_keys"]


def test_61_numbers_for_three_boats_and_two_more_per_obstacle():
    config = GameConfig.preset("aamas2024")
    assert len(observation_keys(config)) == 61
    islands = config.replace(obstacles={"circle": [(1.0, (40.0, 10.0))], "polygon": [((1, 1), (2, 1), (1, 2))]})
    assert observation_keys(islands)[61:] == (
        "obstacle_0_distance",
        "obstacle_0_bearing",
        "obstacle_1_distance",
        "obstacle_1_bearing",
    )


def test_slots_fill_every_place_once():
    slots = boat_slots(GameConfig(team_size=3))
    for i in range(6):
        assert sorted(slots[i, [j for j in range(6) if j != i]]) == [21 + 8 * k for k in range(5)]
    assert slots[4, [3, 5, 0, 1, 2]].tolist() == [21, 29, 37, 45, 53]


def described(view, i):
    """What boat ``i`` sees, written anew in plain Python from the definitions."""
    config, size, n = view.config, view.config.team_size, view.config.n_boats
    width, height = config.env_bounds_m
    (x, y), heading, team = view.position[i], view.heading_deg[i], i // size

    def sight(px, py):
        return (math.degrees(math.atan2(px - x, py - y)) - heading, math.hypot(px - x, py - y))

    def wall(axis, at):
        ends = (min(max(x, 0.0), width), min(max(y, 0.0), height))
        return sight(at, ends[1]) if axis == 0 else sight(ends[0], at)

    walls = [wall(1, 0.0), wall(0, 0.0), wall(1, height), wall(0, width)]
    if team == 1:
        walls = walls[2:] + walls[:2]
    seen = [sight(*view.flag_home[1 - team]), sight(*view.flag_home[team]), *walls, wall(0, width / 2)]
    numbers = [value for pair in seen for value in pair]
    numbers += [view.speed_mps[i], *status(view, i), view.captures[team], view.captures[1 - team]]
    for j in [j for j in range(n) if j // size == team and j != i] + [j for j in range(n) if j // size != team]:
        px, py = view.position[j]
        back = math.degrees(math.atan2(x - px, y - py))
        numbers += [*sight(px, py), view.heading_deg[j] - back, view.speed_mps[j], *status(view, j)]
    return np.array(numbers, dtype=float)


def status(view, i):
    return [view.has_flag[i], view.on_side[i], view.tagging_cooldown_s[i], view.is_tagged[i]]


@settings(derandomize=True, deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.integers(1, 4))
def test_observations_agree_with_a_plain_description(seed, team_size):
    config = GameConfig.preset(
        "mctf2025", team_size=team_size, default_start=False, on_side_start=False, platforms="di"
    )
    core = BatchedMctf(config, seed=seed)
    writer = InfoWriter(core)
    core.state[0, 0, :2] += (-30.0, 0.0) if seed % 3 == 0 else (0.0, 0.0)
    random = np.random.default_rng(seed)
    for _ in range(3):
        wanted = np.stack([random.uniform(0, 9, core.n_boats), random.uniform(-180, 180, core.n_boats)], axis=-1)
        core.step(wanted[np.newaxis])
    raw, view = writer.raw_observations(), core.view()
    angles = writer.observation.is_angle
    for i in range(core.n_boats):
        difference = raw[i] - described(view, i)
        difference[angles] = (difference[angles] + 180.0) % 360.0 - 180.0
        np.testing.assert_allclose(difference, 0.0, atol=1e-9)
    assert ((raw[:, angles] > -180.0) & (raw[:, angles] <= 180.0)).all()
    low, high = core.observation_low, core.observation_high
    normalised = np.clip(2.0 * (raw - low) / (high - low) - 1.0, -1.0, 1.0)
    np.testing.assert_allclose(core.observations[0], normalised, atol=1e-6)


def test_obstacles_are_seen_less_the_boats_radius():
    config = GameConfig.preset(
        "aamas2024", obstacles={"circle": [(2.0, (30.0, 20.0))], "polygon": [((28, 30), (32, 30), (30, 36))]}
    )
    env = MctfEnv(config)
    start = {"agent_position": {"agent_0": (30.0, 10.0)}, "agent_heading": {"agent_0": 90.0}}
    _, infos = env.reset(options={"init_dict": start})
    seen = infos["agent_0"]["unnorm_obs"]
    assert seen["obstacle_0_distance"] == pytest.approx(10.0 - 2.0 - 1.25)
    assert seen["obstacle_0_bearing"] == pytest.approx(-90.0)
    assert seen["obstacle_1_distance"] == pytest.approx(20.0 - 1.25)
    state = infos["agent_0"]["global_state"]
    assert state[("agent_0", "obstacle_0_distance")] == seen["obstacle_0_distance"]
    assert env.observation_space("agent_0").shape == (65,)


def test_two_boats_on_one_point_see_finite_numbers(place, hold):
    core = place()
    core.state[0, 1, :2] = core.state[0, 0, :2]
    hold(core)
    assert np.isfinite(core.observations).all()


def test_global_state_dict_holds_the_state(place):
    env = MctfEnv("mctf2025")
    env.reset(seed=1)
    _, _, _, _, infos = env.step({"agent_0": 4, "agent_4": 2})
    state, view = infos["agent_3"]["global_state"], env.view()
    for i, agent_id in enumerate(env.possible_agents):
        np.testing.assert_array_equal(state[(agent_id, "pos")], view.position[i])
        assert state[(agent_id, "heading")] == view.heading_deg[i]
        assert state[(agent_id, "scrimmage_line_distance")] == pytest.approx(abs(view.position[i, 0] - 80.0))
        assert state[(agent_id, "on_side")] is True
        assert state[(agent_id, "tagging_cooldown")] == 60.0
    np.testing.assert_array_equal(state["red_flag_home"], (140.0, 40.0))
    assert state["blue_flag_pickup"] is False
    assert env.state().shape == env.state_space.shape
    assert env.state_space.contains(env.state())
