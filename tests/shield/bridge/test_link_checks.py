"""Checks before a start: each passes on a good link, each fault is found, named, and comes with what to do."""

import math
from dataclasses import replace

import numpy as np
import pytest
from bridge_fakes import fleet_of, fleet_text
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.autopilot_parameters import ASKED, FENCE_ASKED
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.link_checks import (
    Watched,
    check_autopilot,
    check_clock,
    check_commanders,
    check_fence,
    check_latency,
    check_rates,
    check_spread,
    hard_line,
    link_checks,
    needed_m,
    stopping_way_m,
)
from steerclear.shield.bridge.mavlink.fence import FenceReader, FenceZone
from steerclear.shield.bridge.mavlink.vehicle import LinkHealth
from steerclear.shield.bridge.messages import BoatReading, Contact
from steerclear.shield.bridge.preflight_checks import (
    SITUATION,
    Check,
    CheckResult,
    check_situation,
    not_passed,
    run_check,
    run_checks,
    validate_accepted,
)
from steerclear.shield.bridge.tracker import Tracker
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import get_platform
from steerclear.shield.surroundings import Surroundings

HERON, HERONS = get_platform("heron"), fleet_of()
GOOD = LinkHealth(
    rates_hz={"GLOBAL_POSITION_INT": 20.0, "ATTITUDE": 20.0},
    missing="",
    round_trips_s=(0.03, 0.04, 0.05),
    shortest_delay_s=0.02,
    clock_starts=1,
    wall_ahead_s=0.2,
    fix_type=3,
    version=(4, 6, 0),
    parameters={"WP_SPEED": HERON.max_speed_mps, "FS_GCS_ENABLE": 0.0},
    signs=False,
    stations=frozenset(),
    other_commander_s=-math.inf,
    faults={},
)


def readings(count=100, *, spread_m=0.03, speed=0.0, age=0.05, heading_age=None, faults=None):
    random = np.random.default_rng(0)
    old = age if heading_age is None else heading_age
    return [
        BoatReading(
            "blue_1",
            float(i),
            position_m=tuple(10.0 + spread_m * random.standard_normal(2)),
            position_age_s=age,
            heading_rad=1.0,
            heading_age_s=old,
            speed_mps=speed,
            velocity_age_s=age,
            turn_rate_rads=0.0,
            turn_rate_age_s=old,
            faults=(faults or {}) if i == 3 else {},
        )
        for i in range(count)
    ]


def found(check, said=(), **changes):
    return CheckResult("", *check(Watched("blue_1", said, replace(GOOD, **changes), HERONS, 100.0)))


class FakeLink:
    def __init__(self, said):
        self._said, self.asked = iter(said), 0

    def read(self):
        return next(self._said)

    def learn(self, timeout_s):
        self.asked += 1

    def health(self):
        return GOOD


def test_a_good_link_passes_everything_and_is_watched_once_whatever_was_refused_before():
    before = [BoatReading("blue_1", 0.0, faults={"no_fix": 9})]
    clock, link = ManualClock(10.0), FakeLink([*before, *readings(1000)])
    results = run_checks(link_checks({"blue_1": link}, HERONS, clock, seconds=5.0))
    assert [r.name for r in results] == [
        f"{kind}:blue_1" for kind in ("rates", "latency", "clock", "spread", "autopilot", "commanders", "fence")
    ]
    assert all(r.passed for r in results), [r.text for r in results]
    assert clock.now_s() == pytest.approx(15.0), "one watch for all checks"
    assert link.asked == 1


def test_a_station_that_only_listens_is_named_and_passes():
    result = found(check_commanders, stations=frozenset({(252, 190)}))
    assert result.passed
    assert "another ground station listens (system 252 component 190)" in result.text


def test_a_link_that_breaks_while_watched_fails_its_checks_and_says_so():
    results = run_checks(link_checks({"blue_1": FakeLink(readings(3))}, HERONS, ManualClock(), 1.0))
    assert not any(r.passed for r in results)
    assert all("the check itself failed (" in r.text for r in results)


