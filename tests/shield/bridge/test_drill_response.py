"""The drill: boats drive a short way inside the fence, and what they did is held against their platform."""

import math
import re
from collections import deque
from dataclasses import replace

import numpy as np
import pytest
from bridge_fakes import World, fleet_text
from steerclear.env.config import GameConfig
from steerclear.experiments.sim_boats.game import start_places
from steerclear.experiments.sim_boats.settings import SimBoat
from steerclear.shield.bridge.drill import (
    EACH_S,
    Drill,
    DrillSample,
    Driven,
    check_course,
    check_model,
    check_response,
    counted_words,
    drill_checks,
)
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.messages import BoatReading, Sent, Snapshot, Tick
from steerclear.shield.bridge.model_error import ModelErrorMonitor
from steerclear.shield.bridge.preflight_checks import CheckResult, run_checks
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.proving import reference_models

DT_S = 0.1
HERON = get_platform("heron")


def fleet_in(length_m, width_m, **settings):
    """A fleet whose geofence lies 5 m around a field of that size."""
    fence = f"geofence: {{xmin_m: -5, ymin_m: -5, xmax_m: {length_m + 5}, ymax_m: {width_m + 5}}}"
    return parse_fleet(re.sub("geofence: .*", fence, fleet_text(**settings)))


FLEET = fleet_in(80, 40, blue=2, red=2)


class Water:
    """Boats of the file on their platforms, or on others than the file says, driven by a drill."""

    def __init__(self, platform=HERON, delay_steps=0, noise=0.0, reverse=False, compass_deg=0.0):
        self.params = platform.pack()
        self.rows = [fresh_state(5.0 + 20.0 * i, 5.0 + 8.0 * i, 40.0 * i, 0.0) for i in range(4)]
        self.waiting = deque([None] * delay_steps)
        self.random, self.noise, self.reverse, self.compass = np.random.default_rng(1), noise, reverse, compass_deg
        self.trails = [[] for _ in self.rows]

    def seen(self):
        return np.array(self.rows)[:, [L.X, L.Y, L.HEADING, L.SPEED]]

    def reading(self, i, now):
        x, y, heading, speed = self.seen()[i] + self.noise * self.random.standard_normal(4)
        course = math.radians(heading) % (2 * math.pi)
        pointing = math.radians(heading + self.compass) % (2 * math.pi)
        return BoatReading(
            FLEET.names[i], now, (x, y), 0.0, pointing, 0.0, speed, course, 0.0, 0.0, 0.0, "GUIDED", True, "", 0.1
        )

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
    monitor = drill.model_error = ModelErrorMonitor(FLEET, boats)
    for k in range(round(drill.seconds / DT_S) + 5):
        now = 50.0 + DT_S * k
        readings = {name: water.reading(i, now) for i, name in enumerate(FLEET.names[:2])}
        monitor.update({name: water.rows[i].copy() for i, name in enumerate(boats)}, readings)
        drill.offer(Snapshot(k, now, water.seen()))
        values = drill.latest().commands.values
        values = values if bend is None else bend(DT_S * k, values.copy())
        sent = {
            name: Sent(name, now, values[i][1], values[i][0], "fake", True) for i, name in enumerate(FLEET.names[:2])
        }
        monitor.sent(sent)
        tick = Tick(k, now, now, now, readings, (), None, None, None, None, False, sent, 0.0)
        drill.take(tick)
        water.step(values)
    return drill, water


@pytest.fixture(scope="module")
def good():
    return driven(("blue_1", "blue_2"), noise=0.01)


@pytest.fixture(scope="module")
def samples():
    return driven()[0].samples["blue_1"]


def test_boats_that_are_what_the_file_says_pass(good):
    results = run_checks(drill_checks(good[0], FLEET))
    kinds = ("course", "response", "model")
    assert [r.name for r in results] == [f"{kind}:{boat}" for boat in ("blue_1", "blue_2") for kind in kinds]
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
    for trail in (first, second):
        assert all(FLEET.geofence.holds(x, y) for x, y in trail)
        assert np.ptp(trail, axis=0).max() > 5.0


