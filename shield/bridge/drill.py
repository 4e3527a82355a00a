"""`Drill`: a short drive of one boat after the other, all of them behind the shield, to see how they respond.

It stands where a policy stands: the loop asks it what boats should do, the shield filters that, and the ticks it gets
back hold what was really sent and what the boats did.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..commands import Commands
from ..jit import Array
from ..platforms import Platform, fresh_state, step_boat
from ..platforms import layout as L
from ..tracks import whole_steps
from .fleet_file import FleetFile
from .messages import Answer, BoatReading, Snapshot, Tick
from .model_error import AHEAD_S as PREDICTED_S
from .model_error import ENOUGH_S, SHARE, TOLD_BY, ModelErrorMonitor
from .preflight_checks import Check, Found, checks_by_kind, found

AHEAD_S = 8.0
TURN_S = 7.0
STOP_S = 5.0
EACH_S = AHEAD_S + TURN_S + STOP_S  # how long the drill of one boat takes, s
TURN_RAD = math.radians(60.0)
TOP_SHARE = 0.6
FASTEST_MPS = 1.5
COURSE_STEP_DEG = 15.0
ENOUGH_M, EDGE_M = 20.0, 10.0  # room beyond which others, and the geofence's edge, disturb no drill, m
TURN_COST_M = 0.5  # a first turn that differs by a radian from a right angle counts as so much less room, m
SAME_MPS, SAME_RAD = 0.05, math.radians(1.0)  # commands that differ by less are the same
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
SAME_S = 0.005  # delays closer than this are reported as the same, s
TURNED_DEG = 15.0
LONG_ENOUGH_S = 3.0  # only where a heading was commanded for so long it is judged whether the boat turned away from it
MOST_CHANGED = 0.4  # of a drill with a greater share of commands changed too little is left to judge


@dataclass(frozen=True)
class DrillSample:
    """One turn of the loop."""

    time_s: float  # of the turn
    reading: BoatReading  # of the boat
    heading_rad: float  # as sent; NaN when nothing was
    speed_mps: float
    # whether something else than the drill's own command was decided: the shield gave way, a declared response was
    # due, or nothing could be decided
    changed: bool = False
    # how far the boat is from where it was predicted, m, for each of `PREDICTED_S`; NaN where there is no telling
    missed_m: tuple[float, ...] = (math.nan,) * len(PREDICTED_S)


class Drill:
    """A `NominalSource` and a `TickSink`: boats are drilled in order; all others of the process lie still.

    Attributes:
        seconds: how long it takes.
        samples: by boat's name, of its own turn only.
        model_error: the loop's monitor; set before the loop runs. None: nothing is known of predictions.
    """

    def __init__(self, fleet: FleetFile, boats: Sequence[str]) -> None:
        self.samples: dict[str, list[DrillSample]] = {name: [] for name in boats}
        self.seconds = EACH_S * len(self.samples)
        self.model_error: ModelErrorMonitor | None = None
        self._fleet = fleet
        self._boats = tuple(self.samples)
        self._began_s = math.nan
        self._courses: dict[str, tuple[float, float]] = {}
        self._commands: Commands | None = None

    def offer(self, snapshot: Snapshot) -> None:
        """See `NominalSource`."""
        if math.isnan(self._began_s):
            self._began_s = snapshot.taken_s
        values = np.column_stack([np.zeros(len(snapshot.seen)), np.radians(snapshot.seen[:, 2])])
        boat, into_s = self.turn_of(snapshot.taken_s)
        if boat:
            i = self._fleet.names.index(boat)
            values[i] = self._wanted(boat, snapshot.seen[i], np.delete(snapshot.seen, i, axis=0), into_s)
        self._commands = Commands.absolute_rad(values)

    def latest(self) -> Answer:
        """See `NominalSource`."""
        return Answer() if self._commands is None else Answer(self._commands, 0.0)

    def take(self, tick: Tick) -> None:
        """See `TickSink`."""
        boat, _ = self.turn_of(tick.began_s)
        reading, sent = tick.readings.get(boat), tick.sent.get(boat)
        if reading is not None:
            command = (math.nan, math.nan) if sent is None else (sent.heading_rad, sent.speed_mps)
            sample = DrillSample(tick.began_s, reading, *command, self._is_changed(boat, tick, command))
            if self.model_error is not None:
                sample = replace(sample, missed_m=self.model_error.latest_m(boat))
            self.samples[boat].append(sample)

    def turn_of(self, time_s: float) -> tuple[str, float]:
        """Whose turn it is and for how long already, s; no name before and after."""
        into_s = time_s - self._began_s
        if not 0.0 <= into_s < self.seconds:
            return "", 0.0
        return self._boats[int(into_s / EACH_S)], into_s % EACH_S

    def close(self) -> None:
        """Nothing is held."""

    def _is_changed(self, boat: str, tick: Tick, command: tuple[float, float]) -> bool:
        """Whether the tick's command is not the drill's; what the link made of it, such as a cap, does not count."""
        if self._commands is None:
            return True
        speed, heading = self._commands.values[self._fleet.names.index(boat)]
        if tick.decisions is not None and tick.fleet is not None and boat in tick.fleet.names:
            i = tick.fleet.names.index(boat)
            decided = tick.decisions.filtered.absolute(i, tick.fleet.heading_rad[i])
        else:
            decided = command[1], command[0]
        turned = abs((decided[1] - heading + math.pi) % (2.0 * math.pi) - math.pi)
        return not (abs(decided[0] - speed) <= SAME_MPS and turned <= SAME_RAD)

    def _wanted(self, boat: str, row: Array, others: Array, into_s: float) -> tuple[float, float]:
        """Speed m/s and heading rad; speed 0 for a boat nobody sees."""
        if not np.isfinite(row).all():
            return 0.0, 0.0
        if boat not in self._courses:
            self._courses[boat] = self._courses_of(boat, row, others)
        first, second = self._courses[boat]
        speed = self._speed_mps(boat)
        if into_s < AHEAD_S:
            return speed, first
        return (speed if into_s < AHEAD_S + TURN_S else 0.0), second

    def _speed_mps(self, boat: str) -> float:
        return min(FASTEST_MPS, TOP_SHARE * self._fleet.platform_of[boat].max_speed_mps)

    def _courses_of(self, boat: str, row: Array, others: Array) -> tuple[float, float]:
        """Course and the course after the turn that lead farthest from other boats and from the geofence's edge.

        Where several leave room enough, the one that begins with a right angle: a turn tells of the steering.
        """
        places = others[np.isfinite(others[:, :2]).all(axis=1), :2]
        speed, best, most = self._speed_mps(boat), (0.0, 0.0), -math.inf
        for first in np.radians(np.arange(0.0, 360.0, COURSE_STEP_DEG)):
            for second in (first + TURN_RAD, first - TURN_RAD):
                path = self._path(row, speed, first, second)
                apart = np.hypot(*(path[:, None, :] - places[None, :, :]).transpose(2, 0, 1)).min(initial=ENOUGH_M)
                turn = abs(math.remainder(first - math.radians(row[2]), 2.0 * math.pi))
                room = (
                    min(ENOUGH_M, float(apart)) + min(EDGE_M, self._inside_m(path)) - TURN_COST_M * abs(turn - TURN_RAD)
                )
                if room > most:
                    best, most = (float(first % (2.0 * math.pi)), float(second % (2.0 * math.pi))), room
        return best

    def _path(self, row: Array, speed: float, first: float, second: float) -> Array:
        """Places on the way, (k, 2) m, as straight legs."""
        leg, at = np.arange(1.0, AHEAD_S + 1.0), row[:2]
        one = at + speed * leg[:, None] * np.array([math.sin(first), math.cos(first)])
        more = np.arange(1.0, TURN_S + STOP_S + 1.0)[:, None]
        return np.vstack([at, one, one[-1] + speed * more * np.array([math.sin(second), math.cos(second)])])

    def _inside_m(self, path: Array) -> float:
        xmin, ymin, xmax, ymax = self._fleet.geofence.box
        x, y = path.T
        return float(np.min([x - xmin, xmax - x, y - ymin, ymax - y]))


@dataclass(frozen=True)
class Driven:
    """What the checks of a drill look at: a boat's own turn of it, its platform, and what the file says."""

    samples: Sequence[DrillSample]
    platform: Platform
    dt_s: float  # step of the loop, s
    outside_m: float  # ``limits.model.outside_m``: beyond it a boat is slowed


