"""Escapes of some boats must not be bought with those of others, who were let pass."""

import json
from pathlib import Path

import numpy as np
import pytest
from shield_loops import packed, step_all
from shield_scenes import distances
from steerclear.shield import ShieldConfig, Surroundings
from steerclear.shield.batch import BatchedShield
from steerclear.shield.certificates.rating import PAIR_SAFE, STRAIGHT_BASE
from steerclear.shield.ladder import CLEARLY, CLEARLY_BY_TABLES, _clearly
from steerclear.shield.scene import path_samples
from steerclear.shield.setup import boats_of
from steerclear.shield.work import new_work

DOORWAY = Path(__file__).parents[1] / "data" / "doorway.json"
"""Twelve herons of ours in a doorway, one of them inside a circle kept by rule: states, the shield's memory, wishes."""


def test_a_boat_that_passed_goes_back_to_its_escape_when_another_needs_the_room():
    """Its escape after the wanted command lies where the other's has to go; 2.34 m apart without, in half a second."""
    scene = json.loads(DOORWAY.read_text())
    state = np.array(scene["state"])[None]
    n = state.shape[1]
    around = Surroundings(keep_out=[(0.0, 34.0, 30.0), (0.0, -34.0, 30.0)])
    shield = BatchedShield(ShieldConfig(), 1, ("heron",) * n, (0,) * n, around)
    for name, values in scene["memory"].items():
        getattr(shield._memory, name)[0] = values
    for wanted in scene["wanted"]:
        commands = shield.decide(state, np.array(wanted)[None], np.ones((1, n), bool))
        step_all(packed(["heron"] * n), state, commands, shield.config.dt_s)
        assert distances(state[..., :2]).min() >= 2.5


@pytest.mark.parametrize(
    ("boat", "merit", "other", "before", "by_tables"),
    [
        (1, STRAIGHT_BASE - 0.5, PAIR_SAFE, STRAIGHT_BASE - 0.45, True),  # a surveyor short of its margin
        (0, STRAIGHT_BASE - 0.5, PAIR_SAFE, STRAIGHT_BASE - 0.45, False),  # a heron is, the surveyor is well
        (0, STRAIGHT_BASE - 0.5, STRAIGHT_BASE - 0.4, STRAIGHT_BASE - 0.45, False),  # the heron more so
        (1, -0.5, PAIR_SAFE, STRAIGHT_BASE - 0.45, False),  # what it is short of is sure to come
        (1, STRAIGHT_BASE - 0.5, PAIR_SAFE, PAIR_SAFE, False),  # the answer leaves nobody short
    ],
)
def test_tables_have_to_tell_a_clear_difference_where_they_tell_what_is_short(boat, merit, other, before, by_tables):
    boats = boats_of(ShieldConfig(), ("heron", "surveyor", "surveyor"), (0, 0, 1))
    work = new_work(3, path_samples(boats))
    work.merit[boat], work.merit[1 - boat] = merit, other
    clearly = _clearly(before, np.array([True, True, False]), boats, work)
    assert clearly == (CLEARLY_BY_TABLES if by_tables else CLEARLY)
