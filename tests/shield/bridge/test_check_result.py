"""Checks: none can stop, hide or quietly pass another."""

import numpy as np
import pytest
from steerclear.shield.bridge.preflight_checks import (
    Check,
    CheckResult,
    not_passed,
    run_check,
    run_checks,
    validate_accepted,
)
from steerclear.shield.exceptions import ConfigError


def answer(name, passed=True):
    return Check(name, lambda: CheckResult(name, passed, "text", {"x_m": 1.0}))


def broken(name):
    def run():
        raise ZeroDivisionError("division by zero")

    return Check(name, run)


def test_a_broken_check_is_not_passed_and_the_others_still_run():
    seen = []
    results = run_checks([answer("a"), broken("b:blue_1"), answer("c", False)], seen.append)
    assert [r.name for r in results] == ["a", "b:blue_1", "c"]
    assert [r.passed for r in results] == [True, False, False]
    assert "division by zero" in results[1].text
    assert seen == results


@pytest.mark.parametrize("value", [None, "yes", 1, float("nan"), np.float64(1.0)])
def test_only_a_truth_value_passes(value):
    assert not run_check(answer("a", value)).passed


def test_accepting_a_check_for_one_boat_leaves_the_other():
    results = run_checks([answer("rates:blue_1", False), answer("rates:blue_2", False), answer("disk", True)])
    assert [r.name for r in not_passed(results)] == ["rates:blue_1", "rates:blue_2"]
    assert [r.name for r in not_passed(results, ["rates:blue_1"])] == ["rates:blue_2"]
    assert not_passed(results, ["rates"]) == []
    assert len(not_passed(results, ["rate", "disk"])) == 2


def test_accepting_what_is_not_checked_is_refused():
    checks = [answer("rates:blue_1"), answer("disk")]
    validate_accepted(["rates", "disk", "rates:blue_1"], checks)
    with pytest.raises(ConfigError, match=r"--accept rate: .*the checks are disk, rates, rates:blue_1"):
        validate_accepted(["rate"], checks)
