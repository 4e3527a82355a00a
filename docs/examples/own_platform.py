"""A boat of your own: described, proved in its own model when it is built, registered, and shielded by name."""

import math
from dataclasses import replace

from steerclear.experiments.conformance import check_platform
from steerclear.shield import Commands, Fleet, Shield
from steerclear.shield.platforms import get_platform, register_platform


@register_platform
def launch():
    """A heron that is slower."""
    return replace(get_platform("heron"), name="launch", max_speed_mps=1.5)


check_platform("launch")
fleet = Fleet.of(
    position_m=[[0, 0], [0, 5.5]], heading_rad=[0, math.pi], speed_mps=[1.5, 1.5], team=[0, 1], platforms="launch"
)
decision = Shield().decide(fleet, Commands.absolute_rad([[1.5, 0.0], [1.5, math.pi]]))[0]
print(f"launch turns to {math.degrees(decision.filtered_heading_rad):.0f} deg ({decision.reason.name})")
