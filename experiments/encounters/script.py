"""What steers a boat of an encounter: one row of numbers, read by compiled code.

A script has three phases. A boat starts in phase 0 and moves on to the next once the time ``AT_S`` of that phase has
come or its target is within ``WITHIN_M`` of it. In a phase it aims at something, at a speed, off by an angle.
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array

# --- script row ------------------------------------------------------------------------------------
TARGET = 0
"""Number of the boat that is hunted; -1 hunts the nearest boat of the other team."""
AUTHORITY = 1
"""1: turns with all the rudder there is, through the derivative of its own autopilot; 0: asks for headings."""
REACHED_M = 2
"""A goal counts as reached within this distance, m."""
PHASE = 3
"""First column of the phases."""
PHASES = 3

# --- columns of a phase ----------------------------------------------------------------------------
AIM = 0
SPEED_MPS = 1
LEAD = 2
"""Share of the way to the meeting point by which a hunter aims ahead: 0 pure pursuit, 1 the meeting point."""
ANGLE_DEG = 3
"""Added to the bearing of what is aimed at; the heading itself for `AIM_HEADING`."""
STANDOFF_M = 4
"""Aims at the point this far ahead of the target's bow (negative: astern), m."""
AT_S = 5
"""Time at which this phase begins, s."""
WITHIN_M = 6
"""Distance to the target at which this phase begins, m; 0 for never."""
N_PHASE = 7
N_SCRIPT = PHASE + PHASES * N_PHASE

# --- values of AIM ---------------------------------------------------------------------------------
AIM_GOALS = 0
AIM_HEADING = 1
AIM_TARGET = 2
AIM_NOWHERE = 3
"""Stays where it is: no speed."""


def phase(
    aim: int,
    speed_mps: float = 0.0,
    lead: float = 0.0,
    angle_deg: float = 0.0,
    standoff_m: float = 0.0,
    at_s: float = math.inf,
    within_m: float = 0.0,
) -> Array:
    """One phase, (N_PHASE,); its columns are described above."""
    return np.array([aim, speed_mps, lead, angle_deg, standoff_m, at_s, within_m], dtype=np.float64)


def script(*phases: Array, target: int = -1, authority: bool = False, reached_m: float = 3.0) -> Array:
    """A script row, (N_SCRIPT,); phases that are left out never begin."""
    row = np.zeros(N_SCRIPT)
    row[[TARGET, AUTHORITY, REACHED_M]] = target, float(authority), reached_m
    never = phase(AIM_NOWHERE)
    for k in range(PHASES):
        row[PHASE + k * N_PHASE : PHASE + (k + 1) * N_PHASE] = phases[k] if k < len(phases) else never
    return row


def to_goals(speed_mps: float, reached_m: float) -> Array:
    """Script of a boat that makes for its goals in turn."""
    return script(phase(AIM_GOALS, speed_mps), reached_m=reached_m)
