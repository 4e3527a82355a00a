"""The loop on simulated boats: what breaks around it or inside, the operator, the geofence, its rate."""

import gc
import math
import time
import tracemalloc

import numpy as np
import pytest
from bridge_fakes import Unheeded, World, fleet_of, fleet_text, pair, since, straight
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield import Surroundings
from steerclear.shield.bridge.control_loop import Overruns, Timing
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.platforms import layout as L

NORTH = 0.0
GIVEN_BACK = {"ready": False, "released": True, "why_not": "it was taken from us (MANUAL) and given back"}


def test_two_boats_told_to_collide_do_not_and_without_the_shield_they_would():
    world = pair().run(20.0)
    assert 2.5 <= world.closest_m < 10.0
    assert any(tick.decisions is not None and tick.decisions.count_intervened for tick in world.sink.ticks)
    assert pair(shield=Unheeded()).run(20.0).closest_m < 1.0


def test_telemetry_that_stops_stops_the_boat_by_its_link_in_the_end_and_the_other_keeps_clear():
    world = pair()
    strike = since(1004.0, lambda world: world.links["blue_1"].fall_silent())
    world.run(4.7, strike)
    assert ("navigation", "stop") in world.responses("blue_1")
    assert world.links["blue_1"].stops == 0
    world.run(4.6, strike)
    assert world.links["blue_1"].stops > 0, "after lost_after_s its state is unknown"
    assert world.last.fleet.names == ("blue_1", "blue_2")
    assert world.last.fleet.controlled.tolist() == [False, True]
    world.run(20.0, strike)
    assert world.closest_m >= 2.5
    grown = [tick.fleet.position_error_m[0] for tick in world.sink.ticks if tick.fleet is not None]
    assert grown[-1] > 2.0
    assert max(grown) < 20.0


def test_telemetry_that_stops_is_replaced_by_the_feed_where_it_knows_the_boat():
    world = pair()
    link = world.links["blue_1"]
    world.contacts.rows["blue_1"] = link.row  # somebody else watches it
    world.contacts.advance = lambda dt_s: None

    def strike(world):
        link.fall_silent()
        link.changed = {"heartbeat_age_s": 0.2}

    world.run(8.0, since(1004.0, strike))
    assert ("navigation", "stop") in world.responses("blue_1")
    assert any("known from the feed" in action.text for action in world.last.actions)
    assert world.last.fleet.controlled.tolist() == [True, True]
    assert link.stops == 0
    assert np.hypot(*(world.last.fleet.state[0, :2] - link.row[:2])) < 0.3
    world.run(15.0, since(1004.0, strike))
    assert world.closest_m >= 2.5


def test_a_boat_that_stays_where_it_jumped_to_is_believed_in_the_end():
    world = pair().run(2.0)
    world.links["blue_1"].offset_m = (30.0, 0.0)
    world.run(1.5)
    assert abs(world.last.fleet.state[0, L.X] - 20.0) < 3.0
    world.run(2.0)
    assert world.last.fleet.state[0, L.X] == pytest.approx(world.links["blue_1"].row[L.X] + 30.0, abs=0.5)


def duel():
    """One own boat, one other coming straight at it."""
    fleet = fleet_of(blue=1, red=1)
    return World(fleet, [(20.0, 0.0, 0.0, 2.0)], straight(NORTH), others=[("red_1", 20.3, 40.0, 180.0, 2.0)])


def test_a_lost_contact_slows_then_stops_us_and_is_kept_clear_of():
    world = duel()
    strike = since(1002.0, lambda world: world.contacts.silent.add("red_1"))
    world.run(3.5, strike)
    assert ("contact", "slow") in world.responses("red_1")
    world.run(4.0, strike)
    assert ("contact", "stop") in world.responses("red_1")
    assert world.closest_m >= 2.5
    ages = [tick.fleet.age_s[1] for tick in world.run(8.0, strike).sink.ticks]
    assert max(ages) <= world.fleet.shield_config.max_track_age_s


def test_an_override_of_a_lost_contact_leaves_it_out_and_says_so():
    world = duel()
    world.contacts.silent.add("red_1")
    world.run(1.0)
    assert ("contact", "stop") in world.responses("red_1")
    world.operator.override("contact", "red_1", 30.0, world.clock.now_s())
    world.run(1.0)
    assert ("override", "contact") in world.responses("red_1")
    assert ("contact", "stop") not in world.responses()
    assert "red_1" not in world.last.fleet.names
    world.run(31.0)
    assert ("contact", "stop") in world.responses("red_1")


