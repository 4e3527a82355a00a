"""Pursuers of the certificate against those of the full model; several opponents; rammers of slow boats."""

import itertools
import math

import numpy as np
import pytest
from shield_loops import scattered, step_all
from shield_scenes import fleet_of, relative
from stages import stages_of
from steerclear.shield import Reason, Shield, ShieldConfig
from steerclear.shield.backup.rollout import roll_out
from steerclear.shield.barriers.neighbours import find_neighbours
from steerclear.shield.barriers.pursuit import clear_of_pursuer
from steerclear.shield.batch import BatchedShield
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
@pytest.mark.parametrize("most", [0.15, 0.45, 1.0])
def test_no_pursuer_that_steers_at_the_boat_comes_nearer_than_expected(name, most):
    short = []
    for platform, own, pursuer, side, turn in scenes(name, 30, seed=7):
        margin, steps = modelled(name, own, pursuer, side, turn)
        if margin > 0.0:
            short.append(2.5 + margin - chase(platform, own, pursuer, side, turn, most, steps))
    assert len(short) > 8
    assert max(short) < GRAZE_M


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


TIMES_S = (0.0, 2.0, 6.0, 9.0, 20.0, np.inf)


def test_less_fear_changes_no_more_commands():
    """Of many scenes of a few opponents about, each time changes no more than the next longer one, or hardly."""
    random, count = np.random.default_rng(8), 300
    platforms, team = ("surveyor",) * 3, (0, 1, 1)
    states = scattered(random, count, list(platforms), 30.0, gap_m=6.0)
    wanted = np.zeros((count, 3, 2))
    wanted[..., 0], wanted[..., 1] = 3.0, random.uniform(-90.0, 90.0, (count, 3))
    ours = np.broadcast_to(np.array([True, False, False]), (count, 3)).copy()
    changed = []
    for time_s in TIMES_S:
        guard = BatchedShield(ShieldConfig(adversary_horizon_s=time_s), count, platforms, team)
        sent = guard.decide(states.copy(), wanted.copy(), ours)
        changed.append(int((sent[:, 0] != wanted[:, 0]).any(axis=1).sum()))
    assert all(sooner <= later + 3 for sooner, later in itertools.pairwise(changed)), changed
    assert changed[0] < changed[-1] - 30, changed


def decided(boats):
    """Reason and certificate of the first boat, told to go straight on; the others are opponents."""
    fleet = fleet_of([(x, y, heading, 3.0) for x, y, heading in boats], [0] + [1] * (len(boats) - 1), "surveyor")
    fleet.state[:, L.THRUST] = 100.0
    answer = Shield().decide(fleet, relative(*[(3.0, 0.0)] * len(boats)))
    return Reason(answer.reason[0]), answer.safety_margin_m[0]


def two_opponents(count, reach_m):
    random = np.random.default_rng(5)
    for _ in range(count):
        places = random.uniform(-reach_m, reach_m, (2, 2))
        headings = np.degrees(np.arctan2(-places[:, 0], -places[:, 1])) + random.uniform(-60.0, 60.0, 2)
        if (np.linalg.norm(places, axis=1) > 4.0).all():
            yield [(*place, heading) for place, heading in zip(places, headings, strict=True)]


def test_another_opponent_never_makes_the_shield_content():
    passed = refused = 0
    for first, second in two_opponents(150, 22.0):
        both, _ = decided([(0, 0, 0), first, second])
        if both != Reason.PASSED:
            refused += 1
            continue
        passed += 1
        assert decided([(0, 0, 0), first])[0] == Reason.PASSED
        assert decided([(0, 0, 0), second])[0] == Reason.PASSED
    assert passed > 30
    assert refused > 15


def test_an_opponent_that_leaves_does_not_help_against_one_that_rams():
    rammed = decided([(0, 0, 0), (0.8, 3.1, 91.0)])
    joined = decided([(0, 0, 0), (0.8, 3.1, 91.0), (-12.1, -0.7, -90.0)])
    assert rammed[0] == joined[0] == Reason.BEST_EFFORT
    assert joined[1] <= rammed[1] + 0.05


