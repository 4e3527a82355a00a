"""The filters as guards: commands that pass, reasons, symmetry, refusals."""

import numpy as np
import pytest
from guard_scenes import ahead, scene
from steerclear.experiments.baselines.textbook import BARRIERS, NAMES, Barrier, TextbookGuard
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError, FleetError
from steerclear.shield.platforms import layout as L
from textbook_drill import openings

CONFIG = ShieldConfig(edge_m=None)
FILTERS = pytest.mark.parametrize("name", NAMES)


def guard_for(name, state, team=None, platform="heron", gains=None):
    n = state.shape[1]
    return TextbookGuard(name, CONFIG, len(state), (platform,) * n, team or tuple(range(n)), gains)


@FILTERS
def test_safe_commands_pass_bit_for_bit(name):
    random = np.random.default_rng(1)
    state = scene((0, 0, 0), (600, 5, 90), (-700, 0, -90))
    guard = guard_for(name, state, gains=BARRIERS[name].tried[0])
    for _ in range(50):
        wanted = np.stack([random.uniform(0, 2, (1, 3)), random.uniform(-40, 40, (1, 3))], axis=2)
        sent = guard.decide(state, wanted, np.array([[True, True, True]]))
        assert sent.tobytes() == wanted.tobytes()
        assert (guard.reason == 0).all()


@FILTERS
def test_boats_of_others_are_left_alone(name):
    state = scene((0, 0, 0), (0.5, 8, 180))
    wanted = ahead(state)
    wanted[0, 1] = np.nan, -0.0
    guard = guard_for(name, state)
    sent = guard.decide(state, wanted, np.array([[True, False]]))
    assert sent[0, 1].tobytes() == wanted[0, 1].tobytes()
    assert (sent[0, 0] != wanted[0, 0]).any()
    assert guard.reason[0, 0] in (1, 2)
    assert guard.reason[0, 1] == 0
    assert guard.certificate_m[0, 0] == pytest.approx(np.hypot(0.5, 8) - guard.radius_m)
    assert np.isinf(guard.certificate_m[0, 1])


@FILTERS
def test_reason_tells_whether_a_command_was_changed(name):
    random = np.random.default_rng(2)
    n, games = 4, 300
    state = np.concatenate(
        [scene(*zip(*random.uniform(-14, 14, (2, n)), random.uniform(-180, 180, n), strict=True)) for _ in range(games)]
    )
    wanted = np.stack([random.uniform(0, 2, (games, n)), random.uniform(-90, 90, (games, n))], axis=2)
    ours = np.tile([True, True, True, False], (games, 1))
    guard = guard_for(name, state, team=(0, 0, 0, 1))
    sent = guard.decide(state, wanted, ours)
    changed = (sent != wanted).any(axis=2)
    assert np.isfinite(sent).all()
    assert not changed[guard.reason == 0].any()
    assert changed[guard.reason == 1].all()
    assert set(np.unique(guard.reason)) >= {0, 1, 2}
    assert (guard.reason <= 2).all()
    assert (np.abs(sent[changed][:, 1]) <= 180.0).all()
    assert (sent[changed][:, 0] >= -1e-9).all()
    assert (sent[changed][:, 0] <= 2.0 + 1e-9).all()


@FILTERS
def test_mirrored_scenes_get_mirrored_commands(name):
    for family in ("head_on", "crossing", "rammer"):
        state, _ = openings(family, "heron", 30, 5)
        state[:, 1, : L.Y + 1] *= 0.4
        mirrored = state.copy()
        mirrored[..., [L.X, L.HEADING, L.RUDDER, L.HEADING_ERROR, L.HEADING_INTEGRAL]] *= -1.0
        ours = np.tile([True, False], (30, 1))
        one, two = guard_for(name, state), guard_for(name, state)
        sent, other = one.decide(state, ahead(state), ours), two.decide(mirrored, ahead(state), ours)
        assert (one.reason == two.reason).all()
        np.testing.assert_allclose(other * [1.0, -1.0], sent, atol=1e-6)


@FILTERS
def test_team_mates_share_the_answer(name):
    """Two boats that meet in a symmetric way both give way, alike; an opponent in that place does nothing for us."""
    state = scene((-3, -0.4, 90), (3, 0.4, -90))
    guard = guard_for(name, state, team=(0, 0))
    sent = guard.decide(state, ahead(state), np.array([[True, True]]))
    np.testing.assert_allclose(sent[0, 0], sent[0, 1], atol=1e-6)
    assert (guard.reason > 0).all()


