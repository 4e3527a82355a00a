"""A decision that needs every stage: run once, all is compiled before boats move."""

from __future__ import annotations

import numpy as np

from .commands import Commands
from .fleet import Fleet
from .surroundings import Surroundings

PLACES_M = ((0.0, 0.0), (0.0, 4.2), (300.0, 3.0))
"""Two boats of ours that run at each other, and an opponent: beside them it would leave no room for the program."""


def tight_spot() -> tuple[Fleet, Commands, Surroundings]:
    """Boats whose wanted commands need the program and its check, between static constraints of each kind."""
    fleet = Fleet.of(
        position_m=PLACES_M,
        heading_rad=[0.0, np.pi, -np.pi / 2],
        speed_mps=[1.5, 1.5, 1.5],
        team=[0, 0, 1],
        platforms="heron",
    )
    around = Surroundings(keep_out=((0.0, -4.0, 1.0),), stops=((-4.0, 0.0, 1.0),), circles=((-4.0, 6.0, 0.5),))
    return fleet, Commands.relative_deg(np.array([[2.0, 0.0]] * len(PLACES_M))), around
