"""Observations and the global state, against a plain description of what a boat sees."""

import math
import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.env.angles import wrap_bearing
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.infos import InfoWriter, VectorNormalizer
from steerclear.env.mctf import MctfEnv
from steerclear.env.observation_layout import pack_lines, sight_of_line, sight_of_point
from steerclear.env.obstacles import closest_on_segment
from steerclear.env.trace import load_trace
from steerclear.env.view import GameView
from steerclear.shield.exceptions import GameError


def test_the_page_names_every_number_at_its_index():
    page = (Path(__file__).parents[2] / "docs" / "policies.md").read_text(encoding="utf-8")
    table = page.partition("<!-- observation -->")[2].partition("<!-- /observation -->")[0]
    core = BatchedMctf("aamas2024")
    entries = re.findall(r"`(\w+)`", table.partition('("teammate_0", entry)')[2].partition("| as above |")[0])
    covered = []
    for row in table.splitlines()[3:]:
        numbers = [int(number) for number in re.findall(r"\d+", row.split("|")[1])]
        first, last, named = numbers[0], numbers[-1], re.findall(r"`([^`]+)`", row.split("|")[2])
        keys = core.observation_keys[first : last + 1]
        covered += range(first, last + 1)
        if "entry" in row.split("|")[2]:
            boats = [name.split('"')[1] for name in named]
            assert [boats[0], boats[-1]] == [keys[0][0], keys[-1][0]]
            assert [entry for _, entry in keys] == entries * (len(keys) // len(entries))
        else:
            assert [named[0], named[-1]] == [keys[0], keys[-1]]
            assert set(named) <= set(keys)
    assert covered == list(range(core.n_obs)) == list(range(61))
    assert core.tagging_cooldown_s.max() <= core.config.tagging_cooldown_s == 10.0
    assert "`mctf2026` has 67" in page
    game = BatchedMctf("mctf2026")
    assert game.n_obs == 67
    assert game.rules.corners.tolist() == [[[0.0, 80.0], [0.0, 0.0]], [[160.0, 80.0], [160.0, 0.0]]]
    documented = set(re.findall(r"^        (\w+):", GameView.__doc__, flags=re.M))
    assert documented == {field.name for field in fields(GameView)}


def test_keys_are_those_of_the_recorded_games(traces):
    for path in traces.values():
        trace = load_trace(path)
        writer = InfoWriter(BatchedMctf(trace.config))
        assert list(writer.observation.keys) == trace.meta["obs_keys"]
        assert list(writer.global_state.keys) == trace.meta["global_state_keys"]


def described(view, i):
    """What boat ``i`` sees, written anew in plain Python from the definitions."""
    config, size, n = view.config, view.config.team_size, view.config.n_boats
    width, height = config.env_bounds_m
    (x, y), heading, team = view.position[i], view.heading_deg[i], i // size

    def obs(px, py):
        return (math.degrees(math.atan2(px - x, py - y)) - heading, math.hypot(px - x, py - y))

    def wall(axis, at):
        ends = (min(max(x, 0.0), width), min(max(y, 0.0), height))
        return obs(at, ends[1]) if axis == 0 else obs(ends[0], at)

    walls = [wall(1, 0.0), wall(0, 0.0), wall(1, height), wall(0, width)]
    if team == 1:
        walls = walls[2:] + walls[:2]
    seen = [obs(*view.flag_home[1 - team]), obs(*view.flag_home[team]), *walls, wall(0, width / 2)]
    numbers = [value for pair in seen for value in pair]
    numbers += [view.speed_mps[i], *status(view, i), view.captures[team], view.captures[1 - team]]
    for j in [j for j in range(n) if j // size == team and j != i] + [j for j in range(n) if j // size != team]:
        px, py = view.position[j]
        back = math.degrees(math.atan2(x - px, y - py))
        numbers += [*obs(px, py), view.heading_deg[j] - back, view.speed_mps[j], *status(view, j)]
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


examples = settings(derandomize=True, deadline=None, max_examples=200)

coordinate = st.floats(-200.0, 200.0)

heading = st.floats(-180.0, 180.0)

point = st.tuples(coordinate, coordinate)


def turned(a, b):
    """Angle between two directions, deg."""
    return abs((a - b + 180.0) % 360.0 - 180.0)


@examples
@given(st.floats(-539.0, 539.0))
def test_wrapped_bearings_keep_their_direction_and_astern_is_plus_180(angle):
    wrapped = wrap_bearing(angle)
    assert -180.0 < wrapped <= 180.0
    assert turned(wrapped, angle) < 1e-9


@examples
@given(point, heading, point, st.tuples(st.floats(1.0, 99.0), st.floats(-99.0, 99.0)))
def test_a_line_is_seen_at_its_closest_point(here, course, start, along):
    segment = np.array([start, (start[0] + along[0], start[1] + along[1])])
    bearing, distance = sight_of_line(*here, course, pack_lines(segment[np.newaxis]), 0)
    foot = closest_on_segment(segment, *here)
    want_bearing, want_distance = sight_of_point(*here, course, *foot)
    assert abs(distance - want_distance) < 1e-9
    if want_distance > 1e-6:
        assert turned(bearing, want_bearing) < 1e-4


def test_walls_are_seen_exactly_abreast():
    lines = pack_lines(np.array([[[80.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 40.0]]]))
    assert sight_of_line(33.3, 7.7, 0.0, lines, 0) == (180.0, 7.7)
    assert sight_of_line(33.3, 7.7, 90.0, lines, 1) == (180.0, 33.3)
    assert sight_of_line(33.3, 0.0, 90.0, lines, 0) == (0.0, 0.0)


@pytest.fixture
def normalizer():
    low, high = np.array([-180.0, -5.0, -5.0, 0.0]), np.array([180.0, 85.0, 45.0, 2.0])
    return VectorNormalizer(["bearing", ("agent_0", "pos"), "speed"], [1, 2, 1], low, high)


def test_missing_entries_and_wrong_lengths_are_refused(normalizer):
    with pytest.raises(GameError, match=r"entries are missing: \['speed'\]"):
        normalizer.normalized({"bearing": 0.0, ("agent_0", "pos"): (0.0, 0.0)})
    with pytest.raises(GameError, match=r"shape \(3,\); give \(4,\)"):
        normalizer.unnormalized(np.zeros(3))
