"""A barrier of your own: the water round a ferry under way, which boats keep out of."""

import math

from steerclear.experiments.conformance import check_barrier
from steerclear.shield import Commands, Fleet, Shield
from steerclear.shield.barriers import Barrier, register_barrier
from steerclear.shield.platforms import fresh_state, get_platform, step_boat

FERRY = [0.0, 40.0, 0.0, -1.0, 10.0]  # x, y, m; velocity east and north, m/s; radius of its domain, m


def margin(x_m, y_m, ahead_s, ferry):
    """Distance from the domain, where the ferry will be then, m."""
    east, north = ferry[0] + ahead_s * ferry[2], ferry[1] + ahead_s * ferry[3]
    return math.hypot(x_m - east, y_m - north) - ferry[4]


@register_barrier
def ferry():
    """The ferry as it is seen now: the function is asked before every decision."""
    return Barrier("ferry", margin, values=lambda: FERRY)


check_barrier("ferry")
shield, params = Shield(barriers=("ferry",)), get_platform("heron").pack()
fleet = Fleet.of(position_m=[[0, 0]], heading_rad=[0], speed_mps=[0], team=[0], platforms="heron")
boat, nearest, bound = fleet.state[0], math.inf, set()
boat[:] = fresh_state(0.0, 0.0, 0.0)
for _ in range(400):
    decisions = shield.decide(fleet, Commands.relative_deg([[1.5, -boat[2]]]))  # north, where the ferry comes from
    if decisions[0].intervened:
        bound.add((decisions[0].reason.name, *decisions[0].active_constraints))
    step_boat(params, boat, *decisions.filtered.values[0], 0.1)
    FERRY[1] += 0.1 * FERRY[3]
    nearest = min(nearest, margin(boat[0], boat[1], 0.0, FERRY))
print(*sorted(bound))
print(f"nearest: {nearest:.2f} m from the domain")
