import time

import pytest
from steerclear.shield.bridge.clock import ManualClock, MonotonicClock
from steerclear.shield.exceptions import ConfigError


def test_a_fast_clock_runs_its_factor_faster():
    clock = MonotonicClock(50.0)
    began, machine = clock.now_s(), time.monotonic()
    clock.sleep_until(began + 5.0)
    assert clock.now_s() >= began + 5.0
    assert time.monotonic() - machine >= 0.1 - 1e-6


@pytest.mark.skipif(not hasattr(time, "CLOCK_BOOTTIME"), reason="this system's monotonic clock is the only one")
def test_time_that_the_computer_was_asleep_counts(monkeypatch):
    clock, gettime = MonotonicClock(), time.clock_gettime
    before_s = clock.now_s()
    asleep_s = {time.CLOCK_BOOTTIME: 60.0}  # time.monotonic() stands still meanwhile
    monkeypatch.setattr(time, "clock_gettime", lambda which: gettime(which) + asleep_s.get(which, 0.0))
    assert 60.0 <= clock.now_s() - before_s < 70.0


def test_sleeping_until_the_past_returns_at_once_and_a_manual_clock_never_goes_back():
    clock = ManualClock(3.0)
    clock.sleep_until(1.0)
    assert clock.now_s() == 3.0
    clock.sleep_until(4.5)
    assert clock.now_s() == 4.5


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf")])
def test_a_clock_that_stands_or_runs_back_is_refused(speed):
    with pytest.raises(ConfigError, match="> 0"):
        MonotonicClock(speed)