@pytest.mark.parametrize(
    ("check", "said", "changes", "words"),
    [
        (check_rates, readings(), {"missing": "ATTITUDE at 3.0 of 20 Hz"}, "ATTITUDE at 3.0 of 20 Hz; lower rate_hz"),
        (check_rates, readings(age=0.8), {}, "0.80 s old, more than 0.5 s"),
        (check_rates, readings(age=math.inf), {}, "wait for GPS"),
        (check_rates, readings(age=math.nan), {}, "check the radio"),
        (check_rates, readings(faults={"no_fix": 2, "duplicate": 9}), {}, "refused while watched: 2 no_fix;"),
        *((check_rates, readings(faults={k: 5}), {}, f"5 {k}") for k in ("fix_silent", "poor_fix", "no_estimate")),
        (check_rates, [], {}, "inf s old"),
        (check_rates, readings(age=7.6), {}, "telemetry was 7.60 s old"),
        (
            check_rates,
            readings(age=7.6, heading_age=0.05),
            {"fix_type": 1, "fix_fault": "GPS has no fix"},
            "no position yet (GPS has no fix)",
        ),
        (check_latency, [], {"round_trips_s": (0.05,) * 18 + (0.9,) * 4}, "0.90 s (95 of 100), more than 0.2 s"),
        (check_latency, [], {"round_trips_s": ()}, "answers no TIMESYNC"),
        (check_latency, [], {"round_trips_s": (math.nan,) * 3}, "take a faster radio"),
        (check_clock, [], {"clock_starts": 0}, "no time-stamped telemetry"),
        (check_clock, [], {"clock_starts": 2}, "restarted while connected; check its power"),
        (check_clock, [], {"signs": True, "wall_ahead_s": -90.0}, "-90 s from the boat's GPS time"),
        (check_spread, readings(spread_m=1.0), {}, "wait for a better fix"),
        (check_spread, readings(speed=1.0), {}, "moves at 1.0 m/s"),
        (check_spread, readings(age=1.0), {}, "no position to watch"),
        (check_spread, readings(spread_m=math.nan), {}, "no position to watch"),
        (check_spread, [], {}, "no position to watch"),
        (check_autopilot, [], {"fix_type": 1}, "GPS has no fix (fix type 1): wait for one"),
        (check_autopilot, [], {"fix_type": -1}, "does not say whether GPS has a fix"),
        (check_autopilot, [], {"fix_fault": "GPS fix is poor"}, "GPS fix is poor: wait for a good GPS fix"),
        (check_autopilot, [], {"parameters": {}, "version": None}, "WP_SPEED is not known"),
        (
            check_commanders,
            [],
            {"stations": frozenset({(252, 190), (255, 190)})},
            "has our id (system 255 component 190): give it another id than 255",
        ),
        (check_commanders, [], {"other_commander_s": 97.0}, "somebody else commanded it 3 s ago; end that program"),
        (
            check_commanders,
            [],
            {"other_commander_s": 97.0, "commander": "(system 252, component 190) sends SET_MODE"},
            "somebody else (system 252, component 190 sends SET_MODE) commanded it 3 s ago",
        ),
        (check_commanders, [], {"faults": {"bad_signature": 4}}, "refused 4 bad_signature: somebody sends in this"),
        (check_commanders, [], {"faults": {"second_sender": 1}}, "find them before you start"),
    ],
)
def test_each_fault_is_found_and_named(check, said, changes, words):
    result = found(check, said, **changes)
    assert not result.passed
    assert words in result.text


@pytest.mark.parametrize(
    ("check", "said", "changes"),
    [
        (check_rates, readings(faults={"duplicate": 4, "out_of_order": 2}), {}),
        (check_clock, [], {"wall_ahead_s": 3600.0}),
        (check_clock, [], {"signs": True, "wall_ahead_s": math.nan}),
        (check_commanders, [], {"signs": True, "faults": {"unsigned": 3, "replayed": 1}}),
    ],
)
def test_what_is_no_reason_not_to_start(check, said, changes):
    assert found(check, said, **changes).passed


