"""Static constraints of the game a fleet plays, by the code that gives them to the shield in the simulator."""

from __future__ import annotations

from steerclear.env.core import BatchedMctf
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.surroundings import OPEN_WATER, Surroundings
from steerclear.shield.wrappers.mctf import surroundings_of

from .rules import game_config


def grounds_of(fleet: FleetFile) -> Surroundings:
    """Obstacles of the game, and the circle of our own flag at home as ``stops``; nothing when no boat plays.

    Raises:
        FleetFileError: the preset or a rule is unknown, or a rule contradicts another key.
    """
    if not fleet.agent_ids:
        return OPEN_WATER
    return surroundings_of(BatchedMctf(game_config(fleet)), fleet.team_number)
