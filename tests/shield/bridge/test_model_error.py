"""What the model misses becomes margin: measured, within bounds, slowly; a boat far outside its model is found out."""

import math
from dataclasses import replace

import numpy as np
import pytest
from bridge_fakes import fleet_of
from steerclear.shield.bridge.fleet_settings import Limits, ModelLimit
from steerclear.shield.bridge.messages import BoatReading, Sent
from steerclear.shield.bridge.model_error import WIDEN_MPS, ModelErrorMonitor
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L

DT_S, NAME = 0.1, "blue_1"


def drive(turn_share=1.0, seconds=40.0, limits=None, aged=None, speed_share=1.0, left_out=()):
    """A rover weaves; its turning differs from its platform's by a share. Gives the foresight and its margins."""
    fleet = fleet_of(blue=1, red=0, platform="ardurover_boat")
    if limits is not None:
        fleet = fleet.model_copy(update={"limits": Limits(model=ModelLimit(**limits))})
    platform = get_platform("ardurover_boat")
    true = replace(
        platform,
        turn_rate_per_mps=turn_share * platform.turn_rate_per_mps,
        max_turn_rate_dps=turn_share * platform.max_turn_rate_dps,
        max_speed_mps=speed_share * platform.max_speed_mps,
    ).pack()
    foresight, row, margins = ModelErrorMonitor(fleet, (NAME,)), fresh_state(0.0, 0.0, 0.0, 2.0), []
    for k in range(round(seconds / DT_S)):
        if k not in left_out:  # else the autopilot goes on with what it was told last
            told = 2.5, 80.0 * math.sin(0.9 * k * DT_S)
        age = aged(k * DT_S) if aged is not None else 0.0
        reading = BoatReading(NAME, k * DT_S, position_age_s=age, ready=True)
        if k not in left_out:
            foresight.update({NAME: row.copy()}, {NAME: reading})
            foresight.sent({NAME: Sent(NAME, k * DT_S, math.radians(told[1]), told[0], "told", True)})
        step_boat(true, row, told[0], math.remainder(told[1] - row[L.HEADING], 360.0), DT_S)
        margins.append(foresight.margin_m[NAME])
    return foresight, np.array(margins)


def test_a_boat_that_is_its_model_gets_no_margin():
    foresight, margins = drive()
    assert margins.max() == 0.0
    assert foresight.quantile_m(NAME, 2) < 1e-6
    assert foresight.actions() == []


def test_a_loop_that_falls_behind_every_second_still_finds_out_a_wrong_model():
    foresight, margins = drive(turn_share=0.5, left_out=range(5, 400, 10))
    assert margins[-1] == pytest.approx(min(foresight.quantile_m(NAME), 1.0), abs=0.05)
    assert margins[-1] > 0.2


def test_what_the_model_misses_widens_the_margin_slowly_and_is_told():
    foresight, margins = drive(turn_share=0.5)
    assert margins[-1] == pytest.approx(min(foresight.quantile_m(NAME), 1.0), abs=0.05)
    assert margins[-1] > 0.2
    assert np.abs(np.diff(margins)).max() <= WIDEN_MPS * DT_S + 1e-12
    (action,) = foresight.actions()
    assert action.condition == "tracking"
    assert action.response == "none"
    assert "95 of 100" in action.text


def test_the_margin_is_bounded_as_declared():
    _, margins = drive(turn_share=0.3, limits={"widest_m": 0.25})
    assert margins.max() == pytest.approx(0.25)


@pytest.mark.parametrize("seconds", [10.0, 40.0])
def test_a_margin_under_way_to_its_bound_is_not_told_as_the_bound(seconds):
    foresight, margins = drive(turn_share=0.3, limits={"widest_m": 0.5}, seconds=seconds)
    (action,) = foresight.actions()
    bound = "the most that limits.model.widest_m allows"
    assert foresight.quantile_m(NAME) > 0.5
    if seconds < 20.0:
        assert margins[-1] < 0.4
        assert f"margin {margins[-1]:.2f} m, growing to 0.50 m, {bound}" in action.text
    else:
        assert f"margin 0.50 m, {bound}" in action.text


def test_errors_grow_with_the_time_ahead():
    foresight, _ = drive(turn_share=0.6)
    found = [foresight.quantile_m(NAME, ahead) for ahead in range(3)]
    assert found == sorted(found)
    assert found[0] > 0.0


def test_a_boat_far_outside_its_model_is_counted_and_one_inside_is_forgiven():
    foresight, _ = drive(speed_share=0.3, limits={"outside_m": 0.5}, seconds=20.0)
    assert foresight.outside_s(NAME) > 5.0
    assert drive()[0].outside_s(NAME) == 0.0
