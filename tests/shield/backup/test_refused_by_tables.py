"""Manoeuvres that tables refuse are told without all look-ups: the answer is that of all of them."""

import numpy as np
import pytest
from stages import screened, stages_of
from steerclear.shield import ShieldConfig
from steerclear.shield.backup.laying import refused_by_tables, set_out
from steerclear.shield.backup.rank import ALL, BOATS, OBSTACLES, OPPONENTS, SAME_M, WORST, Rank
from steerclear.shield.barriers.clearance import FAR
from steerclear.shield.barriers.value_function import margin_at_once, table_answers
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import fresh_state

TRIAL = 4


def scenes(count):
    """Screened: a surveyor and three opponents near it, margins to be kept against each."""
    random = np.random.default_rng(11)
    for _ in range(count):
        rows = [fresh_state(0.0, 0.0, 0.0, random.uniform(0.5, 3.0))]
        for angle in random.uniform(-np.pi, np.pi, 3):
            far = random.uniform(4.0, 35.0)
            heading = np.degrees(angle) + random.uniform(90.0, 270.0)
            rows.append(fresh_state(far * np.sin(angle), far * np.cos(angle), heading, random.uniform(0.5, 3.0)))
        state = np.array(rows)
        state[:, L.THRUST] = 100.0
        at = stages_of(ShieldConfig(), state, ["surveyor"] * 4, [0, 1, 1, 1])
        at.memory.has_backup[0], at.memory.threat_m[0] = True, random.uniform(-1.0, 2.0, 4)
        screened(at, np.array([[3.0, random.uniform(-60.0, 60.0)]] * 4))
        yield at, random


def most_rank(at):
    """What the rank of the trial cannot exceed, and from how many look-ups that is known."""
    margins, fails = [FAR], False
    for j in range(1, 4):
        if at.work.near[0, j] and table_answers(0, j, TRIAL, at.boats, at.work):
            margin = margin_at_once(0, j, TRIAL, -FAR, at.boats, at.work)
            fails = fails or margin < at.work.threat_target_m[0, j]
            margins.append(margin)
    return Rank(OBSTACLES, min(margins)) if fails else Rank(ALL, FAR)


@pytest.mark.parametrize("done", [0, 1])
def test_the_answer_is_that_of_all_look_ups(done):
    answers = []
    for at, random in scenes(150):
        for side, togo in ((1.0, 0.0), (1.0, 90.0), (-1.0, 45.0), (-0.5, 180.0)):
            set_out(0, TRIAL, side, togo, 3.0, done, at.scene)
            most = most_rank(at)
            at.work.first_refuser[0] = random.integers(0, 4)
            near = [Rank(OBSTACLES, most.worth_m + more) for more in (-1e-4, 0.0, 1e-4)]
            others = WORST, Rank(BOATS, -1.0), Rank(OBSTACLES, -200.0), Rank(OPPONENTS, -1.0), Rank(ALL, 0.0)
            for best in (*near, *others):
                refused = refused_by_tables(0, TRIAL, best, at.scene)
                assert refused == (most.kept == OBSTACLES and most <= Rank(best.kept, best.worth_m + SAME_M))
                answers.append(refused)
    assert 0.1 < np.mean(answers) < 0.9
