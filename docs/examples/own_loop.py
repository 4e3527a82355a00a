"""An environment of your own, every command behind the shield; a decision read, and a figure of your own off and on."""

from dataclasses import replace

import numpy as np
from steerclear.shield import Commands, Fleet, Shield
from steerclear.shield.platforms import get_platform

STRAIGHT_ON = Commands.absolute_deg([[1.0, 0.0], [1.0, 180.0]])  # speed, heading: a row for every boat, opponents too
MINE = replace(get_platform("si"), name="mine", max_speed_mps=1.0)  # else `si` goes up to 10 m/s


def read(boats):
    """The boats as the shield sees them; it decides for those of team 0."""
    at, heading, speed = boats[:, :2], boats[:, 2], boats[:, 3]  # east and north, m; deg; m/s
    return Fleet.of(position_m=at, heading_deg=heading, speed_mps=speed, team=[0, 1], platforms=MINE)


def step(boats, commands, dt_s=0.1):
    """Boats move as `si` does: speed at once, 90 deg/s at most, along the mean of old and new speed and heading.

    ``commands.values``: rows of speed, m/s, and heading, rad, as they were given.
    """
    speed, heading = commands.values.T
    turn = np.clip((np.degrees(heading) - boats[:, 2] + 180.0) % 360.0 - 180.0, -90.0 * dt_s, 90.0 * dt_s)
    way, along = dt_s * 0.5 * (boats[:, 3] + speed), np.radians(boats[:, 2] + 0.5 * turn)
    moved = boats[:, :2] + np.column_stack([way * np.sin(along), way * np.cos(along)])
    return np.column_stack([moved, boats[:, 2] + turn, speed])


shielded = Shield(separation_m=2.5).wrap(lambda boats: STRAIGHT_ON, read=read)
for name, policy in (("off", lambda boats: STRAIGHT_ON), ("on", shielded)):
    boats, nearest_m, changed = np.array([[0.0, 0.0, 0.0, 1.0], [0.5, 20.0, 180.0, 1.0]]), np.inf, 0
    for _ in range(200):
        boats = step(boats, policy(boats))
        nearest_m = min(nearest_m, np.hypot(*(boats[0, :2] - boats[1, :2])))
        changed += policy is shielded and shielded.decisions["boat_0"].intervened
    print(f"shield {name}: nearest {nearest_m:.2f} m, {changed} commands changed")
