"""Encounters of twenty herons with twenty others, in which what one boat could not keep was taken from others."""

import numpy as np
import pytest
from steerclear.experiments.encounters import Conditions, draw, play
from steerclear.experiments.encounters.scene import join
from steerclear.shield import Reason
from steerclear.shield.platforms import layout as L

OWN = 20


def film_of(number):
    return play(join([draw("crowd_40", "heron", "heron", Conditions(), 0, number, 1)]), "shield", Conditions())


def gaps_of(film):
    """Distances of every own boat from every boat, (T+1, 20, 40) m, from itself inf."""
    place = film.state[:, 0][:, :, [L.X, L.Y]]
    gaps = np.linalg.norm(place[:, :OWN, None] - place[:, None], axis=-1)
    gaps[:, range(OWN), range(OWN)] = np.inf
    return gaps


@pytest.mark.parametrize("number", [961, 962])
def test_mates_that_passed_make_room_for_the_escape_another_has_held(number):
    assert gaps_of(film_of(number))[..., :OWN].min() >= 2.5


@pytest.mark.parametrize("number", [546, 572, 873])
def test_a_boat_is_not_let_off_by_what_a_team_mate_far_away_cannot_keep(number):
    """Three encounters with a hit by an opponent of a boat that had 2 m to spare a few seconds before."""
    film = film_of(number)
    assert gaps_of(film).min() >= 2.5
    reason, told_m = film.reason[:, 0, :OWN], film.safety_margin_m[:, 0, :OWN]
    both = (reason == Reason.BEST_EFFORT).any(axis=1, keepdims=True) & (reason == Reason.BACKUP)
    assert both.any()  # some keep everything by their backup where others cannot
    assert (told_m[both] >= 0.0).all()
