"""Which manoeuvres boats look at: by what they know of opponents, and whether they steer without thrust."""

import numpy as np
import pytest
from steerclear.shield import ShieldConfig
from steerclear.shield.model import boats_of


def looked_at(kinds, team, **settings):
    boats = boats_of(ShieldConfig(**settings), kinds, team)
    return boats.manoeuvres, boats.n_manoeuvres


def test_gentle_turns_are_for_boats_with_tables_and_slow_ones_for_those_that_need_no_thrust():
    plans, _ = looked_at(("surveyor", "heron", "ardurover_boat"), (0, 1, 1))
    gentle, slow = np.abs(plans[:, :, 0]) < 1.0, (plans[:, :, 2] == 0.5)
    assert gentle.any(axis=1).tolist() == [True, False, False]
    assert slow.any(axis=1).tolist() == [False, False, True]


@pytest.mark.parametrize("kind", ["surveyor", "heron", "ardurover_boat"])
def test_either_side_is_offered_alike(kind):
    plans, n_manoeuvres = looked_at((kind, "surveyor"), (0, 1))
    rows = plans[0, : n_manoeuvres[0]]
    turns = rows[rows[:, 1] > 0.0]
    mirrored = turns * [-1.0, 1.0, 1.0]
    assert {tuple(row) for row in turns} == {tuple(row) for row in mirrored}
