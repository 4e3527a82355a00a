"""What is told of boats inside the radius is the distance they are inside, not a rank."""

import math

import numpy as np
import pytest
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig
from steerclear.shield.batch import BatchedShield
from steerclear.shield.exceptions import FleetError
from steerclear.shield.platforms.usv import fresh_state

KEPT_M = 2.5


def two(gap_m, team=(0, 1)):
    return Fleet.of(
        position_m=[[0, 0], [0, gap_m]],
        heading_rad=[0, math.pi],
        speed_mps=[2, 2],
        team=team,
        platforms="heron",
    )


AHEAD = Commands.relative_deg(np.array([[2.0, 0.0], [2.0, 0.0]]))


@pytest.mark.parametrize("gap_m", [0.0, 0.1, 0.5, 1.0, 2.0, 2.4])
@pytest.mark.parametrize("coordination", ["team", "per_boat"])
@pytest.mark.parametrize("team", [(0, 1), (0, 0)])
def test_the_certificate_in_breach_is_how_far_inside_the_boats_are(gap_m, coordination, team):
    decision = Shield(coordination=coordination).decide(two(gap_m, team), AHEAD)[0]
    assert decision.safety_margin_m == pytest.approx(gap_m - KEPT_M)
    assert decision.slack_m == pytest.approx(KEPT_M - gap_m)


@pytest.mark.parametrize("gap_m", [0.1, 1.0, 2.4])
def test_the_batch_tells_the_same(gap_m):
    state = np.array([[fresh_state(0.0, 0.0, 0.0, 2.0), fresh_state(0.0, gap_m, 180.0, 2.0)]])
    batch = BatchedShield(ShieldConfig(), 1, ("heron", "heron"), (0, 1))
    batch.decide(state, AHEAD.values[None], np.array([[True, False]]))
    assert batch.safety_margin_m[0, 0] == pytest.approx(gap_m - KEPT_M)


@pytest.mark.parametrize("wanted", [[[2.0, 0.0]] * 2, np.zeros((2, 2)), None])
def test_commands_of_another_kind_are_refused_with_the_remedy(wanted):
    with pytest.raises(FleetError, match=r"decide takes a Fleet and Commands, not Fleet and .*Commands\.absolute_rad"):
        Shield().decide(two(20.0), wanted)
