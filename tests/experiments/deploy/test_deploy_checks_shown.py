"""Lines of checks before the start, as the operator reads them."""

import io

import pytest
from rich.console import Console
from steerclear.experiments.cli_boats import show_check
from steerclear.shield.bridge.preflight_checks import CheckResult


@pytest.mark.parametrize(
    ("passed", "accepted", "mark"),
    [
        (True, (), "ok"),
        (True, ("drill",), "ok"),
        (False, (), "FAIL"),
        (False, ("rates",), "FAIL"),
        (False, ("drill",), "not passed, accepted:"),
        (False, ("drill:blue_1",), "not passed, accepted:"),
    ],
)
def test_what_was_accepted_beforehand_does_not_read_as_a_failure(passed, accepted, mark):
    stream = io.StringIO()
    show_check(Console(file=stream, width=80), CheckResult("drill:blue_1", passed, "42 [s] ago"), accepted)
    line = stream.getvalue()
    assert line.split("drill:blue_1")[0].strip() == mark
    assert "drill:blue_1: 42 [s] ago" in line
