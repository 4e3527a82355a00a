"""Undertow's ways past opponents that keep a habit, and who is held to guard."""

import math

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.policies.entrants.sight import look
from steerclear.policies.entrants.undertow.aims import aim_of
from steerclear.policies.entrants.undertow.passage import homeward, outward
from steerclear.policies.entrants.undertow.raid import Phase, Raid
from steerclear.policies.entrants.undertow.watch import Watch
from steerclear.policies.entrants.undertow.waters import WAKES_S, Waters
from steerclear.policies.entrants.undertow.way import slack_m
from test_undertow import moved

FAR_M = -1000.0


class Known:
    """Habits that are what a test says: number to track."""

    def __init__(self, tracks):
        self._tracks = tracks

    def track(self, number, looks):
        return self._tracks.get(number)


def standing(x, y, may_tag=1.0):
    """The track of a boat that stays where it is."""
    return np.tile([x, y, may_tag], (90, 1))


@pytest.fixture
def sight():
    env = MctfEnv("aamas2024")
    places = [[20.0, 25.0], [20.0, 15.0], [38.0, 20.0], [75.0, 38.0], [75.0, 2.0], [55.0, 20.0]]
    env.reset(seed=1, options={"init_dict": {"agent_position": places}})
    return look(env.core, 0)


def sailed(boat, points, step_m=0.25):
    """Points of a way and when a boat is there, s."""
    legs = list(zip((boat.at, *points[:-1]), points, strict=True))
    places = np.concatenate([np.linspace(a, b, max(int(math.dist(a, b) / step_m), 2))[1:] for a, b in legs])
    return places, np.cumsum(np.hypot(*np.diff(places, axis=0, prepend=[boat.at]).T)) / boat.top


def test_a_way_leads_round_who_stands_and_to_the_flag(sight):
    waters = Waters(sight, Known({2: standing(52.0, 14.0)}), 2.0, FAR_M)
    found = outward(waters, sight.own[2])
    places, _ = sailed(sight.own[2], found.points)
    off_m = np.hypot(places[:, 0] - 52.0, places[:, 1] - 14.0)[places[:, 0] > sight.line]
    assert found.room_m > 0.0
    assert off_m.min() >= sight.reach + 2.0
    assert math.dist(found.points[-1], sight.goal) < sight.reach


def test_the_way_home_is_thought_of_before_a_boat_sets_out(sight):
    """From 12 s on another opponent keeps the line: out is free, home is not."""
    late = np.concatenate([standing(52.0, 20.0, 0.0)[:12], np.tile([43.0, 20.0, 1.0], (78, 1))])
    wall = {n: np.where([[True, False, True]], late, y) for n, y in enumerate((8.0, 20.0, 32.0))}
    assert outward(Waters(sight, Known(wall), 0.0, FAR_M), sight.own[2]).room_m < 0.0
    open_to_all = {n: standing(43.0, 20.0, 0.0) for n in range(3)}
    assert outward(Waters(sight, Known(open_to_all), 0.0, FAR_M), sight.own[2]).room_m == math.inf


def test_a_patrol_is_passed_while_it_is_elsewhere(sight):
    """It is in the way for 10 s and then not; whoever waits finds the way that was shut."""
    comes, goes = standing(52.0, 20.0), standing(52.0, 20.0)
    comes[10:], goes[:10] = [75.0, 20.0, 0.0], [75.0, 20.0, 0.0]
    points = np.linspace((41.0, 20.0), (63.0, 20.0), 40)[None]
    times_s = np.linspace(1.0, 12.0, 40)[None]
    rooms = [
        float(Waters(sight, Known({2: track}), 0.0, FAR_M).room_m(points, times_s + after_s, np.array([12.0]))[0])
        for track, after_s in ((comes, 0.0), (comes, 15.0), (goes, 0.0))
    ]
    assert rooms[0] < 0.0 < rooms[1]
    assert rooms[2] < 0.0


def test_who_keeps_no_habit_is_held_to_cut_the_boat_off(sight):
    boat, grab, home = sight.own[2], (61.0, 20.0), (39.0, 20.0)
    points, times_s = sailed(boat, (grab, home))
    grabs_s = math.dist(boat.at, grab) / boat.top
    room = Waters(sight, Known({}), 0.0, 0.0).room_m(points[None], times_s[None], np.array([grabs_s]))
    assert room[0] == pytest.approx(slack_m(sight, boat, grab, home), abs=1.0)


def test_a_tagged_boat_that_is_soon_free_is_kept_clear_of(sight):
    tagged = moved(sight, 0.0, foes={2: {"tagged": True, "x": 50.0, "y": 20.0}})
    at, free_s = (60.0, 20.0), 5.0  # it is free again where its base is in reach
    waters = Waters(tagged, Known({0: standing(75.0, 38.0), 1: standing(75.0, 2.0)}), 1.0, FAR_M)
    for after_s, near in ((free_s, True), (free_s + 1.5 * WAKES_S, False)):
        room = waters.room_m(np.array([[(at[0], at[1] + 8.0)]]), np.array([[after_s]]), np.array([99.0]))[0]
        assert room == pytest.approx(8.0 - sight.reach - 1.0) if near else room > 0.0


