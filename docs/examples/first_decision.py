"""One decision: two boats head on."""

import math

from steerclear.shield import Commands, Fleet, Shield

shield = Shield(separation_m=2.5, profile="constant_velocity")
fleet = Fleet.of(
    position_m=[[0, 0], [0, 5.3]],  # east, north
    heading_rad=[0, math.pi],  # clockwise from north: head on
    speed_mps=[2, 2],
    team=[0, 1],  # ours, theirs
    platforms="heron",
    names=["ours", "theirs"],
)
nominal = Commands.absolute_rad([[2.0, 0.0], [2.0, math.pi]])  # speed, heading: straight on
d = shield.decide(fleet, nominal)[0]
print(
    d.reason.name,
    f"{math.degrees(d.filtered_heading_rad):.1f} deg",
    d.active_constraints,
    f"margin {d.safety_margin_m:.3f} m",
)
