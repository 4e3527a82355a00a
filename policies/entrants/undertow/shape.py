"""The numbers of a raid: distances and times that say how it is sailed and when each phase gives way to the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any


def _number(scripted: float, unit: float, least: float, most: float) -> Any:
    return field(default=scripted, metadata={"limits": (unit, least, most)})


@dataclass(frozen=True)
class Shape:
    """Numbers of a raid, m and s: the script's own, the unit that a learner counts in, least and most."""

    post_m: float = _number(5.0, 2.0, 2.0, 15.0)  # boats this near to their posts are ready
    clear_m: float = _number(11.0, 4.0, 0.0, 25.0)  # opponents but the guard are so far off its ways as it begins,
    kept_clear_m: float = _number(11.0, 5.0, 0.0, 25.0)  # and while the bait waits; nearer ones end the raid
    stale_s: float = _number(30.0, 10.0, 3.0, 120.0)  # longest time that a blocked side is kept
    baited_s: float = _number(25.0, 8.0, 3.0, 60.0)  # longest time for the bait
    near_m: float = _number(17.0, 4.0, 6.0, 40.0)  # the second boat sets out when the guard is so near to the bait
    above_m: float = _number(1.0, 4.0, -20.0, 20.0)  # and so far on the bait's side of the middle
    dragged_m: float = _number(10.0, 4.0, 0.0, 35.0)  # the third sets out when it is so far beyond the line,
    drawn_m: float = _number(6.0, 4.0, -20.0, 20.0)  # the guard no farther than this on the bait's side of the middle,
    gap_m: float = _number(12.0, 4.0, 0.0, 40.0)  # and farther than this from the third
    bait_x_m: float = _number(1.5, 1.5, 0.5, 15.0)  # the bait stands so far beyond the line,
    bait_m: float = _number(4.0, 2.0, 1.5, 18.0)  # and so far from its edge
    drag_m: float = _number(3.0, 1.5, 1.5, 15.0)  # how far from its edge the second boat sails;
    corner_x_m: float = _number(0.0, 4.0, -10.0, 20.0)  # it turns for the flag so far before the flag's x,
    turn_x_m: float = _number(7.0, 3.0, -10.0, 12.0)  # to a point so far behind the flag
    turn_m: float = _number(6.0, 3.0, -10.0, 15.0)  # and beside it,
    turned_m: float = _number(10.0, 4.0, 0.0, 20.0)  # until it is so far from its edge
    door_x_m: float = _number(2.0, 2.0, 0.5, 20.0)  # the third waits so far before the line,
    door_m: float = _number(8.0, 3.0, 2.0, 25.0)  # and from the bait's edge
    wait_x_m: float = _number(5.0, 2.5, 0.5, 20.0)  # it gathers so far before the line,
    wait_m: float = _number(10.0, 3.0, 2.0, 25.0)  # and from the bait's edge
    run_m: float = _number(7.0, 3.0, -10.0, 16.0)  # it sails so far to the bait's side of the flag
    run_x_m: float = _number(4.0, 4.0, -10.0, 25.0)  # until it is so far beyond the line,
    past_x_m: float = _number(4.0, 3.0, -10.0, 12.0)  # then for a point so far behind the flag
    past_m: float = _number(7.5, 3.0, -10.0, 16.0)  # and beside it
    home_m: float = _number(4.0, 10.0, -15.0, 30.0)  # with the flag the third bears off so far in 15 m,
    drag_home_m: float = _number(4.0, 10.0, -15.0, 30.0)  # and the second
    chase_m: float = _number(20.0, 5.0, 0.0, 60.0)  # intruders this near are met; all while the own flag is taken
    edge_m: float = _number(6.0, 2.0, 2.0, 20.0)  # where nobody stays at home the third waits so far off its edge,
    free_m: float = _number(-24.0, 6.0, -60.0, 20.0)  # sets out at this `slack_m`,
    kept_free_m: float = _number(-30.0, 6.0, -60.0, 20.0)  # and gives up below this;
    guard_m: float = _number(7.0, 2.0, 5.5, 20.0)  # the others stand so far before the own flag,
    charge_m: float = _number(22.0, 8.0, 0.0, 60.0)  # and sail at intruders when the third is so near its grab

    def moved(self, units: Sequence[float]) -> Shape:
        """Changed by so many units of `LIMITS` in each number, within its limits."""
        values: dict[str, Any] = {}
        for name, by in zip(NAMES, units, strict=True):
            unit, low, high = LIMITS[name]
            values[name] = min(max(getattr(self, name) + unit * float(by), low), high)
        return replace(self, **values)

    def scaled(self, factor: float) -> Shape:
        """With distances so many times as long; times stay."""
        return replace(self, **{name: factor * getattr(self, name) for name in NAMES if not name.endswith("_s")})


LIMITS: dict[str, tuple[float, float, float]] = {one.name: one.metadata["limits"] for one in fields(Shape)}
"""Unit, least and most of each number."""
NAMES = tuple(LIMITS)
WIDE_M = 80.0
"""Width of the field that the script's numbers were chosen on."""
SCRIPTED = Shape()
"""The script's own, chosen by hand."""
