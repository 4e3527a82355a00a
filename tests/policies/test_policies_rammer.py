import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.policies.scripted.boats import meeting_time_s
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.platforms import layout as L

near = st.floats(-50.0, 50.0)
slow = st.floats(-3.0, 3.0)


@settings(deadline=None)  # the first call may compile
@given(near, near, slow, slow, st.floats(0.1, 3.0))
def test_at_the_meeting_time_the_target_is_as_far_as_the_rammer_gets(east, north, v_east, v_north, speed):
    time = meeting_time_s(east, north, v_east, v_north, speed)
    distance = math.hypot(east, north)
    assert 0.0 <= time <= 30.0
    reached = math.hypot(east + v_east * time, north + v_north * time) - speed * time
    guess = min(distance / speed, 30.0)
    assert abs(reached) <= 1e-6 * (1.0 + distance) or time == pytest.approx(guess)


@settings(deadline=None)
@given(near, near, slow, slow, st.floats(0.1, 3.0))
def test_no_earlier_meeting_is_missed(east, north, v_east, v_north, speed):
    time = meeting_time_s(east, north, v_east, v_north, speed)
    for earlier in np.linspace(0.0, 0.999, 40) * min(time, 30.0):
        gap = math.hypot(east + v_east * earlier, north + v_north * earlier) - speed * earlier
        if math.hypot(east, north) > 1e-6 and time < 30.0 and time != pytest.approx(math.hypot(east, north) / speed):
            assert gap > -1e-6


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        ((10.0, 0.0, 0.0, 0.0, 2.0), 5.0),  # stands still
        ((10.0, 0.0, -2.0, 0.0, 2.0), 2.5),  # head on, equal speeds: no quadratic term
        ((10.0, 0.0, 1.0, 0.0, 2.0), 10.0),  # flees, slower
        ((10.0, 0.0, 3.0, 0.0, 2.0), 5.0),  # flees, faster: a guess
        ((0.0, 0.0, 1.0, 0.0, 2.0), 0.0),  # already there
        ((3.0, 4.0, 0.0, 0.0, 0.0), 0.0),  # a rammer that cannot move
    ],
)
def test_known_meetings(case, expected):
    assert meeting_time_s(*case) == pytest.approx(expected)


def chase(preset, place, course, steps, side=0, **options):
    """One rammer against one boat that is put on a course at every step; the closest distance, m."""
    core = BatchedMctf(GameConfig.preset(preset, team_size=1))
    rammer, target = (0, 1) if side == 0 else (1, 0)
    width, height = core.config.env_bounds_m
    core.state[0, rammer, :3] = [0.5 * width, 0.5 * height, 180.0]
    core.state[0, target, :2] = np.array(place) * (width, height)
    heading, speed = course
    team = policies.make_batch("rammer", **options)
    team.reset(core, side, 0)
    closest, actions = math.inf, np.zeros((1, 2, 2))
    for _ in range(steps):
        core.state[0, target, L.HEADING], core.state[0, target, L.SPEED] = heading, speed
        actions[:, rammer] = team.act(core, side)[:, 0]
        actions[:, target] = [speed, 0.0]
        core.is_tagged[:] = False  # the chase alone counts
        core.step(actions)
        gap = math.hypot(*(core.state[0, rammer, :2] - core.state[0, target, :2]))
        closest = min(closest, gap)
    return closest


@pytest.mark.parametrize("preset", ["aamas2024", "mctf2025"])
@pytest.mark.parametrize(("side", "place"), [(0, (0.3, 0.2)), (1, (0.7, 0.8)), (0, (0.9, 0.5)), (1, (0.5, 0.9))])
def test_hits_a_stationary_boat(preset, side, place):
    assert chase(preset, place, (0.0, 0.0), steps=900, side=side) < 1.5


def test_leads_its_target():
    """It steers ahead of a crossing boat, not at it."""
    core = BatchedMctf(GameConfig.preset("aamas2024", team_size=1))
    core.state[0, 0, :4] = [30.0, 20.0, 0.0, 0.0]
    core.state[0, 1, :4] = [30.0, 30.0, 90.0, 1.0]
    team = policies.make_batch("rammer")
    team.reset(core, 0, 0)
    speed, heading = team.act(core, 0)[0, 0]
    assert speed == 2.0
    assert heading == pytest.approx(30.0)  # asin(1 / 2): the sideways speeds agree


def test_does_not_leave_the_field_to_meet_a_boat():
    core = BatchedMctf(GameConfig.preset("aamas2024", team_size=1))
    core.state[0, 0, :4] = [60.0, 20.0, 0.0, 0.0]
    core.state[0, 1, :4] = [78.0, 20.0, 90.0, 1.9]
    team = policies.make_batch("rammer")
    team.reset(core, 0, 0)
    assert team.act(core, 0)[0, 0, 1] == pytest.approx(90.0)
    core.state[0, 1, :4] = [78.0, 30.0, 0.0, 1.9]
    heading = math.radians(team.act(core, 0)[0, 0, 1])
    edge = 20.0 + 18.0 / math.tan(heading)
    assert edge == pytest.approx(40.0 - 1.25)


def test_takes_the_nearest_and_spares_its_team_unless_told_otherwise():
    core = BatchedMctf("aamas2024")
    core.state[0, :, L.SPEED] = 0.0
    core.state[0, :, :3] = [[20, 20, 0], [25, 20, 0], [5, 5, 0], [20, 30, 0], [70, 30, 0], [75, 5, 0]]
    for options, heading in (({}, 0.0), ({"target_team_mates": True}, 90.0)):
        team = policies.make_batch("rammer", **options)
        team.reset(core, 0, 0)
        assert team.act(core, 0)[0, 0, 1] == pytest.approx(heading)


def test_options_are_checked():
    for speed_fraction in (0.0, 1.5, float("nan"), "fast", True):
        with pytest.raises(PolicyError, match="speed_fraction"):
            policies.make("rammer", speed_fraction=speed_fraction)
    with pytest.raises(PolicyError, match="True or False"):
        policies.make("rammer", target_team_mates="yes")
    core, team = BatchedMctf("aamas2024"), policies.make_batch("rammer", speed_fraction=0.25)
    team.reset(core, 0, 0)
    assert (team.act(core, 0)[..., 0] == 0.5).all()