@pytest.mark.parametrize(("aside_m", "ahead_m"), [(5, 25), (7, 16), (7, 25), (9, 12), (9, 20)])
def test_what_each_leaves_open_both_together_do_not(aside_m, ahead_m):
    bearing = np.degrees(np.arctan2(-aside_m, -ahead_m))
    starboard, port = (aside_m, ahead_m, bearing), (-aside_m, ahead_m, -bearing)
    for one in (starboard, port):
        reason, safety_margin_m = decided([(0, 0, 0), one])
        assert reason == Reason.PASSED
        assert safety_margin_m > 0.1
    reason, safety_margin_m = decided([(0, 0, 0), starboard, port])
    assert reason != Reason.PASSED
    assert safety_margin_m < 0.0


@pytest.mark.parametrize("gap_m", [60.0, 200.0])
def test_opponents_out_of_the_tables_sight_change_nothing(gap_m):
    near = decided([(0, 0, 0), (9.0, 20.0, 180.0)])
    assert decided([(0, 0, 0), (9.0, 20.0, 180.0), (0.0, -gap_m, 180.0)]) == near


SURVEYOR = get_platform("surveyor")


def slow_boat(speed_mps=1.0, thrust=20.0):
    row = fresh_state(0.0, 0.0, 0.0, speed_mps)
    row[[L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = thrust, 0.0, 0.0
    return row


def opponent(x, y, heading_deg):
    row = fresh_state(x, y, heading_deg, 3.0)
    row[[L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = 100.0, 0.0, 0.0
    return row


def chased(certificate, count=40, steps=500):
    """First certificates and closest distances of slow boats without thrust, each with a rammer that leads it."""
    rng, params = np.random.default_rng(8), SURVEYOR.pack()
    state = np.zeros((count, 2, L.N_STATE))
    for game in state:
        game[0] = slow_boat(rng.uniform(0.5, 2.0), 30.0)
        angle, far = rng.uniform(-math.pi, math.pi), rng.uniform(10.0, 60.0)
        game[1] = opponent(far * math.sin(angle), far * math.cos(angle), math.degrees(angle) + 180.0)
    shield = BatchedShield(
        ShieldConfig(profile="ramming", opponent_model=certificate), count, ("surveyor",) * 2, (0, 1)
    )
    ours, closest, first = np.tile([True, False], (count, 1)), np.full(count, math.inf), None
    for _ in range(steps):
        wanted = np.zeros((count, 2, 2))
        wanted[:, :, 0] = 3.0
        wanted[:, 1, 1] = bearing_to_quarry(state)
        sent = shield.decide(state, wanted, ours)
        first = shield.safety_margin_m[:, 0].copy() if first is None else first
        step_all(np.array([params, params]), state, sent, 0.1)
        closest = np.minimum(closest, np.linalg.norm(state[:, 0, :2] - state[:, 1, :2], axis=1))
    return first, closest


def bearing_to_quarry(state):
    """Turn, deg, of each rammer to where the boat will be when it gets there at 3 m/s."""
    heading = np.radians(state[:, 0, L.HEADING])
    way = state[:, 0, :2] - state[:, 1, :2]
    ahead_s = np.linalg.norm(way, axis=1) / 3.0
    way = way + (state[:, 0, L.SPEED] * ahead_s)[:, None] * np.column_stack([np.sin(heading), np.cos(heading)])
    return (np.degrees(np.arctan2(way[:, 0], way[:, 1])) - state[:, 1, L.HEADING] + 180.0) % 360.0 - 180.0


def test_who_is_promised_a_backup_gets_it():
    first, closest = chased("auto")
    assert (first >= 0.0).sum() > 10
    assert (closest[first >= 0.0] >= 2.5).all()
