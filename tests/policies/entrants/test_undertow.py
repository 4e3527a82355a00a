"""Undertow: the phases of its raid, its mirrored chart, and a raid in a game."""

from dataclasses import replace

import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.policies.entrants.sight import look
from steerclear.policies.entrants.undertow.chart import Chart, off
from steerclear.policies.entrants.undertow.raid import Phase, Raid
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


def test_fewer_than_three_boats_are_refused():
    env = MctfEnv(GameConfig.preset("aamas2024", team_size=2))
    env.reset(seed=1)
    with pytest.raises(PolicyError, match="needs three boats"):
        policies.make("undertow").reset(env, env.possible_agents[:2], 0)