@FILTERS
def test_batches_are_games_one_by_one(name):
    state, _ = openings("crossing", "heron", 6, 9)
    state[:, 1, : L.Y + 1] *= 0.4
    ours = np.tile([True, False], (6, 1))
    batch = guard_for(name, state).decide(state, ahead(state), ours).copy()
    for b in range(6):
        alone = guard_for(name, state[:1]).decide(state[b : b + 1], ahead(state[:1]), ours[:1])
        assert alone[0].tobytes() == batch[b].tobytes()


@FILTERS
@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e300])
def test_what_is_not_a_number_is_refused(name, bad):
    state = scene((0, 0, 0), (20, 0, 0))
    guard, ours = guard_for(name, state), np.array([[True, False]])
    broken = state.copy()
    broken[0, 1, L.X] = bad
    with pytest.raises(FleetError, match="not finite"):
        guard.decide(broken, ahead(state), ours)
    wanted = ahead(state)
    wanted[0, 0, 1] = bad
    with pytest.raises(FleetError, match="wanted command"):
        guard.decide(state, wanted, ours)


def test_shapes_and_settings_are_checked():
    state = scene((0, 0, 0), (20, 0, 0))
    guard = guard_for("parabolic", state)
    with pytest.raises(FleetError, match="wanted has shape"):
        guard.decide(state, np.zeros((1, 3, 2)), np.ones((1, 2), bool))
    with pytest.raises(FleetError, match="state has shape"):
        guard.decide(state[0], ahead(state), np.ones((1, 2), bool))
    with pytest.raises(ConfigError, match="unknown filter 'parabola'; choose one of velocity_cbf"):
        TextbookGuard("parabola", CONFIG, 1, ("heron",), (0,))
    with pytest.raises(ConfigError, match="no delay"):
        TextbookGuard("parabolic", ShieldConfig(delay_s=0.2), 1, ("heron",), (0,))
    with pytest.raises(ConfigError, match="games is 0"):
        TextbookGuard("parabolic", CONFIG, 0, ("heron",), (0,))
    with pytest.raises(ConfigError, match="one of each per boat"):
        TextbookGuard("parabolic", CONFIG, 1, ("heron",), (0, 1))


def test_gains_of_another_filter_are_refused():
    with pytest.raises(ConfigError, match="3 gains for velocity_cbf; give 1"):
        TextbookGuard("velocity_cbf", CONFIG, 1, ("heron", "heron"), (0, 1), gains=(1.0, 2.0, 3.0))


def test_a_barrier_of_ones_own_is_a_guard(monkeypatch):
    """The same row as the distance's, by another function: h = 3 (|p|^2 - R^2)."""

    def tripled(p, v, radius_m):
        return 3.0 * ((p * p).sum(axis=0) - radius_m**2), 6.0 * p, 6.0 * p

    monkeypatch.setitem(BARRIERS, "tripled", Barrier(tripled, tuned={}, tried=((0.025,),), of_velocity=True))
    state, _ = openings("crossing", "heron", 6, 9)
    state[:, 1, : L.Y + 1] *= 0.4
    ours = np.tile([True, False], (6, 1))
    sent = guard_for("tripled", state).decide(state, ahead(state), ours)
    known = guard_for("velocity_cbf", state, gains=(0.025,)).decide(state, ahead(state), ours)
    assert (sent != ahead(state)).any()
    np.testing.assert_allclose(sent, known, atol=1e-9)


def test_a_barrier_that_gives_no_number_lets_nothing_through(monkeypatch):
    def broken(p, v, radius_m):
        return np.full(p.shape[1:], np.nan), 6.0 * p, 6.0 * p

    monkeypatch.setitem(BARRIERS, "broken", Barrier(broken, tuned={}, tried=((0.025,),), of_velocity=True))
    state = scene((0, 0, 0), (0.5, 3.0, 180))
    guard = guard_for("broken", state)
    sent = guard.decide(state, ahead(state), np.array([[True, False]]))
    assert guard.reason[0, 0] == 3
    assert sent[0, 0, 0] == 0.0


def test_reset_forgets_what_was_reported():
    state = scene((0, 0, 0), (0.5, 6, 180))
    guard = guard_for("collision_cone", state)
    guard.decide(state, ahead(state), np.array([[True, False]]))
    guard.reset(np.array([True]))
    assert (guard.reason == 0).all()
    assert np.isinf(guard.certificate_m).all()
