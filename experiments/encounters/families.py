"""The families of encounters, and drawing encounters of them: a seed and a number always give the same one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np
from steerclear.shield.exceptions import ConfigError

from . import duels, groups, pursuits
from .cast import Cast
from .field import Box, field_of
from .scenes import Conditions, Scenes


@dataclass(frozen=True)
class Family:
    """A kind of encounter.

    Attributes:
        name: of the family.
        build: puts the boats of one encounter into a cast.
        others: how many boats the own team does not command.
        field_for: number of boats that its field is made for; 0 is open water.
        lasts: how many times as long as others it lasts.
    """

    name: str
    build: Callable[[Cast], None]
    others: int
    field_for: int = 0
    lasts: float = 1.0

    @property
    def words(self) -> str:
        """What happens in it."""
        return (self.build.__doc__ or self.name).strip().splitlines()[0]


FAMILIES: dict[str, Family] = {
    family.name: family
    for family in (
        Family("head_on", duels.head_on, 1),
        Family("crossing_left", duels.crossing_left, 1),
        Family("crossing_right", duels.crossing_right, 1),
        Family("overtaking", duels.overtaking, 1),
        Family("converging_2", groups.converging_2, 0),
        Family("converging_3", groups.converging_3, 0),
        Family("circle_3", groups.circle_3, 0, lasts=2.0),
        Family("circle_6", groups.circle_6, 0, lasts=2.0),
        Family("doorway", groups.doorway, 2, field_for=4),
        Family("cluster", groups.cluster, groups.CLUSTER),
        Family("corner", duels.corner, 1, field_for=2),
        Family("sudden_turn", duels.sudden_turn, 1),
        Family("rammer_1", groups.rammer_1, 1),
        Family("at_rest", groups.at_rest, 1),
        Family("rammer_2", groups.rammer_2, 2),
        Family("rammer_3", groups.rammer_3, 3),
        Family("rammer_3v3", groups.rammer_3v3, 3),
        Family("crowd_6", groups.crowd_6, 3, field_for=6),
        Family("crowd_12", groups.crowd_12, 6, field_for=12),
        Family("crowd_40", groups.crowd_40, 20, field_for=40),
        Family("crowd_40_own", groups.crowd_40_own, 0, field_for=40),
        Family("pursued_along_edge", pursuits.pursued_along_edge, 1, field_for=2, lasts=pursuits.LASTS),
        Family("pursued_into_corner", pursuits.pursued_into_corner, 1, field_for=2, lasts=pursuits.LASTS),
        Family("chased_in_box", pursuits.chased_in_box, 1, field_for=2, lasts=pursuits.LASTS),
        Family("chased_in_box_2", pursuits.chased_in_box_2, 2, field_for=3, lasts=pursuits.LASTS),
        Family("chased_in_box_3", pursuits.chased_in_box_3, 3, field_for=4, lasts=pursuits.LASTS),
    )
}
MOST_DRAWS = 200


def get_family(name: str) -> Family:
    """The family of that name.

    Raises:
        ConfigError: there is none; the message names the nearest, or all.
    """
    if name not in FAMILIES:
        near = get_close_matches(name, FAMILIES, 1)
        hint = f"did you mean {near[0]!r}?" if near else f"choose from {', '.join(FAMILIES)}"
        raise ConfigError(f"unknown family {name!r}; {hint}")
    return FAMILIES[name]


def draw(family: str, own: str, other: str, conditions: Conditions, seed: int, first: int, count: int) -> Scenes:
    """Draw the encounters ``first`` .. ``first + count - 1`` of a family.

    Args:
        family: its name.
        own: platform of the own boats.
        other: platform of the others.
        conditions: of the run; only the radius and the noise have a say in where boats start.
        seed: of the run.
        first: number of the first encounter.
        count: how many.

    Raises:
        SteerclearError: an unknown name, or an encounter that cannot be drawn with this radius.
    """
    kind = get_family(family)
    if first < 0 or count < 1:
        raise ConfigError(f"encounters {first} to {first + count - 1} cannot be drawn; ask for at least one, from 0 on")
    casts = [_one(kind, own, other, conditions, seed, number) for number in range(first, first + count)]
    scale = casts[0].scale
    return Scenes(
        family=family,
        platforms=tuple(casts[0].platforms),
        team=np.array(casts[0].team, dtype=np.int64),
        state=np.array([cast.state for cast in casts for _ in _variants(cast)], dtype=np.float64),
        script=np.array([rows for cast in casts for rows in _scripts(cast)], dtype=np.float64),
        goals=np.array([_even(cast.goals) for cast in casts for _ in _variants(cast)], dtype=np.float64),
        current=np.array([cast.current for cast in casts for _ in _variants(cast)]),
        noise_seed=np.array([cast.noise_seed for cast in casts for _ in _variants(cast)], dtype=np.uint64),
        number=np.array([first + k for k, cast in enumerate(casts) for _ in _variants(cast)], dtype=np.int64),
        field=_field(kind, casts[0]),
        length_s=kind.lasts * (30.0 + 15.0 * min(scale, 4.0)),
    )


def _one(kind: Family, own: str, other: str, conditions: Conditions, seed: int, number: int) -> Cast:
    """Draw until no two boats start too close, and none outside the field."""
    cast = Cast(own, other, conditions, seed, kind.name, number)
    gap = 1.1 * conditions.radius_m + 2.0 * conditions.noise_m
    for _ in range(MOST_DRAWS):
        cast.clear()
        kind.build(cast)
        if cast.closest_m() > gap and _is_inside(kind, cast):
            if kind.field_for == 0:
                cast.turn(cast.uniform(-180.0, 180.0))
            cast.settle()
            return cast
    raise ConfigError(f"no encounter of {kind.name} fits a radius of {conditions.radius_m:g} m; choose a smaller one")


def _is_inside(kind: Family, cast: Cast) -> bool:
    """Whether every boat starts inside the field, where there is one."""
    box = _field(kind, cast)
    return box is None or all(box[0] <= x <= box[2] and box[1] <= y <= box[3] for x, y, *_ in cast.state)


def _field(kind: Family, cast: Cast) -> Box | None:
    return field_of(cast, kind.field_for) if kind.field_for else None


def _variants(cast: Cast) -> Sequence[object]:
    return cast.variants or [None]


def _scripts(cast: Cast) -> list[list[np.ndarray]]:
    """Scripts of all boats, once per variant."""
    if not cast.variants:
        return [cast.script]
    return [[row if k == boat else own for k, own in enumerate(cast.script)] for boat, row in cast.variants]


def _even(goals: list[list[tuple[float, float]]]) -> np.ndarray:
    """Goals of all boats, (n, G, 2): boats with fewer stay at their last one."""
    most = max(len(line) for line in goals)
    return np.array([[*line, *[line[-1]] * (most - len(line))] for line in goals], dtype=np.float64)
