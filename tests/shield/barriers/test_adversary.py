"""How long opponents are feared: the longer, the less is left, and the more commands are changed."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from shield_loops import scattered
from shield_scenes import fleet_of, relative
from stages import stages_of
from steerclear.shield import Shield, ShieldConfig
from steerclear.shield.backup.rollout import roll_out
from steerclear.shield.barriers.neighbours import find_neighbours
from steerclear.shield.barriers.pursuit import clear_of_pursuer
from steerclear.shield.batch import BatchedShield
from steerclear.shield.platforms import layout as L

TIMES_S = (0.0, 2.0, 6.0, 9.0, 20.0, np.inf)


def apart(x, y, heading_deg):
    """A surveyor of ours at the origin heading north, and an opponent, both at full thrust and speed."""
    fleet = fleet_of([(0.0, 0.0, 0.0, 3.0), (x, y, heading_deg, 3.0)], [0, 1], "surveyor")
    state = fleet.state.copy()
    state[:, L.THRUST] = 100.0
    return replace(fleet, state=state)


def certificates_m(fleet, **settings):
    """Margins told of the first boat, by time."""
    wanted = relative((3.0, 0.0), (3.0, 0.0))
    return [
        Shield(adversary_horizon_s=time_s, **settings).decide(fleet, wanted)[0].safety_margin_m for time_s in TIMES_S
    ]


@pytest.mark.parametrize("gap_m", [14.0, 20.0, 26.0])
@pytest.mark.parametrize("heading_deg", [90.0, 180.0, 225.0])
def test_of_what_is_looked_up_less_is_left_the_longer_it_is_feared(gap_m, heading_deg):
    told = certificates_m(apart(1.0, gap_m, heading_deg))
    assert all(sooner >= later - 1e-9 for sooner, later in itertools.pairwise(told[1:]))


def test_a_pursuer_holds_its_course_after_its_time():
    """Its turn ends where the time does: what is left of a straight run grows no smaller with less of it."""
    random, narrowed = np.random.default_rng(4), 0
    for state in scattered(random, 60, ["heron", "heron"], 25.0, gap_m=4.0):
        margins = []
        for time_s in TIMES_S[1:]:
            config = ShieldConfig(adversary_horizon_s=time_s, opponent_model="turning_circle", margin_cap_m=50.0)
            at = stages_of(config, state, ["heron"] * 2, [0, 1])
            find_neighbours(at.scene)
            at.adversary_horizon_s[:] = time_s
            roll_out(0, 0, 1.0, 0.0, 2.0, 0, at.scene)
            margins.append(clear_of_pursuer(0, 1, 0, -1e6, at.scene))
        assert margins[-1] <= min(margins) + 0.25, "pursuing for ever is the worst but for the strides of the run"
        narrowed += margins[0] > margins[-1] + 1.0
    assert narrowed >= 5


def test_less_fear_changes_no_more_commands():
    """Of many scenes of a few opponents about, each time changes no more than the next longer one, or hardly."""
    random, count = np.random.default_rng(8), 300
    platforms, team = ("surveyor",) * 3, (0, 1, 1)
    states = scattered(random, count, list(platforms), 30.0, gap_m=6.0)
    wanted = np.zeros((count, 3, 2))
    wanted[..., 0], wanted[..., 1] = 3.0, random.uniform(-90.0, 90.0, (count, 3))
    ours = np.broadcast_to(np.array([True, False, False]), (count, 3)).copy()
    changed = []
    for time_s in TIMES_S:
        guard = BatchedShield(ShieldConfig(adversary_horizon_s=time_s), count, platforms, team)
        sent = guard.decide(states.copy(), wanted.copy(), ours)
        changed.append(int((sent[:, 0] != wanted[:, 0]).any(axis=1).sum()))
    assert all(sooner <= later + 3 for sooner, later in itertools.pairwise(changed)), changed
    assert changed[0] < changed[-1] - 30, changed
