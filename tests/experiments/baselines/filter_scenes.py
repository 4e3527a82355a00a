"""Scenes, commands and filters that the tests of all filters share."""

import numpy as np
from steerclear.experiments.baselines.registry import FILTERS
from steerclear.shield.config import ShieldConfig
from steerclear.shield.platforms import fresh_state
from steerclear.shield.platforms import layout as L
from steerclear.shield.surroundings import OPEN_WATER

CONFIG = ShieldConfig(edge_m=None)


def scene(*boats, speed=2.0):
    """One game of boats given as (x, y, heading deg), under way."""
    state = np.array([[fresh_state(x, y, heading, speed) for x, y, heading in boats]])
    state[..., L.THRUST] = 100.0
    return state


def crowd(games, seed=2, reach_m=14.0, boats=4):
    """Games of boats at random places."""
    random = np.random.default_rng(seed)
    spots = [
        zip(*random.uniform(-reach_m, reach_m, (2, boats)), random.uniform(-180, 180, boats), strict=True)
        for _ in range(games)
    ]
    return np.concatenate([scene(*one) for one in spots])


def ahead(state, speed=2.0):
    """Commands to go straight on."""
    wanted = np.zeros((*state.shape[:2], 2))
    wanted[..., 0] = speed
    return wanted


def filter_for(name, state, team=None, config=CONFIG, **settings):
    """The filter of a name, for herons."""
    n = state.shape[1]
    fleet = (config, len(state), ("heron",) * n, team or tuple(range(n)), OPEN_WATER)
    return FILTERS[name].make(*fleet, settings)
