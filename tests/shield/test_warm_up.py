"""Everything is compiled before the first decision, and nothing is remembered of it."""

import numpy as np
import pytest
from shield_scenes import head_on
from steerclear.shield import Commands, Shield, decide, shield

AHEAD = Commands.relative_deg(np.array([[2.0, 0.0]] * 2))
STAGES = "begin", "begin_group", "linearise", "accept", "end_group", "end"


@pytest.fixture
def stages_run(monkeypatch):
    """Names of the stages that are run where a backend of qpsolvers stands between them."""
    seen = set()
    for name in STAGES:
        stage = getattr(decide, name)
        monkeypatch.setattr(decide, name, lambda *values, name=name, stage=stage: (seen.add(name), stage(*values))[1])
    return seen


def test_what_is_run_needs_every_stage(stages_run):
    fleet, wanted, around = shield._tight_spot()
    decisions = Shield(solver="daqp").decide(fleet, wanted, around)
    assert stages_run == set(STAGES)
    np.testing.assert_array_equal(Shield().decide(fleet, wanted, around).reason, decisions.reason)


@pytest.mark.parametrize("coordination", ["team", "per_boat"])
def test_decisions_are_the_same_with_and_without(coordination):
    told = []
    for warm in (False, True):
        guard = Shield(coordination=coordination, delay_s=0.2)
        fleet = head_on(5.5)
        before = [guard.decide(fleet, AHEAD).filtered.values]
        if warm:
            guard.warm_up(fleet)
        before += [guard.decide(fleet, AHEAD).filtered.values for _ in range(3)]
        told.append(np.array(before))
    np.testing.assert_array_equal(*told)


@pytest.mark.parametrize("settings", [{}, {"position_error_m": 0.3, "delay_s": 0.2}, {"separation_m": 4.0}])
def test_every_stage_is_compiled_whatever_the_settings(stages_run, settings):
    """Wide margins leave no room for the program where the boats are; its check would be compiled under way."""
    Shield(solver="daqp", **settings).warm_up()
    assert stages_run == set(STAGES)
