import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.experiments.encounters import FAMILIES, Conditions, draw
from steerclear.experiments.encounters import script as S
from steerclear.experiments.encounters.builder import SceneBuilder
from steerclear.shield.exceptions import ConfigError, PlatformError
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


def test_seeds_numbers_families_and_platforms_differ():
    base = draw("rammer_1", "heron", "heron", USUAL, 0, 0, 2)
    assert not np.array_equal(base.state[0], base.state[1])
    for other in (("rammer_1", "heron", "heron", 1), ("rammer_1", "heron", "surveyor", 0)):
        family, own, foe, seed = other
        assert not np.array_equal(base.state, draw(family, own, foe, USUAL, seed, 0, 2).state)


def test_conditions_other_than_the_radius_leave_the_scene_alone():
    quiet = draw("crossing_left", "heron", "heron", USUAL, 0, 0, 4)
    rough = draw("crossing_left", "heron", "heron", Conditions(2.5, 0.3, 0.0, 0.5), 0, 0, 4)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(quiet, name), getattr(rough, name))


def test_sudden_turns_are_tried_at_every_moment_to_both_sides():
    scenes = draw("sudden_turn", "heron", "heron", USUAL, 0, 0, 2)
    assert scenes.games == 24
    first = scenes.script[:12, 1]
    begin = S.PHASE + S.N_PHASE
    assert len(set(first[:, begin + S.AT_S])) == 6
    turns = first[:, begin + S.ANGLE_DEG] - first[:, S.PHASE + S.ANGLE_DEG]
    assert len(set(np.round((turns + 180) % 360 - 180, 6))) == 2
    assert (scenes.state[:12] == scenes.state[0]).all()


def test_crossings_come_from_the_side_they_are_named_after():
    for family, sign in (("crossing_left", -1.0), ("crossing_right", 1.0)):
        state = draw(family, "heron", "heron", USUAL, 0, 0, 20).state
        course = np.radians(state[:, 0, L.HEADING])
        apart = state[:, 1, :2] - state[:, 0, :2]
        right = apart[:, 0] * np.cos(course) - apart[:, 1] * np.sin(course)
        assert (np.sign(right) == sign).all()


@pytest.mark.parametrize("family", ["circle_3", "circle_6"])
@pytest.mark.parametrize(("own", "other"), [("heron", "heron"), ("heron", "surveyor")])
def test_boats_round_a_circle_want_to_its_opposite_point_and_would_be_in_the_middle_at_once(family, own, other):
    scenes = draw(family, own, other, USUAL, 0, 0, 30)
    boats = len(scenes.platforms)
    assert scenes.own.all()
    assert scenes.platforms == ((own, other) * boats)[:boats]
    start = scenes.state[:, :, :2]
    np.testing.assert_allclose(scenes.goals[:, :, 0], -start, atol=1e-9)
    bearings = np.radians(scenes.state[:, :, L.HEADING])
    far = np.linalg.norm(start, axis=-1)
    np.testing.assert_allclose(start, -far[..., None] * np.stack([np.sin(bearings), np.cos(bearings)], -1), atol=1e-9)
    across_s = 2.0 * far / scenes.state[:, :, L.SPEED]
    np.testing.assert_allclose(across_s, across_s[:, :1] * np.ones(boats))
    assert across_s.min() > 15.0
    assert across_s.max() < 25.0
    assert np.ptp(across_s[:, 0]) > 5.0
    angles = np.sort(np.arctan2(start[..., 0], start[..., 1]), axis=1)
    apart_deg = np.degrees(np.diff(angles, axis=1, append=angles[:, :1] + 2.0 * np.pi))
    off_deg = np.abs(apart_deg - 360.0 / boats)
    assert 5.0 < off_deg.max() <= 20.0


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


def test_a_turned_cast_keeps_all_distances_and_bearings():
    cast = SceneBuilder("heron", "heron", USUAL, 0, "any", 0)
    cast.add_own(1.0, 2.0, 30.0, 1.0, (5.0, 9.0))
    row = S.script(S.phase(S.AIM_HEADING, 1.0, angle_deg=170.0))
    cast.add_other(4.0, 6.0, 170.0, 1.0, row)
    before = cast.closest_m()
    cast.turn(90.0)
    assert cast.closest_m() == pytest.approx(before)
    np.testing.assert_allclose(cast.state[0][[L.X, L.Y, L.HEADING]], [2.0, -1.0, 120.0], atol=1e-12)
    np.testing.assert_allclose(cast.goals[0][0], (9.0, -5.0), atol=1e-12)
    assert cast.script[1][S.PHASE + S.ANGLE_DEG] == pytest.approx(-100.0)
