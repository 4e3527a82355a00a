"""Encounters of twenty herons with twenty others, in which a mate that was let pass closed the way of another."""

import numpy as np
import pytest
from steerclear.experiments.encounters.families import draw
from steerclear.experiments.encounters.play import play
from steerclear.experiments.encounters.scenes import Conditions, join
from steerclear.shield.platforms import layout as L

OWN = 20


@pytest.mark.parametrize("number", [961, 962])
def test_mates_that_passed_make_room_for_the_escape_another_has_held(number):
    scenes = join([draw("crowd_40", "heron", "heron", Conditions(), 0, number, 1)])
    place = play(scenes, "shield", Conditions()).state[:, 0, :OWN, [L.X, L.Y]].transpose(1, 2, 0)
    gaps = np.linalg.norm(place[:, :, None] - place[:, None], axis=-1)
    assert gaps[:, ~np.eye(OWN, dtype=bool)].min() >= 2.5
