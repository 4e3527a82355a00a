"""Draw the barrier round an opponent: the margin of a boat that sails north, wherever it is, as level sets."""

import math
import sys

import numpy as np
from matplotlib.figure import Figure
from steerclear.shield import Commands, Fleet, Shield

PICTURE = sys.argv[1] if len(sys.argv) > 1 and sys.argv[1].endswith((".png", ".svg")) else None
STEP_M, LEVELS_M = (0.1 if PICTURE else 1.0), (0.0, 1.0, 2.0)  # coarse where only areas are printed; fine: 3 minutes
NORTH = Commands.absolute_rad([[2.0, 0.0], [2.0, math.pi]])


def margin(shield, east_m, north_m):
    """The margin of a boat that sails north at 2 m/s; the opponent is at the origin and heads south as fast."""
    fleet = Fleet.of(
        position_m=[[east_m, north_m], [0, 0]],
        heading_rad=[0, math.pi],
        speed_mps=[2, 2],
        team=[0, 1],
        platforms="heron",
    )
    shield.reset()
    return shield.decide(fleet, NORTH)[0].safety_margin_m


east, north = np.arange(0.0, 7.1, STEP_M), np.arange(-9.0, 6.1, STEP_M)  # the other half is its mirror image
both = np.r_[-east[:0:-1], east]
angle = np.linspace(0.0, 2.0 * np.pi, 90)
figure = Figure(figsize=(7.2, 4.6), layout="constrained")
for plan, (profile, title) in zip(
    figure.subplots(1, 2, sharey=True),
    [("constant_velocity", "opponent holds its course"), ("ramming", "opponent pursues")],
    strict=True,
):
    for level, shade in zip(LEVELS_M, ("tab:red", "tab:purple", "tab:blue"), strict=True):
        shield = Shield(separation_m=2.5 + level, profile=profile)  # h >= level is h >= 0 of a larger separation
        half = np.array([[min(margin(shield, x, y), 9.0) for x in east] for y in north])
        h = np.c_[half[:, :0:-1], half]
        if level == 0.0:
            print(f"{title}: h < 0 on {(h < 0.0).sum() * STEP_M**2:.0f} m2; the disc of 2.5 m has 20 m2")
            plan.contourf(both, north, h, levels=[-9.0, 0.0], colors=[shade], alpha=0.25)
        lines = plan.contour(both, north, h, levels=[0.0], colors=[shade], linewidths=1.2)
        plan.clabel(lines, fmt={0.0: f"h = {level:g} m"}, fontsize=7)
    plan.plot(2.5 * np.cos(angle), 2.5 * np.sin(angle), color="tab:orange", lw=1.0)
    plan.plot(0.0, 0.0, "v", color="tab:orange", ms=9)
    plan.set(xlabel="east, m", aspect="equal", title=title)
    plan.set_ylabel("north, m; our boat sails north" if profile == "constant_velocity" else "")
if PICTURE:
    figure.savefig(PICTURE, dpi=140)
