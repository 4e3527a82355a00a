"""gatekeeper and PL-CBF: known answers, closed loops, what their programs leave."""

import numpy as np
import pytest
from filter_scenes import ahead, filter_for, scene
from steerclear.experiments.baselines.plcbf import share_left
from steerclear.shield.platforms import get_platform, step_boat
from steerclear.shield.platforms import layout as L

NAMES = ("gatekeeper", "gatekeeper-worst", "pl-cbf")
FILTERS = pytest.mark.parametrize("name", NAMES)
GATEKEEPERS = pytest.mark.parametrize("name", ["gatekeeper", "gatekeeper-worst"])
HERON = get_platform("heron").pack()


def sail(guard, state, ours, steps=200):
    """Closest distance of the first two boats and reasons of the first, all boats wanting to go straight on."""
    state, closest, reasons = state.copy(), np.inf, []
    for _ in range(steps):
        sent = ahead(state)
        if guard is not None:
            sent = guard.decide(state, ahead(state), ours).copy()
            reasons.append(int(guard.reason[0, 0]))
        for i in range(state.shape[1]):
            step_boat(HERON, state[0, i], sent[0, i, 0], sent[0, i, 1], 0.1)
        closest = min(closest, float(np.hypot(*(state[0, 0, :2] - state[0, 1, :2]))))
    return closest, reasons


@FILTERS
def test_head_on_in_open_water_keeps_the_radius(name):
    state, ours = scene((0, 0, 0), (0.3, 40, 180)), np.array([[True, False]])
    assert sail(None, state, ours)[0] < 1.0
    closest, reasons = sail(filter_for(name, state), state, ours)
    assert closest >= 2.5
    assert reasons[0] == 0
    assert set(reasons) > {0}
    assert reasons[-1] == 0


@GATEKEEPERS
def test_a_boat_already_inside_goes_on_with_what_it_committed_to(name):
    state, ours = scene((0, 0, 0), (0.5, 40, 180)), np.array([[True, False]])
    guard = filter_for(name, state)
    guard.decide(state, ahead(state), ours)
    assert guard.memory[0, 0, 0] >= 1.0
    first, _, _, speed, heading = guard.memory[0, 0]
    state[0, 1, : L.Y + 1] = 0.0, 1.0
    for _ in range(int(first)):
        sent = guard.decide(state, ahead(state, 1.0), ours)
        assert guard.reason[0, 0] == 2
        np.testing.assert_array_equal(sent[0, 0], [2.0, 0.0])  # what was wanted when it was committed to
        assert guard.safety_margin_m[0, 0] < 0.0
    sent = guard.decide(state, ahead(state, 1.0), ours)
    np.testing.assert_allclose(sent[0, 0], [speed, heading])


def test_the_worst_opponent_is_met_earlier_than_one_that_holds_course():
    state, ours = scene((0, 0, 0), (0.3, 40, 180)), np.array([[True, False]])
    first = [sail(filter_for(name, state), state, ours, 100)[1].index(1) for name in ("gatekeeper-worst", "gatekeeper")]
    assert first[0] < first[1]


def test_a_library_keeps_clear_of_a_crossing_boat():
    state, ours = scene((0, 0, 0), (18, 20, -90)), np.array([[True, False]])
    assert sail(None, state, ours, 150)[0] < 1.5
    assert sail(filter_for("pl-cbf", state), state, ours, 150)[0] >= 2.5


@pytest.mark.parametrize(
    ("row", "need", "share"),
    [((1.0, 0.0), -5.0, 1.0), ((1.0, 0.0), 5.0, 0.0), ((1.0, 0.0), 0.0, 0.5), ((0.0, -1.0), 0.5, 0.25),
     ((1.0, 1.0), 0.0, 0.5), ((1.0, 1.0), 1.0, 0.125), ((0.0, 0.0), -1.0, 1.0), ((0.0, 0.0), 1.0, 0.0)],
)  # fmt: skip
def test_share_of_the_inputs_that_a_row_leaves(row, need, share):
    square = np.array([[-1.0, 1.0], [-1.0, 1.0]])
    assert share_left(np.array(row), need, square) == pytest.approx(share)
