"""Checks of links: each passes on a good link, and each fault is found, named, and comes with what to do."""

import math
from dataclasses import replace

import numpy as np
import pytest
from steerclear.shield.bridge.autopilot_parameters import ASKED, FENCE_ASKED
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.link_checks import (
    Watched,
    check_autopilot,
    check_clock,
    check_commanders,
    check_latency,
    check_rates,
    check_spread,
    link_checks,
)
from steerclear.shield.bridge.mavlink.vehicle import LinkHealth
from steerclear.shield.bridge.messages import BoatReading
from steerclear.shield.bridge.preflight_checks import CheckResult, run_checks
from steerclear.shield.platforms import get_platform

HERON = get_platform("heron")
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


def readings(count=100, *, spread_m=0.03, speed=0.0, age=0.05, faults=None, seed=0):
    random = np.random.default_rng(seed)
    return [
        BoatReading(
            "blue_1",
            float(i),
            position_m=tuple(10.0 + spread_m * random.standard_normal(2)),
            position_age_s=age,
            heading_rad=1.0,
            heading_age_s=age,
            speed_mps=speed,
            velocity_age_s=age,
            turn_rate_rads=0.0,
            turn_rate_age_s=age,
            faults=(faults or {}) if i == 3 else {},
        )
        for i in range(count)
    ]


def found(check, health=GOOD, said=()):
    return CheckResult("", *check(Watched("blue_1", said, health, HERON, 100.0)))


class FakeLink:
    def __init__(self, health=GOOD, said=None):
        self._health, self._said, self.asked = health, iter(said or readings(1000)), 0

    def read(self):
        return next(self._said)

    def learn(self, timeout_s):
        self.asked += 1

    def health(self):
        return self._health


def test_a_good_link_passes_everything_and_is_watched_once():
    clock, link = ManualClock(10.0), FakeLink()
    checks = link_checks({"blue_1": link}, {"blue_1": HERON}, clock, seconds=5.0)
    results = run_checks(checks)
    assert [r.name for r in results] == [
        f"{kind}:blue_1" for kind in ("rates", "latency", "clock", "spread", "autopilot", "commanders")
    ]
    assert all(r.passed for r in results), [r.text for r in results]
    assert clock.now_s() == pytest.approx(15.0), "one watch for all checks"
    assert link.asked == 1


def test_a_link_that_breaks_while_watched_fails_its_checks_and_says_so():
    class Broken(FakeLink):
        def read(self):
            raise OSError("no such wire")

    results = run_checks(link_checks({"blue_1": Broken()}, {"blue_1": HERON}, ManualClock(), 1.0))
    assert not any(r.passed for r in results)
    assert all("no such wire" in r.text for r in results)


LATE = [replace(reading, position_age_s=7.6, heading_age_s=7.6, velocity_age_s=7.6) for reading in readings()]
BOOTING = [replace(reading, position_age_s=7.6, velocity_age_s=7.6) for reading in readings()]


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
        (check_rates, LATE, {}, "telemetry was 7.60 s old"),
        (check_rates, BOOTING, {"fix_type": 1, "fix_fault": "GPS has no fix"}, "no position yet (GPS has no fix)"),
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
        (check_commanders, [], {"stations": frozenset({(255, 190)})}, "on the link (system 255 component 190)"),
        (check_commanders, [], {"other_commander_s": 97.0}, "somebody else commanded it 3 s ago; end that program"),
        (check_commanders, [], {"faults": {"bad_signature": 4}}, "refused 4 bad_signature: somebody sends in this"),
        (check_commanders, [], {"faults": {"second_sender": 1}}, "find them before you start"),
    ],
)
def test_each_fault_is_found_and_named(check, said, changes, words):
    result = found(check, replace(GOOD, **changes), said)
    assert not result.passed
    assert words in result.text


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
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
    ],
)
def test_autopilot(parameters, words):
    result = found(check_autopilot, replace(GOOD, parameters={**GOOD.parameters, **parameters}))
    assert not result.passed
    assert words in result.text


@pytest.mark.parametrize(
    "parameters",
    [
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
    ],
)
def test_an_autopilot_whose_settings_change_nothing_passes(parameters):
    result = found(check_autopilot, replace(GOOD, parameters={**GOOD.parameters, **parameters}))
    assert result.passed, result.text


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
    assert found(check, replace(GOOD, **changes), said).passed


def test_what_was_refused_before_the_watch_is_not_of_it():
    said = [BoatReading("blue_1", 0.0, faults={"no_fix": 9}), *readings(1000)]
    (rates, *_) = run_checks(link_checks({"blue_1": FakeLink(said=said)}, {"blue_1": HERON}, ManualClock(10.0), 2.0))
    assert rates.passed, rates.text


def test_every_parameter_that_is_looked_at_is_asked_for():
    assert {"MAV_GCS_SYSID", "MAV_OPTIONS", "ARMING_SKIPCHK", "FENCE_ENABLE", "AVOID_ENABLE", "OA_TYPE"} <= {*ASKED}
    assert {"FS_ACTION", "BATT_FS_LOW_ACT", "BATT_FS_CRT_ACT"} <= {*ASKED}
    assert "FENCE_ACTION" in FENCE_ASKED
    assert {"SYSID_MYGCS", "SYSID_ENFORCE", "ARMING_CHECK", "GUID_TIMEOUT"} <= {*ASKED}
