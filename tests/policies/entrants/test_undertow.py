"""Undertow: the phases of its raid, its mirrored chart, and a raid in a game."""

from dataclasses import replace

import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.policies.entrants.sight import look
from steerclear.policies.entrants.undertow.aims import aim_of
from steerclear.policies.entrants.undertow.chart import Chart, off
from steerclear.policies.entrants.undertow.raid import Phase, Raid
from steerclear.policies.entrants.undertow.shape import SCRIPTED
from steerclear.policies.entrants.undertow.way import slack_m
from steerclear.shield.exceptions import PolicyError

PLACES = [[38.0, 36.0], [38.0, 4.0], [35.0, 30.0], [20.0, 20.0], [22.0, 20.0], [60.0, 20.0]]


@pytest.fixture
def sight():
    env = MctfEnv("aamas2024")
    env.reset(seed=1, options={"init_dict": {"agent_position": PLACES}})
    return look(env.core, 0)


def moved(sight, time_s=0.0, own=None, foes=None):
    """The same moment with some boats changed: number to fields."""
    boats = {side: list(getattr(sight, side)) for side in ("own", "foes")}
    for side, changes in (("own", own or {}), ("foes", foes or {})):
        for number, fields in changes.items():
            boats[side][number] = replace(boats[side][number], **fields)
    return replace(sight, own=tuple(boats["own"]), foes=tuple(boats["foes"]), time=sight.time + time_s)


def begun(sight):
    """A raid whose third boat has just been sent."""
    raid = Raid(sight)
    raid.advance(sight)
    baited = moved(sight, 5.0, {0: {"x": 41.5}}, {2: {"x": 50.0, "y": 27.0}})
    raid.advance(baited)
    dragged = moved(baited, 10.0, {0: {"tagged": True}, 1: {"x": 55.0, "on_side": False}}, {2: {"x": 55.0, "y": 12.0}})
    raid.advance(dragged)
    return raid, dragged


def test_a_raid_goes_through_its_phases_and_ends_with_the_flag_home(sight):
    raid = Raid(sight)
    raid.advance(sight)
    assert raid.phase == Phase.BAIT
    raid, dragged = begun(sight)
    assert raid.phase == Phase.RUN
    assert raid.bait_taken
    raid.advance(moved(dragged, 10.0, {2: {"x": 60.0, "on_side": False, "carries": True}}))
    assert raid.phase == Phase.RUN
    raid.advance(moved(dragged, 20.0, {2: {"x": 39.0}}))
    assert raid.phase == Phase.GATHER


@pytest.mark.parametrize("lost", [{2: {"tagged": True}}, {1: {"tagged": True}}])
def test_a_raid_is_given_up_when_a_boat_it_needs_is_tagged(sight, lost):
    raid, dragged = begun(sight)
    raid.advance(moved(dragged, 1.0, lost))
    assert raid.phase == Phase.GATHER


def test_the_third_boat_waits_while_the_guard_is_near_it(sight):
    raid = Raid(sight)
    raid.advance(sight)
    raid.advance(moved(sight, 5.0, {0: {"x": 41.5}}, {2: {"x": 50.0, "y": 27.0}}))
    raid.advance(moved(sight, 12.0, {1: {"x": 55.0}}, {2: {"x": 45.0, "y": 25.0}}))
    assert raid.phase == Phase.DRAG


def test_no_raid_begins_with_another_opponent_in_the_way_and_the_chart_is_turned(sight):
    blocked = moved(sight, 0.0, foes={0: {"x": 50.0, "y": 36.0, "on_side": True}})
    raid = Raid(blocked)
    raid.advance(blocked)
    assert raid.phase == Phase.GATHER
    assert raid.upper
    raid.advance(replace(blocked, time=blocked.time + 31.0))
    assert not raid.upper


