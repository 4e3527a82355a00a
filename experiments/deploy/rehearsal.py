"""What can be refused before anything is opened: the shield a file asks for, in its water, with its boats; its logs."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from steerclear.shield import Fleet, Shield
from steerclear.shield.bridge.blackbox.disk import explain
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.static_obstacles import StaticObstacles
from steerclear.shield.exceptions import BridgeError, FleetFileError, SteerclearError
from steerclear.shield.platforms import fresh_state
from steerclear.shield.surroundings import Surroundings

from .grounds import grounds_of

APART_M = 100.0
"""Boats of the rehearsal lie so far apart: only who they are counts."""


def refuse_early(fleet: FleetFile) -> None:
    """See that a run of this file can begin, before anything is sent to a boat.

    Raises:
        FleetFileError: as `rehearse`, or the game's rules make no sense.
        BridgeError: as `check_log_folder`.
    """
    rehearse(fleet, grounds_of(fleet))
    check_log_folder(fleet.log_dir)


def rehearse(fleet: FleetFile, grounds: Surroundings) -> None:
    """Build all that the loop will build of a file, once, as it will be at its first turn.

    Args:
        fleet: the file, with its measured delay.
        grounds: static constraints of the game, see `grounds.grounds_of`.

    Raises:
        FleetFileError: the shield's settings leave nothing of the water, or it would refuse these boats.
    """
    try:
        for fixed in StaticObstacles(fleet, grounds).forms:
            Shield(fleet.shield_config, fixed)
        boats_of(fleet).check()
    except SteerclearError as error:
        raise FleetFileError(f"the shield cannot be built for this file: {error}") from None


def boats_of(fleet: FleetFile) -> Fleet:
    """All boats of a file, at rest and far apart."""
    ours = {boat.name for boat in fleet.ours}
    return Fleet(
        state=np.array([fresh_state(APART_M * i, 0.0, 0.0) for i in range(len(fleet.names))]),
        team=np.array([fleet.team_of[name] for name in fleet.names], dtype=np.int64),
        platforms=tuple(fleet.kind_of[name] for name in fleet.names),
        controlled=np.array([name in ours for name in fleet.names]),
        names=fleet.names,
    )


def check_log_folder(folder: Path) -> None:
    """Make the folder of the logs, and see that it takes a file.

    Raises:
        BridgeError: it cannot be made or written; what is wrong and what to do.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"steerclear")
            file.flush()
    except OSError as error:
        raise BridgeError(f"cannot write logs into {folder}: {explain(error)}") from None
