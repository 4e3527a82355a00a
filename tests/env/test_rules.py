import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.shield.platforms import layout as L

FAR_RED = {2: (60.0, 4.0), 3: (60.0, 36.0)}
FAR_BLUE = {0: (20.0, 4.0), 1: (20.0, 36.0)}


def drive(core, boat, speed=0.0, heading=0.0):
    """One step in which one boat is told (speed, relative heading) and the others stop."""
    actions = np.zeros((1, core.n_boats, 2))
    actions[0, boat] = speed, heading
    return core.step(actions)


def test_a_flag_is_grabbed_within_the_radius_only(place, hold):
    near = place({0: (60.1, 20.0), 1: (20.0, 30.0), **FAR_RED})
    assert near.has_flag[0].tolist() == [True, False, False, False]
    assert near.flag_taken[0].tolist() == [False, True]
    assert near.grabs[0].tolist() == [1, 0]
    far = place({0: (59.9, 20.0), 1: (20.0, 30.0), **FAR_RED})
    hold(far)
    assert not far.has_flag.any()
    assert far.grabs[0].tolist() == [0, 0]


def test_the_first_boat_takes_the_flag_when_two_are_in_reach(place):
    core = place({0: (63.0, 14.0), 1: (63.0, 26.0), **FAR_RED}, tagging_cooldown=[0.0] * 4)
    assert core.has_flag[0].tolist() == [True, False, False, False]


def test_neither_a_tagged_boat_nor_one_at_home_grabs(place, hold):
    core = place({0: (61.0, 20.0), **FAR_RED}, is_tagged={"agent_0": True})
    hold(core)
    assert not core.has_flag.any()
    core = place({2: (75.0, 20.0)})
    assert not core.has_flag.any()


def test_a_carried_flag_follows_and_scores_on_the_own_side(place):
    core = place({0: (41.05, 10.0), 1: (20.0, 30.0), **FAR_RED}, has_flag={"agent_0": True}, heading={"agent_0": -90})
    drive(core, 0, speed=10.0)
    np.testing.assert_allclose(core.flag_position[0, 1], core.state[0, 0, :2])
    # half way in one step: the side counts as of before the move
    drive(core, 0, speed=10.0)
    assert core.state[0, 0, L.X] < 40.0
    assert core.captures[0].tolist() == [0, 0]
    drive(core, 0)
    assert core.captures[0].tolist() == [1, 0]
    assert not core.has_flag.any()
    assert not core.flag_taken.any()
    np.testing.assert_allclose(core.flag_position[0, 1], core.flag_home[1])


def test_capture_at_the_own_base_waits_for_the_base(place):
    positions = {0: (41.0, 20.0), 1: (20.0, 36.0), **FAR_RED}
    setup = dict(has_flag={"agent_0": True}, heading={"agent_0": -90}, overrides={"capture_at": "own_base"})
    core = place(positions, **setup)
    for _ in range(4):
        drive(core, 0, speed=10.0)
    assert core.on_side[0, 0]
    assert core.captures[0].tolist() == [0, 0]
    for _ in range(25):
        drive(core, 0, speed=10.0)
    assert core.captures[0].tolist() == [1, 0]


def test_a_tag_needs_side_reach_and_a_full_cooldown(place, hold):
    positions = {0: (30.0, 20.0), 1: (5.0, 5.0), 2: (35.0, 20.0), 3: (60.0, 36.0)}
    core = place(positions)
    assert core.is_tagged[0].tolist() == [False, False, True, False]
    assert core.made_tag[0].tolist() == [2, -1, -1, -1]
    assert core.tagging_cooldown_s[0, 0] == 0.0
    assert core.tags[0].tolist() == [1, 0]
    core = place(positions, tagging_cooldown={"agent_0": 9.85})
    assert not core.is_tagged.any()
    hold(core)
    assert not core.is_tagged.any()
    hold(core)
    assert core.is_tagged[0, 2]
    core = place({**positions, 0: (24.0, 20.0)})
    assert not core.is_tagged.any()


def test_one_tag_a_boat_in_agent_order(place):
    core = place({0: (30.0, 20.0), 1: (5.0, 35.0), 2: (37.0, 20.0), 3: (32.0, 24.0)})
    assert core.is_tagged[0].tolist() == [False, False, True, False]
    core = place({0: (30.0, 20.0), 1: (30.0, 25.0), 2: (37.0, 20.0), 3: (32.0, 29.0)})
    assert core.made_tag[0].tolist() == [2, 3, -1, -1]


def test_a_tagged_carrier_loses_the_flag(place):
    core = place({0: (30.0, 20.0), 1: (5.0, 5.0), 2: (35.0, 20.0)}, has_flag={"agent_2": True})
    assert core.is_tagged[0, 2]
    assert not core.has_flag.any()
    assert not core.flag_taken.any()


