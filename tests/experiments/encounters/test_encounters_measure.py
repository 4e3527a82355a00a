import dataclasses
import json

import numpy as np
import pytest
from steerclear.env.record import find_breaches
from steerclear.experiments.encounters import Conditions, draw, measure, play
from steerclear.experiments.encounters.figures import summarise
from steerclear.experiments.encounters.outcomes import (
    SIDES,
    judge_game,
    measure_chunk,
    start_certificate_m,
    tally,
    worst_games,
)
from steerclear.experiments.encounters.scene import read_scene, write_scene
from steerclear.experiments.statistics import upper_bound
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import layout as L

USUAL = Conditions()


@pytest.fixture(scope="module")
def crowd_film():
    return play(draw("crowd_6", "heron", "heron", USUAL, 2, 0, 3), "none", USUAL)


def test_breaches_are_those_of_the_record(crowd_film):
    counted = tally(crowd_film)
    for game in range(3):
        places = crowd_film.state[:, game, :, :2]
        found = find_breaches(places, 2.5)
        own = (found[:, 1] < 3).astype(int) + (found[:, 2] < 3)
        assert counted["breaches_teammate"][game] == (own == 2).sum()
        assert counted["breaches_opponent"][game] == (own == 1).sum()
        gaps = np.linalg.norm(places[1:, :3, None] - places[1:, None, 3:], axis=-1)
        assert counted["closest_opponent_m"][game] == pytest.approx(gaps.min())
    assert counted["breaches_opponent"].sum() > 0


def test_changes_are_counted_and_averaged_over_changed_steps():
    scenes = dataclasses.replace(draw("head_on", "heron", "heron", USUAL, 0, 0, 1), length_s=2.0)
    film = play(scenes, "none", USUAL)
    film.filtered[:5, 0, 0, 1] += 355.0
    film.filtered[5:10, 0, 0, 0] -= 0.5
    counted = tally(film)
    assert counted["changed_share"][0] == pytest.approx(0.5)
    assert counted["heading_change_deg"][0] == pytest.approx(2.5)
    assert counted["speed_change_mps"][0] == pytest.approx(0.25)


def test_the_worst_variant_of_each_encounter_counts():
    scenes = draw("sudden_turn", "heron", "heron", USUAL, 0, 4, 2)
    closest = np.full(24, 5.0)
    closest[[3, 20]] = 1.0, 2.0
    assert worst_games(scenes, closest).tolist() == [3, 20]
    columns = measure_chunk(scenes, "none", USUAL, judge=False)
    assert columns["number"].tolist() == [4.0, 5.0]
    every = tally(play(scenes, "none", USUAL))["closest_m"].reshape(2, 12)
    np.testing.assert_array_equal(columns["closest_m"], every.min(axis=1))
    np.testing.assert_array_equal(columns["variant"], every.argmin(axis=1))


def test_an_unguarded_head_on_breach_is_judged_avoidable():
    outcome = measure("head_on", "none", n=6, seed=0)
    figures = outcome.summary
    assert figures["breached"] == figures["unshielded_breached"] == figures["avoidable"] > 0
    assert figures["not_judged"] == figures["unavoidable"] == 0
    assert (outcome.columns["last_preventable_s"][outcome.columns["avoidable"] > 0] > 0.0).all()
    assert figures["goal_time_ratio"] == 1.0
    assert sum(figures["responsible"].values()) == figures["breached"]
    assert figures["responsible"]["own"] + figures["responsible"]["both"] > 0
    unjudged = measure("head_on", "none", n=6, seed=0, judge=False).summary
    assert (unjudged["avoidable"], unjudged["not_judged"]) == (0, figures["breached"])


def test_a_late_command_has_to_be_given_so_much_earlier():
    scenes = draw("head_on", "heron", "heron", USUAL, 0, 0, 4)
    found = {}
    for delay_s in (0.0, 1.0):
        film = dataclasses.replace(play(scenes, "none", USUAL), conditions=Conditions(delay_s=delay_s))
        found[delay_s] = judge_game(film, int(tally(film)["closest_m"].argmin()))
    assert found[0.0]["avoidable"] == found[1.0]["avoidable"] == 1.0
    lead_s = found[1.0]["last_preventable_s"] - found[0.0]["last_preventable_s"]
    assert lead_s == pytest.approx(1.0)
    assert SIDES[int(found[1.0]["responsible"])] == "opponent"  # whose commands act at once