def test_a_chart_is_the_other_one_mirrored(sight):
    up, down = Chart(sight, True), Chart(sight, False)
    for (x, y), (x_down, y_down) in zip(up.posts, down.posts, strict=True):
        assert (x, sight.size[1] - y) == pytest.approx((x_down, y_down))
    assert up.run((50.0, 26.0))[1] + down.run((50.0, 14.0))[1] == pytest.approx(sight.size[1])


def test_distance_from_a_way_is_from_its_nearest_point():
    assert off((5.0, 3.0), (0.0, 0.0), (10.0, 0.0)) == pytest.approx(3.0)
    assert off((13.0, 4.0), (0.0, 0.0), (10.0, 0.0)) == pytest.approx(5.0)


def test_it_brings_a_flag_home_where_the_guard_is_drawn_away():
    env = MctfEnv("aamas2024")
    places = [*PLACES[:5], [75.0, 3.0]]
    observations, infos = env.reset(seed=1, options={"init_dict": {"agent_position": places}})
    team, still = policies.make("undertow"), dict.fromkeys(env.possible_agents[3:], -1)
    team.reset(env, env.possible_agents[:3], 1)
    team._raid.phase = Phase.RUN
    while env.core.time_s[0] < 40.0 and not env.core.captures[0, 0]:
        observations, _, _, _, infos = env.step(team.act(observations, infos) | still)
    assert env.core.captures[0].tolist() == [1, 0]


ALL_HERE = {0: {"x": 12.0, "y": 38.0}, 1: {"x": 20.0, "y": 38.0}, 2: {"x": 30.0, "y": 34.0, "on_side": False}}


def alone(sight):
    """A moment at which all opponents are on the own side and the third boat waits at the other edge; its raid."""
    here = moved(sight, 0.0, {2: {"x": 38.0, "y": 6.0}}, {n: {"on_side": False, **at} for n, at in ALL_HERE.items()})
    raid = Raid(here)
    raid.advance(here)
    return raid, here


def test_the_slack_of_a_way_counts_reach_speed_and_the_way_round_by_the_base(sight):
    here = moved(sight, 0.0, {2: {"x": 41.0, "y": 20.0}}, {n: {"x": 5.0, "on_side": False} for n in range(3)})
    boat, grab, home = here.own[2], (62.0, 20.0), (39.5, 20.0)
    met = slack_m(moved(here, 0.0, foes={0: {"x": 30.0, "y": 20.0}}), boat, grab, home)
    last = 39.5 + 22.5 / 11  # the last point of the way on their side, at steps of 22.5 / 11 m
    assert met == pytest.approx((last - 30.0) - here.reach - (62.0 - last))  # both sail as far from the grab on
    at_home = moved(here, 0.0, foes={0: {"x": 60.0, "y": 20.0, "on_side": True}})
    tagged = moved(here, 0.0, foes={0: {"x": 30.0, "y": 20.0, "tagged": True}})
    assert slack_m(at_home, boat, grab, home) < met < slack_m(tagged, boat, grab, home)


def test_once_every_opponent_has_come_the_third_boat_sails_alone_and_brings_the_flag_home(sight):
    raid, here = alone(sight)
    assert raid.unguarded
    assert raid.phase == Phase.RUN
    assert not raid.upper
    raid.advance(moved(here, 12.0, {2: {"x": 62.0, "carries": True}}))
    assert raid.held
    raid.advance(moved(here, 25.0, {2: {"x": 39.0}}))
    assert raid.phase == Phase.GATHER
    again = Raid(here)
    again.remember(raid.memory(here.time), here.time, mirrored=False)
    assert again.unguarded


def test_while_one_opponent_has_stayed_at_home_it_is_drawn_away_as_before(sight):
    raid = Raid(sight)
    for number in (0, 1):
        raid.advance(moved(sight, 1.0, foes={number: {"x": 20.0}}))
    assert not raid.unguarded
    assert raid.phase == Phase.BAIT
    raid.advance(moved(sight, 2.0, foes={2: {"x": 20.0}}))
    assert raid.unguarded
    assert raid.phase == Phase.GATHER


