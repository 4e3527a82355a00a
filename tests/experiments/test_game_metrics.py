"""What happened in a game, as numbers: against cases worked out by hand, and the recorder's own count."""

import json

import numpy as np
import pytest
from steerclear.env.config import GameConfig
from steerclear.env.record import make_record, meta_of
from steerclear.experiments.game_metrics import (
    count_deadlocks,
    deadlocks,
    tally,
)

REASONS = ["PASSED", "QP", "QP_RELAXED", "BACKUP", "BEST_EFFORT", "HELD", "NOT_COVERED", "RIGHT_OF_WAY"]


def record_of(position, shielded=True, **arrays):
    """A record of two boats per team whose track is given; nothing else happens in it."""
    position = np.asarray(position, dtype=float)
    steps = len(position) - 1
    config = GameConfig.preset("aamas2024", team_size=2)
    meta = meta_of(config, reason_names=REASONS, shielded=["agent_0", "agent_1"] if shielded else [])
    still = {name: np.zeros((steps + 1, 4)) for name in ("heading_deg", "speed_mps", "has_flag", "is_tagged", "oob")}
    reason = np.full((steps, 4), 6)
    if shielded:
        reason[:, :2] = 0
    base = {
        "position": position,
        **still,
        "flag_position": np.zeros((steps + 1, 2, 2)),
        "captures": np.zeros((steps + 1, 2)),
        "nominal": np.zeros((steps, 4, 2)),
        "filtered": np.zeros((steps, 4, 2)),
        "reason": reason,
        "intervened": np.zeros((steps, 4)),
        "safety_margin_m": np.full((steps, 4), np.nan),
        "violations": np.zeros((0, 4)),
    }
    return make_record(meta, **{**base, **arrays})


@pytest.fixture
def crossing():
    """Boats 0 and 1 (blue) touch once; boat 2 (red) passes boat 0 at 3 m; boat 3 stays far away."""
    track = np.zeros((5, 4, 2))
    track[:, 1] = [[9, 0], [2, 0], [9, 0], [9, 0], [9, 0]]
    track[:, 2] = [[0, 30], [0, 30], [0, 3], [0, 30], [0, 30]]
    track[:, 3] = [70, 30]
    return track


def test_violations_are_split_by_team_and_radius(crossing):
    counts = tally(record_of(crossing), 0)
    assert counts["violations_teammate_2.5m"] == 1
    assert counts["violations_teammate_4.0m"] == 1
    assert counts["violations_opponent_2.5m"] == 0
    assert counts["violations_opponent_4.0m"] == 1
    assert counts["closest_teammate_m"] == counts["closest_m"] == 2.0
    assert counts["closest_opponent_m"] == 3.0
    assert tally(record_of(crossing), 0, (3.25,))["violations_opponent_3.25m"] == 1
    assert counts["collisions"] == 2, "each boat in it counts; the game's radius is 2.5 m"
    assert tally(record_of(crossing), 1)["collisions"] == 0
    crossing[2, 2] = [0, 2]
    assert [tally(record_of(crossing), side)["collisions"] for side in (0, 1)] == [3, 1]


def test_deadlocks_are_those_of_the_own_team(crossing):
    record = record_of(np.repeat(crossing[:1], 102, axis=0))
    record["nominal"][..., 0], record["speed_mps"][:] = 1.0, 0.1
    assert tally(record, 0)["deadlocks"] == tally(record, 1)["deadlocks"] == 1
    record["speed_mps"][50, 0] = 1.0
    assert (tally(record, 0)["deadlocks"], tally(record, 1)["deadlocks"]) == (0, 1)


def test_a_single_boat_has_no_team_mate_to_be_close_to():
    config = GameConfig.preset("aamas2024", team_size=1)
    record = record_of(np.zeros((3, 4, 2)))
    alone = {name: array[:, :2] if array.ndim > 1 and array.shape[1] == 4 else array for name, array in record.items()}
    alone["flag_position"], alone["violations"] = record["flag_position"], record["violations"]
    meta = meta_of(config, reason_names=REASONS)
    alone["meta"] = np.array(json.dumps(meta, default=lambda value: np.asarray(value).tolist()))
    counts = tally(alone, 0)
    assert counts["closest_teammate_m"] is None
    assert counts["closest_m"] == counts["closest_opponent_m"] == 0.0


OWN = np.array([True, True, False])


def still(steps, speed_mps=0.1, nominal_mps=1.0):
    return np.full((steps, 3), speed_mps), np.full((steps, 3), nominal_mps)


@pytest.mark.parametrize(
    ("steps", "speed_mps", "nominal_mps", "dt_s", "expected"),
    [
        (101, 0.1, 1.0, 0.1, 1),
        (100, 0.1, 1.0, 0.1, 0),
        (51, 0.1, 1.0, 0.2, 1),
        (50, 0.1, 1.0, 0.2, 0),
        (101, 0.3, 1.0, 0.1, 0),
        (101, 0.1, 0.0, 0.1, 0),
        (1000, 0.1, 1.0, 0.1, 1),
    ],
)
def test_a_deadlock_is_two_mates_that_want_to_move_and_do_not_for_ten_seconds(
    steps, speed_mps, nominal_mps, dt_s, expected
):
    assert count_deadlocks(*still(steps, speed_mps, nominal_mps), OWN, dt_s) == expected


def test_games_are_counted_apart():
    speed_mps, nominal_mps = still(101)
    two = np.stack([speed_mps, speed_mps + 1.0], axis=1)
    out = np.full(2, -1.0)
    deadlocks(two, np.stack([nominal_mps, nominal_mps], axis=1), OWN, 100, out)
    assert out.tolist() == [1.0, 0.0]
