"""Own boats followed by their model: the estimate, a source that froze, and what the model misses made a margin."""

import math
from dataclasses import replace

import numpy as np
import pytest
from bridge_fakes import World, fleet_of, straight
from steerclear.shield.bridge.estimator import GONE_M, LEFT_M, MOST_UNSEEN_M, Estimator
from steerclear.shield.bridge.fleet_settings import Limits, ModelLimit
from steerclear.shield.bridge.messages import BoatReading, Sent
from steerclear.shield.bridge.model_error import WIDEN_MPS, ModelErrorMonitor
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L

DT_S, NAME = 0.1, "blue_1"


def reading(row, now_s):
    heading = math.radians(row[L.HEADING]) % (2 * math.pi)
    place = (float(row[L.X]), float(row[L.Y]))
    return BoatReading(NAME, now_s, place, 0.0, heading, 0.0, float(row[L.SPEED]), velocity_age_s=0.0)


def sail(platform, commands, delay_steps=0, noise=None):
    """Simulated boat and its estimate, step by step; commands (speed, absolute heading deg)."""
    params, row = get_platform(platform).pack(), fresh_state(3.0, 4.0, 90.0, 0.0)
    estimator = Estimator(get_platform(platform), DT_S, delay_steps * DT_S)
    queue, random, pairs = [None] * delay_steps, np.random.default_rng(0), []
    for k, (speed, heading) in enumerate(commands):
        now, seen = 50.0 + k * DT_S, row.copy()
        if noise is not None:
            seen[[L.X, L.Y, L.HEADING, L.SPEED]] += random.normal(size=4) * noise
        estimator.advance(now)
        estimator.correct(reading(seen, now))
        pairs.append((row.copy(), estimator.estimate(now).row))
        estimator.sent(now, math.radians(heading), speed)
        queue.append((speed, float(np.degrees(math.radians(heading)))))
        command = queue.pop(0)
        if command is not None:
            error = (command[1] - row[L.HEADING] + 180.0) % 360.0 - 180.0
            step_boat(params, row, command[0], error, DT_S)
    return pairs


def test_noise_is_smoothed_and_memory_stays_the_boats():
    noise = np.array([0.06, 0.06, 1.0, 0.04])
    commands = [(2.0, 90.0)] * 60 + [(2.0, 30.0)] * 60 + [(1.0, -60.0)] * 60
    pairs = sail("heron", commands, 1, noise)[20:]
    error = np.array([believed - truth for truth, believed in pairs])
    error[:, L.HEADING] = (error[:, L.HEADING] + 180.0) % 360.0 - 180.0
    spread = np.sqrt((error[:, [L.X, L.Y, L.HEADING, L.SPEED]] ** 2).mean(axis=0))
    assert (spread < 0.9 * noise).all()
    assert np.median(np.abs(error[:, L.THRUST])) < 5.0


def test_a_surprise_starts_afresh_where_the_boat_is_and_a_standstill_of_the_loop_is_made_up_in_bounds():
    estimator = Estimator(get_platform("heron"), DT_S, 0.0)
    estimator.correct(reading(fresh_state(0.0, 0.0, 0.0, 0.0), 0.0))
    estimator.advance(DT_S)
    estimator.correct(reading(fresh_state(2.5, 0.0, 70.0, 1.0), DT_S))
    row = estimator.estimate(DT_S).row
    assert row[[L.X, L.SPEED]] == pytest.approx([2.5, 1.0])
    assert row[L.THRUST] == pytest.approx(40.0)
    assert math.isnan(row[L.HEADING_ERROR])
    estimator.sent(DT_S, 0.0, 2.0)
    estimator.advance(1e6)
    row = estimator.estimate(1e6).row
    assert np.isfinite(row[:4]).all()
    assert math.hypot(row[L.X] - 2.5, row[L.Y]) < 2.0 * 5.1


def afloat(command_mps=0.0, speed=0.0, platform="heron"):
    """A boat of ours that lies still, or is under way east."""
    return World(fleet_of(blue=1, red=0, platform=platform), [(20.0, 10.0, 90.0, speed)], straight(90.0, command_mps))


def freeze(world):
    """All the link says stays as it is, with fresh time stamps, while the boat goes on."""
    link = world.links[NAME]
    heading = math.radians(link.row[L.HEADING]) % (2.0 * math.pi)
    link.changed = {"position_m": tuple(link.row[:2]), "heading_rad": heading, "speed_mps": float(link.row[L.SPEED])}


def seconds_until_stopped(world, longest_s=10.0):
    began = world.clock.now_s()
    while world.clock.now_s() < began + longest_s:
        world.run(0.1)
        if ("navigation", "stop") in world.responses(NAME):
            return world.clock.now_s() - began
    return math.inf


def nothing_is_refused(world):
    assert world.loop.tracker.faults == {}


@pytest.mark.parametrize("platform", ["heron", "surveyor", "blueboat"])
def test_a_boat_at_rest_without_noise_is_believed_and_goes_when_it_is_told(platform):
    world = afloat(platform=platform)
    world.run(20.0, nothing_is_refused)
    world.policy.rule = straight(90.0, 1.2)
    world.run(6.0, nothing_is_refused)
    assert world.links[NAME].row[L.SPEED] > 0.4


def test_a_boat_that_starts_late_is_stopped_once_and_then_goes():
    world = afloat(1.2)
    world.links[NAME].deaf = True
    assert seconds_until_stopped(world) < 3.0
    world.links[NAME].deaf = False
    world.run(20.0)
    nothing_is_refused(world)
    assert world.links[NAME].row[L.SPEED] > 0.8


