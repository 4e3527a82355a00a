"""What a check before the start finds, running many so that none can stop or hide another, and those of the situation.

Checks of links are in `link_checks`, those of a drill in `drill`, the disk's in `blackbox.disk`.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

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
    """What one check found.

    Attributes:
        name: short and stable, such as "rates:blue_1": what ``--accept NAME`` names.
        passed: whether boats may start as far as this check goes.
        text: one line: what was found and, when not passed, what the operator must do.
        figures: what was measured, by name with its unit, such as ``{"position_rate_hz": 19.8}``.
    """

    name: str
    passed: bool
    text: str
    figures: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Check:
    """A check yet to be run.

    Attributes:
        name: as in its result; known beforehand, so that a check that fails to answer is still named.
        run: does it; takes its time, moves boats only if its description says so.
    """

    name: str
    run: Callable[[], CheckResult]


Found = tuple[bool, str, Mapping[str, float]]
"""What a check of one boat found: whether it passed, the line, the figures."""
Seen = TypeVar("Seen")


def checks_by_kind(
    kinds: Mapping[str, Callable[[Seen], Found]], boats: Iterable[str], look: Callable[[str], Seen]
) -> list[Check]:
    """A check of each kind for each boat, named ``kind:boat``.

    Args:
        kinds: what each looks for.
        boats: names.
        look: what is looked at of a boat; called when its checks are run.
    """

    def run(name: str, check: Callable[[Seen], Found], boat: str) -> CheckResult:
        return CheckResult(name, *check(look(boat)))

    return [
        Check(f"{kind}:{boat}", partial(run, f"{kind}:{boat}", check, boat))
        for boat in boats
        for kind, check in kinds.items()
    ]


def run_check(check: Check) -> CheckResult:
    """Run one check; whatever goes wrong inside it is a check not passed.

    Args:
        check: to run.

    Returns:
        Its result, under the name it was registered with.
    """
    try:
        result = check.run()
    except Exception as error:  # a check that broke has shown nothing: the answer is no, and the others still run
        LOG.warning("check %s broke", check.name, exc_info=True)
        return CheckResult(
            check.name, False, f"the check itself failed ({type(error).__name__}: {error}); put that right, run again"
        )
    # a numpy bool is fine; None, NaN or a string that crept in must not count as passed
    passed = isinstance(result.passed, (bool, np.bool_)) and bool(result.passed)
    return CheckResult(check.name, passed, result.text, dict(result.figures))


def validate_accepted(accepted: Iterable[str], checks: Iterable[Check]) -> None:
    """Refuse to accept what is not checked: a misspelt name would otherwise look as if it did something.

    Args:
        accepted: names given by the operator.
        checks: that will be run.

    Raises:
        ConfigError: a name is neither that of a check nor its part before ":".
    """
    names = [check.name for check in checks]
    known = sorted({*names, *(name.split(":")[0] for name in names)})
    for name in accepted:
        if name not in known:
            raise ConfigError(f"--accept {name}: there is no such check; the checks are {', '.join(known)}")


def run_checks(checks: Iterable[Check], seen: Callable[[CheckResult], None] | None = None) -> list[CheckResult]:
    """Run checks one after another, all of them, whatever any of them finds.

    Args:
        checks: in the order to run.
        seen: called with each result as it comes, for a display.

    Returns:
        One result per check, in order.
    """
    results = []
    for check in checks:
        results.append(run_check(check))
        if seen is not None:
            seen(results[-1])
    return results


def not_passed(results: Iterable[CheckResult], accepted: Iterable[str] = ()) -> list[CheckResult]:
    """The results that forbid the start.

    Args:
        results: of `run_checks`.
        accepted: names the operator accepted; the part before ":" accepts it for every boat.

    Returns:
        Those that did not pass and were not accepted, in order. Empty results forbid nothing: the caller decides what
        must be checked.
    """
    allowed = set(accepted)
    return [r for r in results if not r.passed and r.name not in allowed and r.name.split(":")[0] not in allowed]


NEAR_MARGIN_M = 1e5
"""Margins beyond this mean that nobody is near."""


def check_situation(name: str, fleet: FleetFile, tracker: Tracker, grounds: Surroundings = OPEN_WATER) -> CheckResult:
    """One of `SITUATION`, of a tracker that has just been updated.

    Args:
        name: of the check.
        fleet: the file.
        tracker: what is known of all boats.
        grounds: static constraints of the game, see `StaticObstacles`.
    """
    return SITUATION[name](fleet, tracker, StaticObstacles(fleet, grounds))


def check_known(fleet: FleetFile, tracker: Tracker, obstacles: StaticObstacles) -> CheckResult:
    """Every boat of the file has been seen, and lately."""
    limits, missing, ages = fleet.limits, [], []
    for name in fleet.names:
        own = name in tracker.commanded
        age = tracker.navigation_age_s(name) if own else tracker.contact_age_s(name)
        ages.append(age)
        if age > (limits.navigation.max_age_s if own else limits.contact.max_age_s):
            why = f" ({tracker.faults[name]})" if name in tracker.faults else ""
            missing.append(f"{name} {words(age)}{why}")
    oldest = max(ages)
    contradicted = [f"{name}: {tracker.contradicted(name)}" for name in fleet.names if tracker.contradicted(name)]
    if contradicted:
        return CheckResult("known", False, f"sources contradict each other, {'; '.join(contradicted)}")
    if missing:
        text = f"where {', '.join(missing)}; check telemetry and feed, or take boats that are not there out of the file"
        return CheckResult("known", False, text, {"oldest_s": oldest})
    return CheckResult("known", True, f"all {len(ages)} boats seen, oldest fix {oldest:.2f} s", {"oldest_s": oldest})


def check_geofence(fleet: FleetFile, tracker: Tracker, obstacles: StaticObstacles) -> CheckResult:
    """The geofence goes around all boats seen."""
    seen = tracker.seen_now()
    inside = [_inside_m(fleet, row) for row in seen]
    outside = [
        f"{name} ({row[0]:.0f}, {row[1]:.0f}) m"
        for name, row, m in zip(fleet.names, seen, inside, strict=True)
        if m < 0
    ]
    known = [m for m in inside if math.isfinite(m)]
    if not known:
        return CheckResult("geofence", False, "no boat seen; check telemetry and feed")
    figures = {"least_inside_m": min(known)}
    if outside:
        return CheckResult("geofence", False, f"outside: {', '.join(outside)}; move them in or widen geofence", figures)
    return CheckResult("geofence", True, f"all boats at least {min(known):.1f} m inside", figures)


def check_certificate(fleet: FleetFile, tracker: Tracker, obstacles: StaticObstacles) -> CheckResult:
    """Each boat of ours has a backup now: its certificate is not negative when told to stop."""
    try:
        given = tracker.assemble(tracker.commanded)
        if given is None:
            return CheckResult("certificate", False, "no boat seen; check telemetry and feed")
        stop = np.column_stack([np.zeros(len(given)), given.heading_rad])
        answer = Shield(fleet.shield_config, obstacles.around()).decide(given, Commands.absolute_rad(stop))
    except SteerclearError as error:
        return CheckResult("certificate", False, f"the shield cannot decide: {error}")
    own = np.flatnonzero(given.controlled)
    if len(own) == 0:
        return CheckResult("certificate", False, "no boat of ours seen; check telemetry")
    worst = int(own[np.argmin(answer.safety_margin_m[own])])
    margin = float(answer.safety_margin_m[worst])
    others = np.delete(given.position_m, worst, axis=0)
    nearest_m = np.hypot(*(others - given.position_m[worst]).T).min(initial=math.inf)
    figures = {"safety_margin_m": margin, "nearest_m": float(nearest_m)}
    name = given.names[worst]
    if not margin >= 0.0:
        near = ", ".join(answer[worst].active_constraints) or "the others"
        text = f"{name} has a margin of {margin:.2f} m beyond the separation; move it away from {near}"
        return CheckResult("certificate", False, text, figures)
    text = "nobody near" if margin > NEAR_MARGIN_M else f"least margin {margin:.2f} m ({name})"
    return CheckResult("certificate", True, text, figures)


def _inside_m(fleet: FleetFile, row: Sequence[float]) -> float:
    """Distance inside the fence, m; negative outside, NaN where the boat was never seen."""
    xmin, ymin, xmax, ymax = fleet.geofence.box
    x, y = float(row[0]), float(row[1])
    return min(x - xmin, xmax - x, y - ymin, ymax - y) if math.isfinite(x) else math.nan


SITUATION: Mapping[str, Callable[[FleetFile, Tracker, StaticObstacles], CheckResult]] = {
    "known": check_known,
    "geofence": check_geofence,
    "certificate": check_certificate,
}
"""The checks of the situation, by name."""
