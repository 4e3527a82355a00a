"""Undertow: the phases of its raid, ways past opponents that keep a habit, and flags that it brings home."""

import math
from dataclasses import replace

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.policies.entrants.observation import look
from steerclear.policies.entrants.undertow.habits import LEAD, WARY, Habits
from steerclear.policies.entrants.undertow.passage import Waters, outward
from steerclear.policies.entrants.undertow.raid import Phase, Raid
from steerclear.policies.entrants.undertow.shape import SCRIPTED
from steerclear.policies.entrants.undertow.team import aim_of
from steerclear.shield.exceptions import PolicyError

PLACES = [[38.0, 36.0], [38.0, 4.0], [35.0, 30.0], [20.0, 20.0], [22.0, 20.0], [60.0, 20.0]]
APART = [[20.0, 25.0], [20.0, 15.0], [38.0, 20.0], [75.0, 38.0], [75.0, 2.0], [55.0, 20.0]]
ROUND_S, FAR_M = 20.0, -1000.0


def observed(places):
    env = MctfEnv("aamas2024")
    env.reset(seed=1, options={"init_dict": {"agent_position": places}})
    return look(env.core, 0)


@pytest.fixture
def obs():
    return observed(PLACES)


@pytest.fixture
def apart():
    return observed(APART)


def moved(obs, time_s=0.0, own=None, foes=None):
    """The same moment with some boats changed: number to fields."""
    boats = {side: list(getattr(obs, side)) for side in ("own", "foes")}
    for side, changes in (("own", own or {}), ("foes", foes or {})):
        for number, fields in changes.items():
            boats[side][number] = replace(boats[side][number], **fields)
    return replace(obs, own=tuple(boats["own"]), foes=tuple(boats["foes"]), time=obs.time + time_s)


def begun(obs):
    """A raid whose third boat has just been sent."""
    raid = Raid(obs)
    raid.advance(obs)
    baited = moved(obs, 5.0, {0: {"x": 41.5}}, {2: {"x": 50.0, "y": 27.0}})
    raid.advance(baited)
    dragged = moved(baited, 10.0, {0: {"tagged": True}, 1: {"x": 55.0, "on_side": False}}, {2: {"x": 55.0, "y": 12.0}})
    raid.advance(dragged)
    return raid, dragged


def test_a_raid_goes_through_its_phases_and_ends_with_the_flag_home(obs):
    raid = Raid(obs)
    raid.advance(obs)
    assert raid.phase == Phase.BAIT
    raid, dragged = begun(obs)
    assert raid.phase == Phase.RUN
    assert raid.bait_taken
    raid.advance(moved(dragged, 10.0, {2: {"x": 60.0, "on_side": False, "carries": True}}))
    assert raid.phase == Phase.RUN
    raid.advance(moved(dragged, 20.0, {2: {"x": 39.0}}))
    assert raid.phase == Phase.GATHER


@pytest.mark.parametrize("lost", [{2: {"tagged": True}}, {1: {"tagged": True}}])
def test_a_raid_is_given_up_when_a_boat_it_needs_is_tagged(obs, lost):
    raid, dragged = begun(obs)
    raid.advance(moved(dragged, 1.0, lost))
    assert raid.phase == Phase.GATHER


GUARD_AWAY, NOBODY_HOME = [*PLACES[:5], [75.0, 3.0]], [*APART[:2], [38.0, 6.0], [20.0, 38.0], [5.0, 38.0], [12.0, 38.0]]


@pytest.mark.parametrize(("places", "phase"), [(GUARD_AWAY, Phase.RUN), (NOBODY_HOME, Phase.GATHER)])
def test_it_brings_a_flag_home_where_the_guard_is_drawn_away_or_nobody_stays_there(places, phase):
    env = MctfEnv("aamas2024")
    observations, infos = env.reset(seed=1, options={"init_dict": {"agent_position": places}})
    team, still = policies.make("undertow"), dict.fromkeys(env.possible_agents[3:], -1)
    team.reset(env, env.possible_agents[:3], 1)
    team._raid.phase = phase
    while env.core.time_s[0] < 40.0 and not env.core.captures[0, 0]:
        observations, _, _, _, infos = env.step(team.act(observations, infos) | still)
    assert env.core.captures[0].tolist() == [1, 0]


