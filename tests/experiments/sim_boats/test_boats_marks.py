"""What held simulated boats when they came too near: who steered, which faults acted, whether the run was over."""

import pytest
from boat_links import READY
from steerclear.experiments.sim_boats import SimBoat, SimFleet
from steerclear.experiments.sim_boats.hull import STEP_S
from steerclear.experiments.sim_boats.world import Mark, circumstances, last_commanded

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
