"""How the game stands, as its referee sees it, and reading it from what somebody sent."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Protocol

from pydantic import Field, TypeAdapter, ValidationError

from ..exceptions import FeedError

MOST_BOATS, LONGEST_NAME, LARGEST = 64, 64, 1e9

Duration = Annotated[float, Field(ge=0.0, le=LARGEST)]
Metres = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Pair = tuple[Annotated[int, Field(ge=0, lt=2**63)], Annotated[int, Field(ge=0, lt=2**63)]]


@dataclass(frozen=True)
class BoatStatus:
    """What the game says of one boat; names as in `steerclear.env`."""

    tagged: bool
    has_flag: bool
    oob: bool
    on_side: bool
    cooldown_s: Duration
    driven: bool


@dataclass(frozen=True)
class FlagStatus:
    """One team's flag: where it is, m in the field, and whether an opponent carries it."""

    x_m: Metres
    y_m: Metres
    taken: bool


@dataclass(frozen=True)
class GameState:
    """How the game stands; pairs are blue, red.

    Attributes:
        time_s: since the game began, s.
        boats: status of each boat by its name.
        flags: the two flags.
        captures, grabs, tags: counts of each team.
        over: whether the game has ended.
        note: what the referee has to say, such as whom it waits for.
    """

    time_s: Duration
    boats: Annotated[Mapping[str, BoatStatus], Field(max_length=MOST_BOATS)]
    flags: tuple[FlagStatus, FlagStatus]
    captures: Pair = (0, 0)
    grabs: Pair = (0, 0)
    tags: Pair = (0, 0)
    over: bool = False
    note: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Plain values, as the feed and the black box have them."""
        pairs = {name: list(getattr(self, name)) for name in ("captures", "grabs", "tags")}
        return {
            "time_s": self.time_s,
            "boats": {name: dict(vars(status)) for name, status in self.boats.items()},
            "flags": [dict(vars(flag)) for flag in self.flags],
            **pairs,
            "over": self.over,
            "note": self.note,
        }


class GameSource(Protocol):
    """Gives the latest state of the game; never waits."""

    def game(self) -> GameState | None:
        """None: none yet."""

    def game_age_s(self) -> float:
        """Its age, s; inf: none yet."""


_READER = TypeAdapter(GameState)


def game_state(content: Mapping[str, Any]) -> GameState:
    """The state of a game from plain values, the inverse of `GameState.as_dict`.

    Raises:
        FeedError: a value is missing or makes no sense.
    """
    if missing := [key for key in ("captures", "grabs", "tags", "over") if key not in content]:
        raise FeedError(f"the game has no {missing[0]}; give it")
    try:
        found = _READER.validate_json(json.dumps(dict(content)), strict=True)  # by JSON's rules lists are pairs
    except ValidationError as error:
        raise FeedError(f"the game's {fault_of(error)}") from None
    except (TypeError, ValueError) as error:
        raise FeedError(f"the game cannot be read ({short(error)})") from None
    for name in found.boats:
        check_name(name, "boat")
    return found


def check_name(value: Any, what: str) -> str:
    """A name of a sender or boat.

    Raises:
        FeedError: it is none.
    """
    if not isinstance(value, str) or not 0 < len(value) <= LONGEST_NAME or not value.isprintable():
        raise FeedError(f"{what} is {short(value)}; give a name of 1 to {LONGEST_NAME} characters")
    return value


def fault_of(error: ValidationError) -> str:
    """The first thing wrong: where it is, the value found, and what it should be."""
    fault = error.errors(include_url=False)[0]
    place = ".".join(map(str, fault["loc"])) or "content"
    if fault["type"] in ("missing", "missing_argument"):
        return f"{short(place)} is missing; give it"
    return f"{short(place)} is {short(fault['input'])}: {fault['msg'].replace('Input', 'it', 1)}"


def short(value: Any) -> str:
    """A value in a line for a person, 60 characters at most."""
    text = value if isinstance(value, str) else str(value) if isinstance(value, BaseException) else repr(value)
    text = "".join(letter if letter.isprintable() else "?" for letter in text)
    return text if len(text) <= 60 else f"{text[:59]}…"
