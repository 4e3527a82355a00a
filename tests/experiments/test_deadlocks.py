import numpy as np
import pytest
from steerclear.experiments.game_metrics import count_deadlocks, deadlocks

OWN = np.array([True, True, False])


def still(steps, speed_mps=0.1, wanted_mps=1.0):
    return np.full((steps, 3), speed_mps), np.full((steps, 3), wanted_mps)


@pytest.mark.parametrize(
    ("steps", "speed_mps", "wanted_mps", "expected"),
    [(101, 0.1, 1.0, 1), (100, 0.1, 1.0, 0), (101, 0.3, 1.0, 0), (101, 0.1, 0.0, 0), (1000, 0.1, 1.0, 1)],
)
def test_a_deadlock_is_two_mates_that_want_to_move_and_do_not_for_ten_seconds(steps, speed_mps, wanted_mps, expected):
    assert count_deadlocks(*still(steps, speed_mps, wanted_mps), OWN, 0.1) == expected


def test_ten_seconds_are_ten_seconds_at_any_step():
    assert count_deadlocks(*still(51), OWN, 0.2) == 1
    assert count_deadlocks(*still(50), OWN, 0.2) == 0


def test_each_begins_anew_once_somebody_moved_and_opponents_are_none_of_it():
    speed_mps, wanted_mps = still(300)
    speed_mps[150, 0] = speed_mps[:, 2] = 1.0
    assert count_deadlocks(speed_mps, wanted_mps, OWN, 0.1) == 2
    assert count_deadlocks(speed_mps, wanted_mps, ~OWN, 0.1) == 0


def test_games_are_counted_apart():
    speed_mps, wanted_mps = still(101)
    two = np.stack([speed_mps, speed_mps + 1.0], axis=1)
    out = np.full(2, -1.0)
    deadlocks(two, np.stack([wanted_mps, wanted_mps], axis=1), OWN, 100, out)
    assert out.tolist() == [1.0, 0.0]
