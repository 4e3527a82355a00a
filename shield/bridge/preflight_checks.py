"""What a check before the start finds, running many so that none can stop or hide another, and those of the situation.

Checks of links are in `link_checks`, those of a drill in `drill`, the disk's in `blackbox.disk`.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

import numpy as np

from ..commands import Commands
from ..exceptions import ConfigError, SteerclearError
from ..shield import Shield
from ..surroundings import OPEN_WATER, Surroundings
from .failsafe import words
from .fleet_file import FleetFile
from .static_obstacles import StaticObstacles
from .tracker import Tracker

LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class CheckResult:
    """What one check found."""

    name: str  # short and stable, such as "rates:blue_1": what ``--accept NAME`` names
    passed: bool  # whether boats may start as far as this check goes
    text: str  # one line: what was found and, when not passed, what the operator must do
    # what was measured, by name with its unit, such as ``{"position_rate_hz": 19.8}``
    figures: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Check:
    """A check yet to be run."""

    name: str  # as in its result; known beforehand, so that a check that fails to answer is still named
    run: Callable[[], CheckResult]  # does it; takes its time, moves boats only if its description says so


Found = tuple[bool, str, Mapping[str, float]]  # what a check found: whether it passed, the line, the figures
Seen = TypeVar("Seen")


def found(fine: str, figures: Mapping[str, float], *faults: tuple[Any, str]) -> Found:
    """The first fault whose condition holds, with the remedy in its line; or that all is fine."""
    text = next((text for holds, text in faults if holds), "")
    return not text, text or fine, figures


def checks_by_kind(
    kinds: Mapping[str, Callable[[Seen], Found]], boats: Iterable[str], look: Callable[[str], Seen]
) -> list[Check]:
    """A check of each kind for each boat, named ``kind:boat``; ``look(boat)`` gives what is looked at, when it runs."""

    def run(name: str, check: Callable[[Seen], Found], boat: str) -> CheckResult:
        return CheckResult(name, *check(look(boat)))

    return [
        Check(f"{kind}:{boat}", partial(run, f"{kind}:{boat}", check, boat))
        for boat in boats
        for kind, check in kinds.items()
    ]


def run_check(check: Check) -> CheckResult:
    """Run one check, its result under the name it was registered with; what goes wrong inside is a check not passed."""
    try:
        result = check.run()
    except Exception as error:  # a check that broke has shown nothing: the answer is no, and the others still run
        LOG.warning("check %s broke", check.name, exc_info=True)
        text = f"the check itself failed ({type(error).__name__}: {error}); put that right, run again"
        return CheckResult(check.name, False, text)
    # a numpy bool is fine; None, NaN or a string that crept in must not count as passed
    passed = isinstance(result.passed, (bool, np.bool_)) and bool(result.passed)
    return CheckResult(check.name, passed, result.text, dict(result.figures))


def run_checks(checks: Iterable[Check], seen: Callable[[CheckResult], None] | None = None) -> list[CheckResult]:
    """Run checks one after another, all of them, whatever any of them finds; ``seen`` gets each result as it comes."""
    results = []
    for check in checks:
        results.append(run_check(check))
        if seen is not None:
            seen(results[-1])
    return results


def validate_accepted(accepted: Iterable[str], checks: Iterable[Check]) -> None:
    """Refuse to accept what is not checked: a misspelt name would otherwise look as if it did something.

    Raises:
        ConfigError: a name is neither that of a check nor its part before ":".
    """
    names = [check.name for check in checks]
    known = sorted({*names, *(name.split(":")[0] for name in names)})
    for name in accepted:
        if name not in known:
            raise ConfigError(f"--accept {name}: there is no such check; the checks are {', '.join(known)}")


def not_passed(results: Iterable[CheckResult], accepted: Iterable[str] = ()) -> list[CheckResult]:
    """The results that forbid the start: not passed and not accepted, in order.

    The part of a name before ":" accepts a check for every boat. Empty results forbid nothing: the caller decides what
    must be checked.
    """
    allowed = set(accepted)
    return [r for r in results if not r.passed and r.name not in allowed and r.name.split(":")[0] not in allowed]


def check_situation(
    name: str, fleet: FleetFile, tracker: Tracker, surroundings: Surroundings = OPEN_WATER
) -> CheckResult:
    """One of `SITUATION`, of a tracker just updated, with the game's surroundings, see `StaticObstacles`."""
    return CheckResult(name, *SITUATION[name](fleet, tracker, StaticObstacles(fleet, surroundings)))


