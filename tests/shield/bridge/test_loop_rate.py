"""Keeping the rate: due times on a grid, missed ones left out, boats at rest at the end, nothing that grows."""

import gc
import math
import tracemalloc

import numpy as np
import pytest
from bridge_fakes import World, fleet_of, straight
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield.bridge.control_loop import Overruns, Timing
from steerclear.shield.platforms import layout as L


@settings(max_examples=100, derandomize=True)
@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=40))
def test_turns_keep_to_the_grid_and_are_never_made_up(durations):
    overruns, due, now = Overruns(0.1), 5.0, 5.0
    for duration in durations:
        now = max(now, due) + duration
        later = overruns.next_due(due, now)
        assert later >= now - 1e-9
        assert later <= now + 0.1 + 1e-9
        assert (later - 5.0) / 0.1 == pytest.approx(round((later - 5.0) / 0.1), abs=1e-6)
        due = later
    assert overruns.turns == len(durations)
    assert (overruns.missed > 0) == any(duration > 0.1 for duration in durations)


def test_the_loop_runs_at_its_rate_and_ends_when_told():
    world = World(fleet_of(blue=1, red=0), [(0.0, 0.0, 0.0, 0.0)], straight(0.0, 0.0))
    assert world.loop.run(3.0) == "ran for 3 s"
    due = np.array([tick.due_s for tick in world.sink.ticks])
    assert np.diff(due[:30]) == pytest.approx(np.full(29, 0.1))
    assert world.links["blue_1"].stops == 1
    world.operator.end("q")
    assert world.loop.run() == "q"


def test_at_the_end_boats_are_brought_to_rest_behind_the_shield():
    starts = [(20.0, 0.0, 0.0, 2.0), (20.3, 14.0, 180.0, 2.0)]
    world = World(fleet_of(blue=2, red=0), starts, lambda s: np.array([[2.0, 0.0], [2.0, math.pi]]))
    moved = world.clock.sleep_until

    def move(time_s):
        while world.clock.now_s() < time_s - 1e-9:
            for link in world.links.values():
                link.advance(0.1)
            world.closest_m = min(world.closest_m, world.distance_m())
            moved(min(time_s, world.clock.now_s() + 0.1))

    world.clock.sleep_until = move
    world.loop.run(1.0)
    assert all(abs(link.row[L.SPEED]) < 0.5 for link in world.links.values())
    assert world.closest_m >= 2.5
    assert ("end", "stop") in world.responses("all")


def test_a_loop_that_breaks_leaves_boats_told_to_stop():
    world = World(fleet_of(blue=1, red=0), [(0.0, 0.0, 0.0, 0.0)], straight(0.0, 0.0))

    def broken(time_s):
        raise KeyboardInterrupt

    world.clock.sleep_until = broken
    with pytest.raises(KeyboardInterrupt):
        world.loop.run()
    assert world.links["blue_1"].stops == 1


def test_nothing_grows_with_time():
    """Memory stays what it was; an hour at 10 Hz is measured by the study of the deploy tests."""
    world = World(
        fleet_of(blue=2, red=1),
        [(20.0, 0.0, 0.0, 2.0), (40.0, 20.0, 180.0, 2.0)],
        lambda s: np.array([[1.0, 0.01 * s.number], [1.0, 2.0], [0.0, 0.0]]),
        others=[("red_1", 60.0, 20.0, 90.0, 0.0)],
    )
    timing = Timing()
    world.loop.parts.sinks[0].take = timing.take
    for link in world.links.values():
        link.sent = _Nothing()
    world.run(30.0)
    gc.collect()
    tracemalloc.start()
    try:
        world.run(10.0)
        gc.collect()
        before, _ = tracemalloc.get_traced_memory()
        world.run(60.0)
        gc.collect()
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert after - before < 150_000, "a tick kept each turn would be 6 MB; the interpreter's own free lists are not"
    assert timing.figures()["read_to_sent_p99_s"] >= 0.0


class _Nothing(list):
    def append(self, item):
        pass
