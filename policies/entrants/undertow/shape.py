"""Distances and times that define how a raid is sailed and when its phases change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any


def _number(scripted: float, unit: float, least: float, most: float) -> Any:
    return field(default=scripted, metadata={"limits": (unit, least, most)})


@dataclass(frozen=True)
class Shape:
    """Numbers of a raid, m and s: each has the script's value, a learner's unit, a least and a most value."""

    post_m: float = _number(5.0, 2.0, 2.0, 15.0)  # boats this near to their posts are ready
    clear_m: float = _number(11.0, 4.0, 0.0, 25.0)  # distance of non-guards from the raid's ways at its start
    kept_clear_m: float = _number(11.0, 5.0, 0.0, 25.0)  # the same while the bait waits; nearer ones end the raid
    stale_s: float = _number(30.0, 10.0, 3.0, 120.0)  # longest time on a blocked side
    baited_s: float = _number(25.0, 8.0, 3.0, 60.0)  # longest time for the bait
    near_m: float = _number(17.0, 4.0, 6.0, 40.0)  # the second boat starts when the guard is this near to the bait
    above_m: float = _number(1.0, 4.0, -20.0, 20.0)  # and this far on the bait's side of the middle
    dragged_m: float = _number(10.0, 4.0, 0.0, 35.0)  # the third starts when the second is this far beyond the line,
    drawn_m: float = _number(6.0, 4.0, -20.0, 20.0)  # the guard at most this far on the bait's side of the middle
    gap_m: float = _number(12.0, 4.0, 0.0, 40.0)  # and farther than this from the third
    bait_x_m: float = _number(1.5, 1.5, 0.5, 15.0)  # bait's distance beyond the line
    bait_m: float = _number(4.0, 2.0, 1.5, 18.0)  # bait's distance from its edge
    drag_m: float = _number(3.0, 1.5, 1.5, 15.0)  # second boat's distance from its edge
    corner_x_m: float = _number(0.0, 4.0, -10.0, 20.0)  # distance before the flag's x at which it turns for the flag
    turn_x_m: float = _number(7.0, 3.0, -10.0, 12.0)  # it steers to a point this far behind the flag
    turn_m: float = _number(6.0, 3.0, -10.0, 15.0)  # and this far beside it,
    turned_m: float = _number(10.0, 4.0, 0.0, 20.0)  # until it is this far from its edge
    door_x_m: float = _number(2.0, 2.0, 0.5, 20.0)  # third boat's last waiting place: distance before the line
    door_m: float = _number(8.0, 3.0, 2.0, 25.0)  # and from the bait's edge
    wait_x_m: float = _number(5.0, 2.5, 0.5, 20.0)  # its gathering place: distance before the line
    wait_m: float = _number(10.0, 3.0, 2.0, 25.0)  # and from the bait's edge
    run_m: float = _number(7.0, 3.0, -10.0, 16.0)  # its way: distance to the bait's side of the flag,
    run_x_m: float = _number(4.0, 4.0, -10.0, 25.0)  # until it is this far beyond the line
    past_x_m: float = _number(4.0, 3.0, -10.0, 12.0)  # then to a point this far behind the flag
    past_m: float = _number(7.5, 3.0, -10.0, 16.0)  # and this far beside it
    home_m: float = _number(4.0, 10.0, -15.0, 30.0)  # third boat with the flag: sideways distance per 15 m
    drag_home_m: float = _number(4.0, 10.0, -15.0, 30.0)  # the same of the second boat
    chase_m: float = _number(20.0, 5.0, 0.0, 60.0)  # intruders this near are met; all while the own flag is taken
    edge_m: float = _number(6.0, 2.0, 2.0, 20.0)  # lone third boat: distance of its waiting place from its edge
    free_m: float = _number(-24.0, 6.0, -60.0, 20.0)  # it starts at this `slack_m`
    kept_free_m: float = _number(-30.0, 6.0, -60.0, 20.0)  # and gives up below this
    guard_m: float = _number(7.0, 2.0, 5.5, 20.0)  # distance of the guards before the own flag
    charge_m: float = _number(22.0, 8.0, 0.0, 60.0)  # they steer at intruders when the third is this near its grab

    def moved(self, units: Sequence[float]) -> Shape:
        """Return the shape changed by units of `LIMITS` in each number, within its limits."""
        values: dict[str, Any] = {}
        for name, by in zip(NAMES, units, strict=True):
            unit, low, high = LIMITS[name]
            values[name] = min(max(getattr(self, name) + unit * float(by), low), high)
        return replace(self, **values)

    def scaled(self, factor: float) -> Shape:
        """Return the shape with distances scaled by a factor; times do not change."""
        return replace(self, **{name: factor * getattr(self, name) for name in NAMES if not name.endswith("_s")})


LIMITS: dict[str, tuple[float, float, float]] = {one.name: one.metadata["limits"] for one in fields(Shape)}
"""Unit, least and most value of each number."""
NAMES = tuple(LIMITS)
WIDE_M = 80.0
"""Width of the field for which the script's numbers were chosen."""
SCRIPTED = Shape()
"""The script's own numbers, chosen by hand."""
