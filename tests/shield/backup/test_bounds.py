"""What is cut short of a manoeuvre's rank, or never rolled out, could not have been better than the best."""

import numpy as np
import pytest
from shield_loops import scattered
from stages import screened, stages_of
from steerclear.shield import ShieldConfig, Surroundings
from steerclear.shield.backup.family import FAMILY, candidate
from steerclear.shield.backup.paths import READY_SAMPLE
from steerclear.shield.backup.rollout import lay_placed, place_manoeuvre, roll_out
from steerclear.shield.backup.score import ALL, OPPONENTS, WORST, Score, better, is_no_better, score_path
from steerclear.shield.barriers import pursuit
from steerclear.shield.barriers.clearance import FAR
from steerclear.shield.barriers.neighbours import find_neighbours
from steerclear.shield.barriers.value_function import run_opponents
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import fresh_state

FIELD = Surroundings(field=(-40.0, -40.0, 40.0, 40.0), circles=((5.0, 5.0, 2.0),))


def scenes(platform, count, side_m):
    """Three boats of ours and three opponents, screened, at the moment that backups are looked for."""
    random = np.random.default_rng(4)
    for _ in range(count):
        state = scattered(random, 1, [platform] * 6, side_m, gap_m=5.0, speed=(0.3, 1.0))[0]
        state[:, : L.Y + 1] -= 0.5 * side_m
        at = stages_of(ShieldConfig(separation_m=3.0), state, [platform] * 6, [0, 0, 0, 1, 1, 1], FIELD)
        screened(at, np.column_stack([state[:, L.SPEED], random.uniform(-60.0, 60.0, 6)]))
        run_opponents(max(1, int(at.boats.table_steps[0])), at.scene)
        yield at


def ranked(at, number, best):
    """Score of manoeuvre ``number`` of boat 0 from its present state; None where it is not rolled out."""
    trial = len(at.state)
    place_manoeuvre(0, trial, candidate(0, number, 1.0, at.state[0, L.HEADING], at.scene), 0, at.scene)
    if is_no_better(0, trial, best, at.scene):
        return None
    lay_placed(0, trial, 0, at.scene)
    return Score(*score_path(0, trial, best, at.scene))


@pytest.mark.parametrize(("platform", "side_m"), [("heron", 40.0), ("surveyor", 70.0)])
def test_only_what_is_no_better_is_cut_short(platform, side_m):
    spared, taken = 0, 0
    for at in scenes(platform, 25, side_m):
        numbers = range(FAMILY, FAMILY + int(at.boats.n_manoeuvres[0]))
        full = [ranked(at, number, WORST) for number in numbers]
        for best in {*full[::4], Score(ALL, 0.5), Score(OPPONENTS, -1.0)}:
            for number, whole in zip(numbers, full, strict=True):
                rank = ranked(at, number, best)
                if better(whole, best):
                    assert rank == whole
                    taken += 1
                else:
                    assert rank is None or not better(rank, best)
                    spared += rank is None
    assert taken > 100
    assert spared > 100


@pytest.mark.parametrize(("own", "other"), [("heron", "heron"), ("heron", "surveyor"), ("surveyor", "heron")])
def test_the_clearance_from_a_pursuer_is_the_least_of_all_runs_to_their_end(own, other):
    """Also where none is made, since the opponent can never come near, or one is left, since it can do no worse."""
    random, spared, short = np.random.default_rng(9), 0, 0
    for _ in range(150):
        far, angle = random.uniform(4.0, 90.0), random.uniform(-np.pi, np.pi)
        rows = [fresh_state(0.0, 0.0, random.uniform(-180.0, 180.0), random.uniform(0.0, 2.0))]
        rows += [fresh_state(far * np.sin(angle), far * np.cos(angle), random.uniform(-180.0, 180.0), 2.0)]
        config = ShieldConfig(profile="ramming", opponent_model="turning_circle")
        at = stages_of(config, np.array(rows), (own, other), (0, 1))
        find_neighbours(at.scene)
        if not at.near[0, 1]:
            continue
        roll_out(0, 0, random.choice([-1.0, 1.0]), random.choice([0.0, 45.0, 180.0]), 2.0, 0, at.scene)
        boats, ready = at.boats, int(at.ready[0, READY_SAMPLE])
        closely = int(boats.pursuit_samples[0] + (boats.thrust_samples[0] if ready < 0 else 0))
        closely = min(closely + max(0, ready), int(boats.pursuit_samples[0] + boats.thrust_samples[0]))
        lasts = closely + int(boats.chase_samples[0, 1])
        run = pursuit.Pursuit(*pursuit._pursuit_of(0, 1, 0, lasts, closely, False, at.scene))._replace(most_m=1e6)
        rudders = len(pursuit.RUDDERS) - 1 if boats.granted_loss[1] > pursuit.FORGOTTEN_LOSS else 1
        least_m = min(pursuit._run_pursuers(0, 1, 0, rudder, run, -FAR, at.scene) for rudder in range(rudders))
        assert pursuit.clear_of_pursuer(0, 1, 0, -FAR, at.scene) == least_m
        spared += pursuit._never_near(0, 1, 0, lasts, at.scene)
        short += least_m < at.tuning.margin_cap_m
    assert min(spared, short) > 20
