"""The numbers of a raid: distances and times that say how it is sailed and when each phase gives way to the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any


@dataclass(frozen=True)
class Shape:
    """Numbers of a raid, m and s; each is kept within the limits in `LIMITS`.

    Attributes:
        post_m: boats this near to their posts are ready.
        clear_m: distance from the ways of a raid that all opponents but the guard keep when it begins.
        kept_clear_m: the same while the bait waits; nearer ones end the raid.
        stale_s: longest time that a blocked side is kept.
        baited_s: longest time for the bait.
        near_m: the second boat sets out when the guard is so near to the bait.
        above_m: and so far on the bait's side of the middle.
        dragged_m: the third sets out when the second is so far beyond the line,
        drawn_m: the guard no farther than this on the bait's side of the middle,
        gap_m: and farther than this from the third.
        bait_x_m, bait_m: where the bait stands: beyond the line, from its edge.
        drag_m: how far from its edge the second boat sails.
        corner_x_m: it turns for the flag so far before the flag's x;
        turn_x_m, turn_m: to a point so far behind the flag and beside it,
        turned_m: until it is so far from its edge.
        door_x_m, door_m: where the third waits: before the line, from the bait's edge.
        wait_x_m, wait_m: where it gathers.
        run_m, run_x_m: the third sails so far to the bait's side of the flag until it is so far beyond the line,
        past_x_m, past_m: then for a point so far behind the flag and beside it.
        home_m, drag_home_m: third and second boat with the flag bear off so far in 15 m.
        chase_m: intruders this near are met; all of them while the own flag is taken.
        edge_m: how far from its edge the third boat waits while no opponent stays at home;
        free_m: it sets out when opponents that cut it off at once would miss it by so much, see `way.slack_m`,
        kept_free_m: and gives up below this;
        guard_m: the others stand so far before the own flag,
        charge_m: and sail at intruders when the third is this near to where it grabs.
    """

    post_m: float = 5.0
    clear_m: float = 11.0
    kept_clear_m: float = 11.0
    stale_s: float = 30.0
    baited_s: float = 25.0
    near_m: float = 17.0
    above_m: float = 1.0
    dragged_m: float = 10.0
    drawn_m: float = 6.0
    gap_m: float = 12.0
    bait_x_m: float = 1.5
    bait_m: float = 4.0
    drag_m: float = 3.0
    corner_x_m: float = 0.0
    turn_x_m: float = 7.0
    turn_m: float = 6.0
    turned_m: float = 10.0
    door_x_m: float = 2.0
    door_m: float = 8.0
    wait_x_m: float = 5.0
    wait_m: float = 10.0
    run_m: float = 7.0
    run_x_m: float = 4.0
    past_x_m: float = 4.0
    past_m: float = 7.5
    home_m: float = 4.0
    drag_home_m: float = 4.0
    chase_m: float = 20.0
    edge_m: float = 6.0
    free_m: float = -24.0
    kept_free_m: float = -30.0
    guard_m: float = 7.0
    charge_m: float = 22.0

    def moved(self, units: Sequence[float]) -> Shape:
        """Changed by so many units of `LIMITS` in each number, within its limits."""
        values: dict[str, Any] = {}
        for name, by in zip(NAMES, units, strict=True):
            unit, low, high = LIMITS[name]
            values[name] = min(max(getattr(self, name) + unit * float(by), low), high)
        return replace(self, **values)

    def scaled(self, factor: float) -> Shape:
        """With distances so many times as long; times stay."""
        return replace(self, **{name: factor * getattr(self, name) for name in NAMES if name not in TIMES})


NAMES = tuple(field.name for field in fields(Shape))
TIMES = ("stale_s", "baited_s")
WIDE_M = 80.0
"""Width of the field that the script's numbers were chosen on."""
LIMITS = {
    "post_m": (2.0, 2.0, 15.0),
    "clear_m": (4.0, 0.0, 25.0),
    "kept_clear_m": (5.0, 0.0, 25.0),
    "stale_s": (10.0, 3.0, 120.0),
    "baited_s": (8.0, 3.0, 60.0),
    "near_m": (4.0, 6.0, 40.0),
    "above_m": (4.0, -20.0, 20.0),
    "dragged_m": (4.0, 0.0, 35.0),
    "drawn_m": (4.0, -20.0, 20.0),
    "gap_m": (4.0, 0.0, 40.0),
    "bait_x_m": (1.5, 0.5, 15.0),
    "bait_m": (2.0, 1.5, 18.0),
    "drag_m": (1.5, 1.5, 15.0),
    "corner_x_m": (4.0, -10.0, 20.0),
    "turn_x_m": (3.0, -10.0, 12.0),
    "turn_m": (3.0, -10.0, 15.0),
    "turned_m": (4.0, 0.0, 20.0),
    "door_x_m": (2.0, 0.5, 20.0),
    "door_m": (3.0, 2.0, 25.0),
    "wait_x_m": (2.5, 0.5, 20.0),
    "wait_m": (3.0, 2.0, 25.0),
    "run_m": (3.0, -10.0, 16.0),
    "run_x_m": (4.0, -10.0, 25.0),
    "past_x_m": (3.0, -10.0, 12.0),
    "past_m": (3.0, -10.0, 16.0),
    "home_m": (10.0, -15.0, 30.0),
    "drag_home_m": (10.0, -15.0, 30.0),
    "chase_m": (5.0, 0.0, 60.0),
    "edge_m": (2.0, 2.0, 20.0),
    "free_m": (6.0, -60.0, 20.0),
    "kept_free_m": (6.0, -60.0, 20.0),
    "guard_m": (2.0, 5.5, 20.0),
    "charge_m": (8.0, 0.0, 60.0),
}
"""Unit that a learner counts in, least and most of each number."""
SCRIPTED = Shape()
"""The script's own, chosen by hand."""
