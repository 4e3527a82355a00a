"""The pursuers of the certificate against pursuers of the full boat model."""

import math

import numpy as np
import pytest
from stages import stages_of
from steerclear.shield import ShieldConfig
from steerclear.shield.backup.rollout import roll_out
from steerclear.shield.barriers.neighbours import find_neighbours
from steerclear.shield.barriers.pursuit import clear_of_pursuer
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import actuate, largest_turn
from steerclear.shield.platforms.usv import fresh_state

GRAZE_M = 0.3
"""How much nearer a pursuer with other habits may come than those followed, m: they are samples of what it may do."""


def boat(platform, x, y, heading, share):
    """A boat at full thrust."""
    state = fresh_state(x, y, heading, share * platform.max_speed_mps)
    state[[L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = platform.max_thrust, 0.0, 0.0
    return state


def bearing_error(pursuer, target):
    wanted = math.degrees(math.atan2(target[L.X] - pursuer[L.X], target[L.Y] - pursuer[L.Y]))
    return (wanted - pursuer[L.HEADING] + 180.0) % 360.0 - 180.0


def sail_to(platform, state, turn_deg, most):
    """One step towards a heading, with at most that share of the full turn."""
    params = platform.pack()
    full = most * largest_turn(params, state, 0.1)
    actuate(params, state, platform.max_speed_mps, max(-full, min(full, turn_deg)), 0.1)


def chase(platform, own, pursuer, side, turn_deg, most, steps):
    """Least distance of a boat on a backup and a pursuer that steers at it with a share of its rudder."""
    own, pursuer, togo, least = own.copy(), pursuer.copy(), turn_deg, math.inf
    for _ in range(steps):
        before = own[L.HEADING]
        sail_to(platform, pursuer, bearing_error(pursuer, own), most)
        sail_to(platform, own, side * togo, 1.0)
        togo = max(0.0, togo - (side * (own[L.HEADING] - before) + 180.0) % 360.0 + 180.0) if togo > 0.0 else 0.0
        least = min(least, math.hypot(own[L.X] - pursuer[L.X], own[L.Y] - pursuer[L.Y]))
    return least


def modelled(name, own, pursuer, side, turn_deg):
    """Least margin, m, the certificate expects of the same backup, and the steps over which it looks."""
    at = stages_of(
        ShieldConfig(profile="ramming", buffer_m=0.0, opponent_model="turning_circle", margin_cap_m=50.0),
        np.array([own, pursuer]),
        (name, name),
        (0, 1),
    )
    find_neighbours(at.scene)
    top = get_platform(name).max_speed_mps
    roll_out(0, 0, side, turn_deg, top, 0, at.scene)
    margin_m = clear_of_pursuer(0, 1, 0, -1e6, at.scene)
    return margin_m, int(at.boats.pursuit_samples[0]) * at.boats.stride


def scenes(name, count, seed):
    platform, random = get_platform(name), np.random.default_rng(seed)
    reach = 6.0 * platform.max_speed_mps
    for _ in range(count):
        angle, far = random.uniform(-math.pi, math.pi), random.uniform(0.5, 2.0) * reach
        own = boat(platform, 0.0, 0.0, 0.0, random.uniform(0.6, 1.0))
        pursuer = boat(
            platform,
            far * math.sin(angle),
            far * math.cos(angle),
            random.uniform(-180.0, 180.0),
            random.uniform(0.6, 1.0),
        )
        yield platform, own, pursuer, random.choice([-1.0, 1.0]), float(random.choice([0.0, 45.0, 90.0, 180.0]))


@pytest.mark.parametrize("name", ["heron", "surveyor"])
@pytest.mark.parametrize("most", [0.15, 0.3, 0.45, 0.6, 1.0])
def test_no_pursuer_that_steers_at_the_boat_comes_nearer_than_expected(name, most):
    short = []
    for platform, own, pursuer, side, turn in scenes(name, 60, seed=7):
        margin, steps = modelled(name, own, pursuer, side, turn)
        if margin > 0.0:
            short.append(2.5 + margin - chase(platform, own, pursuer, side, turn, most, steps))
    assert len(short) > 20
    assert max(short) < GRAZE_M


def test_a_boat_that_regains_its_speed_at_once_is_followed_without_its_loss():
    at = {
        name: stages_of(ShieldConfig(profile="ramming"), np.zeros((2, L.N_STATE)), (name, name), (0, 1))
        for name in ("heron", "surveyor")
    }
    assert at["heron"].boats.granted_loss[1] < 0.1
    assert at["surveyor"].boats.granted_loss[1] == pytest.approx(0.85)
    assert at["surveyor"].boats.granted_dec_mps2[1] == pytest.approx(0.125, abs=0.01)


def test_a_pursuer_at_rest_is_granted_the_turn_its_thrust_will_bring():
    platform = get_platform("surveyor")
    own = boat(platform, 0.0, 0.0, 0.0, 2.26 / 3.0)
    pursuer = fresh_state(4.70, 56.12, -10.05, 0.0)
    pursuer[[L.SPEED_ERROR, L.HEADING_ERROR]] = 0.0
    assert modelled("surveyor", own, pursuer, 1.0, 0.0)[0] < 0.0


def test_a_pursuer_seen_faster_than_its_platform_keeps_that_speed():
    platform = get_platform("heron")
    own, pursuer = boat(platform, 0.0, 0.0, 0.0, 1.0), boat(platform, 0.0, -6.0, 0.0, 1.3)
    assert modelled("heron", own, pursuer, 1.0, 0.0)[0] < 0.5
