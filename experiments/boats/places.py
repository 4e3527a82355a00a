"""The game that boats make up, and where they start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.experiments.play.openings import opening
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import layout as L

from .settings import SimBoat

Place = tuple[float, float, float]
"""x m, y m, heading deg."""
_BLUE, _RED = 0, 1


def playing(boats: Sequence[SimBoat]) -> list[int]:
    """Numbers of the boats that play, blue first; none when the teams are not of one size."""
    blue = [i for i, boat in enumerate(boats) if boat.team == _BLUE]
    red = [i for i, boat in enumerate(boats) if boat.team == _RED]
    return [*blue, *red] if len(blue) == len(red) else []


def game_of(boats: Sequence[SimBoat], preset: str | GameConfig, rules: Mapping[str, Any]) -> GameConfig | None:
    """The game these boats play, by a preset or as given; None when the teams are not of one size.

    Raises:
        ConfigError: the preset or a rule is unknown, or a boat has a policy and no game to play it in.
    """
    players = playing(boats)
    stray = [boat.name for i, boat in enumerate(boats) if boat.policy and i not in players]
    if stray:
        raise ConfigError(
            f"boat {stray[0]!r} has a policy and no game: give as many red boats as blue ones, or no policy"
        )
    if not players:
        return None
    settings = {**rules, "team_size": len(players) // 2, "platforms": tuple(boats[i].platform for i in players)}
    return preset.replace(**settings) if isinstance(preset, GameConfig) else GameConfig.preset(preset, **settings)


def start_places(boats: Sequence[SimBoat], config: GameConfig | None, random_seed: int | None) -> list[Place]:
    """Start of each boat: its own place, else the game's fixed one for teams of that size, or a random one.

    Args:
        boats: all boats.
        config: the game the boats play, if any.
        random_seed: draw places apart from each other, from this seed; None: the fixed ones.

    Raises:
        ConfigError: there is no room for random places, or a boat outside the game has no place of its own.
    """
    largest = max(1, *(sum(boat.team == team for boat in boats) for team in (_BLUE, _RED)))
    game = config or GameConfig.preset("aamas2024", team_size=largest)
    free = _fixed(game) if random_seed is None else _random(game, random_seed)
    waiting = {_BLUE: free[: game.team_size], _RED: free[game.team_size :]}
    return [_next(waiting, boat) for boat in boats]


def _next(waiting: dict[int, list[Place]], boat: SimBoat) -> Place:
    places = waiting.get(boat.team, [])
    place = places.pop(0) if places else None
    if boat.start is None and place is None:
        raise ConfigError(f"boat {boat.name!r} is in no team; give it a start (x m, y m, heading deg)")
    return boat.start or place  # type: ignore[return-value]  # one of them is there


def _fixed(game: GameConfig) -> list[Place]:
    core = BatchedMctf(game.replace(default_start=True))
    return [(float(row[L.X]), float(row[L.Y]), float(row[L.HEADING])) for row in core.state[0]]


def _random(game: GameConfig, seed: int) -> list[Place]:
    start = opening(game, seed)
    pairs = zip(start["agent_position"], start["agent_heading"], strict=True)
    return [(float(x), float(y), float(heading)) for (x, y), heading in pairs]