WRONG = [
    ({"WP_SPEED": 0.0}, "WP_SPEED is not known or 0"),
    ({"WP_SPEED": math.nan}, "WP_SPEED is not known or 0"),
    ({"WP_SPEED": 0.5}, "is below the platform's"),
    ({"GUID_TIMEOUT": 10.0}, "GUID_TIMEOUT is 10 s: set it to 3 or less"),
    ({"GUID_TIMEOUT": 0.0}, "GUID_TIMEOUT is 0 s"),
    ({"ARMING_CHECK": 0.0}, "all checks off: set it to 1"),
    ({"SYSID_MYGCS": 250.0, "SYSID_ENFORCE": 1.0}, "SYSID_MYGCS is 250 and ours is 255"),
    ({"SYSID_MYGCS": 250.0, "FS_GCS_ENABLE": 1.0}, "SYSID_MYGCS is 250"),
    ({"MAV_GCS_SYSID": 252.0, "MAV_OPTIONS": 1.0}, "MAV_GCS_SYSID is 252 and ours is 255: set it to 255"),
    ({"MAV_GCS_SYSID": 252.0, "MAV_OPTIONS": 3.0}, "MAV_GCS_SYSID is 252"),
    ({"MAV_GCS_SYSID": 252.0, "FS_GCS_ENABLE": 1.0}, "MAV_GCS_SYSID is 252"),
    ({"MAV_GCS_SYSID": 1.0, "MAV_GCS_SYSID_HI": 254.0, "MAV_OPTIONS": 1.0}, "MAV_GCS_SYSID is 1"),
    ({"ARMING_SKIPCHK": -1.0}, "all checks skipped: set it to 0"),
    ({"ARMING_SKIPCHK": 8.0}, "ARMING_SKIPCHK 8 leaves GPS unchecked: set it to 0"),
    ({"ARMING_SKIPCHK": 1048574.0}, "leaves compass, GPS, INS unchecked"),
    ({"ARMING_CHECK": 64.0}, "ARMING_CHECK 64 leaves compass, GPS, INS unchecked: set it to 1"),
    ({"AVOID_ENABLE": 2.0, "PRX1_TYPE": 2.0}, "AVOID_ENABLE has bit 1 and PRX1_TYPE is on"),
    ({"AVOID_ENABLE": 3.0, "PRX_TYPE": 2.0}, "AVOID_ENABLE has bit 1 and PRX_TYPE is on"),
    ({"AVOID_ENABLE": 7.0, "BCN_TYPE": 1.0}, "AVOID_ENABLE has bit 2 and BCN_TYPE is on"),
    ({"OA_TYPE": 1.0}, "OA_TYPE is 1, so the autopilot changes commands after the shield: set OA_TYPE to 0"),
    ({"SAIL_ENABLE": 1.0}, "set SAIL_ENABLE to 0"),
    ({"FS_ACTION": 1.0}, "FS_ACTION is 1 (RTL), so the autopilot would sail among boats past the shield"),
    ({"FS_ACTION": 6.0}, "FS_ACTION is 6 (Loiter or Hold)"),
    ({"BATT_FS_LOW_ACT": 4.0}, "BATT_FS_LOW_ACT is 4 (SmartRTL or Hold)"),
    ({"BATT_FS_CRT_ACT": 3.0}, "BATT_FS_CRT_ACT is 3"),
]
HARMLESS = [
    {"MAV_GCS_SYSID": 252.0},
    {"MAV_GCS_SYSID": 252.0, "MAV_OPTIONS": 2.0},
    {"MAV_GCS_SYSID": 250.0, "MAV_GCS_SYSID_HI": 255.0, "MAV_OPTIONS": 1.0},
    {"MAV_GCS_SYSID": 255.0, "MAV_GCS_SYSID_HI": 0.0, "MAV_OPTIONS": 1.0},
    {"ARMING_SKIPCHK": 0.0},
    {"ARMING_SKIPCHK": 1024.0},
    {"ARMING_CHECK": 1.0},
    {"ARMING_CHECK": 28.0},
    {"FENCE_ENABLE": 0.0, "AVOID_ENABLE": 7.0, "FENCE_ACTION": 2.0},
    {"FENCE_ENABLE": 1.0, "AVOID_ENABLE": 0.0},
    {"AVOID_ENABLE": 3.0, "PRX1_TYPE": 0.0},
    {"OA_TYPE": 0.0},
    {"FS_ACTION": 2.0, "BATT_FS_LOW_ACT": 0.0, "BATT_FS_CRT_ACT": 5.0},
    {"FS_ACTION": 0.0},
]


