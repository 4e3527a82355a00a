"""Column layouts of the arrays that compiled code reads.

A boat's full state (hull and autopilot memory) is one row of ``N_STATE`` float64 values. A platform's parameters are
one row of ``N_PARAM``. Plain arrays allow one compiled step to serve a single game, thousands of games and the shield's
predictions.
"""

from __future__ import annotations

# --- state row -------------------------------------------------------------------------------------
X = 0
"""Position east, m."""
Y = 1
"""Position north, m."""
HEADING = 2
"""Heading, deg, clockwise from north (+y), in [-180, 180]."""
SPEED = 3
"""Speed that the simulator stores, m/s."""
THRUST = 4
"""Thrust, percent."""
RUDDER = 5
"""Rudder, percent, positive turns clockwise."""
SPEED_ERROR = 6
"""Last error of the speed controller, m/s; NaN before its first call."""
SPEED_INTEGRAL = 7
"""Integral memory of the speed controller."""
HEADING_ERROR = 8
"""Last error of the heading controller, deg; NaN before its first call."""
HEADING_INTEGRAL = 9
"""Integral memory of the heading controller."""
TURN_RATE = 10
"""Turn rate, deg/s (memory of the double integrator and of rate-controlled boats)."""
N_STATE = 11

# --- parameter row ---------------------------------------------------------------------------------
KIND = 0
MAX_SPEED = 1
SPEED_FACTOR = 2
MAX_THRUST = 3
MAX_RUDDER = 4
TURN_LOSS = 5
TURN_GAIN = 6
MAX_ACC = 7
MAX_DEC = 8
ROTATE_SPEED = 9
SPEED_KP = 10
SPEED_KI = 11
SPEED_KD = 12
SPEED_LIMIT = 13
SPEED_GAIN = 14
HEADING_KP = 15
HEADING_KI = 16
HEADING_KD = 17
HEADING_LIMIT = 18
MAX_TURN_RATE = 19
MAX_ANGULAR_ACC = 20
MAP_SIZE = 21
MAP_THRUST = 22
MAP_CAPACITY = 8
MAP_SPEED = MAP_THRUST + MAP_CAPACITY
N_PARAM = MAP_SPEED + MAP_CAPACITY
MOVE_S = N_PARAM
"""Extra column of rows with N_PARAM + 1 entries: length of a substep, s, of a step with several, see `step`."""

# --- values of KIND --------------------------------------------------------------------------------
KIND_USV = 0
KIND_SINGLE_INTEGRATOR = 1
KIND_DOUBLE_INTEGRATOR = 2
KIND_RATE = 3

# --- columns that boats of one kind use for other values ---------------------------------------------
FULL_TURN_SPEED = MAX_ANGULAR_ACC
"""`KIND_USV`: speed from which the boat turns at its full rate, m/s; 0: at any speed."""
TURN_AT_REST = MAX_RUDDER
"""`KIND_RATE`: turn rate at rest, deg/s."""
TURN_PER_SPEED = TURN_GAIN
"""`KIND_RATE`: turn rate gained with speed, deg/s per m/s; negative: lost."""
SPEED_LAG = SPEED_KD
"""`KIND_RATE`: lag of the speed, s."""
TURN_LAG = HEADING_KD
"""`KIND_RATE`: lag of the turn rate, s."""
