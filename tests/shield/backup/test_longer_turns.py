"""Longer hard turns are not looked at where a shorter one failed while still turning: they would be worth no more."""

import math

import numpy as np
import pytest
from stages import screened, stages_of
from steerclear.shield import ShieldConfig, Surroundings
from steerclear.shield.backup.assign import choose_plan, holds_for_longer
from steerclear.shield.backup.candidates import candidate, hard_turn, preference, remembered
from steerclear.shield.backup.laying import lay_path
from steerclear.shield.backup.rank import rank_path
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import fresh_state

AROUND = Surroundings(field=(-20.0, -20.0, 20.0, 20.0), stops=[(6.0, 6.0, 3.0)], keep_out=[(-9.0, 0.0, 3.0)])
MANY = 1e-9


def scenes(name, count, thrust=100.0):
    """Screened: two boats of ours and three opponents in a small place, one of ours breathing down another's neck."""
    random = np.random.default_rng(29)
    top = get_platform(name).max_speed_mps
    for _ in range(count):
        rows = []
        for k in range(5):
            far, angle = random.uniform(2.6, 12.0), random.uniform(-math.pi, math.pi)
            x, y = (0.0, 0.0) if k == 0 else (far * math.sin(angle), far * math.cos(angle))
            row = fresh_state(x, y, random.uniform(-180.0, 180.0), random.uniform(0.3, 1.0) * top)
            row[[L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = thrust, 0.0, 0.0
            rows.append(row)
        at = stages_of(ShieldConfig(), np.array(rows), [name] * 5, [0, 0, 1, 1, 1], AROUND)
        at.memory.backing_up[:2] = random.random() < 0.5
        at.memory.margin_m[:2], at.memory.threat_m[:2] = 0.4, random.uniform(0.0, 2.0)
        screened(at, np.array([[top, random.uniform(-90.0, 90.0)]] * 5))
        yield at, top


def rated(at, p, top, done):
    """Rank of manoeuvre number p of boat 0, nothing cut short, with what it gains by the hysteresis."""
    heading = at.work.next_state[0, L.HEADING] if done else at.state[0, L.HEADING]
    side, togo, speed = candidate(0, p, top, heading, at.scene)
    trial = len(at.state)
    lay_path(0, trial, side, togo, speed, done, at.scene)
    rank = rank_path(0, trial, -1e9, at.scene)
    return rank, rank + preference(0, p, side, togo, rank, at.scene)


CASES = pytest.mark.parametrize(
    ("name", "thrust"), [("heron", 100.0), ("heron", 60.0), ("heron", 0.0), ("surveyor", 100.0), ("surveyor", 30.0)]
)


@CASES
@pytest.mark.parametrize("done", [0, 1])
def test_a_longer_turn_is_worth_no_more(name, thrust, done):
    left_out = 0
    for at, top in scenes(name, 25, thrust):
        bound = {-1.0: math.inf, 1.0: math.inf}
        for p in range(1, at.boats.plans[0] + 1):
            row = at.plans[p - 1]
            if not hard_turn(row):
                continue
            rank, _ = rated(at, p, top, done)
            left_out += bound[row[0]] < math.inf
            assert rank <= bound[row[0]] + MANY
            if holds_for_longer(len(at.state), at.work):
                bound[row[0]] = min(bound[row[0]], rank)
    if thrust == 100.0:
        assert left_out > (3 if name == "heron" else 30)  # herons have turned before much comes about


@CASES
@pytest.mark.parametrize("done", [0, 1])
def test_the_best_of_all_is_found(name, thrust, done):
    for at, top in scenes(name, 25, thrust):
        heading = at.work.next_state[0, L.HEADING] if done else at.state[0, L.HEADING]
        first = 0 if remembered(0, done, heading, at.memory) else 1
        best = max(rated(at, p, top, done)[1] for p in range(first, at.boats.plans[0] + 1))
        choose_plan(0, top, done, True, at.scene)
        chosen = rated_as_chosen(at)
        assert chosen == pytest.approx(best, abs=at.tuning.hysteresis_m + 1e-9)
        assert at.work.rank[0] == pytest.approx(chosen, abs=1e-9)


def rated_as_chosen(at):
    return rank_path(0, 0, -1e9, at.scene)
