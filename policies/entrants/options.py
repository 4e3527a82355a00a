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
from .observation import Boat, Observation
from .plane import STOP_MPS, Order, ahead, arc, clip, distance, dock, go, heading_to, meeting_point
from .play import EntrantTeam

Test = Callable[[Observation, int], bool]
Steer = Callable[[Observation, int], Order]
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
    """A primitive. ``begins`` and ``ends`` test an observation and a boat's number; ``steer`` returns its order."""

    begins: Test
    ends: Test
    steer: Steer


def attack(obs: Observation, number: int) -> Order:
    """Steer straight to the other flag."""
    return go(obs.own[number], obs.goal)


def flank(obs: Observation, number: int) -> Order:
    """Steer round the side with fewer opponents: along the edge to the x of the flag, then in."""
    boat = obs.own[number]
    if boat.x >= obs.base[0] - obs.reach:
        return go(boat, obs.goal)
    above = sum(foe.y > 0.5 * obs.size[1] for foe in obs.foes) * 2 > len(obs.foes)
    edge_y = EDGE_M + boat.radius if above else obs.size[1] - EDGE_M - boat.radius
    ahead_x = min(boat.x + 2.0 * obs.reach, obs.base[0])
    return go(boat, (ahead_x if abs(boat.y - edge_y) < obs.reach else boat.x + 0.5 * obs.reach, edge_y))


def avoid(obs: Observation, number: int) -> Order:
    """Steer away from the nearest opponent, turned off the edges."""
    boat, foe = obs.own[number], nearest_foe(obs, number)
    x, y = ahead(boat.at, heading_to(foe.at, boat.at), obs.reach)
    inside = clip(x, EDGE_M, obs.size[0] - EDGE_M), clip(y, EDGE_M, obs.size[1] - EDGE_M)
    return boat.top, heading_to(boat.at, inside)


def retreat(obs: Observation, number: int) -> Order:
    """Steer straight home; with the flag, to where it counts."""
    at = dock(obs.own[number], obs) if obs.own[number].carries else None
    if at is not None:
        return obs.own[number].top, heading_to(obs.own[number].at, at)
    return go(obs.own[number], obs.home, obs.keepout + obs.own[number].radius + 1.0)


def guard(obs: Observation, number: int) -> Order:
    """Steer to the boat's own station before the flag."""
    return go(obs.own[number], arc(obs)[number], 2.0)


def tag(obs: Observation, number: int) -> Order:
    """Steer to meet the nearest opponent that can be tagged, in the own half."""
    boat, foe = obs.own[number], target(obs, number)
    if foe is None:
        return STOP_MPS, boat.heading
    x, y = meeting_point(boat, foe)
    return go(boat, (min(x, obs.line - 1.0), clip(y, 1.0, obs.size[1] - 1.0)))


def nearest_foe(obs: Observation, number: int) -> Boat:
    """Return the nearest boat of the other team."""
    return min(obs.foes, key=lambda foe: distance(foe.at, obs.own[number].at))


def target(obs: Observation, number: int) -> Boat | None:
    """Return the nearest opponent that a boat could tag: untagged and in its half; None if there is none."""
    found = [foe for foe in obs.foes if not foe.tagged and not foe.on_side]
    return min(found, key=lambda foe: distance(foe.at, obs.own[number].at), default=None)


def _free(obs: Observation, number: int) -> bool:
    return not obs.own[number].tagged


def _seeks_flag(obs: Observation, number: int) -> bool:
    return _free(obs, number) and not any(boat.carries for boat in obs.own)


def _pressed(obs: Observation, number: int) -> bool:
    near_m = distance(nearest_foe(obs, number).at, obs.own[number].at)
    return _free(obs, number) and not obs.own[number].on_side and near_m < AVOID_M


def _at_home(obs: Observation, number: int) -> bool:
    boat = obs.own[number]
    return distance(boat.at, obs.home) <= obs.reach and not boat.tagged and not boat.carries


def _can_tag(obs: Observation, number: int) -> bool:
    return _free(obs, number) and obs.own[number].recharged and target(obs, number) is not None


def _while(begins: Test, steer: Steer) -> Option:
    """Return an option that ends as soon as it could not begin."""
    return Option(begins, lambda obs, number: not begins(obs, number), steer)