@pytest.mark.parametrize(("parameters", "words"), [*WRONG, *((harmless, "") for harmless in HARMLESS)])
def test_autopilot_parameters_that_change_a_command_after_the_shield_are_refused_and_no_others(parameters, words):
    result = found(check_autopilot, parameters={**GOOD.parameters, **parameters})
    assert result.passed == (not words), result.text
    assert words in result.text
    assert {*parameters} <= {"WP_SPEED", *ASKED, *FENCE_ASKED}, "what is looked at is asked for"


FLEET = fleet_of(platform="ardurover_boat")
ON = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 4.0, "FENCE_MARGIN": 2.0, "AVOID_ENABLE": 0.0}
NEEDED_M = needed_m(FLEET, "blue_1", {"FENCE_MARGIN": 2.0, "AVOID_MARGIN": 2.0, "AVOID_ENABLE": 0.0})


def places(*points):
    return tuple(FLEET.frame.to_geodetic_deg(*point) for point in points)


def box(out_m, inside=True):
    """A rectangle so far outside the hard line."""
    xmin, ymin, xmax, ymax = hard_line(FLEET)
    a, b, c, d = xmin - out_m, ymin - out_m, xmax + out_m, ymax + out_m
    return FenceZone(inside, places((a, b), (c, b), (c, d), (a, d)))


def checked(zones, parameters=ON, home=None, fleet=FLEET):
    health = replace(GOOD, parameters=parameters, fence=zones, home_deg=home)
    return CheckResult("fence", *check_fence(Watched("blue_1", [], health, fleet, 100.0)))


def test_the_hard_line_lies_ten_metres_out_and_the_boat_needs_its_way_to_stop():
    assert hard_line(FLEET) == (-30.0, -30.0, 110.0, 70.0)
    assert stopping_way_m(get_platform("ardurover_boat")) + 2.0 < NEEDED_M
    assert stopping_way_m(HERON) == pytest.approx(9.4, abs=0.5)


@pytest.mark.parametrize("more_m", [-1.0, -0.1, 0.1, 5.0])
def test_a_fence_around_the_water_is_taken_where_a_boat_can_stop_before_it(more_m):
    result = checked([box(NEEDED_M + more_m)])
    assert result.passed == (more_m > 0.0)
    assert result.figures["fence_room_m"] == pytest.approx(NEEDED_M + more_m, abs=0.05)
    assert f"{NEEDED_M:.1f} m" in result.text
    assert result.passed or "move the fence out by" in result.text


ZONES = {
    "through the water": (False, box(-5.0)),
    "too near on one side": (False, FenceZone(True, places((-200, -200), (111, -200), (111, 200), (-200, 200)))),
    "a keep-out zone in the water": (False, box(-45.0, inside=False)),
    "a keep-out circle near": (False, FenceZone(False, places((125.0, 20.0)), 10.0)),
    "a circle to stay in": (False, FenceZone(True, places((40.0, 20.0)), 80.0)),
    "inside out": (False, box(50.0, inside=False)),
    "elsewhere": (False, FenceZone(True, places((500, 500), (600, 500), (600, 600)))),
    "an edge across a corner": (
        False,
        FenceZone(True, places((-200, -200), (300, -200), (300, -130), (-130, 300), (-200, 300))),
    ),
    "a keep-out circle far off": (True, FenceZone(False, places((400.0, 20.0)), 10.0)),
    "a circle to stay in far off": (True, FenceZone(True, places((40, 20)), 300.0)),
}


@pytest.mark.parametrize("case", ZONES)
def test_a_fence_a_boat_may_meet_is_refused_with_figures(case):
    is_far, zone = ZONES[case]
    result = checked([box(80.0), zone])
    assert result.passed == is_far
    assert "the hard line" in result.text
    assert (result.figures["fence_room_m"] >= NEEDED_M) == is_far


def test_the_circle_around_home_counts():
    home = places((40.0, 20.0))[0]
    circle = {**ON, "FENCE_TYPE": 2.0}
    assert not checked((), {**circle, "FENCE_RADIUS": 60.0}, home).passed
    assert checked((), {**circle, "FENCE_RADIUS": 300.0}, home).passed
    assert "cannot be read" in checked((), {**circle, "FENCE_RADIUS": 300.0}).text


