"""A person plays by choosing options with keys; what was chosen when, and at what sight, is kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from steerclear.shield.exceptions import PolicyError

from ..keyboard import Keys, window_keys
from .options import OPTIONS, Choice, OptionPlayer
from .plane import Order
from .sight import Sight

BOAT_KEYS = ("q", "w", "e", "r", "t", "y")
OPTION_KEYS = {str(number): name for number, name in enumerate(OPTIONS, start=1)}
KEPT_S = 1.0
"""A row per boat is kept this often, s, and at once where a person chooses."""
SHOWN = ("x", "y", "heading", "speed", "tagged", "carries", "on_side", "recharged")
Say = Callable[[str], None]
Row = dict[str, Any]


class Demonstrator(OptionPlayer):
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
        """Begin a game."""
        self._keys = self._given_keys or window_keys(env)
        if len(agent_ids) > len(BOAT_KEYS):
            raise PolicyError(f"a person chooses for at most {len(BOAT_KEYS)} boats; the team has {len(agent_ids)}")
        super().reset(env, agent_ids, seed)

    def begin(self, sight: Sight) -> None:
        """The first boat is chosen for; all boats guard."""
        super().begin(sight)
        self._boat, self._held = 0, set[str]()

    def decide(self, sight: Sight) -> list[Order]:
        """Take what the person chose, end what is over, follow the rest."""
        chosen, orders = self._read_keys(sight), self.follow(sight)
        if chosen is not None or sight.time >= self._next_s:
            self._next_s = sight.time + KEPT_S
            self.rows += [row_of(sight, k, choice, k == chosen) for k, choice in enumerate(self._choices)]
        return orders

    def wish(self, sight: Sight, number: int) -> str:
        """The option that was chosen."""
        return self._choices[number].option

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
    boats = {"own": sight.own[number], **{f"mate{k}": mate for k, mate in enumerate(mates)}}
    boats |= {f"foe{k}": foe for k, foe in enumerate(sight.foes)}
    row: Row = {"time_s": sight.time, "boat": number, "option": choice.option, "since_s": choice.since_s}
    row |= {"chosen": chosen, **{f"{who}_{name}": getattr(boat, name) for who, boat in boats.items() for name in SHOWN}}
    return row | {"goal_x": sight.goal[0], "goal_y": sight.goal[1], "flag_taken": sight.taken}
