"""Boats under the shield, sailed on: the distance is kept wherever the certificate says it can be."""

import numpy as np
import pytest
import qpsolvers
from shield_loops import packed, sail, sail_games
from shield_scenes import distances, fleet_of, head_on
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig, Surroundings
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L

GAMES = 24
STEPS_S = 20.0


def starts(platform, n, spread_m, seed):
    """Random states, (GAMES, n, N_STATE), no two boats nearer than 8 m."""
    rng = np.random.default_rng(seed)
    top = get_platform(platform).max_speed_mps
    games = []
    while len(games) < GAMES:
        place = rng.uniform(-spread_m, spread_m, (n, 2))
        gap = np.linalg.norm(place[:, None] - place[None], axis=2) + 99 * np.eye(n)
        if gap.min() > 8:
            games.append([fresh_state(x, y, rng.uniform(-180, 180), rng.uniform(0, top)) for x, y in place])
    return np.array(games)


def wander(platform, n, seed):
    """Random commands, new every second or so."""
    rng = np.random.default_rng(seed)
    top = get_platform(platform).max_speed_mps
    held = np.zeros((GAMES, n, 2))

    def wanted(step, state):
        if step % 10 == 0:
            held[..., 0] = rng.uniform(0.3 * top, top, (GAMES, n))
            held[..., 1] = rng.uniform(-120, 120, (GAMES, n))
        return held.copy()

    return wanted


@pytest.mark.parametrize("dt_s", [0.1, 0.05])
@pytest.mark.parametrize(("platform", "spread_m"), [("heron", 15), ("surveyor", 30)])
@pytest.mark.parametrize("certificate", ["turning_circle", "value_table"])
def test_team_mates_never_come_too_near(certificate, platform, spread_m, dt_s):
    config = ShieldConfig(dt_s=dt_s, opponent_model=certificate)
    state = starts(platform, 3, spread_m, 3)
    run = sail_games(config, state, [platform] * 3, [0, 0, 0], wander(platform, 3, 4), int(STEPS_S / dt_s))
    certified = (run.safety_margin_m[0] >= 0).all(axis=-1)
    assert certified.sum() >= GAMES // 3
    assert run.closest(np.ones(3, bool))[certified].min() >= config.separation_m


@pytest.mark.parametrize("dt_s", [0.1, 0.05])
@pytest.mark.parametrize(("platform", "spread_m"), [("heron", 12), ("surveyor", 30), ("si", 60)])
def test_opponents_that_hold_their_course_are_avoided(platform, spread_m, dt_s):
    config = ShieldConfig(dt_s=dt_s, adversary_horizon_s=0.0)
    state = starts(platform, 3, spread_m, 5)
    top = get_platform(platform).max_speed_mps
    state[:, :, L.SPEED] = top
    thrust = np.interp(top, *np.array(get_platform(platform).thrust_map).T[::-1])
    state[:, :, L.THRUST] = thrust
    random = wander(platform, 3, 6)

    def wanted(step, now):
        commands = random(step, now)
        commands[:, 1:] = top, 0.0
        return commands

    run = sail_games(config, state, [platform] * 3, [0, 1, 1], wanted, int(STEPS_S / dt_s))
    certified = run.safety_margin_m[0][:, 0] >= 0
    assert certified.sum() >= GAMES // 3
    assert run.closest(np.array([True, False, False]))[certified].min() >= config.separation_m


def test_a_side_once_taken_is_kept():
    run = sail(Shield(), head_on(12.0, aside_m=0.05), lambda step, state: np.array([[2.0, 0.0], [2.0, 0.0]]), 60)
    east = run.position[:, 0, 0]
    assert distances(run.position)[:, 0, 1].min() >= 2.5
    assert (np.diff(east) >= -1e-6).all() or (np.diff(east) <= 1e-6).all() or np.ptp(np.sign(np.round(east, 2))) <= 1


@pytest.mark.parametrize("start_y", [18.2, 18.5])
def test_a_boat_that_cannot_keep_off_a_wall_any_more_turns_away_from_it(start_y):
    """A hull's width is lost for a moment, the wall itself is not touched, and the boat stays on its side."""
    around = Surroundings(polygons=[[(-20, -20), (20, -20), (20, 20), (-20, 20)]])
    fleet = fleet_of([(0.3, start_y, 0, 2)], [0])
    run = sail(Shield(surroundings=around), fleet, lambda step, state: np.array([[2.0, 0.0]]), 60)
    assert run.position[:, 0, 1].max() < 19.6


