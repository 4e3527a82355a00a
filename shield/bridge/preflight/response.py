"""What a drill shows: heading against course, and the boat's response against its platform file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ...jit import Array
from ...platforms import Platform, fresh_state, step_boat
from ...platforms import layout as L
from ...tracking.tracks import whole_steps
from ..fleet_file import FleetFile
from .drill import Drill, DrillSample
from .missed import Missed, check_model
from .result import Check, CheckResult

COURSE_DEG = 15.0
COURSE_MPS = 0.8
STEADY_DPS = 5.0
FEWEST = 10
HEADING_DEG = 12.0
SPEED_MPS = 0.35
LONGEST_DELAY_STEPS = 8
LONGEST_DELAY_S = 0.6
SLOWER = 0.6
"""A boat that turns at so much less than its model's rate is slow, not late, though the two look alike at first."""
SAME_S = 0.005
"""Delays that are told apart by less are told as the same, s."""
TURNED_DEG = 15.0
LONG_ENOUGH_S = 3.0
"""Only where a heading was told for so long it is judged whether the boat turned away from it."""
MOST_CHANGED = 0.4
"""Of a drill with a greater share of commands changed too little is left to judge."""


def drill_checks(drill: Drill, missed: Missed, fleet: FleetFile) -> list[Check]:
    """Checks of a drill that has been driven.

    Args:
        drill: with its samples.
        missed: what the boats' models missed meanwhile.
        fleet: the file: platforms, step and limits.
    """
    checks, dt_s, most_m = [], fleet.dt_s, fleet.limits.model.outside_m
    for boat, samples in drill.samples.items():
        platform, errors_m = fleet.platform_of[boat], missed.errors_m[boat]
        checks.append(Check(f"course:{boat}", partial(check_course, boat, samples)))
        checks.append(Check(f"response:{boat}", partial(check_response, boat, samples, platform, dt_s)))
        checks.append(Check(f"model:{boat}", partial(check_model, boat, errors_m, platform, most_m, dt_s)))
    return checks


def check_course(boat: str, samples: Sequence[DrillSample]) -> CheckResult:
    """On straight runs the boat goes where it points."""
    name = f"course:{boat}"
    off = [
        s.reading.heading_rad - s.reading.course_rad
        for s in samples
        if s.reading.speed_mps > COURSE_MPS and abs(s.reading.turn_rate_rads) < math.radians(STEADY_DPS)
    ]
    off = [value for value in off if math.isfinite(value)]
    if len(off) < FEWEST:
        text = (
            f"it ran straight at more than {COURSE_MPS:g} m/s for too short; see its response, give it room, run again"
        )
        return CheckResult(name, False, text, {"samples": float(len(off))})
    mean = math.degrees(math.atan2(np.mean(np.sin(off)), np.mean(np.cos(off))))
    figures = {"heading_less_course_deg": mean, "samples": float(len(off))}
    if not abs(mean) <= COURSE_DEG:
        text = f"it points {mean:+.0f} deg off its course; calibrate its compass, or wait for less current"
        return CheckResult(name, False, text, figures)
    return CheckResult(name, True, f"points {mean:+.1f} deg off its course", figures)


@dataclass(frozen=True)
class _Fit:
    """How one delay fits: rms of heading deg and speed m/s, highest turn rates measured and foretold deg/s."""

    heading_deg: float
    speed_mps: float
    measured_dps: float
    foretold_dps: float

    @property
    def cost(self) -> float:
        return self.heading_deg / HEADING_DEG + self.speed_mps / SPEED_MPS


def check_response(boat: str, samples: Sequence[DrillSample], platform: Platform, dt_s: float) -> CheckResult:
    """The boat did what its platform file foretells of the commands sent."""
    name = f"response:{boat}"
    told = [s for s in samples if math.isfinite(s.heading_rad) and math.isfinite(s.speed_mps)]
    measured = np.array([_measured(s) for s in told])
    if len(told) < 5.0 / dt_s or not np.isfinite(measured).all():
        text = "commands or telemetry were missing during the drill; see the other checks, then run again"
        return CheckResult(name, False, text)
    changed = float(np.mean([s.changed for s in told]))
    stretches = _stretches(told, dt_s)
    if changed > MOST_CHANGED or not stretches:
        text = (
            f"the drill was disturbed: {100.0 * changed:.0f} % of its commands were changed by the shield or a "
            "declared response, too little is left to judge; clear the water, then run again"
        )
        return CheckResult(name, False, text, {"changed_share": changed})
    fits = [_fit(told, measured, platform, dt_s, steps) for steps in range(LONGEST_DELAY_STEPS + 1)]
    fit = min(fits, key=lambda f: f.cost)
    delay_s = _delay_s([f.heading_deg**2 for f in fits], dt_s)
    figures = {
        "delay_s": delay_s,
        "heading_rms_deg": fit.heading_deg,
        "speed_rms_mps": fit.speed_mps,
        "turn_rate_dps": fit.measured_dps,
        "turn_rate_foretold_dps": fit.foretold_dps,
        "changed_share": changed,
    }
    away = any(_turned_away(measured[part], told[part]) for part in stretches)
    fault = _fault(fit, delay_s, measured, away, platform)
    disturbed = f"; {100.0 * changed:.0f} % of its commands changed by the shield" if changed else ""
    if fault and changed:
        fault += f"{disturbed}: repeat it on clear water before you believe it"
    text = fault or (
        f"as {platform.name}: heading within {fit.heading_deg:.1f} deg rms, speed within {fit.speed_mps:.2f} m/s rms, "
        f"effect after {delay_s:.2f} s{disturbed}{counted_words(delay_s, dt_s)}"
    )
    return CheckResult(name, not fault, text, figures)


