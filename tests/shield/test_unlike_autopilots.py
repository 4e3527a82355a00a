"""Crowds of own boats of which only place, heading and speed are told, behind other autopilots than the platform's."""

from dataclasses import replace

import numpy as np
import pytest
from shield_loops import Wander, scattered, step_all
from shield_scenes import distances
from steerclear.shield import Commands, Fleet, Shield
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L

BOATS, STEPS = 5, 150


def other_autopilot(kind, kp=1.0, kd=1.0):
    """The platform's row with the gains of its heading controller times these."""
    pid = kind.heading_pid
    return replace(kind, heading_pid=replace(pid, kp=kp * pid.kp, kd=kd * pid.kd)).pack()


def closest(name, seed, **gains):
    """Closest distance, m, of a crowd."""
    random, kinds = np.random.default_rng(seed), (name,) * BOATS
    state = scattered(random, 1, kinds, 16.0 if name == "heron" else 40.0)[0]
    params = np.array([other_autopilot(get_platform(name), **gains)] * BOATS)
    shield, wander, nearest = Shield(), Wander(seed, 1, kinds), np.inf
    for step in range(STEPS):
        fleet = Fleet.of(
            position_m=state[:, : L.Y + 1],
            heading_rad=np.radians(state[:, L.HEADING]),
            speed_mps=state[:, L.SPEED],
            team=[0] * BOATS,
            platforms=name,
        )
        wanted = wander(step, state[None])[0]
        course = np.radians(state[:, L.HEADING] + wanted[:, 1])
        sent = shield.decide(fleet, Commands.absolute_rad(np.stack([wanted[:, 0], course], axis=1))).filtered
        step_all(params, state[None], sent.as_relative_deg(state[:, L.HEADING])[None], 0.1)
        nearest = min(nearest, distances(state[:, : L.Y + 1]).min())
    return nearest


@pytest.mark.parametrize("gains", [{}, {"kd": 0.5}, {"kd": 0.0}, {"kp": 2.2, "kd": 0.0}])
def test_boats_behind_another_autopilot_keep_their_distance(gains):
    """Believed without proof, the model's memory let boats without a derivative come within 2.1 m of each other."""
    assert min(closest("heron", seed, **gains) for seed in range(6)) >= 2.5
