"""A slow boat that is pursued gains speed, whatever it is told: turns cost it the speed that it needs to get away."""

import numpy as np
import pytest
from steerclear.experiments.encounters import Conditions, draw, play


@pytest.mark.parametrize("number", [51, 81, 99, 125, 177, 223, 256, 296])
def test_boats_at_rest_that_can_get_away_do(number):
    """Encounters that ended with a hit as long as single wanted turns were sent that looked a little better."""
    conditions = Conditions()
    film = play(draw("at_rest", "surveyor", "surveyor", conditions, 0, number, 1), "shield:profile=ramming", conditions)
    assert film.safety_margin_m[0, 0, 0] > 0.3
    own, other = film.state[:, 0, 0, :2], film.state[:, 0, 1, :2]
    assert np.linalg.norm(own - other, axis=-1).min() >= 2.5
