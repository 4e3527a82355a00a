"""Who is looked at first among pursuing opponents, and how it is followed first, decides nothing."""

import numpy as np
import pytest
from stages import screened, stages_of
from steerclear.shield import ShieldConfig
from steerclear.shield.backup.assign import choose_plan, hold
from steerclear.shield.backup.rank import OBSTACLES, OPPONENTS, WORST, Rank, rank_path
from steerclear.shield.barriers.clearance import MARGIN
from steerclear.shield.barriers.opponents import first_then_rest
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import fresh_state

MANNERS = 6
CREWS = {
    "followed": ("turning_circle", ["heron"] * 5),
    "followed in all manners": ("turning_circle", ["surveyor"] * 5),
    "looked up": ("auto", ["surveyor", "heron", "surveyor", "heron", "surveyor"]),
    "one looked up, the others followed": ("auto", ["surveyor", "large_usv", "surveyor", "large_usv", "large_usv"]),
}
"""Certificate and platforms of a boat of ours and four opponents around it."""


def scenes(certificate, platforms, count):
    """Screened: boat 0 has a plan, and its neighbourhood is known."""
    random = np.random.default_rng(17)
    for _ in range(count):
        rows = []
        for k, name in enumerate(platforms):
            platform, far = get_platform(name), (0.0 if k == 0 else random.uniform(5.0, 18.0))
            angle = random.uniform(-np.pi, np.pi)
            row = fresh_state(
                far * np.sin(angle),
                far * np.cos(angle),
                np.degrees(angle) + 180.0 + random.uniform(-40.0, 40.0),
                random.uniform(0.7, 1.0) * platform.max_speed_mps,
            )
            row[[L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = platform.max_thrust, 0.0, 0.0
            rows.append(row)
        at = stages_of(ShieldConfig(certificate=certificate), np.array(rows), platforms, [0, 1, 1, 1, 1])
        at.memory.backing_up[0] = random.random() < 0.5
        top = get_platform(platforms[0]).max_speed_mps
        screened(at, np.array([[top, random.uniform(-90.0, 90.0)]] + [[top, 0.0]] * 4))
        yield at, top


@pytest.mark.parametrize("first_one", range(5))
def test_each_is_looked_at_once(first_one):
    order = [first_then_rest(first_one, number) for number in range(5)]
    assert order[0] == first_one
    assert order[1:] == [j for j in range(5) if j != first_one]


def orders():
    """Every opponent and every manner in turn."""
    return ((j, manner) for j in range(5) for manner in range(MANNERS))


def first(at, j, manner):
    """Set who is looked at first, and how it is followed first; all have to be asked again."""
    at.work.first_pursuer[:], at.work.first_manner[:] = j, manner
    at.work.pursuers_known[:] = False


@pytest.mark.parametrize("crew", CREWS)
def test_a_manoeuvre_is_worth_the_same_as_far_as_it_counts(crew):
    """Cut short, it is worth no more than the best so far; else the same to the bit, and by the same neighbour."""
    cut = 0
    for at, _ in scenes(*CREWS[crew], count=20):
        for best in (WORST, Rank(OBSTACLES, -200.0), Rank(OBSTACLES, -1.0), Rank(OBSTACLES, 1.0), Rank(OPPONENTS, 0.0)):
            found = set()
            for j, manner in orders():
                first(at, j, manner)
                rank = Rank(*rank_path(0, 0, best, at.scene))
                short = rank <= best
                cut += short
                found.add((*best,) if short else (*rank, at.work.clear[0, MARGIN], at.work.bound[0]))
            assert len(found) == 1
    assert cut > 100


@pytest.mark.parametrize("crew", CREWS)
@pytest.mark.parametrize("done", [0, 1])
def test_the_same_manoeuvre_is_chosen(crew, done):
    changed = 0
    for at, top in scenes(*CREWS[crew], count=20):
        hold(0, at.plan.held, at.work)
        at.plan.cause[0] = 1  # an opponent: tables are compared
        for best_of in (False, True):
            found = set()
            for j, manner in orders():
                first(at, j, manner)
                choose_plan(0, top, done, best_of, at.scene)
                found.add(
                    (*at.work.plan[0], at.work.kept[0], at.work.worth_m[0], at.work.clear[0, MARGIN], at.work.bound[0])
                )
                changed += at.work.first_pursuer[0] != j
            assert len(found) == 1
    if "followed" in crew or done == 0:  # one step on a table says the same of all manoeuvres: none is cut short
        assert changed > 20
