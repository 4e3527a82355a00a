import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.experiments.encounters import FAMILIES, Conditions, draw
from steerclear.shield.exceptions import ConfigError, PlatformError

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


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"radius_m": 0.0}, "above 0"),
        ({"radius_m": float("nan")}, "radius_m is nan"),
        ({"delay_s": -0.1}, "delay_s is -0.1"),
        ({"noise_m": float("inf")}, "noise_m is inf"),
        ({"current_mps": "fast"}, "current_mps is 'fast'"),
    ],
)
def test_conditions_out_of_range_are_refused(values, words):
    with pytest.raises(ConfigError, match=words):
        Conditions(**values)


def test_unknown_names_and_empty_ranges_are_refused():
    with pytest.raises(ConfigError, match="did you mean 'rammer_1'"):
        draw("rammer1", "heron", "heron", USUAL, 0, 0, 1)
    with pytest.raises(PlatformError, match="unknown platform 'canoe'"):
        draw("rammer_1", "canoe", "heron", USUAL, 0, 0, 1)
    with pytest.raises(ConfigError, match="at least one"):
        draw("rammer_1", "heron", "heron", USUAL, 0, 0, 0)
    with pytest.raises(ConfigError, match="smaller"):
        draw("crowd_12", "heron", "heron", Conditions(radius_m=20.0), 0, 0, 1)
