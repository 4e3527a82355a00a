"""Small tables and problems that several test files share."""

import numpy as np
from steerclear.shield.platforms.platform import Platform
from steerclear.shield.platforms.proving import reference_models
from steerclear.shield.platforms.registry import get_platform
from steerclear.shield.tables.files import pack_values
from steerclear.shield.tables.grid import Grid
from steerclear.shield.tables.lookup import LEVELS_S, pack
from steerclear.shield.tables.settings import OtherMay, Problem
from steerclear.shield.tables.solve import start

SMALL = {"rho_last_m": 12.0, "n_rho": 9, "n_psi": 8, "n_beta": 7, "n_own": 3, "n_other": 2}


def problem(mode="worst-case", own="heron", other="heron", horizon_s=6.0, dt_s=0.3, **changes):
    boats = get_platform(own), get_platform(other)
    tops = {"own_top_mps": boats[0].max_speed_mps, "other_top_mps": boats[1].max_speed_mps}
    return Problem(*boats, OtherMay(mode), Grid(**(SMALL | tops | changes)), dt_s, horizon_s)


def random_table(seed=0, **changes):
    """A table of random values, at shorter times higher ones: no symmetry or smoothness hides a wrong index."""
    one = problem(**changes)
    state, random = start(one), np.random.default_rng(seed)
    state.values = random.uniform(0.0, 6.0, one.grid.size).astype(np.float32)
    more = random.uniform(0.0, 1.0, (len(LEVELS_S), one.grid.size))[::-1].cumsum(axis=0)[::-1]
    state.levels = pack(np.minimum(state.values + more, 6.0), 6.0)
    state.residual_m = 0.0
    return pack_values(one, state)


def steady_car(name="car", speed_mps=2.0, turn_dps=0.0):
    """A boat of constant speed and bounded turn rate."""
    with reference_models():  # it cannot stop
        return Platform(
            name=name,
            kind="usv",
            max_speed_mps=speed_mps,
            thrust_map=((0.0, speed_mps), (100.0, speed_mps)),
            turn_gain=turn_dps / 2.0,
        )