def test_a_full_disk_is_answered_as_declared_until_it_is_not():
    world = pair().run(0.5)
    world.sink.full = True
    world.run(0.5)
    world.sink.full = False
    world.run(0.2)
    assert ("log", "hold_station") in {(a.condition, a.response) for a in world.sink.ticks[-2].actions}
    assert "free some" in next(a.text for a in world.sink.ticks[-2].actions if a.condition == "log")
    assert ("log", "hold_station") not in world.responses()


def test_stop_all_stops_all_through_the_shield_and_a_second_one_past_it_whoever_has_the_boat():
    world = pair().run(1.0)
    links = list(world.links.values())
    world.operator.stop_all("key")
    world.run(2.0)
    assert all(entry[2] == 0.0 for link in links for entry in link.sent[-10:])
    assert not any(link.stops for link in links)
    assert ("stop_all", "stop") in world.responses("all")
    links[0].changed = GIVEN_BACK
    world.operator.stop_all("key")
    world.run(0.3)
    assert [link.stops for link in links] == [3, 3]
    world.operator.resume()
    world.run(0.3)
    assert links[1].sent[-1][2] > 0.0


class Broken:
    """A shield that raises."""

    def __init__(self, error):
        self.error = error
        self.resets = 0

    def reset(self):
        self.resets += 1

    def decide(self, *_):
        raise self.error


@pytest.mark.parametrize("error", [ValueError("wrong"), MemoryError("no memory")])
def test_whatever_breaks_in_the_decision_all_are_told_to_stop_and_the_loop_goes_on(error):
    shield = Broken(error)
    world = pair(shield=shield).run(1.0)
    assert len(world.sink.ticks) == 10
    assert [link.stops for link in world.links.values()] == [10, 10]
    assert shield.resets == 10
    assert any(action.condition == "decision" and type(error).__name__ in action.text for action in world.last.actions)
    assert world.last.decisions is None


def test_a_broken_turn_and_the_end_stop_all_boats_but_those_somebody_took():
    world = pair()
    taken, ours = world.links["blue_1"], world.links["blue_2"]
    taken.changed = GIVEN_BACK
    world.run(0.5)
    ours.read = lambda: 1 / 0
    world.run(0.5)
    assert (taken.stops, ours.stops) == (0, 5)
    world.loop.run(0.0)
    assert taken.stops == 0
    assert ours.stops > 5


def test_a_sink_that_breaks_stops_nobody():
    world = pair()
    world.sink.take = lambda tick: 1 / 0
    world.run(1.0)
    assert len(world.links["blue_1"].sent) == 10


def test_no_decision_no_command_before_the_first_fix():
    world = pair()
    for link in world.links.values():
        link.changed = {"position_m": (math.nan, math.nan), "position_age_s": math.inf}
    world.run(0.3)
    assert world.last.fleet is None
    assert [link.stops for link in world.links.values()] == [3, 3]
    assert all(not link.sent for link in world.links.values())


def test_a_wall_clock_that_steps_by_an_hour_changes_nothing(monkeypatch):
    plain, stepped, wall = pair().run(6.0), pair().run(2.0), time.time
    for hours in (1.0, -1.0):
        monkeypatch.setattr(time, "time", lambda hours=hours: wall() + 3600.0 * hours)
        stepped.run(2.0)
    for before, after in zip(plain.sink.ticks, stepped.sink.ticks, strict=True):
        np.testing.assert_array_equal(before.decisions.filtered.values, after.decisions.filtered.values)
        assert before.actions == after.actions


def test_a_boat_outside_the_geofence_is_steered_back():
    world = World(fleet_of(blue=1, red=0), [(20.0, 62.0, 0.0, 0.0)], straight(NORTH)).run(1.0)
    assert ("geofence", "return") in world.responses("blue_1")
    world.run(40.0)
    assert world.fleet.geofence.holds(*world.links["blue_1"].row[:2])


def lined(start, more="", **settings):
    """A boat near a hard line 5 m outside the geofence, told to go north."""
    text = fleet_text(blue=1, red=0, more=more).replace("geofence: {", "geofence: {beyond_m: 5.0, then: stop, ")
    return World(parse_fleet(text), [start], straight(NORTH), **settings)


