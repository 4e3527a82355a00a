"""Encounters of a heron and two rammers, one on each quarter, that who takes them to hold their course loses."""

import numpy as np
from steerclear.experiments.encounters import Conditions, draw, play
from steerclear.experiments.encounters.scene import join
from steerclear.shield.platforms import layout as L

NUMBERS = (173, 189, 253, 397, 403, 437, 480, 498, 503, 627)


def closest_m(guard):
    scenes = join([draw("rammer_2", "heron", "heron", Conditions(), 0, number, 1) for number in NUMBERS])
    place = play(scenes, guard, Conditions()).state[..., [L.X, L.Y]]
    return np.linalg.norm(place[:, :, :1] - place[:, :, 1:], axis=-1).min(axis=(0, 2))


def test_two_that_close_in_from_both_quarters_are_seen_coming():
    assert (closest_m("shield") >= 2.5).all()


def test_who_takes_them_to_hold_their_course_loses_them():
    assert (closest_m("shield:profile=hold-course") < 2.5).mean() >= 0.3