ALL_HERE = {0: {"x": 12.0, "y": 38.0}, 1: {"x": 20.0, "y": 38.0}, 2: {"x": 30.0, "y": 34.0, "on_side": False}}
CUT_OFF = {0: {"x": 55.0, "y": 12.0, "on_side": True}, 1: {"x": 50.0, "y": 6.0, "on_side": True}}


@pytest.mark.parametrize(("own", "foes"), [({}, {}), ({2: {"tagged": True}}, {}), ({}, CUT_OFF)])
def test_once_every_opponent_has_come_the_third_boat_sails_alone_unless_tagged_or_cut_off(obs, own, foes):
    """It waits at the other edge until then."""
    here = moved(obs, 0.0, {2: {"x": 38.0, "y": 6.0}}, {n: {"on_side": False, **at} for n, at in ALL_HERE.items()})
    raid = Raid(here)
    raid.advance(here)
    assert (raid.unguarded, raid.phase, raid.upper) == (True, Phase.RUN, False)
    raid.advance(moved(here, 1.0, own, foes))
    assert raid.phase == (Phase.GATHER if own or foes else Phase.RUN)
    if raid.phase == Phase.RUN:
        raid.advance(moved(here, 12.0, {2: {"x": 62.0, "carries": True}}))
        assert raid.held
        raid.advance(moved(here, 25.0, {2: {"x": 39.0}}))
        assert raid.phase == Phase.GATHER
    again = Raid(here)
    again.remember(raid.memory(here.time), here.time, mirrored=False)
    assert again.unguarded


def test_distances_of_a_raid_grow_with_the_field_times_do_not_and_it_needs_three_boats():
    env = MctfEnv("mctf2025")
    env.reset(seed=1)
    shape = Raid(look(env.core, 0)).shape
    assert (shape.guard_m, shape.free_m) == (2.0 * SCRIPTED.guard_m, 2.0 * SCRIPTED.free_m)
    assert shape.baited_s == SCRIPTED.baited_s
    env = MctfEnv(GameConfig.preset("aamas2024", team_size=2))
    env.reset(seed=1)
    with pytest.raises(PolicyError, match="needs three boats"):
        policies.make("undertow").reset(env, env.possible_agents[:2], 0)


def circling(time_s):
    """Where a boat is that circles once in `ROUND_S`."""
    angle = 2.0 * math.pi * time_s / ROUND_S
    return {"x": 60.0 + 5.0 * math.cos(angle), "y": 20.0 - 5.0 * math.sin(angle), "heading": angle + math.pi}


def watched(obs, seconds, place=circling, begin_s=0, habits=None):
    """Habits of opponents of which the third does as it is told."""
    habits = habits or Habits(3)
    for second in range(begin_s, begin_s + seconds):
        assert habits.look(moved(obs, float(second), foes={2: {"on_side": True, "tagged": False, **place(second)}}))
    return habits


def test_who_circles_is_expected_to_go_on_circling_after_the_first_round_looked_at_once_a_second(obs):
    habits = watched(obs, int(ROUND_S) + LEAD)
    assert not habits.look(moved(obs, ROUND_S + LEAD - 0.1))
    assert not habits.settled(2)
    assert habits.track(2, 10) is None
    habits = watched(obs, 60)
    assert habits.settled(2)
    track = habits.track(2, 70)
    expected = [(circling(60 + k)["x"], circling(60 + k)["y"]) for k in range(70)]
    np.testing.assert_allclose(track[:, :2], expected, atol=1e-6)
    assert track[:, 2].all()


def test_who_leaves_its_circle_is_not_relied_on_for_long(obs):
    habits = watched(obs, 60)
    watched(obs, 5, lambda second: {"x": 60.0 - 2.0 * (second - 60), "y": 20.0, "heading": 0.0}, 60, habits)
    assert not habits.settled(2)
    watched(obs, 4 * WARY, begin_s=65, habits=habits)
    assert not habits.settled(2)
    watched(obs, 12 * WARY, begin_s=65 + 4 * WARY, habits=habits)
    assert habits.settled(2)


class Known:
    """Habits that are what a test says: number to track."""

    def __init__(self, tracks):
        self._tracks = tracks

    def track(self, number, looks):
        return self._tracks.get(number)


def standing(x, y, may_tag=1.0):
    """The track of a boat that stays where it is."""
    return np.tile([x, y, may_tag], (90, 1))


