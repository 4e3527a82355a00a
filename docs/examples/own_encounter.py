"""An encounter of your own: two boats cross, one of them shielded; how near do they come?"""

from dataclasses import replace

import numpy as np
from steerclear.shield import Commands, Fleet, Shield
from steerclear.shield.platforms import get_platform, step_boat
from steerclear.shield.platforms import layout as L

POSITIONS, HEADINGS_DEG, SPEED_MPS, DT_S = [[0.0, -20.0], [-20.0, 0.0]], [0.0, 90.0], 2.0, 0.1
WANTED = Commands.absolute_deg([[SPEED_MPS, 0.0], [SPEED_MPS, 90.0]])  # straight on, both


def closest_m(shield):
    """Least distance within 25 s, m."""
    fleet = Fleet.of(
        position_m=POSITIONS, heading_deg=HEADINGS_DEG, speed_mps=[SPEED_MPS] * 2, team=[0, 1], platforms="heron"
    )
    params, state, least = get_platform("heron").pack(), fleet.state.copy(), np.inf
    for _ in range(250):
        commands = WANTED.values
        if shield is not None:
            now = replace(fleet, state=state.copy())
            commands = shield.decide(now, WANTED).sent.values
        for row, (speed_mps, heading_rad) in zip(state, commands, strict=True):
            error_deg = (np.degrees(heading_rad) - row[L.HEADING] + 180.0) % 360.0 - 180.0
            step_boat(params, row, speed_mps, error_deg, DT_S)
        least = min(least, float(np.hypot(*(state[0, :2] - state[1, :2]))))
    return least


print(f"without a shield {closest_m(None):.2f} m")
print(f"with it          {closest_m(Shield(separation_m=2.5)):.2f} m")
