"""Surveyors that several opponents can come near to: one manoeuvre has to do for all."""

import numpy as np
import pytest
from shield_scenes import fleet_of, relative
from steerclear.shield import Reason, Shield
from steerclear.shield.platforms import layout as L


def decided(boats):
    """Reason and certificate of the first boat, told to go straight on; the others are opponents."""
    fleet = fleet_of([(x, y, heading, 3.0) for x, y, heading in boats], [0] + [1] * (len(boats) - 1), "surveyor")
    fleet.state[:, L.THRUST] = 100.0
    answer = Shield().decide(fleet, relative(*[(3.0, 0.0)] * len(boats)))
    return Reason(answer.reason[0]), answer.safety_margin_m[0]


def scenes(count, reach_m):
    random = np.random.default_rng(5)
    for _ in range(count):
        places = random.uniform(-reach_m, reach_m, (2, 2))
        headings = np.degrees(np.arctan2(-places[:, 0], -places[:, 1])) + random.uniform(-60.0, 60.0, 2)
        if (np.linalg.norm(places, axis=1) > 4.0).all():
            yield [(*place, heading) for place, heading in zip(places, headings, strict=True)]


def test_another_opponent_never_makes_the_shield_content():
    passed = refused = 0
    for first, second in scenes(150, 22.0):
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
