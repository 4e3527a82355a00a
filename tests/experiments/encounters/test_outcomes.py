"""What is counted and judged of encounters; closed loops that were lost once."""

import dataclasses
import json

import numpy as np
import pytest
from steerclear.env.record import find_violations
from steerclear.experiments.baselines.registry import NoFilter
from steerclear.experiments.encounters import Conditions, draw, measure, play
from steerclear.experiments.encounters.figures import summarise
from steerclear.experiments.encounters.outcomes import (
    SIDES,
    inactive_columns,
    judge_game,
    measure_chunk,
    never_arrived,
    safe_boats,
    start_safety_margin_m,
    tally,
    worst_games,
)
from steerclear.experiments.encounters.scene import read_scene, write_scene
from steerclear.experiments.statistics import upper_bound
from steerclear.shield import Reason
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import layout as L

USUAL, NEVER, OWN = Conditions(), np.nan, 20
QUARTERS = (173, 189, 253, 397, 403, 437, 480, 498, 503, 627)
"""Encounters of a heron and two rammers, one on each quarter, that who takes them to hold their course loses."""


def test_violations_are_those_of_the_record():
    crowd_film = play(draw("crowd_6", "heron", "heron", USUAL, 2, 0, 3), "none", USUAL)
    counted = tally(crowd_film)
    for game in range(3):
        places = crowd_film.state[:, game, :, :2]
        found = find_violations(places, 2.5)
        own = (found[:, 1] < 3).astype(int) + (found[:, 2] < 3)
        assert counted["violations_teammate"][game] == (own == 2).sum()
        assert counted["violations_opponent"][game] == (own == 1).sum()
        gaps = np.linalg.norm(places[1:, :3, None] - places[1:, None, 3:], axis=-1)
        assert counted["closest_opponent_m"][game] == pytest.approx(gaps.min())
    assert counted["violations_opponent"].sum() > 0


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


def test_names_of_0_9_are_taken_and_answered_with_a_warning():
    with pytest.warns(DeprecationWarning, match="'guard' is now 'safety_filter'"):
        outcome = measure("head_on", guard="none", n=2, seed=0, judge=False)
    with pytest.warns(DeprecationWarning, match="'guard' is now 'safety_filter'"):
        play(draw("head_on", "heron", "heron", USUAL, 0, 0, 1), guard="none", conditions=USUAL)
    with pytest.warns(DeprecationWarning, match="'breached' is now 'violated'"):
        assert outcome.summary["breached"] == outcome.summary["violated"]
    with pytest.warns(DeprecationWarning, match="'breaches_opponent' is now"):
        assert outcome.columns["breaches_opponent"] is outcome.columns["violations_opponent"]


def test_an_unguarded_head_on_violation_is_judged_avoidable():
    outcome = measure("head_on", "none", n=6, seed=0)
    figures = outcome.summary
    assert figures["violated"] == figures["unshielded_violated"] == figures["avoidable"] > 0
    assert figures["not_judged"] == figures["unavoidable"] == 0
    assert (outcome.columns["last_preventable_s"][outcome.columns["avoidable"] > 0] > 0.0).all()
    assert figures["goal_time_ratio"] == 1.0
    assert sum(figures["responsible"].values()) == figures["violated"]
    assert figures["responsible"]["own"] + figures["responsible"]["both"] > 0
    unjudged = measure("head_on", "none", n=6, seed=0, judge=False).summary
    assert (unjudged["avoidable"], unjudged["not_judged"]) == (0, figures["violated"])


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


def test_the_safety_margin_at_the_start_is_the_one_of_the_first_decision():
    scenes = draw("rammer_1", "heron", "heron", USUAL, 0, 0, 6)
    scenes.state[0, 1, [L.X, L.Y]] = scenes.state[0, 0, [L.X, L.Y]] + np.array([2.6, 0.0])
    scenes = dataclasses.replace(scenes, length_s=0.1)
    film = play(scenes, "shield", USUAL)
    found = start_safety_margin_m(film)
    np.testing.assert_array_equal(found.astype(np.float32), film.safety_margin_m[0, :, 0])
    np.testing.assert_array_equal(found, start_safety_margin_m(play(scenes, "none", USUAL)))
    assert found[0] < 0.0
    assert (found[1:] > 0.0).all()


def test_figures_of_made_up_encounters_take_what_nobody_judged_for_possibly_avoidable():
    columns = measure("head_on", "none", n=4, seed=0, judge=False).columns
    columns["violations_opponent"] = np.array([9.0, 1.0, 1.0, 0.0])
    columns |= {"unavoidable": np.array([5.0, 1, 0, 0]), "started_inside": np.array([0, 0, 1.0, 0])}
    columns |= {"not_judged": np.array([4.0, 0, 0, 0]), "avoidable": np.zeros(4)}
    columns["goal_s"] = 1.5 * columns["unshielded_goal_s"]
    figures = summarise(columns)
    names = ("violated", "avoidable", "unavoidable", "started_inside", "not_judged")
    assert [figures[name] for name in names] == [3, 0, 1, 1, 1]
    assert figures["avoidable_upper"] == upper_bound(1, 4)
    assert figures["goal_time_ratio"] == pytest.approx(1.5)
    assert len(figures["closest_quantiles_m"]) == 101
    columns |= {"avoidable": np.array([1.0, 0, 0, 0]), "not_judged": np.zeros(4)}
    assert summarise(columns)["avoidable"] == 1


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
        ("[1", "cannot read"),
        (None, "cannot read"),
    ],
)
def test_a_damaged_scene_is_refused(tmp_path, change, words):
    path = write_scene(tmp_path / "scene.json", draw("head_on", "heron", "heron", USUAL, 0, 0, 1), USUAL)
    if callable(change):
        content = json.loads(path.read_text())
        change(content)
        path.write_text(json.dumps(content))
    elif change:
        path.write_text(change)
    else:
        path.unlink()
    with pytest.raises(Exception, match=words) as caught:
        read_scene(path)
    assert type(caught.value).__name__ in ("ConfigError", "PlatformError")


