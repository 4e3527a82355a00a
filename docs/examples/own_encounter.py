"""An encounter of your own: two boats cross, one of them shielded; how near do they come?"""

from dataclasses import replace

import numpy as np
from steerclear.shield import Commands, Fleet, Shield
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L

SPEED_MPS, DT_S = 2.0, 0.1
STARTS = [(0.0, -20.0, 0.0), (-20.0, 0.0, 90.0)]  # east m, north m, heading deg
NOMINAL = Commands.absolute_deg([[SPEED_MPS, 0.0], [SPEED_MPS, 90.0]])  # straight on, both
OF = Fleet.of(position_m=np.zeros((2, 2)), heading_deg=[0, 90], speed_mps=[0, 0], team=[0, 1], platforms="heron")


def closest_m(shield):
    """Least distance within 25 s, m."""
    params, state, least = get_platform("heron").pack(), np.array([fresh_state(*start) for start in STARTS]), np.inf
    for _ in range(250):
        commands = NOMINAL.values
        if shield is not None:
            commands = shield.decide(replace(OF, state=state.copy()), NOMINAL).filtered.values
        for row, (speed_mps, heading_rad) in zip(state, commands, strict=True):
            error_deg = (np.degrees(heading_rad) - row[L.HEADING] + 180.0) % 360.0 - 180.0
            step_boat(params, row, speed_mps, error_deg, DT_S)
        least = min(least, float(np.hypot(*(state[0, :2] - state[1, :2]))))
    return least


print(f"without a shield {closest_m(None):.2f} m")
print(f"with it          {closest_m(Shield(separation_m=2.5)):.2f} m")
