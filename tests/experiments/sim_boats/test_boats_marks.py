"""What held simulated boats when they came too near: who steered, which faults acted, whether the run was over."""

import contextlib

import pytest
from boat_links import READY
from steerclear.experiments.sim_boats import SimBoat, SimFleet
from steerclear.experiments.sim_boats.hull import STEP_S
from steerclear.experiments.sim_boats.report import _counts
from steerclear.experiments.sim_boats.truth import Mark, circumstances, last_commanded
from steerclear.experiments.sim_boats.vehicle import Mode

STEERED = Mark(True, (), True)
ALONE = Mark(False, ("link_loss",))
PLAYED = Mark(True)
LEFT = Mark(False, held=True)


def held_by(rows, step, boats):
    return circumstances(rows, last_commanded(rows), step, boats)


def test_how_long_a_boat_was_steered_by_nobody_is_told():
    rows = [*[(STEERED, PLAYED)] * 3, *[(ALONE, PLAYED)] * 4, (STEERED, PLAYED)]
    assert held_by(rows, 7, (0, 1)) == {"unsteered_s": [0.4, 0.0], "faults": ["link_loss"], "after_run": False}
    assert held_by(rows, 3, (0, 1)) == {"unsteered_s": [0.0, 0.0], "faults": [], "after_run": False}


def test_a_fault_counts_for_five_seconds():
    rows = [(ALONE,), *[(STEERED,)] * 60]
    assert held_by(rows, 50, (0,))["faults"] == ["link_loss"]
    assert held_by(rows, 52, (0,))["faults"] == []


def test_the_run_is_over_when_nobody_commands_any_more():
    rows = [*[(STEERED, PLAYED)] * 5, *[(LEFT, PLAYED)] * 5]
    assert not held_by(rows, 5, (0, 1))["after_run"]
    assert held_by(rows, 6, (0, 1))["after_run"]
    assert not held_by([(PLAYED,)] * 5, 5, (0,))["after_run"], "nobody ever commanded: no run"


@pytest.mark.parametrize(
    ("gap_s", "then", "in_order"),
    [
        (0.0, LEFT, True),
        (1.5, LEFT, True),  # its commands timed out while HOLD was asked for
        (3.5, LEFT, False),  # its own failsafe
        (0.0, Mark(False), False),  # GUIDED, and nobody there
    ],
)
def test_a_runner_that_dies_does_not_end_the_run(gap_s, then, in_order):
    gap = round(gap_s / STEP_S)
    rows = [*[(STEERED, PLAYED, STEERED)] * 5, *[(Mark(False), PLAYED, LEFT)] * gap, *[(then, PLAYED, LEFT)] * 5]
    assert held_by(rows, len(rows), (0, 1))["after_run"] == in_order
    assert held_by(rows, len(rows), (2, 1))["after_run"], "the other was left in order"
    assert held_by(rows, len(rows), (2, 0))["after_run"] == in_order


def test_a_boat_in_hold_says_so():
    boats = [SimBoat("b0", address="udpin:127.0.0.1:0"), SimBoat("b1", start=(30.0, 10.0, 0.0))]
    with contextlib.closing(SimFleet(boats, autopilot=READY)) as fleet:
        boat = fleet.boats["b0"]
        assert not boat.is_held
        boat.autopilot.vehicle.set_mode(Mode.HOLD, fleet.time_s)
        assert boat.is_held


@pytest.mark.parametrize(("after", "counts"), [(False, True), (True, False)])
def test_what_comes_after_the_run_is_not_held_against_the_shield(after, counts):
    assert _counts({"kind": "teammate", "verdict": "unavoidable", "after_run": after}) == counts


def test_breaches_of_a_simulated_game_carry_them():
    boats = [SimBoat(f"b{i}", team=i // 2, start=(10.0 + i, 10.0, 0.0), policy="hold") for i in range(4)]
    fleet = SimFleet(boats, autopilot=READY, record=True, waits=False)
    fleet.fault("b0", "freeze", duration_s=1.0)
    fleet.advance(1.0)
    breaches, commanded = fleet.judge(0), fleet.truth_record()["commanded"]
    fleet.close()
    assert breaches
    assert commanded.shape[1] == 4
    assert not commanded.any()
    assert all(breach["unsteered_s"] == [0.0, 0.0] and not breach["after_run"] for breach in breaches)
    assert any(breach["faults"] == ["freeze"] for breach in breaches)
