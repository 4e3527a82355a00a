import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from steerclear.experiments.statistics import (
    count_difference,
    count_interval,
    count_ratio_interval,
    mean_interval,
    paired_difference,
    paired_ratio,
    share_interval,
    student_interval,
)
from steerclear.shield.exceptions import ConfigError


def test_wilson_interval_matches_the_published_formula():
    successes, trials, z = 7, 50, stats.norm.ppf(0.975)
    share = successes / trials
    centre = (share + z**2 / (2 * trials)) / (1 + z**2 / trials)
    half = z / (1 + z**2 / trials) * math.sqrt(share * (1 - share) / trials + z**2 / (4 * trials**2))
    interval = share_interval(successes, trials)
    assert interval.value == pytest.approx(0.14)
    assert (interval.low, interval.high) == pytest.approx((centre - half, centre + half), abs=1e-12)


def test_wilson_interval_stays_inside_zero_and_one_and_is_total_ignorance_without_trials():
    assert share_interval(0, 10).low == 0.0
    assert share_interval(10, 10).high == 1.0
    nothing = share_interval(0, 0)
    assert math.isnan(nothing.value)
    assert (nothing.low, nothing.high) == (0.0, 1.0)


@given(st.integers(1, 400), st.floats(0.1, 100.0))
def test_garwood_limits_are_the_tails_of_the_poisson_distribution(events, exposure):
    interval = count_interval(events, exposure)
    assert stats.poisson.sf(events - 1, interval.low * exposure) == pytest.approx(0.025, rel=1e-6)
    assert stats.poisson.cdf(events, interval.high * exposure) == pytest.approx(0.025, rel=1e-6)


def test_bootstrap_of_a_mean_agrees_with_scipy():
    values = np.random.default_rng(5).gamma(2.0, size=40)
    ours = mean_interval(values, seed=1)
    theirs = stats.bootstrap((values,), np.mean, method="percentile", n_resamples=9999, rng=3).confidence_interval
    spread = theirs.high - theirs.low
    assert ours.value == pytest.approx(values.mean())
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), abs=0.04 * spread)
    assert mean_interval([1.0, math.nan, 8.0], seed=4) == mean_interval([1.0, 8.0], seed=4), "seeded, and without NaN"


def test_ratio_of_totals_and_its_missing_denominator():
    interval = paired_ratio([10, 20, 30], [1, 2, 4])
    assert interval.value == pytest.approx(7 / 60)
    assert 0.1 <= interval.low < interval.value < interval.high <= 4 / 30
    assert not math.isfinite(paired_ratio([0, 0], [1, 0]).value)


def test_a_ratio_without_events_has_the_limit_that_its_other_side_allows():
    """Resampling would say [0, 0]. Of n events none is on: p <= 1 - 0.05 ** (1 / n), and the ratio is p / (1 - p)."""
    for off in ([3, 1, 2], [1, 0], [40, 60]):
        share = 1.0 - 0.05 ** (1.0 / sum(off))
        interval = paired_ratio(off, [0] * len(off))
        assert interval.value == interval.low == 0.0
        assert interval.high == pytest.approx(share / (1.0 - share))
    none_off = paired_ratio([0, 0, 0], [2, 1, 0])
    assert (none_off.value, none_off.high) == (math.inf, math.inf)
    assert none_off.low == pytest.approx(1.0 / paired_ratio([2, 1, 0], [0, 0, 0]).high)
    nothing = paired_ratio([0, 0], [0, 0])
    assert math.isnan(nothing.value)
    assert (nothing.low, nothing.high) == (0.0, math.inf)


def test_a_ratio_of_games_that_are_all_alike_is_no_certainty():
    interval = paired_ratio([10, 10, 10], [1, 1, 1])
    share = stats.binomtest(3, 33).proportion_ci(0.95, method="exact")
    assert interval.value == pytest.approx(0.1)
    limits = (share.low / (1 - share.low), share.high / (1 - share.high))
    assert (interval.low, interval.high) == pytest.approx(limits)


@given(st.integers(0, 60), st.integers(0, 60))
def test_a_ratio_of_counts_turned_round_has_its_limits_turned_round(off, on):
    here, there = count_ratio_interval(off, on), count_ratio_interval(on, off)
    assert here.low <= here.high
    if here.low > 0.0:
        assert here.low == pytest.approx(1.0 / there.high)
    assert math.isnan(here.value) or here.low <= here.value <= here.high


def test_means_of_games_that_are_all_alike_have_no_limits_and_differences_of_counts_those_of_their_rates():
    assert math.isnan(mean_interval([]).value)
    alike = mean_interval([2.0] * 8)
    assert alike.value == 2.0
    assert math.isnan(alike.low)
    assert math.isnan(alike.high)
    none = count_difference([0] * 20, [0] * 20)
    assert none.value == 0.0
    assert (none.low, none.high) == pytest.approx((math.log(0.05) / 20, -math.log(0.05) / 20))
    fewer = count_difference([2] * 10, [1] * 10)
    assert fewer.value == -1.0
    assert fewer.low < -1.0 < fewer.high
    assert count_difference([1, 4, 2], [0, 1, 1]) == paired_difference([1, 4, 2], [0, 1, 1])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: share_interval(3, 2), "successes <= trials"),
        (lambda: count_interval(-1), "events >= 0"),
        (lambda: count_interval(1, 0.0), "exposure > 0"),
        (lambda: count_ratio_interval(1, -1), "counts >= 0"),
        (lambda: count_difference([1], [1, 2]), "1 off and 2 on"),
        (lambda: count_interval(1, float("nan")), "exposure > 0"),
        (lambda: paired_difference([1.0], [1.0, 2.0]), "1 off and 2 on"),
    ],
)
def test_bad_input_is_one_clear_error(call, words):
    with pytest.raises(ConfigError, match=words):
        call()


def test_students_interval_of_few_values():
    values = [1.0, 2.0, 6.0]
    low, high = stats.t.interval(0.95, 2, loc=3.0, scale=stats.sem(values))
    found = student_interval(values)
    assert (found.value, found.low, found.high) == pytest.approx((3.0, low, high))
    assert student_interval([4.0]).value == 4.0
    assert math.isnan(student_interval([4.0]).low)
    assert math.isnan(student_interval([4.0, 4.0]).high)
    assert math.isnan(student_interval([]).value)