def drill_checks(drill: Drill, fleet: FleetFile) -> list[Check]:
    """Checks of a drill that has been driven."""
    limit_m = fleet.limits.model.outside_m
    return checks_by_kind(
        KINDS, drill.samples, lambda boat: Driven(drill.samples[boat], fleet.platform_of[boat], fleet.dt_s, limit_m)
    )


def check_model(driven: Driven) -> Found:
    """The boat was where its model foresaw it, near enough that it would not be slowed for it (``limits.model``)."""
    errors = np.array([sample.missed_m for sample in driven.samples]).reshape(-1, len(PREDICTED_S))
    errors = errors[np.isfinite(errors).all(axis=1)]
    judged_s = len(errors) * driven.dt_s
    if judged_s < ENOUGH_S:
        text = (
            f"its place was known and predicted for {judged_s:.1f} s of its drill, {ENOUGH_S:g} s are needed; "
            "see its rates and links, then run again"
        )
        return False, text, {"judged_s": judged_s}
    missed_m = np.quantile(errors, SHARE, axis=0)
    fine = f"its model misses {'/'.join(f'{missed:.1f}' for missed in missed_m)} m 1/2/3 s ahead (95 of 100)"
    fault = (
        f"{fine}, and beyond {driven.outside_m:g} m it would be slowed and handed over (limits.model); drive "
        f"steerclear sea-trial, and put what steerclear fit makes of its log in place of {driven.platform.name}"
    )
    figures = {f"missed_{ahead:g}s_m": float(missed) for ahead, missed in zip(PREDICTED_S, missed_m, strict=True)}
    return found(fine, figures, (missed_m[TOLD_BY] > driven.outside_m, fault))


