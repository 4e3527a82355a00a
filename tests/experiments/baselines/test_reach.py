"""The filter of the value tables: its margins, closed loops, refusals."""

import numpy as np
import pytest
from filter_scenes import CONFIG, ahead, filter_for, scene
from steerclear.experiments.baselines.reach import ReachFilter
from steerclear.experiments.encounters import measure
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import Platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.tables.files import load_table, stack_tables
from steerclear.shield.tables.lookup import WHOLE_S, table_value
from steerclear.shield.workspace import NOT_COVERED, PASSED


def run(guard, state, ours, steps, wanted=None):
    """Closest distance of the first two boats, all boats making straight on, or as wanted."""
    state, closest = state.copy(), np.inf
    for _ in range(steps):
        sent = (ahead(state) if wanted is None else wanted).copy()
        if guard is not None:
            sent[ours] = guard.decide(state, sent, ours)[ours]
        for i in range(state.shape[1]):
            step_boat(guard_params[i], state[0, i], sent[0, i, 0], sent[0, i, 1], 0.1)
        closest = min(closest, float(np.hypot(*(state[0, 0, :2] - state[0, 1, :2]))))
    return closest


guard_params = filter_for("reach", scene((0, 0, 0), (0, 50, 180), (50, 0, 0))).params


def test_certificate_is_the_value_after_the_step():
    """A teammate not decided for keeps its course for the step; the rest is the table's."""
    state, ours = scene((0, 0, 0), (4, 9, -120)), np.array([[True, False]])
    guard = filter_for("reach", state, team=(0, 0))
    wanted = ahead(state)
    guard.decide(state, wanted, ours)
    own, other = state[0].copy()
    for params, row in zip(guard_params, (own, other), strict=False):
        step_boat(params, row, 2.0, 0.0, 0.1)
    tables = stack_tables([load_table("heron", "heron", "cooperative")])
    place, angles = other[:2] - own[:2], np.radians([own[L.HEADING], other[L.HEADING]])
    value = table_value(tables, 0, WHOLE_S, *place, *angles, own[L.SPEED], other[L.SPEED])
    assert guard.reason.tolist() == [[PASSED, NOT_COVERED]]
    assert guard.safety_margin_m[0, 0] == pytest.approx(value - 2.55, abs=1e-3)
    assert np.isinf(guard.safety_margin_m[0, 1])


@pytest.mark.parametrize("team", [(0, 1), (0, 0)])
def test_head_on_herons_keep_the_radius(team):
    state = scene((0.3, 0, 0), (0, 28, 180))
    ours = np.array([[True, team == (0, 0)]])
    guard = filter_for("reach", state, team=team)
    assert run(None, state, ours, 100) < 1.0
    assert 2.5 <= run(guard, state, ours, 100) < 6.0


def test_a_heron_keeps_off_a_rammer():
    summary = measure("rammer_1", "reach", n=6, seed=4, judge=False).summary
    assert summary["unshielded_breached"] == 6
    assert summary["breached"] == 0
    assert summary["changed_percent"] < 95.0


def test_a_radius_that_the_tables_cannot_tell_is_refused():
    with pytest.raises(ConfigError, match="choose a smaller separation_m"):
        ReachFilter(ShieldConfig(separation_m=7.0), 1, ("heron",) * 2, (0, 1))


def test_boats_without_a_table_are_told_how_to_make_one(monkeypatch, tmp_path):
    monkeypatch.setenv("STEERCLEAR_TABLES", str(tmp_path))
    point = Platform(name="point", kind="single_integrator", max_speed_mps=2.0, max_turn_rate_dps=90.0)
    with pytest.raises(
        ConfigError, match=r"steerclear reach solve --own heron --other point\.yaml --other-may worst-case"
    ):
        ReachFilter(CONFIG, 1, ("heron", point), (0, 1))
    ReachFilter(CONFIG, 1, (point,), (0,))
