"""Crowley-BU-LL's primitives as options, and a team that plays fixed ones.

The paper: the entry learned to choose among attack, flank, avoid, retreat, guard, tag and no-op. Here they are options
(Sutton, Precup and Singh 1999): each says when it may begin, what it does, and when it ends. What a learner chooses
with is its own affair; `OptionsTeam` plays given ones.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from steerclear.shield.exceptions import PolicyError

from .catalogue import entrant
from .plane import STOP_MPS, Order, ahead, arc, clip, distance, dock, go, heading_to, meeting_point
from .play import EntrantTeam
from .sight import Boat, Sight

Test = Callable[[Sight, int], bool]
Steer = Callable[[Sight, int], Order]
LONGEST_S = 30.0
"""An option that has not ended by then is ended, s."""
EVERY_S = 1.0
"""Time between looks, s."""
AVOID_M = 16.0
EDGE_M = 4.0
SHOWN = ("x", "y", "heading", "speed", "tagged", "carries", "on_side", "recharged")
"""What a choice may depend on of each boat."""


@dataclass(frozen=True)
class Option:
    """A primitive. ``begins`` and ``ends`` look at a sight and an own boat's number; ``steer`` gives its order."""

    begins: Test
    ends: Test
    steer: Steer


def attack(sight: Sight, number: int) -> Order:
    """Straight to the other flag."""
    return go(sight.own[number], sight.goal)


def flank(sight: Sight, number: int) -> Order:
    """Round the side with fewer foes: along the edge to the height of the flag, then in."""
    boat = sight.own[number]
    if boat.x >= sight.base[0] - sight.reach:
        return go(boat, sight.goal)
    above = sum(foe.y > 0.5 * sight.size[1] for foe in sight.foes) * 2 > len(sight.foes)
    edge_y = EDGE_M + boat.radius if above else sight.size[1] - EDGE_M - boat.radius
    ahead_x = min(boat.x + 2.0 * sight.reach, sight.base[0])
    return go(boat, (ahead_x if abs(boat.y - edge_y) < sight.reach else boat.x + 0.5 * sight.reach, edge_y))


def avoid(sight: Sight, number: int) -> Order:
    """Away from the nearest foe, bent off the edges."""
    boat, foe = sight.own[number], nearest_foe(sight, number)
    x, y = ahead(boat.at, heading_to(foe.at, boat.at), sight.reach)
    inside = clip(x, EDGE_M, sight.size[0] - EDGE_M), clip(y, EDGE_M, sight.size[1] - EDGE_M)
    return boat.top, heading_to(boat.at, inside)


def retreat(sight: Sight, number: int) -> Order:
    """Straight home; with the flag to where it counts."""
    at = dock(sight.own[number], sight) if sight.own[number].carries else None
    if at is not None:
        return sight.own[number].top, heading_to(sight.own[number].at, at)
    return go(sight.own[number], sight.home, sight.keepout + sight.own[number].radius + 1.0)


def guard(sight: Sight, number: int) -> Order:
    """To the boat's own station before the flag."""
    return go(sight.own[number], arc(sight)[number], 2.0)


def tag(sight: Sight, number: int) -> Order:
    """To meet the nearest foe that can be tagged, in the own half."""
    boat, foe = sight.own[number], target(sight, number)
    if foe is None:
        return STOP_MPS, boat.heading
    x, y = meeting_point(boat, foe)
    return go(boat, (min(x, sight.line - 1.0), clip(y, 1.0, sight.size[1] - 1.0)))


def nearest_foe(sight: Sight, number: int) -> Boat:
    """The nearest boat of the other team."""
    return min(sight.foes, key=lambda foe: distance(foe.at, sight.own[number].at))


def target(sight: Sight, number: int) -> Boat | None:
    """The nearest foe that a boat could tag: untagged and in its half; None where there is none."""
    found = [foe for foe in sight.foes if not foe.tagged and not foe.on_side]
    return min(found, key=lambda foe: distance(foe.at, sight.own[number].at), default=None)


def _free(sight: Sight, number: int) -> bool:
    return not sight.own[number].tagged


def _seeks_flag(sight: Sight, number: int) -> bool:
    return _free(sight, number) and not any(boat.carries for boat in sight.own)


def _pressed(sight: Sight, number: int) -> bool:
    near_m = distance(nearest_foe(sight, number).at, sight.own[number].at)
    return _free(sight, number) and not sight.own[number].on_side and near_m < AVOID_M


def _at_home(sight: Sight, number: int) -> bool:
    boat = sight.own[number]
    return distance(boat.at, sight.home) <= sight.reach and not boat.tagged and not boat.carries


def _can_tag(sight: Sight, number: int) -> bool:
    return _free(sight, number) and sight.own[number].recharged and target(sight, number) is not None


def _while(begins: Test, steer: Steer) -> Option:
    """An option that ends when it could not begin."""
    return Option(begins, lambda sight, number: not begins(sight, number), steer)


