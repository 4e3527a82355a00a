"""Scenes and commands that the tests of all guards share."""

import numpy as np
from steerclear.shield.platforms import fresh_state
from steerclear.shield.platforms import layout as L


def scene(*boats, speed=2.0):
    """One game of boats given as (x, y, heading deg), under way."""
    state = np.array([[fresh_state(x, y, heading, speed) for x, y, heading in boats]])
    state[..., L.THRUST] = 100.0
    return state


def ahead(state, speed=2.0):
    """Commands to go straight on."""
    wanted = np.zeros((*state.shape[:2], 2))
    wanted[..., 0] = speed
    return wanted
