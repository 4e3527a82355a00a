"""Scenes that are drawn, and how they are played: who obeys when, the water, errors of positions."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.experiments import encounters
from steerclear.experiments.baselines.registry import NoFilter, build_filter, split_name
from steerclear.experiments.encounters import FAMILIES, Conditions, draw, play
from steerclear.shield.batch import BatchedShield
from steerclear.shield.exceptions import ConfigError, FleetError
from steerclear.shield.platforms import layout as L

USUAL = Conditions()
ARRAYS = ("state", "script", "goals", "current", "noise_seed", "number")


def closest_start_m(scenes):
    places = scenes.state[:, :, :2]
    gaps = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1)
    return gaps[:, ~np.eye(places.shape[1], dtype=bool)].min()


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(("own", "other"), [("heron", "heron"), ("surveyor", "surveyor"), ("heron", "surveyor")])
def test_every_family_starts_apart_and_fits(family, own, other):
    conditions = Conditions(radius_m=4.0)
    scenes = draw(family, own, other, conditions, seed=3, first=0, count=3)
    assert closest_start_m(scenes) > 4.0
    assert (np.diff(scenes.team) >= 0).all()
    assert scenes.own.any()
    assert np.isfinite(scenes.state).all()
    assert (np.unique(scenes.number) == [0, 1, 2]).all()
    usual_s = 45.0 if (own, other) == ("heron", "heron") else 60.0
    assert scenes.length_s == usual_s * FAMILIES[family].lasts
    assert FAMILIES[family].words.endswith(".")
    np.testing.assert_allclose(np.hypot(*scenes.current.T), 1.0)
    if scenes.field is not None:
        assert (scenes.state[:, :, :2] >= scenes.field[:2]).all()
        assert (scenes.state[:, :, :2] <= scenes.field[2:]).all()


@settings(max_examples=20, deadline=None)
@given(st.sampled_from(sorted(set(FAMILIES) - {"crowd_40", "crowd_40_own"})), st.integers(0, 99), st.integers(1, 6))
def test_a_seed_and_a_number_give_the_same_encounter_in_any_batch(family, seed, number):
    alone = draw(family, "heron", "heron", USUAL, seed, number, 1)
    among = draw(family, "heron", "heron", USUAL, seed, number - 1, 3)
    among = among.take(np.flatnonzero(among.number == number))
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(alone, name), getattr(among, name))


def short(scenes, seconds=6.0):
    return dataclasses.replace(scenes, length_s=seconds)


class Recording:
    """Turns every own boat by a set angle, and keeps what it was shown."""

    def __init__(self, games, boats, turn_deg=0.0, speed=None):
        self.reason, self.safety_margin_m = np.zeros((games, boats), np.int64), np.zeros((games, boats))
        self.turn_deg, self.speed, self.seen = turn_deg, speed, []

    def decide(self, state, wanted, ours):
        self.seen.append(state.copy())
        sent = wanted.copy()
        sent[..., 1] = self.turn_deg
        if self.speed is not None:
            sent[..., 0] = self.speed
        return sent


def test_the_same_film_whatever_else_is_in_the_batch():
    conditions = Conditions(noise_m=0.5, current_mps=0.3)
    scenes = short(draw("rammer_2", "heron", "heron", conditions, 5, 0, 6))
    whole, alone = play(scenes, "none", conditions), play(scenes.take([4]), "none", conditions)
    np.testing.assert_array_equal(whole.state[:, 4], alone.state[:, 0])
    np.testing.assert_array_equal(whole.nominal[:, 4], alone.nominal[:, 0])


def test_a_delayed_command_takes_effect_so_much_later():
    scenes = short(draw("head_on", "heron", "heron", USUAL, 1, 0, 1), 3.0)
    paths = []
    for delay_s in (0.0, 0.5):
        safety_filter = Recording(1, 2, turn_deg=60.0)
        paths.append(play(scenes, safety_filter, Conditions(delay_s=delay_s)).state[:, 0, :, L.HEADING])
    turned = [np.flatnonzero(path[:, 0] != path[0, 0])[0] for path in paths]
    assert turned == [1, 6]
    np.testing.assert_array_equal(paths[0][:, 1], paths[1][:, 1])  # others obey at once


def test_a_filter_without_a_reason_is_refused():
    bare = SimpleNamespace(decide=lambda state, nominal, ours: nominal)
    with pytest.raises(ConfigError, match="SimpleNamespace has no reason and no safety_margin_m after decide"):
        play(short(draw("head_on", "heron", "heron", USUAL, 1, 0, 2)), bare, USUAL)


def test_a_filter_that_sends_no_number_is_refused():
    scenes = short(draw("head_on", "heron", "heron", USUAL, 1, 0, 2))
    with pytest.raises(
        FleetError, match=r"boat 0 of game 0 is not finite: .*; let decide return a speed, m/s, and a turn"
    ):
        play(scenes, Recording(2, 2, turn_deg=math.nan), USUAL)


def test_filters_by_name_are_told_of_the_conditions():
    assert split_name("shield:cbf_rate_per_s=inf,opponent_model=distance") == (
        "shield",
        {"cbf_rate_per_s": math.inf, "opponent_model": "distance"},
    )
    scenes = draw("head_on", "heron", "heron", USUAL, 0, 0, 2)
    assert isinstance(build_filter("none", scenes, USUAL), NoFilter)
    shield = build_filter("shield:buffer_m=0.2", scenes, Conditions(radius_m=4.0, noise_m=0.3))
    assert isinstance(shield, BatchedShield)
    kept = shield.config
    assert (kept.separation_m, kept.position_error_m, kept.buffer_m) == (4.0, 0.3, 0.2)


def test_names_until_0_8_0_warn_and_give_the_same():
    played = play(short(draw("head_on", "heron", "heron", USUAL, 0, 0, 1), 0.1), "none", USUAL)
    with pytest.warns(DeprecationWarning, match="'Film' is now 'Trajectory'"):
        assert encounters.Film is encounters.Trajectory
    for old, new in (("wanted", "nominal"), ("sent", "filtered"), ("certificate_m", "safety_margin_m")):
        with pytest.warns(DeprecationWarning, match=f"{old} of a trajectory is called {new}"):
            assert getattr(played, old) is getattr(played, new)
    with pytest.raises(AttributeError, match="no 'told'"):
        _ = played.told


def test_a_shielded_film_repeats_bit_for_bit():
    scenes = short(draw("rammer_1", "heron", "heron", USUAL, 5, 0, 3), 8.0)
    films = [play(scenes, "shield", USUAL) for _ in range(2)]
    np.testing.assert_array_equal(films[0].state, films[1].state)
    assert (films[0].filtered != films[0].nominal).any()
    np.testing.assert_array_equal(films[0].filtered[:, :, 1], films[0].nominal[:, :, 1])


def test_a_delayed_command_is_relative_to_the_heading_it_was_given_at():
    scenes = short(draw("head_on", "heron", "heron", USUAL, 1, 0, 1), 12.0)
    film = play(scenes, _Turner(), Conditions(delay_s=0.4))
    assert film.state[-1, 0, 0, L.HEADING] == pytest.approx(_Turner.heading, abs=1.0)


class _Turner:
    """Commands one absolute heading, as a relative one."""

    heading = 50.0
    reason, safety_margin_m = np.zeros((1, 2), np.int64), np.zeros((1, 2))

    def decide(self, state, wanted, ours):
        sent = wanted.copy()
        sent[0, 0, 1] = (self.heading - state[0, 0, L.HEADING] + 180.0) % 360.0 - 180.0
        return sent


def test_the_current_carries_every_boat_alike():
    still = short(draw("cluster", "heron", "heron", USUAL, 1, 0, 2))
    conditions = Conditions(current_mps=0.4)
    film = play(still, lambda *made: Recording(2, 6, 0.0, 0.0), conditions)
    bare = play(still, lambda *made: Recording(2, 6, 0.0, 0.0), USUAL)
    drift = film.state[-1, :, :, :2] - bare.state[-1, :, :, :2]
    np.testing.assert_allclose(drift, np.broadcast_to(0.4 * 6.0 * still.current[:, None], drift.shape), atol=1e-9)


def test_position_errors_stay_within_the_bound_and_truth_is_untouched():
    conditions = Conditions(noise_m=0.8)
    scenes = short(draw("crowd_6", "heron", "heron", conditions, 1, 0, 4), 20.0)
    safety_filter = Recording(4, 6)
    film = play(scenes, safety_filter, conditions)
    seen = np.array(safety_filter.seen)
    error = np.linalg.norm(seen[..., :2] - film.state[:-1, ..., :2], axis=-1)
    assert error.max() <= 0.8 + 1e-9
    assert error.max() > 0.7
    assert 0.2 < error.mean() < 0.6
    np.testing.assert_array_equal(seen[..., 2:], film.state[:-1, ..., 2:])
