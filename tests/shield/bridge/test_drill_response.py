"""The drill: boats drive a short way inside the fence, and what they did is held against their platform."""

import math
from collections import deque
from dataclasses import replace

import numpy as np
import pytest
from steerclear.shield.bridge.drill import (
    EACH_S,
    Drill,
    DrillSample,
    Missed,
    check_course,
    check_model,
    check_response,
    counted_words,
    drill_checks,
)
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.messages import BoatReading, Sent, Snapshot, Tick
from steerclear.shield.bridge.model_error import ModelErrorMonitor
from steerclear.shield.bridge.preflight_checks import run_checks
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.proving import reference_models

DT_S = 0.1
HERON = get_platform("heron")
FLEET = parse_fleet("""
version: 1
field: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, size_m: [80, 40]}
geofence: {xmin_m: -5, ymin_m: -5, xmax_m: 85, ymax_m: 45}
team: blue
boats:
  - {name: blue_1, agent: agent_0, platform: heron, link: {kind: mavlink, address: "tcp:127.0.0.1:5760", system_id: 1}}
  - {name: blue_2, agent: agent_1, platform: heron, link: {kind: mavlink, address: "tcp:127.0.0.1:5761", system_id: 2}}
  - {name: red_1, agent: agent_2, platform: heron, contact: feed}
  - {name: red_2, agent: agent_3, platform: heron, contact: feed}
feed: {listen: "127.0.0.1:14700"}
""")


class Water:
    """Boats of the file on their platforms, or on others than the file says, driven by a drill."""

    def __init__(self, platform=HERON, delay_steps=0, noise=0.0, reverse=False, compass_deg=0.0, seed=1):
        self.params = platform.pack()
        self.rows = [fresh_state(5.0 + 20.0 * i, 5.0 + 8.0 * i, 40.0 * i, 0.0) for i in range(4)]
        self.waiting = deque([None] * delay_steps)
        self.random, self.noise, self.reverse, self.compass = np.random.default_rng(seed), noise, reverse, compass_deg
        self.trails = [[] for _ in self.rows]

    def seen(self):
        return np.array([[row[L.X], row[L.Y], row[L.HEADING], row[L.SPEED]] for row in self.rows])

    def reading(self, i, now):
        x, y, heading, speed = self.seen()[i] + self.noise * self.random.standard_normal(4)
        return BoatReading(
            FLEET.names[i], now, (x, y), 0.0, math.radians(heading + self.compass) % (2 * math.pi), 0.0, speed,
            math.radians(heading) % (2 * math.pi), 0.0, 0.0, 0.0, "GUIDED", True, "", 0.1,
        )  # fmt: skip

    def step(self, values):
        self.waiting.append(values)
        values = self.waiting.popleft()
        for i, row in enumerate(self.rows):
            if values is not None:
                error = (math.degrees(values[i][1]) - row[L.HEADING] + 180.0) % 360.0 - 180.0
                step_boat(self.params, row, values[i][0], -error if self.reverse else error, DT_S)
            self.trails[i].append((row[L.X], row[L.Y]))


def driven(boats=("blue_1",), bend=None, **water):
    """A drill that has been driven, and the water it was driven on; ``bend(s into it, values)`` stands for a shield."""
    drill, water = Drill(FLEET, boats), Water(**water)
    foresight, water.missed = ModelErrorMonitor(FLEET, boats), Missed(drill)
    water.missed.model_error = foresight
    for k in range(round(drill.seconds / DT_S) + 5):
        now = 50.0 + DT_S * k
        readings = {name: water.reading(i, now) for i, name in enumerate(FLEET.names[:2])}
        foresight.update({name: water.rows[i].copy() for i, name in enumerate(boats)}, readings)
        drill.offer(Snapshot(k, now, water.seen()))
        values = drill.latest().commands.values
        values = values if bend is None else bend(DT_S * k, values.copy())
        sent = {
            name: Sent(name, now, values[i][1], values[i][0], "fake", True) for i, name in enumerate(FLEET.names[:2])
        }
        foresight.sent(sent)
        tick = Tick(k, now, now, now, readings, (), None, None, None, None, False, sent, 0.0)
        drill.take(tick)
        water.missed.take(tick)
        water.step(values)
    return drill, water


@pytest.fixture(scope="module")
def good():
    return driven(("blue_1", "blue_2"), noise=0.01)


def test_boats_that_are_what_the_file_says_pass(good):
    results = run_checks(drill_checks(good[0], good[1].missed, FLEET))
    assert [r.name for r in results] == [
        f"{kind}:{boat}" for boat in ("blue_1", "blue_2") for kind in ("course", "response", "model")
    ]
    assert all(r.passed for r in results), [r.text for r in results]


def test_boats_take_turns_and_stay_inside_the_fence(good):
    drill, water = good
    assert drill.seconds == 2 * EACH_S
    for name in ("blue_1", "blue_2"):
        assert len(drill.samples[name]) == pytest.approx(EACH_S / DT_S, abs=2)
    first, second, *others = (np.array(trail) for trail in water.trails)
    half = round(EACH_S / DT_S)
    assert np.ptp(second[: half - 10], axis=0).max() < 0.5, "the second lies still meanwhile"
    assert np.ptp(first[half + 40 :], axis=0).max() < 3.0, "and the first afterwards"
    assert all(np.ptp(trail, axis=0).max() < 0.5 for trail in others)
    xmin, ymin, xmax, ymax = FLEET.geofence.box
    for trail in (first, second):
        assert (trail > (xmin, ymin)).all()
        assert (trail < (xmax, ymax)).all()
        assert np.ptp(trail, axis=0).max() > 5.0


