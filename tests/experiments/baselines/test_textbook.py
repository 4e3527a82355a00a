"""Textbook filters: symmetry, barriers of your own, closed loops in their own model and on boats, the sweep."""

import numpy as np
import pytest
from guard_scenes import CONFIG, ahead, crowd, scene
from steerclear.experiments.baselines import sweep
from steerclear.experiments.baselines.textbook import BARRIERS, NAMES, Barrier, TextbookGuard
from steerclear.experiments.encounters import Conditions, draw, play
from steerclear.experiments.encounters.outcomes import tally
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import Platform
from steerclear.shield.platforms import layout as L

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


def guard_for(name, state, team=None, gains=None):
    n = state.shape[1]
    return TextbookGuard(name, CONFIG, len(state), ("heron",) * n, team or tuple(range(n)), gains)


def closed_loop(name, platform, family, gains=None, games=16):
    """Columns of encounters with a filter, or without one, and the share of steps whose program was relaxed."""

    def make(config, games, platforms, team, _around):
        return TextbookGuard(name, config, games, platforms, team, gains)

    played = play(draw(family, platform, platform, Conditions(), 3, 0, games), make if name else "none", Conditions())
    return tally(played), (played.reason[:, :, 0] > 1).mean(axis=0)


@FILTERS
def test_with_their_authors_gains_safe_commands_pass_bit_for_bit(name):
    state, wanted = scene((0, 0, 0), (600, 5, 90)), np.array([[[1.3, -20.0], [2.0, 40.0]]])
    guard = guard_for(name, state, gains=BARRIERS[name].tried[0])
    assert guard.decide(state, wanted, np.ones((1, 2), bool)).tobytes() == wanted.tobytes()
    assert (guard.reason == 0).all()


@FILTERS
def test_mirrored_scenes_get_mirrored_commands(name):
    state = crowd(30, 5, 8.0, boats=2)
    mirrored = state.copy()
    mirrored[..., [L.X, L.HEADING, L.RUDDER, L.HEADING_ERROR, L.HEADING_INTEGRAL]] *= -1.0
    one, two = guard_for(name, state), guard_for(name, state)
    sent, other = one.decide(state, ahead(state), OURS), two.decide(mirrored, ahead(state), OURS)
    assert (one.reason == two.reason).all()
    assert (one.reason > 0).any()
    np.testing.assert_allclose(other * [1.0, -1.0], sent, atol=1e-6)


@FILTERS
def test_team_mates_share_the_answer(name):
    """Two boats that meet in a symmetric way both give way, alike; an opponent in that place does nothing for us."""
    state = scene((-3, -0.4, 90), (3, 0.4, -90))
    guard = guard_for(name, state, team=(0, 0))
    sent = guard.decide(state, ahead(state), np.array([[True, True]]))
    np.testing.assert_allclose(sent[0, 0], sent[0, 1], atol=1e-6)
    assert (guard.reason > 0).all()


def test_the_certificate_is_the_distance_less_the_radius():
    state = scene((0, 0, 0), (0.5, 8, 180))
    guard = guard_for("parabolic", state)
    guard.decide(state, ahead(state), OURS[:1])
    assert guard.safety_margin_m[0, 0] == pytest.approx(np.hypot(0.5, 8) - guard.radius_m)


def test_unknown_names_and_gains_of_another_filter_are_refused():
    state = scene((0, 0, 0), (20, 0, 0))
    with pytest.raises(ConfigError, match="unknown filter 'parabola'; choose one of velocity_cbf"):
        guard_for("parabola", state)
    with pytest.raises(ConfigError, match="3 gains for velocity_cbf; give 1"):
        guard_for("velocity_cbf", state, gains=(1.0, 2.0, 3.0))


def test_a_barrier_of_ones_own_is_a_guard(monkeypatch):
    """The same row as the distance's, by another function: h = 3 (|p|^2 - R^2)."""

    def tripled(p, v, radius_m):
        return 3.0 * ((p * p).sum(axis=0) - radius_m**2), 6.0 * p, 6.0 * p

    monkeypatch.setitem(BARRIERS, "tripled", Barrier(tripled, tuned={}, tried=((0.025,),), of_velocity=True))
    state = crowd(30, 5, 8.0, boats=2)
    sent = guard_for("tripled", state).decide(state, ahead(state), OURS)
    known = guard_for("velocity_cbf", state, gains=(0.025,)).decide(state, ahead(state), OURS)
    assert (sent != ahead(state)).any()
    np.testing.assert_allclose(sent, known, atol=1e-9)


def test_a_barrier_that_gives_no_number_lets_nothing_through(monkeypatch):
    def broken(p, v, radius_m):
        return np.full(p.shape[1:], np.nan), 6.0 * p, 6.0 * p

    monkeypatch.setitem(BARRIERS, "broken", Barrier(broken, tuned={}, tried=((0.025,),), of_velocity=True))
    state = scene((0, 0, 0), (0.5, 3.0, 180))
    guard = guard_for("broken", state)
    sent = guard.decide(state, ahead(state), OURS[:1])
    assert guard.reason[0, 0] == 3
    assert sent[0, 0, 0] == 0.0


@pytest.mark.parametrize("family", ["head_on", "crossing_left"])
def test_a_single_integrator_keeps_the_radius_from_straight_movers(family):
    assert (closed_loop(None, POINT, family)[0]["closest_m"] < 2.5).mean() > 0.5
    found, _ = closed_loop("velocity_cbf", POINT, family)
    assert found["closest_m"].min() >= 2.5
    assert (found["changed_share"] > 0.0).mean() > 0.5
    assert (found["changed_share"] < 1.0).all()


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


@FILTERS
def test_the_sweep_takes_the_safest_then_the_gentlest(name, monkeypatch):
    tried = list(BARRIERS[name].tried)
    assert len(set(tried)) > 5
    assert BARRIERS[name].tuned["heron"] in tried
    assert BARRIERS[name].tuned["surveyor"] in tried
    figures = {gains: {"head_on": {"breached": 1, "changed_percent": 0.0}} for gains in tried}
    figures[tried[3]] = {"head_on": {"breached": 0, "changed_percent": 40.0}}
    figures[tried[5]] = {"head_on": {"breached": 0, "changed_percent": 30.0}}
    monkeypatch.setattr(sweep, "try_out", lambda name, platform, gains: figures[gains])
    assert sweep.best(name, "heron") == tried[5]


def test_the_sweep_plays_encounters():
    figures = sweep.try_out("collision_cone", "heron", (3.0,), n=3, seed=1)
    assert list(figures) == list(sweep.FAMILIES)
    assert figures["head_on"]["encounters"] == 3
    assert figures["crossing_left"]["unshielded_breached"] > 0
