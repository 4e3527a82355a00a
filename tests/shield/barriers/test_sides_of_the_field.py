"""How far along a path the sides of the field are looked at."""

import numpy as np
import pytest
from stages import screened, stages_of
from steerclear.shield import ShieldConfig
from steerclear.shield.barriers.static import _sampling
from steerclear.shield.platforms import fresh_state, get_platform


@pytest.mark.parametrize("platform", ["heron", "surveyor"])
@pytest.mark.parametrize(("team", "apart_m", "to_the_end"), [(0, 6.0, True), (1, 20.0, False), (1, 2000.0, True)])
def test_who_may_be_pursued_looks_until_a_half_turn_could_be_over_others_to_the_end(
    platform, team, apart_m, to_the_end
):
    """Pursued by an opponent that is near; not by a team-mate, nor by an opponent that is far away."""
    top = get_platform(platform).max_speed_mps
    state = np.array([fresh_state(0.0, 0.0, 0.0, top), fresh_state(apart_m, 0.0, 0.0, top)])
    at = stages_of(ShieldConfig(), state, [platform] * 2, [0, team])
    screened(at, np.array([[top, 0.0]] * 2))
    half_turn, end = at.boats.static_samples[0], at.boats.samples[0]
    assert half_turn < end
    assert _sampling(0, 0.0, at.scene).side == (end if to_the_end else half_turn)
