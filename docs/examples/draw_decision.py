"""Draw one decision: the straight way to the collision, every backup manoeuvre, and the one that the shield chose."""

import math
import sys

import numpy as np
from matplotlib.figure import Figure
from steerclear.shield import Commands, Fleet, Shield
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import command_for_turn
from steerclear.shield.platforms.step import step_boat

SEPARATION_M, BUFFER_M, DT_S, HORIZON_S = 2.5, 0.05, 0.1, 6.0
HERON = get_platform("heron").pack()
fleet = Fleet.of(
    position_m=[[0, 0], [0, 5.3]],
    heading_rad=[0, math.pi],
    speed_mps=[2, 2],
    team=[0, 1],
    platforms="heron",
    names=["ours", "theirs"],
)


def roll_out(boat, turn_deg):
    """Positions of a heron that turns by ``turn_deg`` at full rudder and then runs straight on, (steps, 2)."""
    state = np.nan_to_num(fleet.state[boat].copy())
    state[L.THRUST] = 100.0  # at its top speed
    left_deg, path = turn_deg, []
    for _ in range(round(HORIZON_S / DT_S)):
        before_deg = state[L.HEADING]
        step_boat(HERON, state, 2.0, command_for_turn(HERON, state, 2.0, left_deg, DT_S), DT_S)
        left_deg -= (state[L.HEADING] - before_deg + 180.0) % 360.0 - 180.0
        path.append(state[[L.X, L.Y]].copy())
    return np.array(path)


theirs = roll_out(1, 0.0)
paths = {turn: roll_out(0, turn) for turn in range(-180, 181, 15)}
margins = {turn: np.hypot(*(path - theirs).T) - SEPARATION_M - BUFFER_M for turn, path in paths.items()}
decision = Shield(separation_m=SEPARATION_M, profile="constant_velocity").decide(
    fleet, Commands.absolute_rad([[2.0, 0.0], [2.0, math.pi]])
)[0]
side = math.copysign(1.0, math.sin(decision.filtered_heading_rad))  # by symmetry either would do
best = max((turn for turn in paths if turn * side > 0), key=lambda turn: margins[turn].min())
print(
    f"{len(paths)} manoeuvres; the best keeps {margins[best].min():.2f} m, the shield {decision.safety_margin_m:.2f} m"
)

figure = Figure(figsize=(7.2, 4.2), layout="constrained")
plan, time = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
for turn, path in paths.items():
    closest = margins[turn].argmin()
    chosen, ahead = turn == best, turn == 0
    colour, width = ("tab:blue", 2.5) if chosen else ("tab:red", 1.5) if ahead else ("0.7", 0.8)
    label = "chosen backup" if chosen else "nominal: straight on" if ahead else "other backups" if turn == 15 else None
    plan.plot(*path.T, color=colour, lw=width, ls="--" if ahead else "-", label=label, zorder=3 if chosen else 2)
    plan.plot(*path[closest], "x", color=colour, ms=6 if chosen or ahead else 3, zorder=3)
    seconds = DT_S * np.arange(1, len(path) + 1)
    time.plot(seconds, margins[turn], color=colour, lw=width, ls="--" if ahead else "-", zorder=3 if chosen else 2)
plan.plot(*theirs.T, color="tab:orange", lw=1.5, label="opponent, predicted")
moment = margins[best].argmin()
angle = np.linspace(0.0, 2.0 * np.pi, 90)
radius = SEPARATION_M + BUFFER_M
plan.plot(
    theirs[moment, 0] + radius * np.cos(angle), theirs[moment, 1] + radius * np.sin(angle), color="tab:orange", lw=0.8
)
plan.plot(0.0, 0.0, "^", color="tab:blue", ms=9)
plan.plot(0.0, 5.3, "v", color="tab:orange", ms=9)
plan.set(xlabel="east, m", ylabel="north, m", aspect="equal", xlim=(-7.5, 7.5), ylim=(-5.5, 8.5))
plan.legend(fontsize=7, loc="upper left")
time.axhline(0.0, color="k", lw=0.8)
time.set(xlabel="time, s", ylabel="margin: distance less 2.55 m, m", ylim=(-2.7, 6.0))
time.annotate(
    f"margin {margins[best].min():.2f} m",
    (DT_S * (moment + 1), margins[best].min()),
    (2.4, -1.8),
    fontsize=8,
    arrowprops={"arrowstyle": "-"},
)
if len(sys.argv) > 1 and sys.argv[1].endswith((".png", ".svg")):
    figure.savefig(sys.argv[1], dpi=140)