def test_encounters_are_counted_from_0_on():
    with pytest.raises(ConfigError, match="first is -1; give a whole number, 0 or more"):
        draw("head_on", "heron", "heron", USUAL, 0, -1, 1)


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


def crowd_of(number):
    return play(draw("crowd_40", "heron", "heron", USUAL, 0, number, 1), "shield", USUAL)


def gaps_of(film):
    """Distances of every own boat from every boat, (T+1, 20, 40) m, from itself inf."""
    place = film.state[:, 0][:, :, [L.X, L.Y]]
    gaps = np.linalg.norm(place[:, :OWN, None] - place[:, None], axis=-1)
    gaps[:, range(OWN), range(OWN)] = np.inf
    return gaps


@pytest.mark.parametrize("number", [961, 962])
def test_mates_that_passed_make_room_for_the_escape_another_has_held(number):
    assert gaps_of(crowd_of(number))[..., :OWN].min() >= 2.5


@pytest.mark.parametrize("number", [546, 572, 873])
def test_a_boat_is_not_let_off_by_what_a_team_mate_far_away_cannot_keep(number):
    """Three encounters with a hit by an opponent of a boat that had 2 m to spare a few seconds before."""
    film = crowd_of(number)
    assert gaps_of(film).min() >= 2.5
    reason, told_m = film.reason[:, 0, :OWN], film.safety_margin_m[:, 0, :OWN]
    both = (reason == Reason.BEST_EFFORT).any(axis=1, keepdims=True) & (reason == Reason.BACKUP)
    assert both.any()  # some keep everything by their backup where others cannot
    assert (told_m[both] >= 0.0).all()


def closest_m(safety_filter):
    scenes = draw("rammer_2", "heron", "heron", USUAL, 0, 0, max(QUARTERS) + 1).take(QUARTERS)
    place = play(scenes, safety_filter, USUAL).state[..., [L.X, L.Y]]
    return np.linalg.norm(place[:, :, :1] - place[:, :, 1:], axis=-1).min(axis=(0, 2))


def test_two_that_close_in_from_both_quarters_are_seen_coming():
    assert (closest_m("shield") >= 2.5).all()


def test_who_takes_them_to_hold_their_course_loses_them():
    assert (closest_m("shield:profile=constant_velocity") < 2.5).mean() >= 0.3


@pytest.fixture(scope="module")
def short_film():
    """Two games of three own boats and three others, one step long: who arrived when is written into it."""
    scenes = dataclasses.replace(draw("crowd_6", "heron", "heron", USUAL, 0, 0, 2), length_s=0.1)
    return play(scenes, "none", USUAL)


@pytest.mark.parametrize(
    ("is_filtered", "bare", "share"),
    [
        ((9.0, 8.0, 7.0), (5.0, 5.0, 5.0), 0.0),
        ((NEVER, 8.0, NEVER), (5.0, 5.0, 5.0), 2.0 / 3.0),
        ((NEVER, NEVER, 7.0), (NEVER, 5.0, 5.0), 1.0 / 3.0),
        ((9.0, 8.0, 7.0), (NEVER, NEVER, NEVER), 0.0),
    ],
)
def test_own_boats_count_that_would_arrive_without_a_guard(short_film, is_filtered, bare, share):
    def arriving(first_goal_s):
        others = (NEVER, 5.0, NEVER)
        return dataclasses.replace(short_film, first_goal_s=np.array([(5.0,) * 6, (*first_goal_s, *others)]))

    np.testing.assert_allclose(never_arrived(arriving(is_filtered), arriving(bare)), [0.0, share])


def circling(safety_filter):
    return measure("circle_3", safety_filter, "surveyor", "surveyor", n=6, seed=0, judge=False)


def test_a_livelock_among_team_mates_is_seen_though_nobody_stands_still():
    livelock = circling("shield:deadlock_timeout_s=inf")
    lost = livelock.columns["never_arrived"]
    assert (lost > 0.0).any()
    assert (lost < 0.7).all(), "two sail on side by side, the third gets across"
    assert livelock.summary["never_arrived_percent"] == pytest.approx(100.0 * lost.mean())
    assert livelock.summary["deadlocked"] == livelock.summary["violated"] == 0
    assert livelock.summary["unshielded_violated"] == 6
    resolved = circling("shield").summary
    assert resolved["never_arrived_percent"] == resolved["violated"] == 0
    assert resolved["reached_percent"] == 100.0


def test_without_a_guard_boats_cross_in_the_middle_and_all_arrive():
    outcome = measure("circle_6", "none", n=6, seed=0, judge=False)
    assert outcome.summary["violated"] == 6
    assert outcome.summary["reached_percent"] == 100.0
    assert not outcome.columns["never_arrived"].any()
