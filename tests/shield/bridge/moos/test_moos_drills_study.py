"""The drills, each held against the time that docs/studies/moos.md promises; seconds of the boat's time."""

import pytest
from drills import DRILLS

pytestmark = pytest.mark.study

WITHIN_S = {
    "its PID drops thrust after": 2.5,
    "boat at rest after": 15.0,
    "told after": 2.0,
    "restarted, steered again after": 3.0,
    "stop wanted after": 1.5,
    "told to stop after": 1.5,
    "given up after": 4.5,
    "thawed, steered again after": 3.0,
    "goes on, steered again after": 3.0,
    "response after": 2.5,
    "numbers posted that are none": 0.0,
    "nothing is sent after": 0.5,
    "given back, filtered again after": 0.5,
    "named after": 0.5,
}


@pytest.mark.parametrize("name", DRILLS)
def test_a_drill_is_answered_in_time(name):
    for what, seconds in DRILLS[name]().items():
        assert seconds is not None, what
        assert seconds <= WITHIN_S[what], (what, seconds)


@pytest.mark.parametrize("warp", [4.0, 5.0])
@pytest.mark.parametrize("name", ["kill -9 of the commander", "override while filtering"])
def test_a_drill_is_answered_in_time_at_a_warp(name, warp):
    for what, seconds in DRILLS[name](warp).items():
        assert seconds is not None, what
        assert seconds <= WITHIN_S[what] + 0.5 * warp, (what, seconds)
