"""The rows' coefficients against finite differences of the exact certificate, the manoeuvre held fixed."""

import numpy as np
import pytest
from shield_loops import fill, packed
from stages import built, screened, stages_of
from steerclear.shield import ShieldConfig, Surroundings
from steerclear.shield.backup.rollout import roll_out
from steerclear.shield.barriers.boats import clear_of_boat
from steerclear.shield.barriers.clearance import FAR, MARGIN
from steerclear.shield.barriers.static import clear_of_near_obstacles, clear_of_static
from steerclear.shield.filter import nominal, qp
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import command_for_turn

STEP = 1e-4
BOAT, NEAR_OBSTACLES, ALL_STATIC = range(3)
"""What a row is about."""


def meeting(random, name, gap_m):
    """Two boats about to meet."""
    state = np.zeros((2, L.N_STATE))
    state[:, [L.SPEED_ERROR, L.HEADING_ERROR]] = 0.0
    bearing = random.uniform(-180.0, 180.0)
    state[1, L.X], state[1, L.Y] = gap_m * np.sin(np.radians(bearing)), gap_m * np.cos(np.radians(bearing))
    state[0, L.HEADING] = bearing + random.uniform(-25.0, 25.0)
    state[1, L.HEADING] = bearing + 180.0 + random.uniform(-25.0, 25.0)
    state[:, L.SPEED] = get_platform(name).max_speed_mps * random.uniform(0.5, 1.0, 2)
    state[:, L.THRUST] = np.nan
    fill(state, packed([name, name]))
    return state


class Linearised:
    """One program about the nominal commands of boat 0, whose first row is ``about`` boat 1 or fixed things."""

    def __init__(self, at, count, about):
        self.at, self.count, self.about = at, count, about
        self.manoeuvres = at.manoeuvre[: len(at.state)].copy()
        self.z = at.z_now[: 2 * count].copy()

    def move(self, z):
        """Lay the paths of the movers under inputs z, their manoeuvres as they are."""
        at = self.at
        commands = at.command.copy()
        for m in range(self.count):
            i = at.movers[m]
            params = at.boats.params[i]
            speed = z[2 * m + 1] / np.sqrt(at.tuning.speed_weight) * params[L.MAX_SPEED]
            turn = z[2 * m] * at.gain[i, 2]
            commands[i] = speed, command_for_turn(params, at.state[i], speed, turn, at.tuning.dt_s)
            nominal.predict(i, commands, at.scene)
            roll_out(i, i, *self.manoeuvres[i], 1, at.scene)

    def margin(self, z):
        """Exact margin from what the row is about."""
        at = self.at
        self.move(z)
        if self.about == BOAT:
            clear_of_boat(0, 1, at.path[0], at.scene, -FAR, FAR)
        elif self.about == NEAR_OBSTACLES:
            clear_of_near_obstacles(0, 0, at.scene, FAR, at.out)
        else:
            clear_of_static(0, 0, at.scene, at.out)
        return at.out[MARGIN]

    def gradients(self):
        """(coefficients of the row before it was scaled, finite differences), each (2 movers,)."""
        at, n = self.at, 2 * self.count
        C, d = at.C[0, :n].copy(), at.d[0]
        target = at.target[0] if self.about != ALL_STATIC else 0.0
        aim_m = 0.0 if self.about == BOAT else qp.STATIC_AIM_M
        lack = target + aim_m - self.margin(self.z)
        scale = lack / (d - C @ self.z)
        steps = STEP * np.eye(n)
        slopes = [(self.margin(self.z + step) - self.margin(self.z - step)) / (2.0 * STEP) for step in steps]
        return scale * C, np.array(slopes)


def linearised(random, name, team, gap_m, tries, surroundings=None):
    """Programs of that many scenes in which the nominal commands are not safe."""
    config = ShieldConfig(adversary_horizon_s=0.0)
    for _ in range(tries):
        at = stages_of(config, meeting(random, name, gap_m * random.uniform(0.6, 1.2)), [name] * 2, team, surroundings)
        top = get_platform(name).max_speed_mps
        wanted = np.column_stack([random.uniform(0.3, 0.95, 2) * top, random.uniform(-2.0, 2.0, 2)])
        if screened(at, wanted) or at.inside_separation.any():
            continue
        count, found = built(at)
        if found > 4 * count:
            yield Linearised(at, count, BOAT)


@pytest.mark.parametrize(
    ("name", "gap_m", "error"), [("surveyor", 10.0, 0.05), ("heron", 5.0, 0.15), ("si", 12.0, 0.2)]
)
def test_a_turn_does_to_the_margin_what_the_row_says(name, gap_m, error):
    pairs = [task.gradients() for task in linearised(np.random.default_rng(1), name, [0, 1], gap_m, 150)]
    told, measured = np.array([[a[0], b[0]] for a, b in pairs]).T
    assert len(told) > 25
    assert np.mean(np.sign(told) == np.sign(measured)) > 0.95
    assert np.median(np.abs(told - measured) / np.abs(measured)) < error


def edge(y):
    return Surroundings(field=(-200.0, -200.0, 200.0, y))


def wall(y):
    return Surroundings(polygons=[[(-90.0, y + 1.0), (90.0, y + 1.0), (90.0, y + 9.0), (-90.0, y + 9.0)]])


def rule(y):
    return Surroundings(keep_out=[(3.0, y + 30.0, 30.0)])


def flag(y):
    return Surroundings(stops=[(3.0, y + 30.0, 30.0)])


@pytest.mark.parametrize(
    ("around", "about"),
    [
        (edge, ALL_STATIC),
        (rule, ALL_STATIC),
        (wall, NEAR_OBSTACLES),
        (flag, NEAR_OBSTACLES),
    ],
)
def test_a_turn_does_to_the_distance_from_fixed_things_what_the_row_says(around, about):
    random, told, measured = np.random.default_rng(3), [], []
    for _ in range(60):
        state = np.zeros((1, L.N_STATE))
        state[0, [L.HEADING, L.SPEED, L.THRUST]] = random.uniform(-40.0, 40.0), 3.0, 100.0
        at = stages_of(ShieldConfig(), state, ["surveyor"], [0], around(random.uniform(2.0, 6.0)))
        if screened(at, np.array([[2.9, 1.0]])):
            continue
        count, found = built(at)
        if found == (6 if about == NEAR_OBSTACLES else 5):  # four are limits; near obstacles are in both others
            a, b = Linearised(at, count, about).gradients()
            told.append(a[0])
            measured.append(b[0])
    assert len(told) > 10
    assert np.sign(told).tolist() == np.sign(measured).tolist()
    np.testing.assert_allclose(told, measured, rtol=0.1, atol=0.003)