def test_home_is_over_the_line_by_the_freest_way(sight):
    boat = moved(sight, 0.0, {2: {"x": 66.0, "y": 12.0, "carries": True, "on_side": False}}).own[2]
    found = homeward(Waters(sight, Known({2: standing(52.0, 22.0)}), 2.0, FAR_M), boat)
    assert found.room_m > 0.0
    assert found.points[-1][0] < sight.line
    assert found.points[-1][1] < 12.0


def test_who_has_come_over_the_line_is_no_guard(sight):
    watch = Watch(sight)
    for number in range(3):
        assert not watch.unguarded
        watch.look(moved(sight, 1.0 + number, foes={number: {"x": 30.0, "on_side": False}}))
    assert watch.unguarded


@pytest.mark.parametrize(("lure_x", "unguarded"), [(30.0, True), (41.0, False)])
def test_who_is_up_at_the_line_with_nobody_to_chase_is_no_guard(sight, lure_x, unguarded):
    up = {number: {"x": 46.0} for number in range(3)}
    watch = Watch(sight)
    for second in range(20):
        watch.look(moved(sight, float(second), {0: {"x": lure_x}, 2: {"x": 30.0}}, up))
    assert watch.unguarded == unguarded


def raid_with(sight, tracks):
    """A raid in which opponents with tracks keep a habit, and the others have left."""
    raid = Raid(sight)
    raid.watch.habits.settled = lambda number: number in tracks
    raid.watch.habits.track = lambda number, looks: tracks.get(number)
    raid.watch._left = {0, 1, 2} - set(tracks)
    return raid


def test_the_third_boat_sails_the_passage_and_the_others_guard(sight):
    raid = raid_with(sight, {n: standing(75.0, y) for n, y in enumerate((38.0, 2.0, 20.0))})
    raid.watch.habits.track = lambda number, looks: standing(75.0, 38.0 if number else 2.0, 0.0)
    chart = raid.advance(sight)
    assert raid.unguarded
    assert raid.phase == Phase.RUN
    assert aim_of(raid, sight, chart, 2).point == raid.passage.points[0]
    assert all(aim_of(raid, sight, chart, number).point[0] < sight.line for number in (0, 1))
    raid.advance(moved(sight, 1.0, {2: {"tagged": True}}))
    assert raid.phase == Phase.GATHER
    assert raid.passage is None


def test_without_a_passage_it_waits_in_turn_at_both_edges(sight):
    raid = raid_with(sight, {n: standing(46.0, y) for n, y in enumerate((8.0, 20.0, 32.0))})
    waits = []
    for second in range(90):
        now = moved(sight, float(second))
        waits.append(aim_of(raid, now, raid.advance(now), 2).point)
    assert raid.phase == Phase.GATHER
    assert {round(y / sight.size[1], 2) for _, y in waits} == {0.15, 0.5, 0.85}
    assert {x for x, _ in waits} == {sight.line - 2.0}


def test_a_second_raid_goes_on_after_the_first_brought_a_flag_home(sight):
    """What was held in a passage before does not end the next one."""
    raid = raid_with(sight, {n: standing(75.0, 38.0, 0.0) for n in range(3)})
    raid.advance(sight)
    raid.advance(moved(sight, 10.0, {2: {"x": 60.0, "carries": True, "on_side": False}}))
    assert raid.held
    raid.advance(moved(sight, 20.0, {2: {"x": 39.0}}))
    raid.advance(moved(sight, 21.0))
    assert raid.phase == Phase.RUN
    raid.advance(moved(sight, 21.1, {2: {"x": 41.0, "on_side": False}}))
    assert raid.phase == Phase.RUN


@pytest.mark.parametrize(("side", "seed"), [(0, 1), (1, 2)])
def test_it_brings_a_flag_home_from_easy_with_a_patrol_before_it(side, seed):
    config = GameConfig.preset("aamas2024", default_start=False)
    env = MctfEnv(config, action_kind="continuous")
    observations, infos = env.reset(seed=seed)
    ids = env.possible_agents
    teams = [policies.make("undertow"), policies.make("easy")][:: 1 if side == 0 else -1]
    for number, team in enumerate(teams):
        team.reset(env, ids[3 * number : 3 * number + 3], 1)
    while env.core.time_s[0] < 200.0 and not env.core.captures[0].any():
        actions = teams[0].act(observations, infos) | teams[1].act(observations, infos)
        observations, _, _, _, infos = env.step(actions)
    assert env.core.captures[0, side] == 1
    assert env.core.captures[0, 1 - side] == 0