def sailed(boat, points, step_m=0.25):
    """Points of a way and when a boat is there, s."""
    legs = list(zip((boat.at, *points[:-1]), points, strict=True))
    places = np.concatenate([np.linspace(a, b, max(int(math.dist(a, b) / step_m), 2))[1:] for a, b in legs])
    return places, np.cumsum(np.hypot(*np.diff(places, axis=0, prepend=[boat.at]).T)) / boat.top


def test_a_way_leads_round_who_stands_and_to_the_flag(apart):
    waters = Waters(apart, Known({2: standing(52.0, 14.0)}), 2.0, FAR_M)
    found = outward(waters, apart.own[2])
    places, _ = sailed(apart.own[2], found.points)
    off_m = np.hypot(places[:, 0] - 52.0, places[:, 1] - 14.0)[places[:, 0] > apart.line]
    assert found.room_m > 0.0
    assert off_m.min() >= apart.reach + 2.0
    assert math.dist(found.points[-1], apart.goal) < apart.reach


def raid_with(obs, tracks):
    """A raid in which opponents with tracks keep a habit, and the others have left."""
    raid = Raid(obs)
    raid.watch.habits.settled = lambda number: number in tracks
    raid.watch.habits.track = lambda number, looks: tracks.get(number)
    raid.watch._left = {0, 1, 2} - set(tracks)
    return raid


def test_the_third_boat_sails_the_passage_and_the_others_guard(apart):
    raid = raid_with(apart, {n: standing(75.0, y) for n, y in enumerate((38.0, 2.0, 20.0))})
    raid.watch.habits.track = lambda number, looks: standing(75.0, 38.0 if number else 2.0, 0.0)
    chart = raid.advance(apart)
    assert raid.unguarded
    assert raid.phase == Phase.RUN
    assert aim_of(raid, apart, chart, 2).point == raid.passage.points[0]
    assert all(aim_of(raid, apart, chart, number).point[0] < apart.line for number in (0, 1))
    raid.advance(moved(apart, 1.0, {2: {"tagged": True}}))
    assert raid.phase == Phase.GATHER
    assert raid.passage is None


def test_a_second_raid_goes_on_after_the_first_brought_a_flag_home(apart):
    """What was held in a passage before does not end the next one."""
    raid = raid_with(apart, {n: standing(75.0, 38.0, 0.0) for n in range(3)})
    raid.advance(apart)
    raid.advance(moved(apart, 10.0, {2: {"x": 60.0, "carries": True, "on_side": False}}))
    assert raid.held
    raid.advance(moved(apart, 20.0, {2: {"x": 39.0}}))
    raid.advance(moved(apart, 21.0))
    assert raid.phase == Phase.RUN
    raid.advance(moved(apart, 21.1, {2: {"x": 41.0, "on_side": False}}))
    assert raid.phase == Phase.RUN


def test_it_brings_a_flag_home_from_easy_with_a_patrol_before_it_whose_habit_it_learns():
    env = MctfEnv(GameConfig.preset("aamas2024", default_start=False), action_kind="continuous")
    observations, infos = env.reset(seed=2)
    teams = [policies.make("easy"), policies.make("undertow")]
    for number, team in enumerate(teams):
        team.reset(env, env.possible_agents[3 * number : 3 * number + 3], 1)
    while env.core.time_s[0] < 200.0 and not env.core.captures[0].any():
        actions = teams[0].act(observations, infos) | teams[1].act(observations, infos)
        observations, _, _, _, infos = env.step(actions)
    assert env.core.captures[0].tolist() == [0, 1]
    assert any(teams[1]._raid.watch.habits.settled(number) for number in range(3))


@pytest.mark.parametrize(("name", "some"), [("chao", True), ("medium", False)])
def test_of_the_opponents_those_that_never_chase_keep_a_habit(name, some):
    """Circling boats do; guards and attackers that see us do not, with a team that sails about."""
    env = MctfEnv(GameConfig.preset("aamas2024", default_start=False), action_kind="continuous")
    observations, infos = env.reset(seed=3)
    own, foes = policies.make("undertow"), policies.make(name)
    own.reset(env, env.possible_agents[:3], 1)
    foes.reset(env, env.possible_agents[3:], 2)
    while env.core.time_s[0] < 75.0:
        actions = own.act(observations, infos) | foes.act(observations, infos)
        observations, _, _, _, infos = env.step(actions)
    assert any(own._raid.watch.habits.settled(number) for number in range(3)) == some