OPTIONS = {
    "attack": _while(_seeks_flag, attack),
    "flank": _while(_seeks_flag, flank),
    "avoid": _while(_pressed, avoid),
    "retreat": Option(lambda sight, number: True, _at_home, retreat),
    "guard": _while(_free, guard),
    "tag": _while(_can_tag, tag),
    "no_op": _while(lambda sight, number: True, lambda sight, number: (STOP_MPS, sight.own[number].heading)),
}
"""By name."""


def check_option(name: str) -> str:
    """Return the name."""
    if name not in OPTIONS:
        raise PolicyError(f"unknown option {name!r}; choose from {', '.join(OPTIONS)}")
    return name


@dataclass(frozen=True)
class Choice:
    """The option one boat follows, and the game time at which it was chosen, s."""

    option: str
    since_s: float

    def ended(self, sight: Sight, number: int) -> bool:
        """Whether it is over: by its own test, or after `LONGEST_S`."""
        return OPTIONS[self.option].ends(sight, number) or sight.time - self.since_s >= LONGEST_S


def next_option(sight: Sight, number: int, wish: str) -> str:
    """What a boat does that wishes for an option: that if it may begin, home with a flag, else guard or nothing."""
    if sight.own[number].carries:
        return "retreat"
    return next((name for name in (wish, "guard") if OPTIONS[name].begins(sight, number)), "no_op")


def row_of(sight: Sight, number: int, choice: Choice) -> dict[str, Any]:
    """One boat at one moment: the option it follows, and the sight it was chosen at, in the own-end frame.

    Returns:
        ``time_s``, ``boat``, ``option``, ``since_s``, ``own_*`` of the boat itself, ``mate{k}_*`` and ``foe{k}_*`` of
        the others, ``goal_x``, ``goal_y`` m, ``flag_taken``.
    """
    mates = [boat for k, boat in enumerate(sight.own) if k != number]
    boats = {"own": sight.own[number], **{f"mate{k}": mate for k, mate in enumerate(mates)}}
    boats |= {f"foe{k}": foe for k, foe in enumerate(sight.foes)}
    row: dict[str, Any] = {"time_s": sight.time, "boat": number, "option": choice.option, "since_s": choice.since_s}
    row |= {f"{who}_{name}": getattr(boat, name) for who, boat in boats.items() for name in SHOWN}
    return row | {"goal_x": sight.goal[0], "goal_y": sight.goal[1], "flag_taken": sight.taken}


class OptionPlayer(EntrantTeam):
    """Chooses an option for each boat once a second; subclasses say which in `wish`."""

    def begin(self, sight: Sight) -> None:
        """All guard, until the first look."""
        self._next_s = sight.time
        self._choices = [Choice("guard", sight.time) for _ in sight.own]

    def decide(self, sight: Sight) -> list[Order]:
        """Choose where it is time, end what is over, follow."""
        if sight.time >= self._next_s - 1e-9:
            self._next_s = sight.time + EVERY_S
            self.look_round(sight)
        return self.follow(sight)

    def follow(self, sight: Sight) -> list[Order]:
        """What the options order; where one is over the boat guards."""
        for number, choice in enumerate(self._choices):
            if choice.ended(sight, number):
                self._choices[number] = Choice(next_option(sight, number, "guard"), sight.time)
        return [OPTIONS[choice.option].steer(sight, number) for number, choice in enumerate(self._choices)]

    def look_round(self, sight: Sight) -> None:
        """Choose for every boat."""
        for number, choice in enumerate(self._choices):
            name = next_option(sight, number, self.wish(sight, number))
            if name != choice.option:
                self._choices[number] = Choice(name, sight.time)

    @abstractmethod
    def wish(self, sight: Sight, number: int) -> str:
        """The option a boat wishes for."""


@entrant("options", "one of Crowley-BU-LL's primitives per boat (boats='attack,flank,guard')")
class OptionsTeam(EntrantTeam):
    """Plays a given option per boat; a boat whose option cannot begin guards, one with the flag returns.

    Args:
        boats: names of options, one for all boats or one per boat.

    Raises:
        PolicyError: an unknown option; the wrong number is reported once the team's size is known.
    """

    name = "options"

    def __init__(self, boats: str | Sequence[str] = ("attack", "flank", "tag")) -> None:
        super().__init__()
        words = boats.split(",") if isinstance(boats, str) else list(boats)
        self._given = [check_option(str(word).strip()) for word in words]

    def begin(self, sight: Sight) -> None:
        """Hand out the options."""
        if len(self._given) not in (1, len(sight.own)):
            raise PolicyError(
                f"boats names {len(self._given)} options for {len(sight.own)} boats; give one or one each"
            )
        self._wishes = self._given * len(sight.own) if len(self._given) == 1 else self._given
        self._choices = [Choice("no_op", -math.inf) for _ in sight.own]

    def decide(self, sight: Sight) -> list[Order]:
        """Follow the options, begin anew those that ended."""
        for number, choice in enumerate(self._choices):
            wanted = next_option(sight, number, self._wishes[number])
            if choice.ended(sight, number) or wanted != choice.option:
                self._choices[number] = Choice(wanted, sight.time)
        return [OPTIONS[choice.option].steer(sight, number) for number, choice in enumerate(self._choices)]