def test_a_fence_nobody_heard_is_not_taken_and_one_that_is_off_is():
    assert "cannot be read" in checked(None).text
    assert checked(None, {"FENCE_ENABLE": 0.0}).passed
    assert checked(None, {}).passed


@pytest.mark.parametrize(
    ("action", "words"),
    [(0.0, "only reports"), (1.0, "FENCE_ACTION is 1 (RTL)"), (4.0, "past the shield: set it to 2"), (2.0, "")],
)
def test_a_fence_is_a_last_resort_only_where_it_holds_the_boat(action, words):
    result = checked([box(80.0)], {**ON, "FENCE_ACTION": action})
    assert result.passed == (not words), result.text
    assert words in result.text


def test_where_boats_may_flee_for_ever_no_fence_is_taken():
    fleet = parse_fleet(fleet_text(platform="ardurover_boat").replace("geofence: {", "geofence: {then: flee, "))
    assert "then is flee" in checked([box(500.0)], fleet=fleet).text


class Autopilot:
    """Answers questions for a fence, every second one."""

    def __init__(self, items):
        self.items, self.asked, self.reader = items, 0, FenceReader((1, 1), self.send)

    def send(self, message):
        self.asked += 1
        if self.asked % 2:
            return True  # lost
        kind = message.get_type()
        if kind == "COMMAND_LONG":
            place = 420000000, -710000000, 0, 0.0, 0.0, 0.0
            self.reader.hear(mavlink.MAVLink_home_position_message(*place, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0))
        elif kind == "MISSION_REQUEST_LIST":
            self.reader.hear(mavlink.MAVLink_mission_count_message(255, 0, len(self.items), mission_type=1))
        else:
            self.reader.hear(self.items[message.seq])
        return True


def item(number, command, place, first=0.0):
    x, y = (round(1e7 * value) for value in place)
    return mavlink.MAVLink_mission_item_int_message(255, 0, number, 0, command, 0, 0, first, 0, 0, 0, x, y, 0, 1)


def test_a_fence_is_read_over_a_radio_that_loses_half_and_items_of_another_mission_are_none():
    zone, circle = box(30.0), FenceZone(False, places((400.0, 20.0)), 12.0)
    items = [item(k, 5001, place, 4.0) for k, place in enumerate(zone.places)]
    reader = Autopilot([*items, item(4, 5004, circle.places[0], 12.0)]).reader
    reader.hear(mavlink.MAVLink_mission_count_message(255, 0, 3, mission_type=0))
    reader.hear(item(0, 5001, (42.0, -71.0), 3.0))
    assert reader.zones is None
    for _ in range(30):
        reader.ask()
    assert reader.is_known
    assert reader.home_deg == (42.0, -71.0)
    first, second = reader.zones
    assert (first.inside, second.inside, second.radius_m) == (True, False, 12.0)
    assert np.array(first.places) == pytest.approx(np.array(zone.places), abs=1e-6)


def answer(name, passed=True):
    return Check(name, lambda: CheckResult(name, passed, "text", {"x_m": 1.0}))


def test_a_broken_check_is_not_passed_and_the_others_still_run():
    seen = []
    results = run_checks([answer("a"), Check("b:blue_1", lambda: 1 / 0), answer("c", False)], seen.append)
    assert [(r.name, r.passed) for r in results] == [("a", True), ("b:blue_1", False), ("c", False)]
    assert "division by zero" in results[1].text
    assert seen == results


@pytest.mark.parametrize("value", [None, "yes", 1, float("nan"), np.float64(1.0)])
def test_only_a_truth_value_passes(value):
    assert not run_check(answer("a", value)).passed


def test_accepting_a_check_for_one_boat_leaves_the_other_and_what_is_not_checked_is_refused():
    checks = [answer("rates:blue_1", False), answer("rates:blue_2", False), answer("disk")]
    results = run_checks(checks)
    for accepted, left in (([], [1, 2]), (["rates:blue_1"], [2]), (["rates"], []), (["rate", "disk"], [1, 2])):
        assert [r.name for r in not_passed(results, accepted)] == [f"rates:blue_{k}" for k in left]
    validate_accepted(["rates", "disk", "rates:blue_1"], checks)
    with pytest.raises(ConfigError, match=r"--accept rate: .*the checks are disk, rates, rates:blue_1"):
        validate_accepted(["rate"], checks)