def test_the_own_flags_home_frees_a_tagged_boat(place, hold):
    core = place({0: (19.9, 20.0), 1: (20.1, 20.0), **FAR_RED}, is_tagged={"agent_0": True, "agent_1": True})
    assert core.is_tagged[0].tolist() == [False, True, False, False]


@pytest.mark.parametrize("tag_on_oob", [True, False])
def test_out_of_bounds_costs_the_flag_and_perhaps_a_tag(place, tag_on_oob):
    core = place(
        {0: (50.0, 38.7), 1: (20.0, 4.0), **{2: (60.0, 4.0), 3: (75.0, 20.0)}},
        has_flag={"agent_0": True},
        heading={"agent_0": 0.0},
        overrides={"tag_on_oob": tag_on_oob},
    )
    drive(core, 0, speed=10.0)
    assert not core.oob.any()
    drive(core, 0, speed=10.0)
    assert core.oob[0].tolist() == [True, False, False, False]
    assert core.is_tagged[0, 0] == tag_on_oob
    assert not core.has_flag.any()
    assert core.events[0, 0, 3] == 1
    drive(core, 0)
    assert core.events[0, 0, 3] == 0


def test_a_boat_exactly_on_an_edge_is_out(place, hold):
    core = place({0: (20.0, 5.0)})
    core.state[0, 0, L.Y] = 40.0
    hold(core)
    assert core.oob[0, 0]


def test_games_end_by_score_or_by_time(place, hold):
    core = place({0: (41.0, 10.0)}, overrides={"max_score": 1}, has_flag={"agent_0": True}, heading={"agent_0": -90})
    for _ in range(3):
        _, _, terminated, truncated = drive(core, 0, speed=10.0)
    assert terminated.tolist() == [True]
    assert truncated.tolist() == [False]
    core = place(overrides={"max_time_s": 0.5})
    _, _, terminated, truncated = hold(core, 4)
    assert not truncated.any()
    _, _, terminated, truncated = hold(core)
    assert (terminated.tolist(), truncated.tolist()) == ([False], [True])


def test_cooldowns_fill_up_and_stay_full(place, hold):
    core = place(tagging_cooldown={"agent_0": 9.75})
    hold(core, 2)
    assert core.tagging_cooldown_s[0, 0] == pytest.approx(9.95)
    hold(core, 2)
    assert core.tagging_cooldown_s[0].tolist() == [10.0] * 4


@settings(derandomize=True, deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["heron", "si"]), st.sampled_from(["own_side", "own_base"]))
def test_what_always_holds(seed, platform, capture_at):
    config = GameConfig.preset(
        "aamas2024", platforms=platform, default_start=False, on_side_start=False, capture_at=capture_at
    )
    core = BatchedMctf(config, n_games=4, seed=seed)
    random = np.random.default_rng(seed)
    before = totals(core)
    for _ in range(150):
        wanted = np.stack([random.uniform(0, 10, (4, 6)), random.uniform(-180, 180, (4, 6))], axis=-1)
        core.step(wanted)
        assert not (core.is_tagged & core.has_flag).any(), "a tagged boat carries no flag"
        assert not (core.oob & core.has_flag).any(), "a boat out of bounds carries no flag"
        carried = np.stack([core.has_flag[:, 3:].sum(axis=1), core.has_flag[:, :3].sum(axis=1)], axis=1)
        assert (carried == core.flag_taken).all(), "a flag is taken exactly when one opponent carries it"
        home = (core.flag_position == core.flag_home).all(axis=-1)
        assert (home | core.flag_taken).all(), "a flag that is not taken is home"
        assert ((core.tagging_cooldown_s >= 0) & (core.tagging_cooldown_s <= 10.0)).all()
        after = totals(core)
        gained = {name: after[name] - before[name] for name in after}
        assert all((gain >= 0).all() for gain in gained.values()), "counts never fall"
        assert (gained["captures"] == core.events[..., 0]).all()
        assert (gained["grabs"] == core.events[..., 1]).all()
        assert (gained["tags"] == core.events[..., 2]).all()
        assert (after["captures"] + core.flag_taken[:, ::-1] <= after["grabs"]).all(), "no capture without a grab"
        assert (core.made_tag >= 0).sum() == core.events[..., 2].sum()
        assert np.isfinite(core.state[..., [L.X, L.Y, L.HEADING, L.SPEED]]).all()
        assert (np.abs(core.state[..., L.HEADING]) <= 180.0).all()
        before = after


def totals(core):
    return {name: getattr(core, name).copy() for name in ("captures", "grabs", "tags")}
