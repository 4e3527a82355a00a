import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from steerclear.env.record import find_breaches
from steerclear.experiments.game_metrics import (
    PairDistances,
    count_breaches,
    count_reversals,
    entries,
    heading_change_deg,
    team_pairs,
)
from steerclear.shield.exceptions import ConfigError


def two_boats(*gaps_m):
    """A track of two boats on a line, this far apart at the start and after every step."""
    track = np.zeros((len(gaps_m), 2, 2))
    track[:, 1, 0] = gaps_m
    return PairDistances.of(track)


@pytest.mark.parametrize(
    ("gaps_m", "count"),
    [
        ((5, 4, 3, 2, 2, 3, 4), 1),  # one visit is one breach, however long
        ((5, 2, 5, 2, 5), 2),  # two visits
        ((5, 2.5, 5), 1),  # exactly on the radius is inside
        ((5, 2.5000001, 5), 0),
        ((2, 5, 5), 0),  # the start position itself is not counted
        ((2, 2, 5, 2), 2),  # but a pair that starts inside counts at the first step
        ((5,), 0),  # no step at all
    ],
)
def test_breaches_are_counted_once_per_entry(gaps_m, count):
    assert count_breaches(two_boats(*gaps_m), 2.5) == count


def test_a_wider_radius_merges_visits():
    track = two_boats(9, 2, 3, 2, 9)
    assert count_breaches(track, 2.5) == 2
    assert count_breaches(track, 4.0) == 1


def test_pairs_of_a_team():
    team = [0, 0, 1, 1]
    distances = PairDistances.of(np.zeros((1, 4, 2)))
    own = distances.of_pairs(team_pairs(team, 0, "teammate"))
    across = distances.of_pairs(team_pairs(team, 0, "opponent"))
    assert own.pairs.tolist() == [[0, 1]]
    assert across.pairs.tolist() == [[0, 2], [0, 3], [1, 2], [1, 3]]
    assert own.closest_m() == np.inf


@given(st.lists(st.integers(0, 40).map(lambda n: n / 4), min_size=1, max_size=40), st.sampled_from([0.5, 2.5, 4.0]))
def test_count_agrees_with_the_recorder_and_swapping_boats_changes_nothing(gaps_m, radius_m):
    distances = two_boats(*gaps_m)
    moved = PairDistances(distances.pairs[:, ::-1], distances.distance_m)
    track = np.zeros((len(gaps_m), 2, 2))
    track[:, 1, 0] = gaps_m
    assert len(find_breaches(track, radius_m)) == count_breaches(distances, radius_m)
    assert count_breaches(moved, radius_m) == count_breaches(distances, radius_m)
    assert entries(distances, radius_m).shape == distances.distance_m.shape


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: PairDistances.of(np.zeros((3, 2))), "shape"),
        (lambda: PairDistances.of(np.full((3, 2, 2), np.nan)), "not finite"),
        (lambda: count_breaches(two_boats(1, 2), -1.0), "must be positive"),
        (lambda: count_breaches(two_boats(1, 2), float("nan")), "must be positive"),
        (lambda: team_pairs([0, 1], 0, "friends"), "teammate or opponent"),
    ],
)
def test_bad_input_is_one_clear_error(call, words):
    with pytest.raises(ConfigError, match=words):
        call()


def test_reversals_are_changes_of_the_commanded_side():
    heading = np.zeros((6, 2))
    command = np.array([[20, 0], [-20, 0], [2, 0], [-20, 4], [20, -4], [20, 0]], dtype=float)
    assert count_reversals(command, heading) == 2


def test_heading_changes_wrap():
    np.testing.assert_allclose(heading_change_deg([170.0, -170.0, 10.0], [-170.0, 170.0, -10.0]), [-20.0, 20.0, 20.0])