def situation(more="", **places):
    """What is found of two own boats and one other at (x, y, heading rad, speed); None: never seen."""
    fleet, contacts, said = fleet_of(blue=2, red=1, more=more), [], {}
    tracker = Tracker(fleet, ["blue_1", "blue_2"])
    for name, place in {"blue_1": (0, 0), "blue_2": (20, 0), "red_1": (40, 0), **places}.items():
        if place is not None:
            x, y, heading, speed = (*place, 0.0, 0.0)[:4]
            contacts += [Contact(name, (x, y), heading, speed, 10.0, 0.0, "test")] if name == "red_1" else []
            said[name] = BoatReading(name, 10.0, (x, y), 0.0, heading, 0.0, speed, math.nan, 0.0)
    tracker.update(10.0, said, contacts)
    return {name: check_situation(name, fleet, tracker) for name in SITUATION}


def test_all_pass_when_boats_are_known_inside_and_apart():
    results = situation()
    assert all(result.passed for result in results.values())
    assert results["geofence"].figures["least_inside_m"] == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("places", "check", "words"),
    [
        ({"red_1": None}, "known", "red_1 never heard"),
        ({"blue_2": None}, "known", "blue_2 never heard"),
        ({"blue_1": (0.0, 75.0)}, "geofence", "blue_1 (0, 75) m"),
        ({"red_1": (0.0, 75.0)}, "geofence", "red_1 (0, 75) m"),
        ({"blue_2": (2.0, 0.0)}, "backup", "move it away"),
        ({"blue_1": (0.0, 0.0, math.pi / 2, 2.0), "blue_2": (3.5, 0.0, 1.5 * math.pi, 2.0)}, "backup", "margin of"),
        *((dict.fromkeys(("red_1", "blue_1", "blue_2")), check, "") for check in SITUATION),
    ],
)
def test_a_boat_unseen_outside_or_too_near_or_too_fast_to_part_is_named(places, check, words):
    result = situation(**places)[check]
    assert not result.passed
    assert words in result.text


@pytest.mark.parametrize(
    ("obstacle", "words"),
    [
        (
            "{name: shore, polygon_m: [[-5, -5], [5, -5], [5, 5], [-5, 5]]}",
            "blue_1 lies inside obstacle shore: correct",
        ),
        ("{polygon_m: [[-5, 5], [5, 5], [5, -5], [-5, -5]]}", "blue_1 lies inside obstacle obstacles[0]: correct"),
        ("{name: rock, circle_m: [1, 0, 2]}", "blue_1 lies inside obstacle rock: correct"),
        (
            "{name: rock, circle_m: [2.5, 0, 2]}",
            "blue_1 lies 0.5 m from obstacle rock, less than obstacle_clearance_m 1",
        ),
        ("{name: pier, polygon_m: [[-5, 0.8], [5, 0.8], [5, 5]]}", "blue_1 lies 0.8 m from obstacle pier, less than"),
        ("{name: all, polygon_m: [[-5, -5], [30, -5], [30, 5], [-5, 5]]}", "blue_2 lies inside obstacle all"),
    ],
)
def test_a_boat_inside_an_obstacle_is_named_and_one_beside_it_is_not(obstacle, words):
    result = situation(f"obstacles: [{obstacle}]")["obstacles"]
    assert not result.passed
    assert words in result.text
    assert "red_1" not in result.text
    away = {"blue_1": (0.0, 30.0), "blue_2": (20.0, 30.0), "red_1": (0.0, 0.0)}
    result = situation(f"obstacles: [{obstacle}]", **away)["obstacles"]
    assert result.passed
    assert result.figures["least_clearance_m"] > 20.0


def test_obstacles_of_the_rules_count_too():
    fleet = fleet_of(blue=1, red=0)
    tracker = Tracker(fleet, ["blue_1"])
    tracker.update(10.0, {"blue_1": BoatReading("blue_1", 10.0, (0.0, 0.0), 0.0, 0.0, 0.0, 0.0, math.nan, 0.0)}, [])
    result = check_situation("obstacles", fleet, tracker, Surroundings(circles=[(0.0, 1.0, 4.0)]))
    assert "blue_1 lies inside obstacle of the rules" in result.text
