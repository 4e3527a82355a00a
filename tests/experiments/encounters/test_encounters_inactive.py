"""The filter-inactive share: which states are sampled, which are safe, who is left alone."""

import numpy as np
import pytest
from steerclear.experiments.baselines.registry import NoFilter
from steerclear.experiments.encounters import Conditions, draw, play
from steerclear.experiments.encounters.outcomes import inactive_columns, safe_boats, tally

USUAL = Conditions()


class Meddler(NoFilter):
    """Changes every command."""

    def decide(self, state, wanted, ours):
        return wanted + 1.0


@pytest.fixture(scope="module")
def bare():
    return play(draw("head_on", "heron", "heron", USUAL, 0, 0, 3), "none", USUAL)


def test_no_guard_leaves_every_state_alone_and_a_meddler_none(bare):
    games = np.array([2, 0])
    found = inactive_columns(bare, "none", USUAL, games)
    assert (found["sampled_safe"] > 0).all()
    np.testing.assert_array_equal(found["left_alone"], found["sampled_safe"])
    meddled = inactive_columns(bare, lambda config, games, kinds, team, around: Meddler(games, 2), USUAL, games)
    np.testing.assert_array_equal(meddled["sampled_safe"], found["sampled_safe"])
    assert not meddled["left_alone"].any()


def test_states_are_sampled_every_two_seconds_and_the_unsafe_are_left_out(bare):
    steps = np.arange(0, bare.scenes.steps, 20)
    game = int(tally(bare)["closest_m"].argmin())
    state = bare.state[steps][:, game]
    safe = safe_boats(bare.scenes, state, USUAL)
    assert not safe[:, 1].any()  # the other boat is nobody's to leave alone
    gap = np.hypot(*(state[:, 0, :2] - state[:, 1, :2]).T)
    assert not safe[gap < 2.5, 0].any()
    assert safe[gap > 40.0, 0].all()
    assert 0 < safe.sum() < len(steps)
    assert inactive_columns(bare, "none", USUAL, np.array([game]))["sampled_safe"].tolist() == [safe.sum()]