def test_a_boat_that_cannot_but_hit_a_wall_meets_it_as_gently_as_it_can():
    """6 m before the wall a surveyor, which needs 9 m to turn along it, does not go straight on."""
    around = Surroundings(polygons=[[(-40, -40), (40, -40), (40, 20), (-40, 20)]])
    fleet = fleet_of([(0.3, 14.0, 0, 3.0)], [0], "surveyor")
    run = sail(Shield(surroundings=around), fleet, lambda step, state: np.array([[3.0, -state[0, L.HEADING]]]), 20)
    way = np.diff(run.position[:, 0], axis=0)[-1]
    assert run.position[-1, 0, 1] > 18.5
    assert abs(np.degrees(np.arctan2(way[0], way[1]))) > 30.0


@pytest.mark.parametrize("name", ["heron", "surveyor", "mctf2024_sim"])
@pytest.mark.parametrize("around", [{"field": (0, 0, 80, 80)}, {"polygons": [[(0, 0), (80, 0), (80, 80), (0, 80)]]}])
def test_a_boat_sent_out_for_ever_stays_in_by_absolute_headings(name, around):
    """Half a turn commanded is one to the other side once it is an absolute heading."""
    params, state = packed([name])[0], np.zeros(L.N_STATE)
    state[[L.X, L.Y, L.SPEED_ERROR, L.HEADING_ERROR]] = 40.0, 50.0, np.nan, np.nan
    shield, highest = Shield(surroundings=Surroundings(**around), obstacle_clearance_m=0.2), 0.0
    for _ in range(600):
        now = Fleet(state[None].copy(), np.array([0]), (name,), np.array([True]), ("a",))
        sent = shield.decide(now, Commands.absolute_rad([[params[L.MAX_SPEED], 0.0]]))[0]
        error = (np.degrees(sent.filtered_heading_rad) - state[L.HEADING] + 180.0) % 360.0 - 180.0
        step_boat(params, state, sent.filtered_speed_mps, error, 0.1)
        highest = max(highest, state[L.Y])
    assert 79.0 < highest < 80.0


def test_a_command_changed_for_an_edge_alone_says_so():
    fleet = fleet_of([(40, 79.78, 85, 1.5), (40, -500, 0, 1.5)], [0, 0])
    decisions = Shield(surroundings=Surroundings(field=(0, -600, 80, 80))).decide(
        fleet, Commands.relative_deg([[2.0, -85.0], [1.5, 0.0]])
    )
    assert list(decisions.intervened) == [True, False]
    assert [each.active_constraints for each in decisions] == [("field",), ()]


@pytest.mark.parametrize("name", ["heron", "surveyor"])
@pytest.mark.parametrize("goal_deg", [0.0, 180.0])
def test_a_boat_outside_the_field_comes_back_whatever_is_wanted(name, goal_deg):
    """At rest 3 m out with its bow outwards it has to go farther out to turn: staying there is not better."""
    fleet = fleet_of([(40, 43, 0, 0.0)], [0], name)
    run = sail(
        Shield(surroundings=Surroundings(field=(0, 0, 80, 40))),
        fleet,
        lambda step, state: np.array([[2.0, goal_deg - state[0, L.HEADING]]]),
        400,
    )
    north = run.position[:, 0, 1]
    assert north.max() < 45.0
    assert (north[300:] < 40.0).all()


def test_a_boat_that_cannot_keep_off_a_circle_any_more_hardly_goes_into_it():
    fleet = fleet_of([(0.3, 6.4, 0, 2)], [0])
    run = sail(Shield(surroundings=Surroundings(circles=[(0, 10, 3)])), fleet, lambda *_: np.array([[2.0, 0.0]]), 60)
    assert np.linalg.norm(run.position[:, 0] - [0, 10], axis=1).min() > 2.6


def test_one_boat_alone_stays_in_the_field_and_off_the_obstacle():
    around = Surroundings(field=(0, 0, 40, 40), circles=[(20, 30, 2)])
    fleet = fleet_of([(20, 10, 0, 2)], [0])
    run = sail(Shield(surroundings=around), fleet, lambda step, state: np.array([[2.0, 0.0]]), 400)
    place = run.position[:, 0]
    assert place.min() > 0
    assert place.max() < 40
    assert np.linalg.norm(place - [20, 30], axis=1).min() >= 2.0


def answers_nonsense(*arguments, **settings):
    return np.full(4, np.nan)


def gives_up(*arguments, **settings):
    return None


def breaks(*arguments, **settings):
    raise RuntimeError("solver broke")


@pytest.mark.parametrize("solver", [answers_nonsense, gives_up, breaks])
def test_boats_keep_apart_when_the_solver_fails(solver, monkeypatch):
    monkeypatch.setattr(qpsolvers, "solve_qp", solver)
    fleet = fleet_of([(0, 0, 0, 2), (0, 14, 180, 2)], [0, 0])
    run = sail(Shield(), fleet, lambda step, state: np.array([[2.0, 0.0], [2.0, 0.0]]), 100)
    assert distances(run.position)[:, 0, 1].min() >= 2.5
    assert np.isfinite(run.sent).all()
