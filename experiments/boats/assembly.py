"""Building a fleet: boats behind their ports, and the world they are in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from steerclear.env.config import GameConfig
from steerclear.shield.exceptions import ConfigError

from .boat import Boat, Setting
from .game import Game
from .hub import PositionHub
from .places import playing, start_places
from .ports import Ports
from .settings import SimBoat, Water
from .weather import Weather
from .world import World


def check_boats(boats: Sequence[SimBoat], noise: float) -> None:
    """Check what single boats cannot.

    Raises:
        ConfigError: no boat, two of one name, or noise out of range.
    """
    if not boats or len({boat.name for boat in boats}) < len(boats):
        raise ConfigError("give at least one boat, each with a name of its own")
    if not 0.0 <= noise <= 100.0:
        raise ConfigError(f"noise is {noise}; give 0 for none, 1 as measured, at most 100")


def build_boats(
    boats: Sequence[SimBoat],
    config: GameConfig | None,
    setting: Setting,
    ports: Ports,
    seed: int,
    random_start: bool,
) -> dict[str, Boat]:
    """Boats at their start, plugged in, by name.

    Raises:
        ConfigError: a place, an address or a system id cannot be used.
    """
    places = start_places(boats, config, seed if random_start else None)
    seeds = np.random.SeedSequence(seed).spawn(len(boats))
    built = {}
    for i, (spec, place) in enumerate(zip(boats, places, strict=True)):
        boat = Boat(spec, place, spec.system_id or i + 1, setting, seeds[i])
        ports.plug_in(boat)
        built[spec.name] = boat
    return built


def build_world(
    boats: Mapping[str, Boat],
    config: GameConfig | None,
    weather: tuple[Water, Setting],
    hub: PositionHub | None,
    seed: int,
    waits: bool,
) -> World:
    """The world of built boats.

    Raises:
        ConfigError: a policy cannot be used.
    """
    everyone = list(boats.values())
    players = [everyone[i] for i in playing([boat.spec for boat in everyone])]
    driven = {i: boat.spec.policy for i, boat in enumerate(players) if boat.spec.policy}
    game = None if config is None else Game(config, driven, seed)
    water, setting = weather
    gusts = Weather(water, setting.frame, np.random.default_rng([seed, 0x9057]))
    return World(everyone, gusts, game, players, hub, waits)