def check_course(driven: Driven) -> Found:
    """On straight runs the boat goes where it points."""
    straight = (
        s.reading
        for s in driven.samples
        if s.reading.speed_mps > COURSE_MPS and abs(s.reading.turn_rate_rads) < math.radians(STEADY_DPS)
    )
    off = [value for reading in straight if math.isfinite(value := reading.heading_rad - reading.course_rad)]
    if len(off) < FEWEST:
        text = (
            f"it ran straight at more than {COURSE_MPS:g} m/s for too short; see its response, give it room, run again"
        )
        return False, text, {"samples": float(len(off))}
    mean = math.degrees(math.atan2(np.mean(np.sin(off)), np.mean(np.cos(off))))
    fault = f"it points {mean:+.0f} deg off its course; calibrate its compass, or wait for less current"
    figures = {"heading_less_course_deg": mean, "samples": float(len(off))}
    fine = f"points {mean:+.1f} deg off its course"
    return found(fine, figures, (not abs(mean) <= COURSE_DEG, fault))


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


def check_response(driven: Driven) -> Found:
    """The boat did what its platform file foretells of the commands sent."""
    platform, dt_s = driven.platform, driven.dt_s
    commanded = [s for s in driven.samples if math.isfinite(s.heading_rad) and math.isfinite(s.speed_mps)]
    measured = np.array([_measured(s) for s in commanded])
    if len(commanded) < 5.0 / dt_s or not np.isfinite(measured).all():
        text = "commands or telemetry were missing during the drill; see the other checks, then run again"
        return False, text, {}
    changed = float(np.mean([s.changed for s in commanded]))
    stretches = _stretches(commanded, dt_s)
    if changed > MOST_CHANGED or not stretches:
        text = (
            f"the drill was disturbed: {100.0 * changed:.0f} % of its commands were changed by the shield or a "
            "declared response, too little is left to judge; clear the water, then run again"
        )
        return False, text, {"changed_share": changed}
    fits = [_fit(commanded, measured, platform, dt_s, steps) for steps in range(LONGEST_DELAY_STEPS + 1)]
    fit, delay_s = min(fits, key=lambda f: f.cost), _delay_s([f.heading_deg**2 for f in fits], dt_s)
    figures = {
        "delay_s": delay_s,
        "heading_rms_deg": fit.heading_deg,
        "speed_rms_mps": fit.speed_mps,
        "turn_rate_dps": fit.measured_dps,
        "turn_rate_foretold_dps": fit.foretold_dps,
        "changed_share": changed,
    }
    disturbed = f"; {100.0 * changed:.0f} % of its commands changed by the shield" if changed else ""
    passed, text, _ = found(
        f"as {platform.name}: heading within {fit.heading_deg:.1f} deg rms, speed within {fit.speed_mps:.2f} m/s rms, "
        f"effect after {delay_s:.2f} s{disturbed}{counted_words(delay_s, dt_s)}",
        figures,
        *_faults(
            fit, delay_s, measured, any(_turned_away(measured[part], commanded[part]) for part in stretches), platform
        ),
    )
    if not passed and changed:
        text += f"{disturbed}: repeat it on clear water before you believe it"
    return passed, text, figures