@pytest.mark.parametrize(
    ("own", "foes"),
    [
        ({2: {"tagged": True}}, {}),
        ({}, {0: {"x": 55.0, "y": 12.0, "on_side": True}, 1: {"x": 50.0, "y": 6.0, "on_side": True}}),
    ],
)
def test_the_third_boat_gives_up_tagged_or_cut_off(sight, own, foes):
    raid, here = alone(sight)
    raid.advance(moved(here, 1.0, own, foes))
    assert raid.phase == Phase.GATHER


def test_guards_stand_between_the_flag_and_an_intruder_each_and_sail_at_them_once_the_third_is_near(sight):
    raid, here = alone(sight)
    near = moved(here, 1.0, {0: {"x": 20.0, "y": 28.0}, 1: {"x": 14.0, "y": 28.0}})
    chart = raid.advance(near)
    raid.phase = Phase.GATHER
    points = [aim_of(raid, near, chart, number).point for number in (0, 1)]
    for point, foe in zip(points, (near.foes[1], near.foes[0]), strict=True):
        flag_to_point = point[0] - near.home[0], point[1] - near.home[1]
        flag_to_foe = foe.x - near.home[0], foe.y - near.home[1]
        assert flag_to_point[0] * flag_to_foe[1] == pytest.approx(flag_to_point[1] * flag_to_foe[0])
        assert flag_to_point[0] ** 2 + flag_to_point[1] ** 2 == pytest.approx(SCRIPTED.guard_m**2)
    assert aim_of(raid, near, chart, 2).point == pytest.approx((38.0, 6.0))
    raid.phase, out = Phase.RUN, moved(near, 5.0, {2: {"x": 45.0, "y": 9.0}})
    assert aim_of(raid, out, chart, 0).point == pytest.approx((20.0, 37.0))
    assert aim_of(raid, out, chart, 2).point[0] > 60.0


def test_all_meet_who_has_the_own_flag(sight):
    raid, here = alone(sight)
    taken = replace(moved(here, 1.0, foes={0: {"carries": True}}), taken=True, flag=(12.0, 38.0))
    chart = raid.advance(taken)
    assert raid.phase == Phase.GATHER
    assert all(aim_of(raid, taken, chart, number).point[1] > 36.0 for number in range(3))


def test_it_brings_a_flag_home_while_nobody_stays_there():
    env = MctfEnv("aamas2024")
    places = [[20.0, 25.0], [20.0, 15.0], [38.0, 6.0], [20.0, 38.0], [5.0, 38.0], [12.0, 38.0]]
    observations, infos = env.reset(seed=1, options={"init_dict": {"agent_position": places}})
    team, still = policies.make("undertow"), dict.fromkeys(env.possible_agents[3:], -1)
    team.reset(env, env.possible_agents[:3], 1)
    while env.core.time_s[0] < 40.0 and not env.core.captures[0, 0]:
        observations, _, _, _, infos = env.step(team.act(observations, infos) | still)
    assert env.core.captures[0].tolist() == [1, 0]


@pytest.mark.parametrize(("preset", "factor"), [("aamas2024", 1.0), ("mctf2025", 2.0)])
def test_distances_of_a_raid_grow_with_the_field_and_times_do_not(preset, factor):
    env = MctfEnv(preset)
    env.reset(seed=1)
    shape = Raid(look(env.core, 0)).shape
    assert shape.guard_m == factor * SCRIPTED.guard_m
    assert shape.free_m == factor * SCRIPTED.free_m
    assert shape.baited_s == SCRIPTED.baited_s


def test_fewer_than_three_boats_are_refused():
    env = MctfEnv(GameConfig.preset("aamas2024", team_size=2))
    env.reset(seed=1)
    with pytest.raises(PolicyError, match="needs three boats"):
        policies.make("undertow").reset(env, env.possible_agents[:2], 0)
