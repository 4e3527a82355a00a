"""The tables of the package: there, whole, for today's boats, small, converged."""

import itertools

import numpy as np
import pytest
from steerclear.shield.platforms.registry import get_platform
from steerclear.shield.tables.areas import area_m2, reach_ahead_m
from steerclear.shield.tables.files import SHIPPED, check_parameters, read_table
from steerclear.shield.tables.lookup import LEVELS_S
from steerclear.shield.tables.settings import OtherMay, problem_of, table_name
from steerclear.shield.tables.solve import CONVERGED_M

BOATS = ("heron", "surveyor")
PLACES = list(itertools.product(BOATS, BOATS, OtherMay))
CONVERGED_SHARE = 0.08
SHORT = {
    ("heron", "surveyor", "2.5"): 0.16,
    ("heron", "surveyor", "4"): 0.37,
    ("surveyor", "heron", "4"): 0.11,
    ("surveyor", "surveyor", "4"): 0.2,
}
"""Worst-case tables that are known to fall short of it, and by how much (docs/tables.md)."""
FILES = {path.name for path in SHIPPED.glob("*.npz")}


def shipped(own, other, mode):
    return read_table(SHIPPED / f"{table_name(own, other, mode)}.npz")


@pytest.mark.parametrize(("own", "other", "mode"), PLACES)
def test_every_pair_has_its_table(own, other, mode):
    card = shipped(own, other, mode).card
    check_parameters(card, get_platform(own), get_platform(other), mode)
    assert card.checked_radii_m == (2.5, 4.0)
    for radius in ("2.5", "4"):
        assert card.margin[radius]["runs"] >= 1000
        known = SHORT.get((own, other, radius)) if mode is OtherMay.WORST_CASE else None
        assert card.convergence[radius]["mean"] <= (known or CONVERGED_SHARE)


@pytest.mark.parametrize(("own", "other"), list(itertools.product(BOATS, BOATS)))
def test_worst_cases_are_kept_for_shorter_times_that_tell_of_no_less(own, other):
    table = shipped(own, other, OtherMay.WORST_CASE)
    assert table.card.levels_s == LEVELS_S
    assert (table.levels[:-1] >= table.levels[1:]).all()
    assert (table.levels[-1] >= table.values).all()


@pytest.mark.parametrize("other", BOATS)
def test_who_is_no_slower_is_followed_until_nothing_changes(other):
    card = shipped("surveyor", other, OtherMay.WORST_CASE).card
    assert card.residual_m <= CONVERGED_M
    assert card.horizon_s == problem_of("surveyor", other).horizon_s == 90.0


def test_nothing_else_is_shipped_and_it_is_small():
    assert {f"{table_name(*place)}.npz" for place in PLACES} == FILES
    assert sum((SHIPPED / name).stat().st_size for name in FILES) < 10e6


@pytest.mark.parametrize(("own", "other"), list(itertools.product(BOATS, BOATS)))
def test_help_makes_sets_smaller(own, other):
    worst, helped = (shipped(own, other, mode) for mode in OtherMay)
    tops = get_platform(own).max_speed_mps, get_platform(other).max_speed_mps
    for heading in (0.0, 90.0, 180.0):
        assert np.pi * 2.5**2 * 0.99 <= area_m2(helped, 2.5, heading, *tops) <= area_m2(worst, 2.5, heading, *tops)
    assert reach_ahead_m(helped, 2.5, 180.0, *tops) < reach_ahead_m(worst, 2.5, 180.0, *tops)
