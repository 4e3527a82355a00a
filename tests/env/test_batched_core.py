"""Many games at once are single games, bit for bit; what is handed in is checked; events are rewarded."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.env.config import GameConfig, RewardWeights
from steerclear.env.core import BatchedMctf
from steerclear.shield.exceptions import GameError
from steerclear.shield.platforms import layout as L

NAMES = (
    "state",
    "is_tagged",
    "has_flag",
    "oob",
    "on_side",
    "driven",
    "tagging_cooldown_s",
    "flag_position",
    "flag_taken",
    "captures",
    "grabs",
    "tags",
    "collisions",
    "time_s",
    "observations",
    "rewards",
)
RANDOM = GameConfig.preset(
    "aamas2024",
    team_size=2,
    platforms=("heron", "surveyor", "large_usv", "di"),
    default_start=False,
    on_side_start=False,
    obstacles={"circle": [(2.0, (40.0, 20.0))]},
)


def random_actions(seed, n_games, n_boats):
    random = np.random.default_rng(seed)
    hold = random.uniform(0, 1, (n_games, n_boats)) < 0.1
    speed = np.where(hold, 0.0, random.uniform(0, 4, (n_games, n_boats)))
    return np.stack([speed, random.uniform(-60, 60, (n_games, n_boats))], axis=-1)


@settings(derandomize=True, deadline=None, max_examples=6)
@given(st.integers(0, 1000))
def test_a_batch_plays_each_game_bit_for_bit_as_a_single_game(seed):
    batch = BatchedMctf(RANDOM, n_games=70, seed=seed)
    single = BatchedMctf(RANDOM, n_games=1, seed=0)
    watched = (0, 63, 64, 69)
    starts = {b: (batch.state[b].copy(), batch.games.rng[b]) for b in watched}
    actions = [random_actions(1000 * seed + t, 70, 4) for t in range(80)]
    tracks = {b: [] for b in watched}
    for step in actions:
        batch.step(step)
        for b in watched:
            tracks[b].append([getattr(batch, name)[b].copy() for name in NAMES])
    for b in watched:
        single.games.rng[0] = starts[b][1]
        place_as(single, starts[b][0])
        alone = []
        for step in actions:
            single.step(step[b : b + 1])
            alone.append([getattr(single, name)[0].copy() for name in NAMES])
        for name, mine, its in zip(NAMES, zip(*alone, strict=True), zip(*tracks[b], strict=True), strict=True):
            np.testing.assert_array_equal(np.array(mine), np.array(its), err_msg=name)


def place_as(core, state):
    start = {"agent_position": state[:, :2], "agent_speed": state[:, L.SPEED], "agent_heading": state[:, L.HEADING]}
    core.reset_game(0, start)


def test_resetting_some_games_leaves_the_others_alone():
    core = BatchedMctf(RANDOM, n_games=4, seed=1)
    first = core.state.copy()
    for t in range(10):
        core.step(random_actions(t, 4, 4))
    before = {name: getattr(core, name).copy() for name in NAMES if name != "observations"}
    core.reset(np.array([False, True, False, True]))
    for name, values in before.items():
        np.testing.assert_array_equal(getattr(core, name)[[0, 2]], values[[0, 2]], err_msg=name)
    assert core.time_s.tolist() == pytest.approx([1.0, 0.0, 1.0, 0.0])
    assert not np.array_equal(core.state[1], first[1]), "the random numbers go on"
    core.reset(seed=1)
    np.testing.assert_array_equal(core.state, first)


def test_the_boat_and_the_game_of_a_bad_command_are_named_and_nothing_moves():
    core = BatchedMctf(RANDOM, 2, seed=0)
    before = core.state.copy()
    actions = np.zeros((2, 4, 2))
    actions[1, 2, 1] = np.inf
    with pytest.raises(GameError, match="action of agent_2 in game 1"):
        core.step(actions)
    with pytest.raises(GameError, match="command of agent_2 in game 1"):
        core.step(np.zeros((2, 4, 2)), lambda _, commands: actions)
    with pytest.raises(GameError, match="commands have shape"):
        core.step(np.zeros((2, 4, 2)), lambda _, commands: commands[0])
    np.testing.assert_array_equal(core.state, before)


def test_rewards_weigh_the_events_of_both_teams(place, hold):
    weights = RewardWeights(capture=1.0, grab=0.5, tag=0.25, oob=0.125, collision=2.0)
    positions = {0: (30.0, 20.0), 1: (75.0, 2.0), 2: (36.0, 20.0), 3: (60.0, 30.0)}
    core = place(positions, overrides={"reward": weights}, tagging_cooldown=[9.95, 0.0, 0.0, 0.0])
    _, rewards, _, _ = hold(core)
    assert core.events[0].tolist() == [[0, 0, 1, 0], [0, 0, 0, 0]]
    assert rewards[0].tolist() == [0.25, 0.25, -0.25, -0.25]
    core.state[0, 3, :2] = (60.0, 40.0)
    core.state[0, 1, :2] = (60.0, 39.0)
    _, rewards, _, _ = hold(core)
    assert rewards[0].tolist() == [0.125, 0.125 - 2.0, -0.125, -0.125 - 2.0]


def test_four_thousand_games_stay_small():
    core = BatchedMctf("mctf2025", n_games=4096, seed=0)
    held = sum(a.nbytes for a in core.games) + core.observations.nbytes + core.rewards.nbytes
    assert held < 20e6
