"""What a boat is told to do does not hang on teammates that have nothing to do with it."""

import numpy as np
import pytest
from shield_loops import sail
from shield_scenes import crowded_edge, fleet_of
from steerclear.shield import Commands, Reason, Shield, ShieldConfig, Surroundings
from steerclear.shield.platforms import layout as L

FIELD = (0.0, 0.0, 900.0, 80.0)


@pytest.mark.parametrize("platform", ["heron", "surveyor"])
def test_a_boat_outside_is_no_leave_for_another_to_go_out(platform):
    """One lies a little beyond the lower edge, bow outwards; the other presses through the upper one, far away."""
    top = 2.0 if platform == "heron" else 3.0
    fleet = fleet_of([(500.0, -0.3, 180.0, 0.0), (100.0, 55.0, 30.0, top)], [0, 0], platform)
    out = np.array([180.0, 30.0])

    def wanted(step, state):
        return np.stack([np.full(2, top), (out - state[:, L.HEADING] + 180.0) % 360.0 - 180.0], axis=-1)

    run = sail(Shield(ShieldConfig(edge_m=0.2), Surroundings(field=FIELD)), fleet, wanted, 600)
    assert (run.reason[:, 0] > 0).mean() > 0.2, "or it is not outside for long"
    assert (FIELD[3] - run.position[:, 1, 1]).min() >= 0.15


def remembered(shield):
    """What a shield keeps of each boat from one decision to the next."""
    return shield._deciders.scene.memories[0]


def sailed(groups):
    """Run of those groups, and the shield afterwards."""
    rows, team, courses = ([one for group in groups for one in group[k]] for k in range(3))
    fleet = fleet_of(rows, team, "heron")
    fleet.state[:, L.THRUST] = 100.0
    shield = Shield(ShieldConfig(edge_m=0.2), Surroundings(field=FIELD))

    def wanted(step, state):
        error = (np.array(courses) - state[:, L.HEADING] + 180.0) % 360.0 - 180.0
        return np.stack([np.full(len(state), 2.0), error], axis=-1)

    return sail(shield, fleet, wanted, 100), shield


@pytest.mark.parametrize("seed", range(8))
def test_groups_that_cannot_meet_are_decided_for_as_if_each_were_alone(seed):
    """And what is remembered of them is the same as well."""
    random = np.random.default_rng(seed)
    near, far = crowded_edge(random, 100.0), crowded_edge(random, 600.0)
    (alone, one), (together, both) = sailed([near]), sailed([near, far])
    n = len(near[0])
    np.testing.assert_allclose(together.position[:, :n], alone.position, atol=1e-6)
    np.testing.assert_array_equal(together.reason[:, :n], alone.reason)
    np.testing.assert_allclose(together.safety_margin_m[:, :n], alone.safety_margin_m, atol=1e-6)
    mine = remembered(one)
    np.testing.assert_allclose(remembered(both)[:n, : mine.shape[1]], mine, atol=1e-6)


def abreast(first, other):
    """The last of three surveyors in a row abreast, or of the last two: what is decided for it, an opponent nearby.

    The first has to back up before an opponent of its own, and is in reach of the second only.
    """
    rows = [(0.0, 0.0, 0.0, 2.5), (0.0, 20.0, 180.0, 3.0), (105.0, 0.0, 0.0, 2.5), (210.0, 0.0, 0.0, 3.0), other]
    fleet = fleet_of(rows[first:], [0, 1, 0, 0, 1][first:], "surveyor")
    fleet.state[:, L.THRUST] = 100.0
    decisions = Shield(profile="ramming").decide(fleet, Commands.relative_deg(np.tile([3.0, 0.0], (len(fleet), 1))))
    assert first > 0 or decisions[0].intervened
    return decisions[len(fleet) - 2]


def test_what_is_told_of_a_boat_hangs_on_no_backup_of_one_that_it_cannot_meet():
    """Value tables are looked up at another time for who backs up than for who passes."""
    random, close = np.random.default_rng(0), 0
    for _ in range(120):
        bearing, far_m = random.uniform(-np.pi, np.pi), random.uniform(15.0, 40.0)
        other = (210.0 + far_m * np.sin(bearing), far_m * np.cos(bearing), random.uniform(-180.0, 180.0), 3.0)
        alone, together = abreast(2, other), abreast(0, other)
        assert together.reason == alone.reason
        assert together.safety_margin_m == pytest.approx(alone.safety_margin_m, abs=1e-9)
        close += alone.reason == Reason.PASSED and alone.safety_margin_m < 2.0
    assert close > 2
