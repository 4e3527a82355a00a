"""What the scripted policies' compiled code reads and remembers: column numbers and behaviour codes."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from steerclear.shield.jit import Array, BoolArray, IntArray


class Behaviour(IntEnum):
    """What one boat does; a team is a list of these, one per boat."""

    HOLD = 0
    RANDOM = 1
    RAMMER = 2
    WAYPOINTS = 3
    EASY_ATTACK = 4
    EASY_DEFEND = 5
    MEDIUM_ATTACK = 6
    MEDIUM_DEFEND = 7
    HARD_ATTACK = 8
    HARD_DEFEND = 9
    HARD = 10


# --- columns of a boat's memory row ----------------------------------------------------------------
GOAL = 0
"""Number of the path point or given waypoint the boat is heading for."""
GOAL_X = 1
"""Waypoint east, m."""
GOAL_Y = 2
"""Waypoint north, m."""
TIME_LEFT = 3
"""Time until the boat draws again, s; 0 before the first draw."""
HELD_SPEED = 4
"""Speed held by the random walk, m/s."""
HELD_HEADING = 5
"""Absolute heading held by the random walk, deg."""
REACHED = 6
"""Waypoints reached so far."""
N_MEMORY = 7

# --- columns of the field row ----------------------------------------------------------------------
WIDTH = 0
"""Field along x, m."""
HEIGHT = 1
"""Field along y, m."""
KEEPOUT = 2
"""Radius around the own flag that its own boats may not enter, without the boat's radius, m."""
STEP = 3
"""Time between two decisions, s."""
SPEED_FRACTION = 4
"""Share of its top speed a rammer or waypoint boat asks for."""
HIT_TEAM_MATES = 5
"""1 when a rammer also aims at boats of its own team."""
MEDIUM_REACH = 6
"""Distance within which opponents push a medium attacker off, m."""
CORNER_INSET = 7
"""How far inside its own side's corners, along both edges, a team brings the flag to, m; 0: not to corners."""
N_FIELD = 8

# --- columns of a boat's limits --------------------------------------------------------------------
MAX_SPEED = 0
"""Top speed, m/s."""
RADIUS = 1
"""Agent radius, m."""
N_LIMIT = 2


class Game(NamedTuple):
    """One game as the kernels see it: ``n`` boats, two teams (0 blue, 1 red)."""

    state: Array
    """``(n, N_STATE)`` state rows, see ``steerclear.shield.platforms.layout``."""
    limits: Array
    """``(n, N_LIMIT)``."""
    team: IntArray
    """``(n,)``."""
    is_tagged: BoolArray
    has_flag: BoolArray
    on_side: BoolArray
    flag_home: Array
    """``(2, 2)`` m."""
    flag_position: Array
    """``(2, 2)`` m; a taken flag is where its carrier is."""
    field: Array
    """``(N_FIELD,)``."""
