"""The filter-inactive share: which states are sampled, which are safe, who is left alone."""

import numpy as np
import pytest
from steerclear.experiments.baselines.registry import NoGuard
from steerclear.experiments.encounters import Conditions, draw, measure, play
from steerclear.experiments.encounters.figures import summarise
from steerclear.experiments.encounters.outcomes import inactive_columns, safe_boats, tally
from steerclear.shield.platforms import layout as L

USUAL = Conditions()


class Meddler(NoGuard):
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


def test_team_mates_are_safe_together_or_not_at_all():
    scenes = draw("converging_2", "heron", "heron", USUAL, 0, 0, 1)
    state = scenes.state.copy()
    assert safe_boats(scenes, state, USUAL).all()
    state[0, 1, [L.X, L.Y]] = state[0, 0, [L.X, L.Y]] + 1.0
    assert not safe_boats(scenes, state, USUAL).any()


def test_boats_that_no_table_is_about_have_no_share():
    scenes = draw("head_on", "heron", "heron", USUAL, 0, 0, 1)
    wide = Conditions(radius_m=19.0)
    assert not safe_boats(scenes, scenes.state, wide).any()


def test_the_share_is_over_all_samples():
    columns = measure("head_on", "none", n=2, seed=0, judge=False).columns
    assert summarise(columns)["inactive_percent"] == 100.0
    columns |= {"sampled_safe": np.array([10.0, 30.0]), "left_alone": np.array([10.0, 0.0])}
    assert summarise(columns)["inactive_percent"] == pytest.approx(25.0)
    columns["sampled_safe"] = np.zeros(2)
    assert summarise(columns)["inactive_percent"] is None
