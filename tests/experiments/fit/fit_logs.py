"""Logs that tests write, of a simulated boat that was driven."""

import math

import numpy as np
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L

LEGS = [(2.0, 0.0), (2.0, 90.0), (1.0, 20.0), (2.5, -60.0), (0.0, -60.0), (2.0, 30.0)]


def drive(seconds=36.0, legs=LEGS, delay_steps=2, begin_mps=2.0):
    """Rows (time, x, y, heading, speed, told speed, told heading) of a rover: legs of 6 s, obeyed so much later."""
    params, row = get_platform("ardurover_boat").pack(), fresh_state(0.0, 0.0, 0.0, begin_mps)
    rows, commands = [], [legs[0]] * delay_steps
    for k in range(round(seconds / 0.1)):
        now = legs[int(k * 0.1 / 6.0) % len(legs)]
        rows.append((0.1 * k, row[L.X], row[L.Y], row[L.HEADING], row[L.SPEED], *now))
        commands.append(now)
        speed, heading = commands.pop(0)
        step_boat(params, row, speed, math.remainder(heading - row[L.HEADING], 360.0), 0.1)
    return np.array(rows)


def as_csv(path, rows):
    head = "t_s,x_m,y_m,heading_deg,speed_mps,told_speed_mps,told_heading_deg\n"
    path.write_text(head + "".join(",".join(f"{value:.6f}" for value in row) + "\n" for row in rows))
