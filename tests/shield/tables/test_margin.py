"""Figures of a card: model error, duels of the full model, convergence, areas."""

import math

import numpy as np
import pytest
from steerclear.shield.exceptions import TableError
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.registry import get_platform
from steerclear.shield.tables.areas import area_m2, reach_ahead_m
from steerclear.shield.tables.duel import PURE, duel
from steerclear.shield.tables.files import SHIPPED, Card, pack_values, read_table, stack_tables
from steerclear.shield.tables.make import convergence, make_table
from steerclear.shield.tables.margin import full_thrust_state, model_error, value_loss
from steerclear.shield.tables.solve import start
from table_scenes import problem

HERON = read_table(SHIPPED / "heron-heron-worst-case.npz")
TABLES = stack_tables([HERON])
PARAMS = np.stack([get_platform("heron").pack()] * 2)


def test_the_reduced_model_is_close_to_the_boat():
    heron, surveyor = (model_error(name, dt_s, 60) for name, dt_s in (("heron", 0.2), ("surveyor", 1.0)))
    assert heron["place_m_max"] < 0.1
    assert surveyor["place_m_max"] < 0.1
    assert surveyor["speed_mps_p99"] < 0.2
    assert heron == model_error("heron", 0.2, 60)


def untouched(**changes):
    """A table before any play: its sets are discs."""
    one = problem(**changes)
    state = start(one)
    state.residual_m = 0.0
    return pack_values(one, state)


def test_areas_of_discs():
    table = untouched(n_rho=40, cap_m=6.0)
    assert area_m2(table, 2.5, 135.0, 2.0, 1.0) == pytest.approx(math.pi * 2.5**2, rel=0.02)
    assert reach_ahead_m(table, 4.0, 180.0, 2.0, 2.0) == pytest.approx(4.0, abs=0.05)
    assert convergence(table, untouched(n_rho=30), 2.5)["largest"] < 0.02


def meeting(distance_m):
    own, other = (full_thrust_state(get_platform("heron"), 2.0, heading) for heading in (0.0, 180.0))
    other[L.Y] = distance_m
    return own, other


def test_a_head_on_from_outside_the_set_is_survived_and_from_inside_it_is_not():
    ahead = reach_ahead_m(HERON, 2.5, 180.0, 2.0, 2.0)
    near = [duel(TABLES, 0, PARAMS, *meeting(ahead + extra), PURE, False, 2, 100) for extra in (0.1, -0.8)]
    assert near[0] >= 2.5
    assert near[1] < 2.5


def test_runs_from_outside_the_set_keep_the_radius():
    found = value_loss(HERON, 2.5, 30, 10.0)
    assert (found["breaches"], found["margin_m"], found["depth_m"]) == (0, 0.0, 0.0)
    assert value_loss(untouched(), 2.5, 30, 10.0)["breaches"] > 0  # a table that promises too much is found out


def test_tables_without_values_near_the_radius_are_told():
    one = problem()
    state = start(one)
    state.values[:] = 0.0
    with pytest.raises(TableError, match=r"no state of value near 2\.5 m"):
        value_loss(pack_values(one, state), 2.5, 1, 1.0)


def test_a_made_table_has_a_complete_card_and_leaves_no_checkpoint(tmp_path):
    kept, stages = tmp_path / "kept", []
    table = make_table(problem(n_rho=12), (2.5,), threads=2, checkpoint=kept, runs=3, stage=staged(stages))
    assert list(tmp_path.iterdir()) == []
    assert [name for name, _ in stages] == ["solve", "coarser grid", "runs"]
    assert Card.of_json(table.card.to_json()) == table.card
    assert set(table.card.convergence) == set(table.card.margin) == {"2.5"}
    assert set(table.card.model_error) == {"own", "other"}


def staged(stages, interrupt=None):
    def stage(name):
        stages.append((name, 0))
        if name == interrupt:
            raise KeyboardInterrupt
        return lambda done, total, residual_m: None

    return stage


def test_an_interrupted_table_keeps_what_was_solved(tmp_path):
    kept = tmp_path / "kept"
    with pytest.raises(KeyboardInterrupt):
        make_table(problem(), (2.5,), threads=1, checkpoint=kept, runs=3, stage=staged([], "runs"))
    assert {path.name for path in tmp_path.iterdir()} == {"kept", "kept.coarser"}
    make_table(problem(), (2.5,), threads=1, checkpoint=kept, runs=3)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("radius", [0.5, 5.5, math.nan])
def test_radii_outside_the_table_are_refused(radius):
    with pytest.raises(TableError, match=r"outside the table's 1 to 4\.8 m; choose one within"):
        make_table(problem(), (radius,))
