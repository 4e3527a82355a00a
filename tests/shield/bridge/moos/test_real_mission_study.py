"""The 3 v 3 mission on the real MOOS-IvP, where it is installed: ``pytest -m study -s``."""

import pytest
from real_mission import APART_M, SEPARATION_M, missing, play

pytestmark = [pytest.mark.study, pytest.mark.skipif(bool(missing()), reason=missing())]


def test_three_against_three_on_the_real_stack():
    found = play()
    assert found["turns under way"] > 0.7 * found["turns"]
    assert found["closest teammate, m"] > SEPARATION_M - APART_M
    assert found["closest opponent, m"] > SEPARATION_M - APART_M
    assert found["commands changed, share"] < 0.3, "they sail their lanes all the same"
    assert found["decided again the same"] == found["decisions"] > 0.9 * found["turns"]