@pytest.mark.parametrize("speed", [0.4, 1.2, 2.0])
def test_a_source_that_freezes_under_way_is_seen_within_a_second(speed):
    world = afloat(speed, speed).run(3.0)
    freeze(world)
    assert seconds_until_stopped(world) <= 1.05
    assert "frozen" in world.loop.tracker.faults[NAME]


def frozen_at_rest():
    """A boat whose source froze while it lay still, and that is told to go."""
    world = afloat().run(5.0)
    freeze(world)
    world.policy.rule = straight(90.0, 1.2)
    return world, world.links[NAME]


def test_a_source_that_froze_at_rest_is_seen_within_a_second_of_the_boats_leaving():
    world, link = frozen_at_rest()
    while math.dist(link.row[:2], (20.0, 10.0)) < LEFT_M:
        world.run(0.1)
    assert seconds_until_stopped(world) <= 1.05
    assert math.dist(link.row[:2], (20.0, 10.0)) < GONE_M + 0.2


@pytest.mark.parametrize("by_hand", [False, True])
def test_a_source_that_stays_frozen_leads_a_boat_no_farther_than_its_error_covers(by_hand):
    world, link = frozen_at_rest()
    farthest_m = 0.0
    for _ in range(900):
        world.run(0.1)
        farthest_m = max(farthest_m, math.dist(link.row[:2], (20.0, 10.0)))
        track = world.loop.tracker.track(NAME)
        assert math.dist(track.position_m(), link.row[:2]) <= track.error_m + GONE_M + 0.1
    assert farthest_m < MOST_UNSEEN_M + 1.5
    assert link.row[L.SPEED] == pytest.approx(0.0, abs=0.05)
    assert "frozen" in world.loop.tracker.faults[NAME]
    if by_hand:  # who takes it and gives it back begins anew
        link.changed = {"ready": False, "why_not": "driven by hand"}
        world.run(1.0)
    link.changed = {}
    world.run(10.0)
    assert link.row[L.SPEED] > 0.5  # it moves again with the first value that changes


def drive(turn_share=1.0, seconds=40.0, limits=None, speed_share=1.0, left_out=()):
    """A rover weaves; its turning differs from its platform's by a share. Gives the monitor and its margins."""
    fleet = fleet_of(blue=1, red=0, platform="ardurover_boat")
    fleet = fleet.model_copy(update={"limits": Limits(model=ModelLimit(**(limits or {})))})
    platform = get_platform("ardurover_boat")
    true = replace(
        platform,
        turn_rate_per_mps=turn_share * platform.turn_rate_per_mps,
        max_turn_rate_dps=turn_share * platform.max_turn_rate_dps,
        max_speed_mps=speed_share * platform.max_speed_mps,
    ).pack()
    monitor, row, margins = ModelErrorMonitor(fleet, (NAME,)), fresh_state(0.0, 0.0, 0.0, 2.0), []
    for k in range(round(seconds / DT_S)):
        if k not in left_out:  # else the autopilot goes on with what it was told last
            told = 2.5, 80.0 * math.sin(0.9 * k * DT_S)
            monitor.update({NAME: row.copy()}, {NAME: BoatReading(NAME, k * DT_S, position_age_s=0.0, ready=True)})
            monitor.sent({NAME: Sent(NAME, k * DT_S, math.radians(told[1]), told[0], "told", True)})
        step_boat(true, row, told[0], math.remainder(told[1] - row[L.HEADING], 360.0), DT_S)
        margins.append(monitor.margin_m[NAME])
    return monitor, np.array(margins)


def test_a_boat_that_is_its_model_gets_no_margin():
    monitor, margins = drive()
    assert margins.max() == 0.0
    assert monitor.quantile_m(NAME, 2) < 1e-6
    assert monitor.actions() == []
    assert monitor.outside_s(NAME) == 0.0


@pytest.mark.parametrize("left_out", [(), range(5, 400, 10)], ids=["in time", "behind every second"])
def test_what_the_model_misses_widens_the_margin_slowly_and_is_told_also_where_the_loop_falls_behind(left_out):
    monitor, margins = drive(turn_share=0.5, left_out=left_out)
    assert margins[-1] == pytest.approx(min(monitor.quantile_m(NAME), 1.0), abs=0.05)
    assert margins[-1] > 0.2
    assert np.abs(np.diff(margins)).max() <= WIDEN_MPS * DT_S + 1e-12
    (action,) = monitor.actions()
    assert (action.condition, action.response) == ("tracking", "none")
    assert "95 of 100" in action.text
    found = [monitor.quantile_m(NAME, ahead) for ahead in range(3)]
    assert 0.0 < found[0] <= found[1] <= found[2], "errors grow with the time ahead"


@pytest.mark.parametrize("seconds", [10.0, 40.0])
def test_the_margin_is_bounded_as_declared_and_one_under_way_is_not_told_as_the_bound(seconds):
    monitor, margins = drive(turn_share=0.3, limits={"widest_m": 0.5}, seconds=seconds)
    (action,) = monitor.actions()
    bound = "the most that limits.model.widest_m allows"
    assert monitor.quantile_m(NAME) > 0.5
    if seconds < 20.0:
        assert margins[-1] < 0.4
        assert f"margin {margins[-1]:.2f} m, growing to 0.50 m, {bound}" in action.text
    else:
        assert margins.max() == pytest.approx(0.5)
        assert f"margin 0.50 m, {bound}" in action.text


def test_a_boat_far_outside_its_model_is_counted():
    assert drive(speed_share=0.3, limits={"outside_m": 0.5}, seconds=20.0)[0].outside_s(NAME) > 5.0
