"""Crowley-BU-LL's primitives as options, and a team that plays given ones.

From the paper: the entry learned to choose among attack, flank, avoid, retreat, guard, tag and no-op. Here they are
options (Sutton, Precup and Singh 1999): each states when it may begin, what it does, and when it ends. How a learner
chooses is up to the learner; `OptionsTeam` plays given options.
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
"""An option ends after this time at the latest."""
EVERY_S = 1.0
"""Time between choices."""
AVOID_M = 16.0
EDGE_M = 4.0
SHOWN = ("x", "y", "heading", "speed", "tagged", "carries", "on_side", "recharged")
"""What a choice may depend on, of each boat."""


@dataclass(frozen=True)
class Option:
    """A primitive. ``begins`` and ``ends`` test a sight and an own boat's number; ``steer`` returns its order."""

    begins: Test
    ends: Test
    steer: Steer


def attack(sight: Sight, number: int) -> Order:
    """Steer straight to the other flag."""
    return go(sight.own[number], sight.goal)


def flank(sight: Sight, number: int) -> Order:
    """Steer round the side with fewer opponents: along the edge to the x of the flag, then in."""
    boat = sight.own[number]
    if boat.x >= sight.base[0] - sight.reach:
        return go(boat, sight.goal)
    above = sum(foe.y > 0.5 * sight.size[1] for foe in sight.foes) * 2 > len(sight.foes)
    edge_y = EDGE_M + boat.radius if above else sight.size[1] - EDGE_M - boat.radius
    ahead_x = min(boat.x + 2.0 * sight.reach, sight.base[0])
    return go(boat, (ahead_x if abs(boat.y - edge_y) < sight.reach else boat.x + 0.5 * sight.reach, edge_y))


def avoid(sight: Sight, number: int) -> Order:
    """Steer away from the nearest opponent, turned off the edges."""
    boat, foe = sight.own[number], nearest_foe(sight, number)
    x, y = ahead(boat.at, heading_to(foe.at, boat.at), sight.reach)
    inside = clip(x, EDGE_M, sight.size[0] - EDGE_M), clip(y, EDGE_M, sight.size[1] - EDGE_M)
    return boat.top, heading_to(boat.at, inside)


def retreat(sight: Sight, number: int) -> Order:
    """Steer straight home; with the flag, to where it counts."""
    at = dock(sight.own[number], sight) if sight.own[number].carries else None
    if at is not None:
        return sight.own[number].top, heading_to(sight.own[number].at, at)
    return go(sight.own[number], sight.home, sight.keepout + sight.own[number].radius + 1.0)


def guard(sight: Sight, number: int) -> Order:
    """Steer to the boat's own station before the flag."""
    return go(sight.own[number], arc(sight)[number], 2.0)


def tag(sight: Sight, number: int) -> Order:
    """Steer to meet the nearest opponent that can be tagged, in the own half."""
    boat, foe = sight.own[number], target(sight, number)
    if foe is None:
        return STOP_MPS, boat.heading
    x, y = meeting_point(boat, foe)
    return go(boat, (min(x, sight.line - 1.0), clip(y, 1.0, sight.size[1] - 1.0)))


def nearest_foe(sight: Sight, number: int) -> Boat:
    """Return the nearest boat of the other team."""
    return min(sight.foes, key=lambda foe: distance(foe.at, sight.own[number].at))


def target(sight: Sight, number: int) -> Boat | None:
    """Return the nearest opponent that a boat could tag: untagged and in its half; None if there is none."""
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
    """Return an option that ends as soon as it could not begin."""
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
"""The options by name."""


def check_option(name: str) -> str:
    """Return the name; refuse an unknown one."""
    if name not in OPTIONS:
        raise PolicyError(f"unknown option {name!r}; choose from {', '.join(OPTIONS)}")
    return name


@dataclass(frozen=True)
class Choice:
    """A boat's option, and the game time of its choice, s."""

    option: str
    since_s: float

    def ended(self, sight: Sight, number: int) -> bool:
        """Return whether it has ended: by its own test, or after `LONGEST_S`."""
        return OPTIONS[self.option].ends(sight, number) or sight.time - self.since_s >= LONGEST_S


def next_option(sight: Sight, number: int, wish: str) -> str:
    """Return a boat's next option: with a flag retreat, else the wished one or guard if it may begin, or no-op."""
    if sight.own[number].carries:
        return "retreat"
    return next((name for name in (wish, "guard") if OPTIONS[name].begins(sight, number)), "no_op")


def row_of(sight: Sight, number: int, choice: Choice) -> dict[str, Any]:
    """Return one boat's option and what it sees, in the own-end frame.

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
    """Chooses an option for each boat once a second; subclasses choose in `wish`."""

    def begin(self, sight: Sight) -> None:
        """Let all boats guard until the first choice."""
        self._next_s = sight.time
        self._choices = [Choice("guard", sight.time) for _ in sight.own]

    def decide(self, sight: Sight) -> list[Order]:
        """Choose if it is time, end options that are over, and follow them."""
        if sight.time >= self._next_s - 1e-9:
            self._next_s = sight.time + EVERY_S
            self.look_round(sight)
        return self.follow(sight)

    def follow(self, sight: Sight) -> list[Order]:
        """Return the options' orders; a boat whose option has ended guards."""
        for number, choice in enumerate(self._choices):
            if choice.ended(sight, number):
                self._choices[number] = Choice(next_option(sight, number, "guard"), sight.time)
        return [OPTIONS[choice.option].steer(sight, number) for number, choice in enumerate(self._choices)]

    def look_round(self, sight: Sight) -> None:
        """Choose an option for every boat."""
        for number, choice in enumerate(self._choices):
            name = next_option(sight, number, self.wish(sight, number))
            if name != choice.option:
                self._choices[number] = Choice(name, sight.time)

    @abstractmethod
    def wish(self, sight: Sight, number: int) -> str:
        """Return the option that a boat wishes for."""


@entrant("options", "one of Crowley-BU-LL's primitives per boat (boats='attack,flank,guard')")
class OptionsTeam(EntrantTeam):
    """Plays a given option per boat. A boat whose option cannot begin guards; one with the flag returns.

    Args:
        boats: names of options, one for all boats or one per boat.

    Raises:
        PolicyError: an unknown option; a wrong number of them is reported once the team's size is known.
    """

    name = "options"

    def __init__(self, boats: str | Sequence[str] = ("attack", "flank", "tag")) -> None:
        super().__init__()
        words = boats.split(",") if isinstance(boats, str) else list(boats)
        self._given = [check_option(str(word).strip()) for word in words]

    def begin(self, sight: Sight) -> None:
        """Assign the options."""
        if len(self._given) not in (1, len(sight.own)):
            raise PolicyError(
                f"boats names {len(self._given)} options for {len(sight.own)} boats; give one or one each"
            )
        self._wishes = self._given * len(sight.own) if len(self._given) == 1 else self._given
        self._choices = [Choice("no_op", -math.inf) for _ in sight.own]

    def decide(self, sight: Sight) -> list[Order]:
        """Follow the options; restart those that have ended."""
        for number, choice in enumerate(self._choices):
            wanted = next_option(sight, number, self._wishes[number])
            if choice.ended(sight, number) or wanted != choice.option:
                self._choices[number] = Choice(wanted, sight.time)
        return [OPTIONS[choice.option].steer(sight, number) for number, choice in enumerate(self._choices)]
