"""Boats that turn at once carry on with a backup from opponents for a moment; others' autopilots need no such rest."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.experiments.encounters import Conditions, Trajectory, draw, play
from steerclear.shield import Reason

CALM = Conditions()
ROUNDING_M = 1e-3


def _rammed(platform: str, number: int, guard: str) -> Trajectory:
    return play(draw("rammer_1", platform, platform, CALM, 7, number, 1), guard, CALM)


def _times_turned_back(film: Trajectory) -> int:
    """Changes of side of what the own boat is told, turns of less than a degree not counted."""
    told = film.filtered[:, 0, 0, 1]
    side = np.sign(told[np.abs(told) > 1.0])
    return int(np.count_nonzero(side[1:] != side[:-1]))


def _closest_m(film: Trajectory) -> float:
    own, other = film.state[:, 0, 0, :2], film.state[:, 0, 1, :2]
    return float(np.linalg.norm(own - other, axis=-1).min())


def test_a_rate_boat_that_is_rammed_is_turned_back_half_as_often():
    without, with_it = (
        [_rammed("ardurover_boat", number, guard) for number in range(4)]
        for guard in ("shield:min_backup_hold_s=0", "shield")
    )
    assert min(map(_closest_m, [*without, *with_it])) >= 2.5
    before, after = (sum(map(_times_turned_back, films)) for films in (without, with_it))
    assert before > 100, "nothing to mend"
    assert after < 0.5 * before


def test_a_backup_is_left_only_when_its_time_is_over_or_the_opponent_is_far():
    film = _rammed("ardurover_boat", 1, "shield:min_backup_hold_s=1")
    backing_up = film.reason[:, 0, 0] == Reason.BACKUP
    starts = np.flatnonzero(backing_up & ~np.r_[True, backing_up[:-1]])
    ends = np.flatnonzero(~backing_up & np.r_[False, backing_up[:-1]])
    lengths = [(start, ends[ends > start][0]) for start in starts if (ends > start).any()]
    assert lengths
    early = [end for start, end in lengths if end - start < 10]
    assert all(film.safety_margin_m[end, 0, 0] >= 2.0 - ROUNDING_M for end in early)
    assert len(early) < len(lengths), "none of them was held"


@settings(max_examples=3, deadline=None)
@given(number=st.integers(0, 500), platform=st.sampled_from(["heron", "surveyor"]))
def test_other_boats_decide_as_ever(number, platform):
    longer, none = (_rammed(platform, number, f"shield:min_backup_hold_s={dwell}") for dwell in (5, 0))
    np.testing.assert_array_equal(longer.filtered, none.filtered)
