"""Crowds of own boats of which only place, heading and speed are told, behind other autopilots than the platform's."""

import logging
from dataclasses import replace

import numpy as np
import pytest
from shield_loops import Wander, scattered, step_all
from shield_scenes import distances
from steerclear.shield import Commands, Fleet, Shield
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L

BOATS, STEPS = 5, 150
LOG = logging.getLogger(__name__)


class Forgetful(Shield):
    """A shield that follows no autopilot: thrust is what the speed tells."""

    def _with_memory(self, fleet):
        return fleet, None


def other_autopilot(kind, kp=1.0, kd=1.0):
    """The platform's row with the gains of its heading controller times these."""
    pid = kind.heading_pid
    return replace(kind, heading_pid=replace(pid, kp=kp * pid.kp, kd=kd * pid.kd)).pack()


def closest(maker, name, seed, noise=(0.0, 0.0), parts=1, coordination="team", **gains):
    """Closest distance, m, of a crowd; headings (deg) and speeds (m/s) seen are noisy, a step has so many parts."""
    random, kinds = np.random.default_rng(seed), (name,) * BOATS
    state = scattered(random, 1, kinds, 16.0 if name == "heron" else 40.0)[0]
    params = np.array([other_autopilot(get_platform(name), **gains)] * BOATS)
    shield, wander, nearest = maker(coordination=coordination), Wander(seed, 1, kinds), np.inf
    for step in range(STEPS):
        fleet = Fleet.of(
            position_m=state[:, : L.Y + 1],
            heading_rad=np.radians(state[:, L.HEADING] + noise[0] * random.normal(size=BOATS)),
            speed_mps=np.maximum(0.0, state[:, L.SPEED] + noise[1] * random.normal(size=BOATS)),
            team=[0] * BOATS,
            platforms=name,
        )
        wanted = wander(step, state[None])[0]
        course = np.radians(state[:, L.HEADING] + wanted[:, 1])
        sent = shield.decide(fleet, Commands.absolute_rad(np.stack([wanted[:, 0], course], axis=1))).sent
        for _ in range(parts):
            step_all(params, state[None], sent.as_relative_deg(state[:, L.HEADING])[None], 0.1 / parts)
        nearest = min(nearest, distances(state[:, : L.Y + 1]).min())
    return nearest


@pytest.mark.parametrize("gains", [{}, {"kd": 0.5}, {"kd": 0.0}, {"kp": 2.2, "kd": 0.0}])
def test_boats_behind_another_autopilot_keep_their_distance(gains):
    """Believed without proof, the model's memory let boats without a derivative come within 2.1 m of each other."""
    assert min(closest(Shield, "heron", seed, **gains) for seed in range(6)) >= 2.5


CASES = {
    "the platform's": {},
    "decided by boat": {"coordination": "per_boat"},
    "noise of 3 deg, 0.1 m/s": {"noise": (3.0, 0.1)},
    "half the derivative": {"kd": 0.5},
    "no derivative": {"kd": 0.0},
    "no derivative, 2.2 times the gain": {"kp": 2.2, "kd": 0.0},
    "20 Hz": {"parts": 2},
}


@pytest.mark.study
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(("name", "runs"), [("heron", 60), ("surveyor", 40)])
def test_what_is_followed_does_not_make_crowds_less_safe(name, runs, case):
    without, followed = (
        np.array([closest(maker, name, seed, **CASES[case]) for seed in range(runs)]) for maker in (Forgetful, Shield)
    )
    hits = [int((each < 2.5).sum()) for each in (without, followed)]
    least = [float(each.min()) for each in (without, followed)]
    LOG.warning("%s, %s: %d and %d of %d below 2.5 m, least %.2f and %.2f m", name, case, *hits, runs, *least)
    assert hits[1] <= hits[0] + 1