@pytest.mark.parametrize(("platform", "preset"), [("heron", "aamas2024"), ("ardurover_boat", "mctf2025")])
def test_boats_at_the_games_start_line_can_be_drilled_there(platform, preset):
    """None is led where another one disturbs its drill."""
    game = GameConfig.preset(preset, team_size=3)
    fleet = fleet_in(*game.env_bounds_m, blue=3, red=3, platform=platform)
    boats = [SimBoat(name, platform, fleet.team_of[name]) for name in fleet.names]
    starts = [(*place, 0.0) for place in start_places(boats, game, None)]
    drill = Drill(fleet, fleet.names[:3])

    def rule(snapshot):
        drill.offer(snapshot)
        return drill.latest().commands.values

    others = [(name, *start) for name, start in zip(fleet.names[3:], starts[3:], strict=True)]
    world = World(fleet, starts[:3], rule, others=others)
    for name, *start in others:
        world.contacts.commands[name] = (start[2], 0.0)
    world.run(0.1).run(3 * EACH_S, each=lambda world: drill.take(world.last))
    for boat, driven_by in drill.samples.items():
        assert sum(sample.changed for sample in driven_by) / len(driven_by) <= 0.05
        assert judged(check_response, driven_by, fleet.platform_of[boat], fleet.dt_s).passed
    assert world.closest_m > 2.5


def judged(check, samples, platform=HERON, dt_s=DT_S):
    """What a check says of a boat's own turn."""
    return CheckResult(check.__name__, *check(Driven(samples, platform, dt_s, FLEET.limits.model.outside_m)))


def given_way(begin_s, end_s, turn_deg=160.0):
    """Somebody comes near for a while: the shield turns the first boat away."""

    def bend(into_s, values):
        if begin_s <= into_s < end_s:
            values[0] = 1.2, (values[0][1] + math.radians(turn_deg)) % (2 * math.pi)
        return values

    return bend


def response_of(**water):
    return judged(check_response, driven(**water)[0].samples["blue_1"])


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


@pytest.mark.parametrize(
    ("when_s", "turn_deg"), [((4.0, 6.0), 160.0), ((12.0, 14.9), -160.0), ((13.5, 19.9), 160.0), ((18.0, 20.0), -160.0)]
)
def test_a_boat_that_gave_way_to_another_is_not_taken_to_steer_the_wrong_way_round(when_s, turn_deg):
    result = response_of(bend=given_way(*when_s, turn_deg), noise=0.01)
    assert result.passed, result.text
    assert result.figures["changed_share"] == pytest.approx((when_s[1] - when_s[0]) / EACH_S, abs=0.02)
    assert "% of its commands changed by the shield" in result.text


def test_a_compass_that_is_off_is_found():
    result = judged(check_course, driven(compass_deg=25.0)[0].samples["blue_1"])
    assert not result.passed
    assert "+25 deg off its course; calibrate its compass" in result.text


def test_a_boat_that_does_not_move_passes_nothing():
    with reference_models():
        aground = replace(HERON, name="aground", max_speed_mps=0.01)
    drill, _ = driven(platform=aground)
    for check in drill_checks(drill, FLEET):
        assert not check.run().passed


def model_of(boat, drill):
    return judged(check_model, drill.samples[boat])


def test_a_boat_far_from_where_it_is_foreseen_is_to_be_fitted_first_by_what_is_missed_in_its_own_turn(good):
    """As the loop would slow it. In the other's turn it lies still, which must not thin its errors out."""
    alone, _ = driven(("blue_1",), reverse=True)
    both, _ = driven(("blue_1", "blue_2"), reverse=True)
    results = [model_of("blue_1", drill) for drill in (alone, both)]
    for result in (*results, model_of("blue_2", both)):
        assert not result.passed
        assert "steerclear sea-trial" in result.text
        assert "steerclear fit" in result.text
    figures = [result.figures["missed_2s_m"] for result in results]
    assert figures[0] > 1.5
    assert figures[1] == pytest.approx(figures[0], rel=0.05)
    assert model_of("blue_1", good[0]).figures["missed_2s_m"] < 0.05


@pytest.mark.parametrize("seen", [0, 30])
def test_a_boat_that_was_hardly_seen_is_not_passed(seen, samples):
    missed_m = [(0.0, 0.0, 0.0)] * seen + [(0.0, math.nan, math.nan)] * 200
    result = judged(check_model, [replace(samples[0], missed_m=row) for row in missed_m])
    assert not result.passed
    assert f"for {seen * DT_S:.1f} s of its drill, 5 s are needed" in result.text


def test_going_astern_is_found(samples):
    astern = [replace(s, reading=replace(s.reading, speed_mps=-s.reading.speed_mps)) for s in samples]
    assert "goes astern" in judged(check_response, astern).text


def test_missing_and_impossible_samples_do_not_pass(samples):
    unknown = [DrillSample(0.1 * i, BoatReading("blue_1", 0.0), 1.0, 1.0) for i in range(200)]
    for missing in ([], unknown):
        assert not judged(check_response, missing).passed
        assert not judged(check_course, missing).passed
    assert not judged(check_response, [replace(s, heading_rad=math.nan) for s in samples]).passed
