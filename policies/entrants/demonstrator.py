"""A person plays by choosing options with keys; what was chosen when, and at what sight, is kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from steerclear.shield.exceptions import PolicyError

from ..keyboard import Keys, window_keys
from .options import OPTIONS, Choice, next_option
from .plane import Order
from .play import EntrantTeam
from .sight import Boat, Sight

BOAT_KEYS = ("q", "w", "e", "r", "t", "y")
OPTION_KEYS = {str(number): name for number, name in enumerate(OPTIONS, start=1)}
KEPT_S = 1.0
"""A row per boat is kept this often, s, and at once where a person chooses."""
Say = Callable[[str], None]
Row = dict[str, Any]


class Demonstrator(EntrantTeam):
    """Plays the options a person chooses.

    Args:
        keys: where keys come from; None takes the window.
        say: told what was chosen, in words.

    Attributes:
        rows: demonstrations so far, see `row_of`.
    """

    name = "demonstrator"

    def __init__(self, keys: Keys | None = None, say: Say = lambda words: None) -> None:
        super().__init__()
        self._given_keys, self._say = keys, say
        self.rows: list[Row] = []

    def reset(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Begin a game.

        Raises:
            PolicyError: no window and no keys, more boats than keys, or see `EntrantTeam.reset`.
        """
        self._keys = self._given_keys or window_keys(env)
        if len(agent_ids) > len(BOAT_KEYS):
            raise PolicyError(f"a person chooses for at most {len(BOAT_KEYS)} boats; the team has {len(agent_ids)}")
        super().reset(env, agent_ids, seed)

    def begin(self, sight: Sight) -> None:
        """The first boat is chosen for; all boats guard."""
        self._boat, self._held, self._next_s = 0, set[str](), sight.time
        self._choices = [Choice("guard", sight.time) for _ in sight.own]

    def decide(self, sight: Sight) -> list[Order]:
        """Take what the person chose, end what is over, follow the rest."""
        chosen = self._read_keys(sight)
        for number, choice in enumerate(self._choices):
            if choice.ended(sight, number):
                self._choices[number] = Choice(next_option(sight, number, "guard"), sight.time)
        if chosen is not None or sight.time >= self._next_s:
            self._next_s = sight.time + KEPT_S
            self.rows += [row_of(sight, k, choice, k == chosen) for k, choice in enumerate(self._choices)]
        return [OPTIONS[choice.option].steer(sight, number) for number, choice in enumerate(self._choices)]

    def _read_keys(self, sight: Sight) -> int | None:
        """The boat for which an option was just chosen, None when none was. A key counts when it goes down."""
        held = self._keys()
        pressed, self._held = held - self._held, set(held)
        for number, key in enumerate(BOAT_KEYS[: len(self._choices)]):
            if key in pressed:
                self._boat = number
        for key, name in OPTION_KEYS.items():
            if key in pressed:
                return self._choose(sight, name)
        return None

    def _choose(self, sight: Sight, name: str) -> int | None:
        if not OPTIONS[name].begins(sight, self._boat):
            self._say(f"boat {self._boat + 1} cannot begin {name} now")
            return None
        self._choices[self._boat] = Choice(name, sight.time)
        self._say(f"boat {self._boat + 1}: {name}")
        return self._boat


def row_of(sight: Sight, number: int, choice: Choice, chosen: bool) -> Row:
    """One boat at one moment: the option it follows, and the sight it was chosen at, in the own-end frame.

    Returns:
        ``time_s``, ``boat``, ``option``, ``since_s``, ``chosen`` (by the person at this very moment), ``own_*`` of the
        boat itself, ``mate{k}_*`` and ``foe{k}_*`` of the others, ``goal_x``, ``goal_y`` m, ``flag_taken``.
    """
    mates = [boat for k, boat in enumerate(sight.own) if k != number]
    row: Row = {"time_s": sight.time, "boat": number, "option": choice.option, "since_s": choice.since_s}
    row |= {"chosen": chosen, **_boat("own", sight.own[number])}
    for k, mate in enumerate(mates):
        row |= _boat(f"mate{k}", mate)
    for k, foe in enumerate(sight.foes):
        row |= _boat(f"foe{k}", foe)
    return row | {"goal_x": sight.goal[0], "goal_y": sight.goal[1], "flag_taken": sight.taken}


def _boat(who: str, boat: Boat) -> Row:
    names = ("x", "y", "heading", "speed", "tagged", "carries", "on_side", "recharged")
    return {f"{who}_{name}": getattr(boat, name) for name in names}
