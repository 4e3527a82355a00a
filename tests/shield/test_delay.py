"""Commands that take effect later, currents of unknown direction, and circles that stop a boat."""

import numpy as np
import pytest
from shield_loops import fill, packed, step_all
from shield_scenes import head_on
from steerclear.env.motion import keep_out
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig, Surroundings
from steerclear.shield.batch import BatchedShield
from steerclear.shield.platforms import layout as L

LATE = 3


def sail_late(fleet, steps, believed_steps=LATE):
    """Head-on run in which every command takes effect ``LATE`` steps late; returns distances and sent commands."""
    params, state = packed(fleet.platforms), fleet.state.copy()
    fill(state, params)
    config = ShieldConfig(delay_s=0.1 * believed_steps, track_error_mps=0.0)
    decide = batch(config, fleet)
    queue = [np.column_stack([state[:, L.SPEED], state[:, L.HEADING]]) for _ in range(LATE)]
    distance, sent = [], []
    for _ in range(steps):
        wanted = np.column_stack([np.full(len(state), 2.0), np.zeros(len(state))])
        out = decide(state, wanted)
        sent.append(out.copy())
        queue.append(np.column_stack([out[:, 0], state[:, L.HEADING] + out[:, 1]]))
        target = queue.pop(0)
        error = (target[:, 1] - state[:, L.HEADING] + 180.0) % 360.0 - 180.0
        step_all(params, state[None], np.column_stack([target[:, 0], error])[None], 0.1)
        distance.append(np.hypot(*(state[0, :2] - state[1, :2])))
    return np.array(distance), np.array(sent)


def batch(config, fleet):
    shield = BatchedShield(config, 1, fleet.platforms, tuple(fleet.team))
    return lambda state, wanted: shield.decide(state[None], wanted[None], fleet.controlled[None])[0]


@pytest.mark.parametrize("platforms", ["heron", "surveyor"])
def test_the_distance_is_kept_when_the_delay_is_known(platforms):
    fleet = head_on(gap_m=60.0, platforms=platforms, aside_m=0.5)
    distance, sent = sail_late(fleet, 300)
    assert distance.min() >= 2.5
    assert (sent[:, 0, 1] != 0.0).any()


def test_a_delay_kept_from_the_shield_costs_distance():
    fleet = head_on(gap_m=60.0, aside_m=0.5)
    known, _ = sail_late(fleet, 300)
    unknown, _ = sail_late(fleet, 300, believed_steps=0)
    assert unknown.min() < known.min()


def test_safe_commands_pass_bit_for_bit():
    fleet = head_on(gap_m=300.0)
    decide = batch(ShieldConfig(delay_s=0.3), fleet)
    state = fleet.state.copy()
    fill(state, packed(fleet.platforms))
    random = np.random.default_rng(0)
    for _ in range(6):
        wanted = random.uniform([0.1, -170.0], [2.0, 170.0], (2, 2))
        assert (decide(state, wanted) == wanted).all()


@pytest.mark.parametrize("nonsense", [(2.0, np.nan), (np.inf, 0.0), (2.0, 1e300)])
def test_what_others_told_a_boat_before_it_was_ours_may_be_nonsense(nonsense):
    fleet = head_on(gap_m=4.0)
    shield = Shield(delay_s=0.1)
    taken = Fleet(fleet.state, fleet.team, fleet.platforms, np.array([False, False]), fleet.names)
    shield.decide(taken, Commands.relative_deg([nonsense, (2.0, 0.0)]))
    decision = shield.decide(fleet, Commands.relative_deg([(2.0, 0.0), (2.0, 0.0)]))[0]
    assert np.isfinite([decision.filtered_speed_mps, decision.filtered_heading_rad, decision.safety_margin_m]).all()
    assert decision.safety_margin_m < 0.0


GAMES, CURRENT_MPS = 12, 0.3

EDGE = 60.0


def deepest(name, top, told_mps):
    """How far boats that make for a circle and the edge behind it got into either, m, over currents from all sides."""
    around = Surroundings(field=(-EDGE, -EDGE, EDGE, EDGE), stops=[(0.0, 0.0, 4.0)])
    config = ShieldConfig(current_mps=told_mps, edge_m=0.0)
    shield = BatchedShield(config, GAMES, (name,), (0,), around)
    angles = np.linspace(0.0, 2.0 * np.pi, GAMES, endpoint=False)
    drift = CURRENT_MPS * config.dt_s * np.column_stack([np.sin(angles), np.cos(angles)])
    state = np.zeros((GAMES, 1, L.N_STATE))
    state[:, 0, L.X], state[:, 0, L.Y] = np.linspace(-3.0, 3.0, GAMES), -40.0
    state[:, 0, L.SPEED], state[:, 0, L.THRUST] = top, 100.0
    into_circle, over_edge = -np.inf, -np.inf
    for _ in range(250):
        wanted = np.zeros((GAMES, 1, 2))
        wanted[:, 0, 0], wanted[:, 0, 1] = top, -state[:, 0, L.HEADING]
        sent = shield.decide(state, wanted, np.ones((GAMES, 1), bool))
        state[:, 0, :2] += drift
        step_all(packed([name]), state, sent, config.dt_s)
        into_circle = max(into_circle, (4.0 - np.linalg.norm(state[:, 0, :2], axis=1)).max())
        over_edge = max(over_edge, (np.abs(state[:, 0, :2]) - EDGE).max())
    return into_circle, over_edge