OPTIONS = {
    "attack": _while(_seeks_flag, attack),
    "flank": _while(_seeks_flag, flank),
    "avoid": _while(_pressed, avoid),
    "retreat": Option(lambda obs, number: True, _at_home, retreat),
    "guard": _while(_free, guard),
    "tag": _while(_can_tag, tag),
    "no_op": _while(lambda obs, number: True, lambda obs, number: (STOP_MPS, obs.own[number].heading)),
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

    def ended(self, obs: Observation, number: int) -> bool:
        """Return whether it has ended: by its own test, or after `LONGEST_S`."""
        return OPTIONS[self.option].ends(obs, number) or obs.time - self.since_s >= LONGEST_S


def next_option(obs: Observation, number: int, wish: str) -> str:
    """Return a boat's next option: with a flag retreat, else the wished one or guard if it may begin, or no-op."""
    if obs.own[number].carries:
        return "retreat"
    return next((name for name in (wish, "guard") if OPTIONS[name].begins(obs, number)), "no_op")


def row_of(obs: Observation, number: int, choice: Choice) -> dict[str, Any]:
    """Return one boat's option and what it sees, in the own-end frame.

    Returns:
        ``time_s``, ``boat``, ``option``, ``since_s``, ``own_*`` of the boat itself, ``mate{k}_*`` and ``foe{k}_*`` of
        the others, ``goal_x``, ``goal_y`` m, ``flag_taken``.
    """
    mates = [boat for k, boat in enumerate(obs.own) if k != number]
    boats = {"own": obs.own[number], **{f"mate{k}": mate for k, mate in enumerate(mates)}}
    boats |= {f"foe{k}": foe for k, foe in enumerate(obs.foes)}
    row: dict[str, Any] = {"time_s": obs.time, "boat": number, "option": choice.option, "since_s": choice.since_s}
    row |= {f"{who}_{name}": getattr(boat, name) for who, boat in boats.items() for name in SHOWN}
    return row | {"goal_x": obs.goal[0], "goal_y": obs.goal[1], "flag_taken": obs.taken}


class OptionPlayer(EntrantTeam):
    """Chooses an option for each boat once a second; subclasses choose in `wish`."""

    def begin(self, obs: Observation) -> None:
        """Let all boats guard until the first choice."""
        self._next_s = obs.time
        self._choices = [Choice("guard", obs.time) for _ in obs.own]

    def decide(self, obs: Observation) -> list[Order]:
        """Choose if it is time, end options that are over, and follow them."""
        if obs.time >= self._next_s - 1e-9:
            self._next_s = obs.time + EVERY_S
            self.look_round(obs)
        return self.follow(obs)

    def follow(self, obs: Observation) -> list[Order]:
        """Return the options' orders; a boat whose option has ended guards."""
        for number, choice in enumerate(self._choices):
            if choice.ended(obs, number):
                self._choices[number] = Choice(next_option(obs, number, "guard"), obs.time)
        return [OPTIONS[choice.option].steer(obs, number) for number, choice in enumerate(self._choices)]

    def look_round(self, obs: Observation) -> None:
        """Choose an option for every boat."""
        for number, choice in enumerate(self._choices):
            name = next_option(obs, number, self.wish(obs, number))
            if name != choice.option:
                self._choices[number] = Choice(name, obs.time)

    @abstractmethod
    def wish(self, obs: Observation, number: int) -> str:
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

    def begin(self, obs: Observation) -> None:
        """Assign the options."""
        if len(self._given) not in (1, len(obs.own)):
            raise PolicyError(f"boats names {len(self._given)} options for {len(obs.own)} boats; give one or one each")
        self._wishes = self._given * len(obs.own) if len(self._given) == 1 else self._given
        self._choices = [Choice("no_op", -math.inf) for _ in obs.own]

    def decide(self, obs: Observation) -> list[Order]:
        """Follow the options; restart those that have ended."""
        for number, choice in enumerate(self._choices):
            wanted = next_option(obs, number, self._wishes[number])
            if choice.ended(obs, number) or wanted != choice.option:
                self._choices[number] = Choice(wanted, obs.time)
        return [OPTIONS[choice.option].steer(obs, number) for number, choice in enumerate(self._choices)]
