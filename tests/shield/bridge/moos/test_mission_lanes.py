"""The lanes of the mission on the real MOOS-IvP, sailed without it: a hull as uSimMarineV22 moves it behind pMarinePID.

At 1.2 m/s its rudder turns it at up to 15 deg/s, a heron's at up to 58 deg/s. Taken for herons, boats of ours come
within 1 m on these lanes.
"""

import math

import numpy as np
import pytest
from real_mission import LANES, PLATFORMS, POSITION_ERROR_M, SEPARATION_M, SPEED_MPS
from steerclear.shield import Commands, Fleet, Shield
from steerclear.shield.platforms import fresh_state, get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import (
    kept_share,
    move_along_mean,
    speed_of_thrust,
    speed_towards,
    turn_of_rudder,
    update_rudder,
    update_thrust,
)
from steerclear.shield.surroundings import Surroundings

HERON, TAKEN_FOR = get_platform("heron").pack(), get_platform(PLATFORMS["uSimMarineV22"])
FULL_MPS = 5.0
"""uSimMarineV22 turns at its turn_rate from this speed on, and in proportion to speed below."""
DT_S, DELAY_STEPS, OURS, TEAM = 0.1, 2, 3, np.array([0, 0, 0, 1, 1, 1])
ARRIVED_M = 3.0


def step_hull(row, speed_mps, error_deg):
    update_thrust(HERON, row, speed_mps, DT_S)
    update_rudder(HERON, row, error_deg, DT_S)
    thrust, rudder = row[L.THRUST], row[L.RUDDER]
    speed = speed_towards(HERON, row[L.SPEED], speed_of_thrust(HERON, thrust) * kept_share(HERON, rudder), DT_S)
    turn = turn_of_rudder(HERON, thrust, rudder, DT_S) * min(1.0, speed / FULL_MPS)
    move_along_mean(HERON, row, speed, row[L.HEADING] + turn, DT_S)


def sail(seed, seconds, is_shielded):
    """Least distance of a boat of ours from any other, m, and how many commands of ours were changed."""
    rng, closest, changed = np.random.default_rng(seed), math.inf, 0
    bearings = [math.atan2(there[0] - here[0], there[1] - here[1]) for here, there in LANES]
    rows = np.array([fresh_state(*here, math.degrees(way)) for (here, _), way in zip(LANES, bearings, strict=True)])
    rows[:, : L.Y + 1] += rng.normal(0.0, 0.5, (len(rows), 2))
    shield = Shield(
        surroundings=Surroundings(field=(-20.0, -20.0, 100.0, 60.0)),
        delay_s=DELAY_STEPS * DT_S,
        position_error_m=POSITION_ERROR_M,
    )
    ends, pending = [1] * len(rows), [[(0.0, way)] * DELAY_STEPS for way in bearings]
    for _ in range(round(seconds / DT_S)):
        wanted = np.empty((len(rows), 2))
        for i, row in enumerate(rows):
            if math.dist(LANES[i][ends[i]], row[: L.Y + 1]) < ARRIVED_M:
                ends[i] = 1 - ends[i]
            dx, dy = LANES[i][ends[i]] - row[: L.Y + 1]
            wanted[i] = SPEED_MPS, math.atan2(dx, dy) % (2.0 * math.pi)
        told = wanted
        if is_shielded:
            seen = np.full_like(rows, np.nan)
            seen[:, : L.SPEED + 1] = rows[:, : L.SPEED + 1]
            names = tuple(f"boat_{i}" for i in range(len(rows)))
            fleet = Fleet(seen, TEAM, (TAKEN_FOR,) * len(rows), TEAM == 0, names)
            decisions = shield.decide(fleet, Commands.absolute_rad(wanted))
            told = decisions.filtered.values
            changed += decisions.count_intervened
        for i, row in enumerate(rows):
            pending[i].append(tuple(told[i] if i < OURS else wanted[i]))
            speed, heading = pending[i].pop(0)
            step_hull(row, speed, (math.degrees(heading) - row[L.HEADING] + 180.0) % 360.0 - 180.0)
        apart = np.hypot(*(rows[:OURS, None, : L.Y + 1] - rows[None, :, : L.Y + 1]).transpose(2, 0, 1))
        closest = min(closest, apart[apart > 0.0].min())
    return closest, changed


@pytest.mark.parametrize("seed", range(2))
def test_boats_taken_for_what_they_are_keep_clear_on_the_lanes_of_the_mission(seed):
    seconds = 180.0
    assert sail(seed, seconds, is_shielded=False)[0] < 1.0, "the lanes do cross"
    closest, changed = sail(seed, seconds, is_shielded=True)
    assert closest > SEPARATION_M
    assert 0 < changed < 0.5 * OURS * seconds / DT_S, "they sail their lanes all the same"
