"""Textbook filters: symmetry, barriers of your own, closed loops in their own model and on boats, the sweep."""

import numpy as np
import pytest
from filter_scenes import CONFIG, ahead, crowd, scene
from steerclear.experiments.baselines.textbook import BARRIERS, NAMES, Barrier, TextbookFilter
from steerclear.experiments.encounters import Conditions, draw, play
from steerclear.experiments.encounters.outcomes import tally
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import Platform

FILTERS = pytest.mark.parametrize("name", NAMES)
UNICYCLE = Platform(
    name="unicycle",
    kind="double_integrator",
    max_speed_mps=2.0,
    max_acc=1.0,
    max_turn_rate_dps=90.0,
    max_angular_acc_dps2=1e5,
)
POINT = Platform(name="point", kind="single_integrator", max_speed_mps=2.0, max_turn_rate_dps=3600.0)
OURS = np.tile([True, False], (30, 1))


def filter_for(name, state, team=None, gains=None):
    n = state.shape[1]
    return TextbookFilter(name, CONFIG, len(state), ("heron",) * n, team or tuple(range(n)), gains)


def closed_loop(name, platform, family, gains=None, games=16):
    """Columns of encounters with a filter, or without one, and the share of steps whose program was relaxed."""

    def make(config, games, platforms, team, _around):
        return TextbookFilter(name, config, games, platforms, team, gains)

    played = play(draw(family, platform, platform, Conditions(), 3, 0, games), make if name else "none", Conditions())
    return tally(played), (played.reason[:, :, 0] > 1).mean(axis=0)


def test_unknown_names_and_gains_of_another_filter_are_refused():
    state = scene((0, 0, 0), (20, 0, 0))
    with pytest.raises(ConfigError, match="unknown filter 'parabola'; choose one of velocity_cbf"):
        filter_for("parabola", state)
    with pytest.raises(ConfigError, match="3 gains for velocity_cbf; give 1"):
        filter_for("velocity_cbf", state, gains=(1.0, 2.0, 3.0))


def test_a_barrier_of_ones_own_is_a_guard(monkeypatch):
    """The same row as the distance's, by another function: h = 3 (|p|^2 - R^2)."""

    def tripled(p, v, radius_m):
        return 3.0 * ((p * p).sum(axis=0) - radius_m**2), 6.0 * p, 6.0 * p

    monkeypatch.setitem(BARRIERS, "tripled", Barrier(tripled, tuned={}, tried=((0.025,),), of_velocity=True))
    state = crowd(30, 5, 8.0, boats=2)
    sent = filter_for("tripled", state).decide(state, ahead(state), OURS)
    known = filter_for("velocity_cbf", state, gains=(0.025,)).decide(state, ahead(state), OURS)
    assert (sent != ahead(state)).any()
    np.testing.assert_allclose(sent, known, atol=1e-9)


def test_a_barrier_that_gives_no_number_lets_nothing_through(monkeypatch):
    def broken(p, v, radius_m):
        return np.full(p.shape[1:], np.nan), 6.0 * p, 6.0 * p

    monkeypatch.setitem(BARRIERS, "broken", Barrier(broken, tuned={}, tried=((0.025,),), of_velocity=True))
    state = scene((0, 0, 0), (0.5, 3.0, 180))
    guard = filter_for("broken", state)
    sent = guard.decide(state, ahead(state), OURS[:1])
    assert guard.reason[0, 0] == 3
    assert sent[0, 0, 0] == 0.0


@pytest.mark.parametrize("family", ["head_on", "crossing_left"])
@pytest.mark.parametrize(
    ("name", "gains"), [("exponential_cbf", (0.5, 0.5)), ("collision_cone", (1.0,)), ("parabolic", (1.0, 2.0, 2.0))]
)
def test_a_unicycle_keeps_the_radius_while_its_program_has_an_answer(name, gains, family):
    """In its own model a filter fails only where it says so: reason 2, no answer within the limits of the inputs."""
    found, relaxed = closed_loop(name, UNICYCLE, family, gains)
    breached = found["closest_m"] < 2.5
    assert (relaxed[breached] > 0.0).all()
    assert not breached.all()


@FILTERS
def test_heron_head_on_is_avoided_and_commands_pass_again(name):
    found, _ = closed_loop(name, "heron", "head_on")
    assert found["closest_m"].min() >= 2.5
    assert (found["changed_share"] > 0.0).mean() > 0.5
    assert (found["changed_share"] < 1.0).all()