def counted_words(delay_s: float, dt_s: float) -> str:
    """What to add where a shield counts a delay as more than it is; nothing where it is whole turns already."""
    counted_s = whole_steps(delay_s, dt_s) * dt_s
    if counted_s - delay_s < SAME_S:
        return ""
    return f"; a delay of {delay_s:.4g} s is counted as {counted_s:.4g} s, in whole turns of the loop"


def _measured(sample: DrillSample) -> tuple[float, float]:
    """Heading deg and speed m/s, run on to the turn where they may be."""
    reading = sample.reading
    turned = reading.turn_rate_rads * reading.heading_age_s
    return math.degrees(reading.heading_rad + (turned if math.isfinite(turned) else 0.0)), reading.speed_mps


def _fit(told: Sequence[DrillSample], measured: Array, platform: Platform, dt_s: float, steps: int) -> _Fit:
    """Run the platform's model on the commands sent, taking effect ``steps`` later."""
    params = platform.pack()
    row = fresh_state(0.0, 0.0, _half_turn(measured[0, 0]), measured[0, 1])
    foretold = np.empty_like(measured)
    for i in range(len(told)):
        foretold[i] = row[L.HEADING], row[L.SPEED]
        if i >= steps:
            command = told[i - steps]
            error = _half_turn(math.degrees(command.heading_rad) - row[L.HEADING])
            step_boat(params, row, command.speed_mps, error, dt_s)
    heading = _half_turn(measured[:, 0] - foretold[:, 0])
    speed = measured[:, 1] - foretold[:, 1]
    return _Fit(
        float(np.sqrt(np.mean(heading**2))),
        float(np.sqrt(np.mean(speed**2))),
        _fastest_dps(measured[:, 0], dt_s),
        _fastest_dps(foretold[:, 0], dt_s),
    )


def _delay_s(costs: Sequence[float], dt_s: float) -> float:
    """Delay of the least cost, between steps by the parabola through its neighbours, s."""
    best = int(np.argmin(costs))
    if not 0 < best < len(costs) - 1:
        return best * dt_s
    before, here, after = costs[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    return float(best + (0.5 * (before - after) / bend if bend > 0.0 else 0.0)) * dt_s


def _fastest_dps(headings_deg: Array, dt_s: float) -> float:
    """Highest turn rate over half a second, deg/s."""
    apart = max(1, round(0.5 / dt_s))
    return float(np.abs(_half_turn(headings_deg[apart:] - headings_deg[:-apart])).max()) / (apart * dt_s)


def _fault(fit: _Fit, delay_s: float, measured: Array, away: bool, platform: Platform) -> str:
    if float(np.median(measured[:, 1])) < -0.2:
        return "it goes astern when told to go ahead; check the motors' direction"
    if away:
        return "it turns away from the heading it is told; check the steering's direction"
    slow = delay_s > LONGEST_DELAY_S and fit.measured_dps < SLOWER * fit.foretold_dps
    if slow or not fit.heading_deg <= HEADING_DEG:
        faster = "faster" if fit.measured_dps > fit.foretold_dps else "slower"
        return (
            f"it turns {faster} than {platform.name} ({fit.measured_dps:.0f} against {fit.foretold_dps:.0f} deg/s, "
            f"{fit.heading_deg:.0f} deg rms); give the platform that fits it (steerclear fit LOG "
            "--out boat.yaml, of a sea-trial's log), or tune its steering"
        )
    if not fit.speed_mps <= SPEED_MPS:
        return (
            f"its speed is {fit.speed_mps:.2f} m/s rms from {platform.name}'s; give the platform that fits it "
            "(steerclear fit LOG --out boat.yaml, of a sea-trial's log), or tune its speed"
        )
    if delay_s > LONGEST_DELAY_S:
        return f"commands take {delay_s:.1f} s to work; shorten the radio's way, or set shield.delay_s to that"
    return ""


def _stretches(told: Sequence[DrillSample], dt_s: float) -> list[slice]:
    """Where the drill's own command to go one way was sent for long enough without a break."""
    found, begin = [], 0
    for i in range(len(told) + 1):
        on = i < len(told) and not told[i].changed and told[i].speed_mps > 0.0
        if on and (i == begin or _apart(told[i], told[begin]) <= TURNED_DEG):
            continue
        if (i - begin) * dt_s >= LONG_ENOUGH_S:
            found.append(slice(begin, i))
        begin = i if on else i + 1
    return found


def _turned_away(measured: Array, told: Sequence[DrillSample]) -> bool:
    """Whether in a stretch it ended farther from the heading told than it began."""
    wanted = math.degrees(told[-1].heading_rad)
    first, last = (abs(_half_turn(measured[i, 0] - wanted)) for i in (0, -1))
    return bool(last > first + TURNED_DEG)


def _apart(one: DrillSample, other: DrillSample) -> float:
    return abs(float(_half_turn(math.degrees(one.heading_rad - other.heading_rad))))


def _half_turn(deg: Any) -> Any:
    return (deg + 180.0) % 360.0 - 180.0