def given_way(begin_s, end_s, turn_deg=160.0):
    """Somebody comes near for a while: the shield turns the first boat away."""

    def bend(into_s, values):
        if begin_s <= into_s < end_s:
            values[0] = 1.2, (values[0][1] + math.radians(turn_deg)) % (2 * math.pi)
        return values

    return bend


def response_of(**water):
    drill, _ = driven(**water)
    return check_response("blue_1", drill.samples["blue_1"], HERON, DT_S)


@pytest.mark.parametrize("steps", [0, 2, 4])
def test_the_delay_is_measured(steps):
    result = response_of(delay_steps=steps, noise=0.01)
    assert result.passed, result.text
    assert result.figures["delay_s"] == pytest.approx(steps * DT_S, abs=0.06)
    assert counted_words(result.figures["delay_s"], DT_S) in result.text


@pytest.mark.parametrize(
    ("water", "words"),
    [
        ({"delay_steps": 7}, "commands take 0.7 s to work"),
        ({"platform": replace(HERON, name="lame", turn_gain=HERON.turn_gain * 0.25)}, "it turns slower than heron"),
        ({"platform": replace(HERON, name="slow", max_speed_mps=0.6, speed_factor=0.0)}, "its speed is"),
        ({"reverse": True}, "turns away from the heading it is told"),
        ({"reverse": True, "bend": given_way(5.0, 7.0)}, "repeat it on clear water before you believe it"),
        ({"bend": given_way(0.0, 20.0)}, "the drill was disturbed"),
        ({"bend": given_way(3.0, 13.0)}, "too little is left to judge; clear the water, then run again"),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else "",
)
def test_a_boat_that_is_not_what_the_file_says_or_cannot_be_judged_is_told(water, words):
    result = response_of(**water)
    assert not result.passed
    assert words in result.text


@pytest.mark.parametrize("when_s", [(4.0, 6.0), (12.0, 14.9), (13.5, 19.9), (18.0, 20.0)])
@pytest.mark.parametrize("turn_deg", [160.0, -160.0])
def test_a_boat_that_gave_way_to_another_is_not_taken_to_steer_the_wrong_way_round(when_s, turn_deg):
    result = response_of(bend=given_way(*when_s, turn_deg), noise=0.01)
    assert result.passed, result.text
    assert result.figures["changed_share"] == pytest.approx((when_s[1] - when_s[0]) / EACH_S, abs=0.02)
    assert "% of its commands changed by the shield" in result.text


def test_a_link_that_caps_the_speed_is_no_disturbance():
    drill, _ = driven()
    samples = [replace(s, speed_mps=min(s.speed_mps, 1.0)) for s in drill.samples["blue_1"]]
    assert not any(sample.changed for sample in samples)


def test_a_compass_that_is_off_is_found():
    drill, _ = driven(compass_deg=25.0)
    result = check_course("blue_1", drill.samples["blue_1"])
    assert not result.passed
    assert "+25 deg off its course; calibrate its compass" in result.text


def test_a_boat_that_does_not_move_passes_nothing():
    with reference_models():
        aground = replace(HERON, name="aground", max_speed_mps=0.01)
    drill, water = driven(platform=aground)
    for check in drill_checks(drill, water.missed, FLEET):
        assert not check.run().passed


def model_of(boat, missed):
    return check_model(boat, missed.errors_m[boat], HERON, FLEET.limits.model.outside_m, DT_S)


def test_a_boat_far_from_where_it_is_foreseen_is_to_be_fitted_first():
    """As the loop would slow it: the words name the trial and the fit, the figures what is missed."""
    _, off = driven(reverse=True)
    result = model_of("blue_1", off.missed)
    assert not result.passed
    assert "steerclear sea-trial" in result.text
    assert "steerclear fit" in result.text
    assert result.figures["missed_2s_m"] > 1.5
    _, same = driven()
    assert model_of("blue_1", same.missed).figures["missed_2s_m"] < 0.05


def test_what_is_missed_counts_in_the_boats_own_turn_alone():
    """In the other's turn it lies still, where any model foresees it: that must not thin its errors out."""
    _, alone = driven(("blue_1",), reverse=True)
    _, both = driven(("blue_1", "blue_2"), reverse=True)
    figures = [model_of("blue_1", water.missed).figures["missed_2s_m"] for water in (alone, both)]
    assert figures[1] == pytest.approx(figures[0], rel=0.05)
    assert not model_of("blue_2", both.missed).passed


@pytest.mark.parametrize("seen", [0, 30])
def test_a_boat_that_was_hardly_seen_is_not_passed(seen):
    result = check_model("blue_1", [(0.0, 0.0, 0.0)] * seen + [(0.0, math.nan, math.nan)] * 200, HERON, 1.5, DT_S)
    assert not result.passed
    assert f"for {seen * DT_S:.1f} s of its drill, 5 s are needed" in result.text


def test_going_astern_is_found():
    drill, _ = driven()
    samples = [replace(s, reading=replace(s.reading, speed_mps=-s.reading.speed_mps)) for s in drill.samples["blue_1"]]
    assert "goes astern" in check_response("blue_1", samples, HERON, DT_S).text


def test_missing_and_impossible_samples_do_not_pass():
    nothing = BoatReading("blue_1", 0.0)
    assert not check_response("blue_1", [], HERON, DT_S).passed
    assert not check_course("blue_1", []).passed
    unknown = [DrillSample(0.1 * i, nothing, 1.0, 1.0) for i in range(200)]
    assert not check_response("blue_1", unknown, HERON, DT_S).passed
    assert not check_course("blue_1", unknown).passed
    drill, _ = driven()
    unsent = [replace(s, heading_rad=math.nan) for s in drill.samples["blue_1"]]
    assert not check_response("blue_1", unsent, HERON, DT_S).passed