KINDS: Mapping[str, Callable[[Driven], Found]] = {
    "course": check_course,
    "response": check_response,
    "model": check_model,
}
"""The checks, by name."""


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


def _fit(commanded: Sequence[DrillSample], measured: Array, platform: Platform, dt_s: float, steps: int) -> _Fit:
    """Run the platform's model on the commands sent, taking effect ``steps`` later."""
    params = platform.pack()
    row = fresh_state(0.0, 0.0, _half_turn(measured[0, 0]), measured[0, 1])
    foretold = np.empty_like(measured)
    for i in range(len(commanded)):
        foretold[i] = row[L.HEADING], row[L.SPEED]
        if i >= steps:
            command = commanded[i - steps]
            error = _half_turn(math.degrees(command.heading_rad) - row[L.HEADING])
            step_boat(params, row, command.speed_mps, error, dt_s)
    heading = _half_turn(measured[:, 0] - foretold[:, 0])
    heading_rms, speed_rms = (float(np.sqrt(np.mean(off**2))) for off in (heading, measured[:, 1] - foretold[:, 1]))
    return _Fit(heading_rms, speed_rms, _fastest_dps(measured[:, 0], dt_s), _fastest_dps(foretold[:, 0], dt_s))


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


def _faults(fit: _Fit, delay_s: float, measured: Array, away: bool, platform: Platform) -> list[tuple[bool, str]]:
    slow = delay_s > LONGEST_DELAY_S and fit.measured_dps < SLOWER * fit.foretold_dps
    speed = "faster" if fit.measured_dps > fit.foretold_dps else "slower"
    remedy = "give the platform that fits it (steerclear fit LOG --out boat.yaml, of a sea-trial's log), or tune its"
    return [
        (float(np.median(measured[:, 1])) < -0.2, "it goes astern when told to go ahead; check the motors' direction"),
        (away, "it turns away from the heading it is told; check the steering's direction"),
        (
            slow or not fit.heading_deg <= HEADING_DEG,
            f"it turns {speed} than {platform.name} ({fit.measured_dps:.0f} against {fit.foretold_dps:.0f} deg/s, "
            f"{fit.heading_deg:.0f} deg rms); {remedy} steering",
        ),
        (
            not fit.speed_mps <= SPEED_MPS,
            f"its speed is {fit.speed_mps:.2f} m/s rms from {platform.name}'s; {remedy} speed",
        ),
        (
            delay_s > LONGEST_DELAY_S,
            f"commands take {delay_s:.1f} s to work; shorten the radio's way, or set shield.delay_s to that",
        ),
    ]


def _stretches(commanded: Sequence[DrillSample], dt_s: float) -> list[slice]:
    """Where the drill's own command to go one way was sent for long enough without a break."""
    stretches, begin = [], 0
    for i in range(len(commanded) + 1):
        on = i < len(commanded) and not commanded[i].changed and commanded[i].speed_mps > 0.0
        if on:
            turned_deg = abs(float(_half_turn(math.degrees(commanded[i].heading_rad - commanded[begin].heading_rad))))
            if i == begin or turned_deg <= TURNED_DEG:
                continue
        if (i - begin) * dt_s >= LONG_ENOUGH_S:
            stretches.append(slice(begin, i))
        begin = i if on else i + 1
    return stretches


def _turned_away(measured: Array, commanded: Sequence[DrillSample]) -> bool:
    """Whether in a stretch it ended farther from the heading commanded than it began."""
    course_deg = math.degrees(commanded[-1].heading_rad)
    first, last = (abs(_half_turn(measured[i, 0] - course_deg)) for i in (0, -1))
    return bool(last > first + TURNED_DEG)


def _half_turn(deg: Any) -> Any:
    return (deg + 180.0) % 360.0 - 180.0
