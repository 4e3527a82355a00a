"""Clearance from things that do not move, against a plain scan of all samples."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield.barriers.clearance import FAR, MARGIN, NORMAL_X, NORMAL_Y, SAMPLE
from steerclear.shield.barriers.static import Sampling, clear_of_constraints
from steerclear.shield.shared import share
from steerclear.shield.workspace import Static, new_registered

NO_EDGE = np.array([-np.inf, -np.inf, np.inf, np.inf])
NONE = np.zeros((0, 3))
NO_WALL = np.zeros((0, 4))


def things(circles=NONE, walls=NO_WALL, obstacle_clearance_m=0.0, side_m=0.0, field=NO_EDGE, keep_out=NONE):
    """Static constraints, as compiled code takes them."""
    line = np.array([-np.inf, -np.inf, np.inf, np.inf])
    return share(
        Static(field, keep_out, circles, walls, obstacle_clearance_m, side_m, 0.0, line, 0, 0, 0.0, new_registered())
    )


def clear_of(near_only, path, static, here=None, near=None, side=None, drift_m=0.0, grace=1.0):
    """Clearance row of a path sampled every 0.5 s, on which a boat goes 1 m from sample to sample."""
    out, last = np.full(4, FAR), len(path) - 1
    here, near = path[0] if here is None else np.asarray(here), last if near is None else near
    side = last if side is None else side
    sampling = Sampling(near, side, last, 0.1, 0.5, 1.0, drift_m, grace)
    clear_of_constraints(near_only, here, path, sampling, static, out)
    return out


def clear_of_obstacles(path, static, **how):
    return clear_of(True, path, static, **how)


def clear_of_all(path, static, **how):
    return clear_of(False, path, static, **how)


@st.composite
def wandering_paths(draw):
    """Samples no farther apart than 1 m."""
    seed = draw(st.integers(0, 10_000))
    random = np.random.default_rng(seed)
    headings = np.cumsum(random.uniform(-0.6, 0.6, 60)) + random.uniform(0, 2 * np.pi)
    steps = random.uniform(0.0, 1.0, 60)[:, None] * np.column_stack([np.sin(headings), np.cos(headings)])
    return np.cumsum(steps, axis=0) + random.uniform(-15.0, 15.0, 2)


def distances_to(path, wall):
    start, way = wall[:2], wall[2:] - wall[:2]
    parts = np.clip((path - start) @ way / max(way @ way, 1e-12), 0.0, 1.0)
    return np.linalg.norm(path - start - parts[:, None] * way, axis=1)


def behind(path, here, wall):
    """At which samples a path that began clear of a wall is behind it: it went through it an odd number of times."""
    crossings, before = [], here
    for at in path:
        # where the two lines meet, as shares of the step and of the wall
        matrix = np.column_stack([at - before, wall[:2] - wall[2:]])
        shares = np.linalg.solve(matrix, wall[:2] - before) if np.linalg.det(matrix) else np.array([2.0, 2.0])
        crossings.append(((shares >= 0.0) & (shares <= 1.0)).all())
        before = at
    return np.cumsum(crossings) % 2 == 1


def left_of(path, here, wall, obstacle_clearance_m, side_m, grace):
    """Distance kept from a wall, m: what the boat is short of now is excused, being behind it is not."""
    apart, now = distances_to(path, wall), distances_to(here[None], wall)[0]
    before = apart - obstacle_clearance_m - min(0.0, now - obstacle_clearance_m) * grace ** np.arange(len(path))
    if now < side_m:
        return before
    return np.where(behind(path, here, wall), -apart - obstacle_clearance_m, before)


def worth_of(margins, path, circle):
    """What a path is worth to a boat in a circle, m: depth, how far it ends short of home, and a trifle for a dip."""
    on = path[-1] + np.arange(0, 21, 4)[:, None] * (path[-1] - path[-2])  # 10 s of samples of 0.5 s
    short = max(0.0, 1.0 + circle[2] - np.linalg.norm(on - circle[:2], axis=1).max())
    return margins[0] - 0.01 * short - 0.002 * (margins[0] - margins.min())


@settings(max_examples=150, deadline=None)
@given(
    wandering_paths(),
    st.integers(0, 10_000),
    st.sampled_from([(0.0, 1.0), (0.06, 0.6), (0.5, 0.9)]),
    st.sampled_from([(0.0, 0.0), (0.2, 0.0), (0.7, 0.3), (1.7, 0.0)]),
)
def test_no_sample_that_counts_is_skipped(path, seed, current, kept):
    (drift_m, grace), (obstacle_clearance_m, side_m) = current, kept
    random = np.random.default_rng(seed)
    circles = np.column_stack([random.uniform(-20, 20, (3, 2)), random.uniform(0.0, 8.0, 3)])
    walls = random.uniform(-20, 20, (2, 4))
    last = len(path) - 1
    out = clear_of_obstacles(path, things(circles, walls, obstacle_clearance_m, side_m), drift_m=drift_m, grace=grace)
    excuse = grace ** np.arange(last + 1)
    margins = [np.linalg.norm(path - circle[:2], axis=1) - circle[2] for circle in circles]
    left = [each - min(0.0, each[0]) * excuse for each in margins]
    left += [left_of(path, path[0], wall, obstacle_clearance_m, side_m, grace) for wall in walls]
    drift = drift_m * np.arange(last + 1)  # no less than any current of that speed can do
    left = [each - drift for each in left]
    assert out[MARGIN] == pytest.approx(min(each.min() for each in left), abs=1e-9)
    out = clear_of_all(path, things(keep_out=circles), drift_m=drift_m, grace=grace)
    within = [each[0] < 0.0 for each in margins]
    held = [(each - drift).min() for inside, each in zip(within, margins, strict=True) if not inside]
    if any(within):
        worth = min(worth_of(margins[k], path, circles[k]) for k in range(3) if within[k])
        assert out[MARGIN] == pytest.approx(min(0.0, *held, 0.0) + worth, abs=1e-9)
        return
    assert out[MARGIN] == pytest.approx(min(held), abs=1e-9)
    at = path[int(out[SAMPLE])]
    nearest = min(circles, key=lambda circle: np.linalg.norm(at - circle[:2]) - circle[2])
    away = (at - nearest[:2]) / np.linalg.norm(at - nearest[:2])
    np.testing.assert_allclose([out[NORMAL_X], out[NORMAL_Y]], away, atol=1e-9)


def test_a_boat_inside_an_obstacle_may_leave_and_must_not_go_deeper():
    circle = np.array([[0.0, 0.0, 5.0]])
    outwards = np.column_stack([np.linspace(4.0, 9.0, 20), np.zeros(20)])
    assert clear_of_obstacles(outwards, things(circle))[MARGIN] == 0.0
    assert clear_of_obstacles(outwards - [2.5, 0.0], things(circle))[MARGIN] == 0.0
    inwards = np.column_stack([np.linspace(4.0, 1.0, 20), np.zeros(20)])
    assert clear_of_obstacles(inwards, things(circle))[MARGIN] == pytest.approx(-3.0)
    # outside so far: there is nothing to excuse
    assert clear_of_obstacles(inwards, things(circle), here=[5.4, 0.0])[MARGIN] == pytest.approx(-4.0)


WALL = np.array([[-5.0, 0.0, 5.0, 0.0]])


def test_a_wall_that_no_sample_is_near_is_not_gone_through():
    """Samples 0.5 m before a wall and 0.5 m behind it, of a boat of 0.2 m."""
    path = np.array([[0.0, -1.5], [0.0, -0.5], [0.0, 0.5], [0.0, 1.5]])
    out = clear_of_obstacles(path, things(walls=WALL, obstacle_clearance_m=0.2))
    assert out[[MARGIN, SAMPLE, NORMAL_Y]] == pytest.approx([-1.7, 3, -1.0])
    aside = path + np.array([5.5, 0.0])
    assert clear_of_obstacles(aside, things(walls=WALL, obstacle_clearance_m=0.2))[MARGIN] > 0.0  # past its end


@pytest.mark.parametrize("side_m", [0.0, 0.3])
def test_a_boat_too_near_to_a_wall_may_leave_it_on_its_side_and_on_either_when_that_is_not_known(side_m):
    for way in (1.0, -1.0):
        path = np.column_stack([np.zeros(20), -0.1 + way * np.linspace(0.0, 6.0, 20)])
        out = clear_of_obstacles(path, things(walls=WALL, obstacle_clearance_m=0.7, side_m=side_m))
        if way < 0.0 or side_m > 0.1:
            assert out[MARGIN] >= -0.1
        else:
            assert out[MARGIN] == pytest.approx(-6.6)


FIELD = np.array([-50.0, -50.0, 50.0, 10.0])


def way_back(*places):
    """Margin of a path through these places, of a boat 2 m beyond the field's northern edge."""
    out = clear_of_all(np.array(places, dtype=np.float64), things(field=FIELD), here=[0.0, 12.0], near=1)
    assert out[NORMAL_Y] == -1.0
    return out[MARGIN]


def test_outside_the_field_the_way_back_is_worth_most_even_if_it_leads_farther_out_at_first():
    stays = way_back((0, 12), (0, 12), (0, 12), (0, 12))
    goes_on = way_back((0, 12), (0, 13), (0, 14), (0, 15))
    along = way_back((0, 12), (1, 12), (2, 12), (3, 12))
    turns = way_back((0, 12), (0.5, 12.6), (1.0, 12.6), (1.0, 12.0))
    turns_wide = way_back((0, 12), (0.5, 13.2), (1.0, 13.2), (1.0, 12.6))
    straight_in = way_back((0, 12), (0, 11.5), (0, 11.0), (0, 10.5))
    assert goes_on < stays == along < turns_wide < turns < straight_in
    assert straight_in < 0.0