def test_the_certificate_at_the_start_is_the_one_of_the_first_decision():
    scenes = draw("rammer_1", "heron", "heron", USUAL, 0, 0, 6)
    scenes.state[0, 1, [L.X, L.Y]] = scenes.state[0, 0, [L.X, L.Y]] + np.array([2.6, 0.0])
    scenes = dataclasses.replace(scenes, length_s=0.1)
    film = play(scenes, "shield", USUAL)
    found = start_certificate_m(film)
    np.testing.assert_array_equal(found.astype(np.float32), film.safety_margin_m[0, :, 0])
    np.testing.assert_array_equal(found, start_certificate_m(play(scenes, "none", USUAL)))
    assert found[0] < 0.0
    assert (found[1:] > 0.0).all()


def test_breaches_that_nobody_judged_may_be_avoidable():
    columns = measure("head_on", "none", n=4, seed=0, judge=False).columns
    columns["breaches_opponent"] = np.array([9.0, 1.0, 1.0, 0.0])
    columns |= {"unavoidable": np.array([5.0, 1, 0, 0]), "started_inside": np.array([0, 0, 1.0, 0])}
    columns |= {"not_judged": np.array([4.0, 0, 0, 0]), "avoidable": np.zeros(4)}
    figures = summarise(columns)
    names = ("avoidable", "unavoidable", "started_inside", "not_judged")
    assert [figures[name] for name in names] == [0, 1, 1, 1]
    assert figures["avoidable_upper"] == upper_bound(1, 4)


def test_figures_of_made_up_encounters():
    columns = measure("head_on", "none", n=4, seed=0, judge=False).columns
    columns["avoidable"], columns["unavoidable"] = np.array([1.0, 0, 0, 0]), np.array([1.0, 1.0, 0, 0])
    columns["breaches_opponent"], columns["not_judged"] = np.array([2.0, 1.0, 0, 0]), np.zeros(4)
    columns["goal_s"] = 1.5 * columns["unshielded_goal_s"]
    figures = summarise(columns)
    assert (figures["breached"], figures["avoidable"], figures["unavoidable"]) == (2, 1, 1)
    assert figures["goal_time_ratio"] == pytest.approx(1.5)
    assert len(figures["closest_quantiles_m"]) == 101


def test_a_scene_file_plays_exactly_again(tmp_path):
    conditions = Conditions(0.2, 0.4, 0.1, radius_m=3.0)
    scenes = draw("sudden_turn", "surveyor", "heron", conditions, 8, 2, 1)
    path = write_scene(tmp_path / "scene.json", scenes, conditions, note="kept")
    again, same = read_scene(path)
    assert same == conditions
    assert json.loads(path.read_text())["note"] == "kept"
    np.testing.assert_array_equal(play(scenes, "none", conditions).state, play(again, "none", conditions).state)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c.update(format=9), "format 9"),
        (lambda c: c.pop("goals"), "KeyError: 'goals'"),
        (lambda c: c["state"][0].pop(), "the scene has a state of shape"),
        (lambda c: c["state"][0][0].__setitem__(0, None), "not finite"),
        (lambda c: c.update(length_s=0.0), "lasts 0.0 s"),
        (lambda c: c.update(platforms=["canoe", "heron"]), "unknown platform"),
    ],
)
def test_a_damaged_scene_is_refused(tmp_path, change, words):
    path = write_scene(tmp_path / "scene.json", draw("head_on", "heron", "heron", USUAL, 0, 0, 1), USUAL)
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(Exception, match=words) as caught:
        read_scene(path)
    assert type(caught.value).__name__ in ("ConfigError", "PlatformError")


def test_a_file_that_is_no_scene_is_refused(tmp_path):
    (tmp_path / "a.json").write_text("[1")
    with pytest.raises(ConfigError, match="cannot read"):
        read_scene(tmp_path / "a.json")
    with pytest.raises(ConfigError, match="cannot read"):
        read_scene(tmp_path / "missing.json")
