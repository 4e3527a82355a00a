"""Checks of where all boats are before the start: known, inside the geofence, and with a backup each."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..commands import Commands
from ..exceptions import SteerclearError
from ..platforms import layout as L
from ..shield import Shield
from ..surroundings import OPEN_WATER, Surroundings
from .failsafe import words
from .fleet_file import FleetFile
from .preflight.result import CheckResult
from .static_obstacles import StaticObstacles
from .tracker import Tracker

NEAR_MARGIN_M = 1e5
"""Margins beyond this mean that nobody is near."""


def check_situation(name: str, fleet: FleetFile, roster: Tracker, grounds: Surroundings = OPEN_WATER) -> CheckResult:
    """One of `SITUATION`, of a roster that has just been updated.

    Args:
        name: of the check.
        fleet: the file.
        roster: what is known of all boats.
        grounds: static constraints of the game, see `water.StaticObstacles`.
    """
    return SITUATION[name](fleet, roster, StaticObstacles(fleet, grounds))


def check_known(fleet: FleetFile, roster: Tracker, water: StaticObstacles) -> CheckResult:
    """Every boat of the file has been seen, and lately."""
    limits, missing, ages = fleet.limits, [], []
    for name in fleet.names:
        own = name in roster.commanded
        age = roster.navigation_age_s(name) if own else roster.contact_age_s(name)
        ages.append(age)
        if age > (limits.navigation.max_age_s if own else limits.contact.max_age_s):
            why = f" ({roster.faults[name]})" if name in roster.faults else ""
            missing.append(f"{name} {words(age)}{why}")
    oldest = max(ages)
    contradicted = [f"{name}: {roster.contradicted(name)}" for name in fleet.names if roster.contradicted(name)]
    if contradicted:
        return CheckResult("known", False, f"sources contradict each other, {'; '.join(contradicted)}")
    if missing:
        text = f"where {', '.join(missing)}; check telemetry and feed, or take boats that are not there out of the file"
        return CheckResult("known", False, text, {"oldest_s": oldest})
    return CheckResult("known", True, f"all {len(ages)} boats seen, oldest fix {oldest:.2f} s", {"oldest_s": oldest})


def check_geofence(fleet: FleetFile, roster: Tracker, water: StaticObstacles) -> CheckResult:
    """The geofence goes around all boats seen."""
    seen = roster.seen_now()
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


def check_certificate(fleet: FleetFile, roster: Tracker, water: StaticObstacles) -> CheckResult:
    """Each boat of ours has a backup now: its certificate is not negative when told to stop."""
    try:
        given = roster.assemble(roster.commanded)
        if given is None:
            return CheckResult("certificate", False, "no boat seen; check telemetry and feed")
        stop = np.column_stack([np.zeros(len(given)), given.heading_rad])
        answer = Shield(fleet.shield_config, water.around()).decide(given, Commands.absolute_rad(stop))
    except SteerclearError as error:
        return CheckResult("certificate", False, f"the shield cannot decide: {error}")
    own = np.flatnonzero(given.controlled)
    if len(own) == 0:
        return CheckResult("certificate", False, "no boat of ours seen; check telemetry")
    worst = int(own[np.argmin(answer.certificate_m[own])])
    margin = float(answer.certificate_m[worst])
    figures = {"certificate_m": margin, "nearest_m": _nearest_m(given.state, worst)}
    name = given.names[worst]
    if not margin >= 0.0:
        near = ", ".join(answer[worst].binding) or "the others"
        text = f"{name} has a margin of {margin:.2f} m beyond the separation; move it away from {near}"
        return CheckResult("certificate", False, text, figures)
    text = "nobody near" if margin > NEAR_MARGIN_M else f"least margin {margin:.2f} m ({name})"
    return CheckResult("certificate", True, text, figures)


def _inside_m(fleet: FleetFile, row: Sequence[float]) -> float:
    """Distance inside the fence, m; negative outside, NaN where the boat was never seen."""
    xmin, ymin, xmax, ymax = fleet.geofence.box
    x, y = float(row[0]), float(row[1])
    return min(x - xmin, xmax - x, y - ymin, ymax - y) if math.isfinite(x) else math.nan


def _nearest_m(state: np.ndarray, i: int) -> float:
    others = np.delete(state[:, [L.X, L.Y]], i, axis=0)
    return float(np.hypot(*(others - state[i, [L.X, L.Y]]).T).min()) if len(others) else math.inf


SITUATION: Mapping[str, Callable[[FleetFile, Tracker, StaticObstacles], CheckResult]] = {
    "known": check_known,
    "geofence": check_geofence,
    "certificate": check_certificate,
}
"""The checks of the situation, by name."""