def check_known(fleet: FleetFile, tracker: Tracker, obstacles: StaticObstacles) -> Found:
    """Every boat of the file has been seen, and lately."""
    limits, missing, oldest = fleet.limits, [], 0.0
    for name in fleet.names:
        own = name in tracker.commanded
        age = tracker.navigation_age_s(name) if own else tracker.contact_age_s(name)
        oldest = max(oldest, age)
        if age > (limits.navigation if own else limits.contact).max_age_s:
            why = f" ({tracker.faults[name]})" if name in tracker.faults else ""
            missing.append(f"{name} {words(age)}{why}")
    contradicted = [f"{name}: {tracker.contradicted(name)}" for name in fleet.names if tracker.contradicted(name)]
    where = ", ".join(missing)
    return found(
        f"every boat seen ({len(fleet.names)}), oldest fix {oldest:.2f} s",
        {"oldest_s": oldest},
        (contradicted, f"sources contradict each other, {'; '.join(contradicted)}"),
        (missing, f"{where}; check telemetry and feed, or take boats that are not there out of the file"),
    )


def check_geofence(fleet: FleetFile, tracker: Tracker, obstacles: StaticObstacles) -> Found:
    """The geofence goes around all boats seen."""
    seen = {name: row for name, row in zip(fleet.names, tracker.seen_now(), strict=True) if math.isfinite(row[0])}
    if not seen:
        return False, "no boat seen; check telemetry and feed", {}
    outside_m = {name: fleet.geofence.outside_m(row[0], row[1]) for name, row in seen.items()}
    least = -float(max(outside_m.values()))
    outside = [f"{name} ({row[0]:.0f}, {row[1]:.0f}) m" for name, row in seen.items() if outside_m[name] > 0.0]
    return found(
        f"all boats at least {least:.1f} m inside",
        {"least_inside_m": least},
        (outside, f"outside: {', '.join(outside)}; move them in or widen geofence"),
    )


def check_obstacles(fleet: FleetFile, tracker: Tracker, obstacles: StaticObstacles) -> Found:
    """No boat of ours lies inside an obstacle, or nearer to its edge than the clearance: the edge would keep it in."""
    needed_m = fleet.shield_config.obstacle_clearance_m
    places = dict(zip(fleet.names, tracker.seen_now().tolist(), strict=True))
    seen = {name: places[name][:2] for name in tracker.commanded if math.isfinite(places[name][0])}
    if not seen:
        return False, "no boat of ours seen; check telemetry", {}
    room = [
        (f"obstacle {area.name}", name, -area.distance_m(*place) if area.holds(*place) else area.distance_m(*place))
        for name, place in seen.items()
        for area in obstacles.areas
    ]
    inside = [f"{name} lies inside {area}" for area, name, room_m in room if room_m < 0.0]
    near = [f"{name} lies {room_m:.1f} m from {area}" for area, name, room_m in room if room_m < needed_m]
    least_m = min((room_m for _, _, room_m in room), default=math.inf)
    return found(
        f"boats at least {least_m:.1f} m from all obstacles" if room else "the file has no obstacles",
        {"least_clearance_m": least_m} if room else {},
        (inside, f"{', '.join(inside)}: correct the polygon or circle (numbers, order, place), or move the boat"),
        (near, f"{', '.join(near)}, less than obstacle_clearance_m {needed_m:g}: move it away"),
    )


def check_backup(fleet: FleetFile, tracker: Tracker, obstacles: StaticObstacles) -> Found:
    """Each boat of ours has a backup now: its safety margin is not negative when told to stop."""
    try:
        given = tracker.assemble(tracker.commanded)
        if given is None:
            return False, "no boat seen; check telemetry and feed", {}
        stop = np.column_stack([np.zeros(len(given)), given.heading_rad])
        answer = Shield(fleet.shield_config, obstacles.around()).decide(given, Commands.absolute_rad(stop))
    except SteerclearError as error:
        return False, f"the shield cannot decide: {error}", {}
    own = np.flatnonzero(given.controlled)
    if len(own) == 0:
        return False, "no boat of ours seen; check telemetry", {}
    worst = int(own[np.argmin(answer.safety_margin_m[own])])
    name, margin = given.names[worst], float(answer.safety_margin_m[worst])
    others = np.delete(given.position_m, worst, axis=0)
    nearest_m = float(np.hypot(*(others - given.position_m[worst]).T).min(initial=math.inf))
    near = ", ".join(answer[worst].active_constraints) or "the others"
    return found(
        "nobody near" if math.isinf(margin) else f"least safety margin {margin:.2f} m ({name})",
        {"safety_margin_m": margin, "nearest_m": nearest_m},
        (
            not margin >= 0.0,
            f"{name} has a safety margin of {margin:.2f} m; move it away from {near}",
        ),
    )


SITUATION: Mapping[str, Callable[[FleetFile, Tracker, StaticObstacles], Found]] = {
    "known": check_known,
    "geofence": check_geofence,
    "obstacles": check_obstacles,
    "backup": check_backup,
}
"""The checks of the situation, by name."""