def test_a_boat_beyond_its_hard_line_is_stopped_by_its_link_at_once_and_handed_over_until_it_is_taken_back():
    world = lined((40.0, 64.0, 0.0, 0.0)).run(0.5)
    link = world.links["blue_1"]
    assert link.stops == 0, "within the hard line it is steered"
    assert any("4.0 m outside the geofence" in a.text for a in world.last.actions)
    link.row[1], link._past = 66.0, []
    world.run(3.5)
    assert link.stops > 0
    first = next(tick for tick in world.sink.ticks if any(a.condition == "hard_line" for a in tick.actions))
    assert "beyond the hard line: stopped by its link, handed over" in first.actions[-1].text
    stops, sent = link.stops, len(link.sent)
    link.row[1] = 50.0  # somebody tows it in: it lies there until it is taken back
    world.run(3.0)
    assert (link.stops, len(link.sent)) == (stops + 30, sent)
    assert any("take it back" in a.text for a in world.last.actions)
    world.operator.take_back("blue_1")
    world.run(0.5)
    assert len(link.sent) > sent


def test_a_boat_that_is_beyond_its_hard_line_once_a_command_works_is_handed_over_in_that_turn():
    world = lined((40.0, 64.6, 0.0, 2.0), more="shield: {delay_s: 0.3}").run(0.2)
    first, second = world.sink.ticks[:2]
    assert first.decisions.outside_m[0] < 5.0, "the shield runs it on by the delay"
    assert [a.condition for a in first.actions if a.response == "stop"] == ["hard_line"]
    assert any(a.condition == "hard_line" and "take it back" in a.text for a in second.actions)


def test_a_boat_that_can_only_stop_before_a_shore_is_stopped_by_its_link_and_goes_on_by_itself():
    shore = Surroundings(polygons=[((-30.0, 20.0), (110.0, 20.0), (110.0, 30.0), (-30.0, 30.0))])
    world = lined((40.0, 5.0, 0.0, 2.0), surroundings=shore).run(25.0)
    assert world.links["blue_1"].row[1] < 20.0
    assert not world.loop.failsafe.handed_over


@settings(max_examples=100, derandomize=True)
@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=40))
def test_turns_keep_to_the_grid_and_are_never_made_up(durations):
    overruns, due, now = Overruns(0.1), 5.0, 5.0
    for duration in durations:
        now = max(now, due) + duration
        later = overruns.next_due(due, now)
        assert now - 1e-9 <= later <= now + 0.1 + 1e-9
        assert (later - 5.0) / 0.1 == pytest.approx(round((later - 5.0) / 0.1), abs=1e-6)
        due = later
    assert overruns.turns == len(durations)
    assert (overruns.missed > 0) == any(duration > 0.1 for duration in durations)


def lone():
    return World(fleet_of(blue=1, red=0), [(0.0, 0.0, 0.0, 0.0)], straight(0.0, 0.0))


def test_the_loop_runs_at_its_rate_and_ends_when_told():
    world = lone()
    assert world.loop.run(3.0) == "ran for 3 s"
    due = np.array([tick.due_s for tick in world.sink.ticks])
    assert np.diff(due[:30]) == pytest.approx(np.full(29, 0.1))
    assert world.links["blue_1"].stops == 1
    world.operator.end("q")
    assert world.loop.run() == "q"


def test_a_loop_that_breaks_leaves_boats_told_to_stop():
    world = lone()

    def broken(time_s):
        raise KeyboardInterrupt

    world.clock.sleep_until = broken
    with pytest.raises(KeyboardInterrupt):
        world.loop.run()
    assert world.links["blue_1"].stops == 1


class _Nothing(list):
    def append(self, item):
        pass


def test_nothing_grows_with_time():
    """Memory stays what it was; an hour at 10 Hz is measured by the study of the deploy tests."""
    world, timing = duel(), Timing()
    world.loop.parts.sinks[0].take = timing.take
    world.links["blue_1"].sent = _Nothing()
    world.run(20.0)
    gc.collect()
    tracemalloc.start()
    try:
        world.run(5.0)
        gc.collect()
        before, _ = tracemalloc.get_traced_memory()
        world.run(20.0)
        gc.collect()
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert after - before < 150_000, "a tick kept each turn would be 2 MB; the interpreter's own free lists are not"
    assert set(timing.figures().values()) - {timing.figures()["decide_p99_s"]} == {0.0}, "this clock stands meanwhile"
