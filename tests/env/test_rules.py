"""The rules: what always holds, collisions, red as blue turned round, a referee of boats that others move."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.shield.exceptions import GameError
from steerclear.shield.platforms import layout as L

FAR_RED = {2: (60.0, 4.0), 3: (60.0, 36.0)}


def drive(core, boat, speed=0.0, heading=0.0):
    """One step in which one boat is told (speed, relative heading) and the others stop."""
    actions = np.zeros((1, core.n_boats, 2))
    actions[0, boat] = speed, heading
    return core.step(actions)


def test_the_first_boat_takes_the_flag_when_two_are_in_reach(place):
    core = place({0: (63.0, 14.0), 1: (63.0, 26.0), **FAR_RED}, tagging_cooldown=[0.0] * 4)
    assert core.has_flag[0].tolist() == [True, False, False, False]


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


def test_one_tag_a_boat_in_agent_order(place):
    core = place({0: (30.0, 20.0), 1: (5.0, 35.0), 2: (37.0, 20.0), 3: (32.0, 24.0)})
    assert core.is_tagged[0].tolist() == [False, False, True, False]
    core = place({0: (30.0, 20.0), 1: (30.0, 25.0), 2: (37.0, 20.0), 3: (32.0, 29.0)})
    assert core.made_tag[0].tolist() == [2, 3, -1, -1]


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


@settings(derandomize=True, deadline=None, max_examples=10)
@given(st.integers(0, 1000))
def test_counts_agree_with_counting_entries_in_the_tracks(seed):
    config = GameConfig.preset("aamas2024", env_bounds_m=(30.0, 15.0), catch_radius_m=1.0, platforms="si", team_size=2)
    radius_m = np.array([0.6, 0.3, 0.9, 0.6])
    core = BatchedMctf(config.replace(agent_radius_m=tuple(radius_m), flag_keepout_m=0.0), seed=seed)
    random = np.random.default_rng(seed)
    near = np.zeros((4, 4), dtype=bool)
    count = np.zeros(4, dtype=int)
    for _ in range(200):
        core.step(np.stack([random.uniform(0, 8, (1, 4)), random.uniform(-180, 180, (1, 4))], axis=-1))
        position = core.state[0, :, :2]
        now = np.linalg.norm(position[:, None] - position[None], axis=-1) <= radius_m[:, None] + radius_m
        np.fill_diagonal(now, False)
        count += (now & ~near).sum(axis=1)
        near = now
    np.testing.assert_array_equal(core.collisions[0], count)


ISLANDS = {"circle": [(3.0, (25.0, 12.0)), (3.0, (55.0, 28.0))]}


@pytest.mark.parametrize(("platform", "obstacles"), [("heron", ISLANDS), ("surveyor", None), ("si", ISLANDS)])
@settings(derandomize=True, deadline=None, max_examples=6)
@given(seed=st.integers(0, 10_000))
def test_swapped_teams_play_the_turned_game(platform, obstacles, seed):
    config = GameConfig.preset(
        "aamas2024", platforms=platform, obstacles=obstacles, default_start=False, on_side_start=False
    )
    core, turned = BatchedMctf(config, seed=seed), BatchedMctf(config, seed=seed)
    swap = [3, 4, 5, 0, 1, 2]
    while core.events.any():  # what the places themselves cause would happen twice
        core.reset()
    turned.reset_game(0, turned_start(core, swap))
    random = np.random.default_rng(seed)
    wanted = np.zeros((1, 6, 2))
    for t in range(200):
        if t % 10 == 0:
            wanted[0] = np.stack([random.uniform(0, 6, 6), random.uniform(-90, 90, 6)], axis=-1)
        core.step(wanted)
        turned.step(wanted[:, swap])
        assert_turned(core, turned, swap)


def turned_start(core, swap):
    state = core.state[0][swap]
    init = {
        "agent_position": core.field.size - state[:, :2],
        "agent_speed": state[:, L.SPEED],
        "agent_heading": (state[:, L.HEADING] + 360.0) % 360.0 - 180.0,
        "agent_has_flag": core.has_flag[0][swap],
        "agent_is_tagged": core.is_tagged[0][swap],
        "agent_tagging_cooldown": core.tagging_cooldown_s[0][swap],
    }
    return init | {name: getattr(core, name)[0][::-1] for name in ("captures", "tags", "grabs")}


def assert_turned(core, turned, swap):
    np.testing.assert_allclose(turned.state[0, :, :2], core.field.size - core.state[0][swap][:, :2], atol=1e-6)
    np.testing.assert_allclose(turned.state[0, :, L.SPEED], core.state[0][swap][:, L.SPEED], atol=1e-6)
    for name in ("is_tagged", "has_flag", "oob", "on_side", "driven", "collisions"):
        np.testing.assert_array_equal(getattr(turned, name)[0], getattr(core, name)[0][swap], err_msg=name)
    for name in ("captures", "grabs", "tags", "flag_taken", "events"):
        np.testing.assert_array_equal(getattr(turned, name)[0], getattr(core, name)[0][::-1], err_msg=name)
    np.testing.assert_allclose(turned.rewards[0], core.rewards[0][swap])
    # the obstacles, which come last, change places
    difference = turned.observations[0, :, :61].astype(float) - core.observations[0][swap][:, :61]
    # normalised bearings of +1 and -1 are one direction
    assert np.minimum(np.abs(difference), np.abs(np.abs(difference) - 2.0)).max() < 1e-5


SEEN = [L.X, L.Y, L.HEADING, L.SPEED]

RULED = (
    "is_tagged", "has_flag", "oob", "on_side", "tagging_cooldown_s", "made_tag", "collisions", "new_collisions",
    "touching", "flag_position", "flag_taken", "captures", "grabs", "tags", "events", "time_s", "terminated",
    "truncated", "previous_position",
)  # fmt: skip


@settings(derandomize=True, deadline=None, max_examples=8)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["heron", "si"]), st.sampled_from(["own_side", "own_base"]))
def test_a_referee_of_a_game_comes_to_the_games_own_verdicts(seed, platform, capture_at):
    config = GameConfig.preset(
        "aamas2024", platforms=platform, capture_at=capture_at, default_start=False, max_score=3, flag_keepout_m=0.0
    )
    game, referee = BatchedMctf(config, n_games=3, seed=seed), BatchedMctf(config, n_games=3, seed=1)
    referee.start_seen(game.state[..., SEEN])
    random = np.random.default_rng(seed)
    goals = random.uniform(0.0, 1.0, (3, 6, 2)) * config.env_bounds_m
    for step in range(250):
        if step % 60 == 0:
            goals = random.uniform(-0.05, 1.05, (3, 6, 2)) * config.env_bounds_m
        dx, dy = np.moveaxis(goals - game.state[..., :2], -1, 0)
        heading = (np.degrees(np.arctan2(dx, dy)) - game.state[..., L.HEADING] + 180.0) % 360.0 - 180.0
        game.step(np.stack([np.full((3, 6), 2.0), heading], axis=-1))
        referee.follow(game.state[..., SEEN], config.dt_s)
        for name in RULED:
            assert np.array_equal(getattr(game, name), getattr(referee, name)), f"{name}, step {step}"
        assert (referee.observe() == game.observe()).all()


def test_a_boat_that_is_nowhere_is_out_of_play_until_seen_again():
    referee = BatchedMctf("aamas2024", seed=0)
    seen = referee.state[..., SEEN].copy()
    seen[0, 0, :2] = (69.0, 20.0)
    referee.start_seen(seen)
    assert referee.has_flag[0, 0]
    lost = seen.copy()
    lost[0, 0] = np.nan
    referee.follow(lost, 0.1)
    assert referee.oob[0, 0]
    assert not referee.has_flag.any()
    np.testing.assert_array_equal(referee.flag_position[0], referee.flag_home)
    for _ in range(5):
        referee.follow(lost, 0.1)
    assert referee.events[0].sum() == 0
    seen[0, 0, :2] = (12.0, 20.0)
    referee.follow(seen, 0.1)
    assert not referee.oob[0, 0]
    assert not referee.is_tagged[0, 0], "seen again at its own flag"
    assert np.isnan(lost[0, 0]).all(), "what is handed over is not written to"


def test_clock_and_cooldown_go_by_the_time_given():
    referee = BatchedMctf("aamas2024", seed=0)
    seen = referee.state[..., SEEN].copy()
    referee.start_seen(seen)
    referee.tagging_cooldown_s[0, 2] = 1.0
    for dt_s in (0.37, 0.0, 2.0):
        referee.follow(seen, dt_s)
    assert referee.time_s[0] == pytest.approx(2.37)
    assert referee.tagging_cooldown_s[0, 2] == pytest.approx(3.37)
    assert referee.tagging_cooldown_s[0, 0] == 10.0
    assert referee.rules.dt_s == 0.1


def test_a_restored_game_looks_like_the_original_and_other_views_are_refused():
    played = MctfEnv("aamas2024")
    played.reset(seed=3)
    for step in range(120):
        actions = {a: (step // 10 + i) % 17 for i, a in enumerate(played.agents)}
        observations, _, _, _, infos = played.step(actions)
    other = MctfEnv("aamas2024")
    other.core.restore(played.view())
    restored, restored_infos = other.core.observe(), other._info_writer.infos()
    for i, agent_id in enumerate(played.possible_agents):
        np.testing.assert_array_equal(restored[0, i], observations[agent_id])
        assert restored_infos[agent_id]["unnorm_obs"] == infos[agent_id]["unnorm_obs"]
    for name, value in vars(played.view()).items():
        if name != "config":
            np.testing.assert_array_equal(getattr(other.view(), name), value)
    one, small = BatchedMctf("aamas2024"), BatchedMctf(GameConfig.preset("aamas2024", team_size=2))
    with pytest.raises(GameError, match="state of the view has shape"):
        one.restore(small.view())
    with pytest.raises(GameError, match="there is no game 1"):
        one.restore(one.view(), 1)