@pytest.mark.parametrize(("name", "top"), [("heron", 2.0), ("surveyor", 3.0)])
def test_a_boat_told_of_the_current_stays_out(name, top):
    unaware, told = deepest(name, top, 0.0), deepest(name, top, CURRENT_MPS)
    assert max(unaware) > 0.0  # or the test would see nothing
    assert max(told) < 0.0


@pytest.mark.parametrize(("name", "top"), [("heron", 2.0), ("surveyor", 3.0)])
@pytest.mark.parametrize("inside_m", [0.05, 0.2, 0.6])
def test_a_boat_that_begins_too_near_to_a_wall_comes_away(name, top, inside_m):
    """Nothing is remembered of a backup, and all manoeuvres fail at once: the one that leaves must still be found."""
    wall = [(0.0, -50.0), (0.0, 150.0), (-1.0, 150.0), (-1.0, -50.0)]
    config = ShieldConfig(current_mps=CURRENT_MPS)
    kept_m = Surroundings(polygons=[wall]).pack(config).segment_m
    shield = BatchedShield(config, 1, (name,), (0,), Surroundings(polygons=[wall]))
    state = np.zeros((1, 1, L.N_STATE))
    state[0, 0, [L.X, L.SPEED, L.THRUST]] = kept_m - inside_m, top, 100.0
    nearest = np.inf
    for _ in range(80):
        wanted = np.array([[[top, 90.0 - state[0, 0, L.HEADING]]]])
        sent = shield.decide(state, wanted, np.ones((1, 1), bool))
        state[0, 0, L.X] -= CURRENT_MPS * config.dt_s
        step_all(packed([name]), state, sent, config.dt_s)
        nearest = min(nearest, state[0, 0, L.X])
    assert nearest > kept_m - inside_m - 0.5
    assert state[0, 0, L.X] > kept_m + 1.0


def test_fixed_things_are_widened_by_the_drift_until_a_command_acts():
    around = Surroundings((0.0, 0.0, 80.0, 40.0), [(20.0, 20.0, 2.0)], keep_out=[(50.0, 20.0, 3.0)])
    still, told = (around.pack(ShieldConfig(delay_s=0.4, current_mps=mps)) for mps in (0.0, 0.6))
    np.testing.assert_allclose(told.field - still.field, [0.9, 0.9, -0.9, -0.9])
    np.testing.assert_allclose(told.circles[:, 2] - still.circles[:, 2], 0.9)
    np.testing.assert_allclose(told.keep_out[:, 2] - still.keep_out[:, 2], 0.9)
    assert (still.current_mps, told.current_mps) == (0.0, 0.6)


HOME, RADIUS = np.array([0.0, 0.0]), 5.0


def pursued_before_the_circle(name, top, gap_m):
    """A boat at half speed bound for the circle from 9 to 12 m, and one at full speed behind it."""
    random = np.random.default_rng(4)
    state = np.zeros((GAMES, 2, L.N_STATE))
    for game in state:
        bearing, aside = random.uniform(0.0, 2.0 * np.pi), random.uniform(-25.0, 25.0)
        away = np.array([np.sin(bearing), np.cos(bearing)])
        game[0, :2] = away * (RADIUS + random.uniform(9.0, 12.0))
        game[0, L.HEADING] = (np.degrees(bearing) + 180.0 + aside + 180.0) % 360.0 - 180.0
        game[1, :2] = game[0, :2] + away * gap_m
        game[1, L.HEADING] = (np.degrees(bearing) + 360.0) % 360.0 - 180.0
        game[:, L.SPEED], game[:, L.THRUST] = (0.5 * top, top), 100.0
    return state


def chase(state, pursuer_mps):
    """Commands (B, 2, 2): hold on at full speed, and straight at the boat."""
    way = state[:, 0, :2] - state[:, 1, :2]
    bearing = np.degrees(np.arctan2(way[:, 0], way[:, 1]))
    commands = np.zeros((len(state), 2, 2))
    commands[:, 0, 0], commands[:, 1, 0] = pursuer_mps, pursuer_mps
    commands[:, 1, 1] = (bearing - state[:, 1, L.HEADING] + 180.0) % 360.0 - 180.0
    return commands


@pytest.mark.parametrize(("name", "top", "gap_m"), [("surveyor", 3.0, 24.0), ("heron", 2.0, 10.0)])
def test_a_pursued_boat_goes_round_the_circle(name, top, gap_m):
    state = pursued_before_the_circle(name, top, gap_m)
    around = Surroundings(stops=[(*HOME, RADIUS + 0.1)])
    shield = BatchedShield(ShieldConfig(), GAMES, (name, name), (0, 1), around)
    params, ours = packed([name, name]), np.tile([True, False], (GAMES, 1))
    stopped, closest = np.zeros(GAMES, bool), np.full(GAMES, np.inf)
    first = None
    for _ in range(200):
        sent = shield.decide(state, chase(state, top), ours)
        first = shield.safety_margin_m[:, 0].copy() if first is None else first
        before = state[:, 0, :2].copy()
        step_all(params, state, sent, 0.1)
        for b in range(GAMES):
            if np.linalg.norm(state[b, 0, :2] - HOME) < RADIUS:
                keep_out(state[b, 0], before[b], HOME, RADIUS)
                stopped[b] = True
        closest = np.minimum(closest, np.linalg.norm(state[:, 0, :2] - state[:, 1, :2], axis=1))
    certified = first >= 0.0
    assert certified.sum() >= GAMES // 2
    assert not stopped[certified].any()
    assert (closest[certified] >= 2.5).all()
