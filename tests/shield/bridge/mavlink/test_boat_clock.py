"""Time since boot to our time: late is late, however fresh it looks."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield.bridge.mavlink.telemetry import BELIEVED_AFTER, BoatClock

OFFSET = 1000.0


def heard(clock, boot_s, delay_s):
    """Age on arrival of what was true at ``boot_s`` and took ``delay_s``."""
    received = boot_s + OFFSET + delay_s
    true = clock.hear(boot_s, received)
    return None if true is None else received - true


def warmed(delay_s=0.02):
    clock = BoatClock()
    for i in range(40):
        heard(clock, 10.0 + 0.05 * i, delay_s + 0.001 * (i % 3))
    return clock, 12.0


def test_a_message_that_took_a_second_longer_is_a_second_old():
    clock, now = warmed()
    assert heard(clock, now, 1.02) == pytest.approx(1.0, abs=0.01)
    assert heard(clock, now + 0.05, 0.02) == pytest.approx(0.0, abs=0.01)


def test_a_delay_there_from_the_start_is_found_by_the_round_trip():
    clock, now = warmed(delay_s=0.4)
    assert heard(clock, now, 0.4) == pytest.approx(0.0, abs=0.01)
    clock.sync(now, now + OFFSET - 0.4, now + OFFSET + 0.4)
    assert heard(clock, now + 0.05, 0.4) == pytest.approx(0.4, abs=0.01)
    assert clock.shortest_delay_s == pytest.approx(0.4, abs=0.01)
    assert clock.round_trip_s == pytest.approx(0.8)


@settings(deadline=None)
@given(st.lists(st.floats(0.0, 0.5), min_size=1, max_size=60))
def test_nothing_is_ever_younger_than_it_is_compared_with_the_quickest(delays):
    clock = BoatClock()
    for i, delay in enumerate(delays):
        age = heard(clock, 10.0 + 5.0 * i, delay)
        quickest = min(delays[: i + 1])
        assert age is not None
        assert age == pytest.approx(delay - quickest, abs=1e-4 * 5.0 * (i + 1) + 1e-6)


def test_a_drifting_clock_is_followed():
    clock = BoatClock()
    for i in range(20_000):
        true = 0.1 * i
        received = true * (1.0 + 5e-5) + OFFSET
        believed = clock.hear(true, received)
        assert received - believed < 0.02


def test_one_message_from_the_future_changes_nothing():
    clock, now = warmed()
    assert clock.hear(now + 3600.0, now + OFFSET) is None
    assert heard(clock, now + 0.05, 0.02) == pytest.approx(0.0, abs=0.01)
    assert clock.starts == 1


def test_a_restart_is_believed_when_enough_agree():
    clock, now = warmed()
    received = [now + OFFSET + 30.0 + 0.05 * i for i in range(BELIEVED_AFTER)]
    answers = [clock.hear(1.0 + 0.05 * i, at) for i, at in enumerate(received)]
    assert answers[:-1] == [None] * (BELIEVED_AFTER - 1)
    assert answers[-1] == pytest.approx(received[-1], abs=0.01)
    assert clock.starts == 2


def test_a_clock_that_lost_time_is_noticed_by_the_round_trip():
    clock, now = warmed()
    clock.sync(now, now + OFFSET - 0.01, now + OFFSET + 0.01)
    received = now + 80.0 + OFFSET
    assert received - clock.hear(now, received) == pytest.approx(80.0, abs=0.1), "until then it looks late"
    clock.sync(now, received - 0.001, received)
    assert clock.starts == 2
    assert received - clock.hear(now + 0.01, received + 0.01) < 0.1


def test_answers_from_another_clock_or_nonsense_are_left():
    clock, now = warmed()
    clock.sync(now + 1e6, now + OFFSET, now + OFFSET + 0.01)
    clock.sync(math.nan, now + OFFSET, now + OFFSET + 0.01)
    clock.sync(now, now + OFFSET + 1.0, now + OFFSET)
    clock.sync(now, now + OFFSET - 60.0, now + OFFSET)
    assert clock.starts == 1
    assert math.isnan(clock.round_trip_s)
    assert heard(clock, now, 0.02) == pytest.approx(0.0, abs=0.01)
