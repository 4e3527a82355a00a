"""The delay from command to effect is measured while a boat is steered, and only when it can be."""

import math

import numpy as np
import pytest
from bridge_fakes import FakeLink
from steerclear.shield import ShieldConfig
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.latency import DelayMeter, Delays
from steerclear.shield.bridge.overruns import left_out
from steerclear.shield.platforms import get_platform

DT_S = 0.1


def measure(platform, delay_steps, noise_deg=0.0, steady=False, seconds=60.0, gaps=()):
    clock = ManualClock()
    link = FakeLink("blue_1", clock, platform, 0.0, 0.0, 0.0, 1.0)
    meter = DelayMeter(get_platform(platform), DT_S)
    queue, random = [(0.0, 1.0)] * delay_steps, np.random.default_rng(1)
    for k in range(round(seconds / DT_S)):
        reading = link.read()
        turned = math.radians(noise_deg) * random.normal()
        if k not in gaps:  # else the boat goes on with what it was told last
            heading = 0.0 if steady else math.radians(60.0) * ((k // 40) % 3)
            meter.update(type(reading)(**{**vars(reading), "heading_rad": reading.heading_rad + turned}))
            meter.sent(heading, 2.0)
        queue.append((math.degrees(heading), 2.0))
        link.command = queue.pop(0)
        link.advance(DT_S)
        clock.sleep_until(clock.now_s() + DT_S)
    return meter.delay_s


@pytest.mark.parametrize("platform", ["heron", "surveyor"])
@pytest.mark.parametrize("steps", [0, 1, 3, 5])
def test_the_delay_is_found(platform, steps):
    assert measure(platform, steps) == pytest.approx(steps * DT_S, abs=0.05)


def test_the_delay_is_found_through_noise():
    assert measure("heron", 2, noise_deg=0.5) == pytest.approx(0.2, abs=0.06)


def test_turns_that_were_left_out_make_no_delay():
    gaps = {k + i for k in range(30, 600, 80) for i in range(15)}  # every other turn of the boat falls into one
    assert measure("heron", 1, gaps=gaps) == pytest.approx(0.1, abs=0.05)


def test_a_loop_that_falls_behind_every_second_still_measures():
    assert measure("heron", 3, gaps=range(5, 600, 10)) == pytest.approx(0.3, abs=0.05)


@pytest.mark.parametrize(
    ("gap_s", "turns"),
    [(0.1, 0), (0.15, 0), (0.2, 1), (0.25, 1), (0.3, 2), (2.0, 19), (-1.0, 0), (-math.inf, 0), (math.nan, 0)],
)
def test_turns_left_out_are_told_from_late_ones(gap_s, turns):
    assert left_out(gap_s, DT_S) == turns


def test_a_boat_that_holds_its_course_tells_nothing():
    assert measure("heron", 2, steady=True) is None


def test_gaps_and_faults_start_anew_and_break_nothing():
    clock = ManualClock()
    link = FakeLink("blue_1", clock)
    meter = DelayMeter(get_platform("heron"), DT_S)
    for changed in ({}, {"heading_rad": math.nan}, {"position_age_s": 9.0}, {}, {"speed_mps": math.inf}, {}):
        link.changed = changed
        meter.update(link.read())
        meter.sent(math.nan, 0.0)
        clock.sleep_until(clock.now_s() + DT_S)
    assert meter.delay_s is None


def test_it_is_told_what_the_shield_counts_on(monkeypatch):
    """A delay of 0.03 s is a whole turn of the loop to the shield."""
    delays = Delays({}, ShieldConfig(dt_s=0.1, delay_s=0.03))
    monkeypatch.setattr(delays, "measured_s", lambda: {"blue_1": 0.4})
    assert "work after 0.4 s, the shield counts on 0.1 s" in delays.actions()[0].text
