"""95 % intervals for shares, counts and means, and paired differences.

Wilson for shares (Wilson 1927), exact Poisson limits for counts (Garwood 1936), the percentile bootstrap
for means and ratios (Efron 1979). A count of zero still has an upper limit: ``-ln(0.05) = 3.0`` events over
all games, the rule of three (Hanley and Lippman-Hand 1983).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats
from steerclear.shield.exceptions import ConfigError

CONFIDENCE = 0.95
RESAMPLES = 4000
Statistic = Callable[[NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True)
class Interval:
    """A value and its confidence limits, in the unit of the value; limits are NaN where none can be given."""

    value: float
    low: float
    high: float

    def scaled(self, factor: float) -> Interval:
        """Return the interval in another unit: every number times ``factor`` (>= 0)."""
        return Interval(self.value * factor, self.low * factor, self.high * factor)

    def contains(self, number: float) -> bool:
        """Tell whether ``number`` lies within the limits; False where there are none."""
        return self.low <= number <= self.high


def share_interval(successes: int, trials: int, confidence: float = CONFIDENCE) -> Interval:
    """Wilson score interval of a share.

    Args:
        successes: how many trials had the property.
        trials: how many there were; with none the limits are 0 and 1 and the value is NaN.
        confidence: probability that the interval covers the true share.

    Raises:
        ConfigError: negative numbers, more successes than trials, or a confidence outside (0, 1).
    """
    _check_confidence(confidence)
    if not 0 <= successes <= trials:
        raise ConfigError(f"a share needs 0 <= successes <= trials; got {successes} of {trials}")
    if trials == 0:
        return Interval(float("nan"), 0.0, 1.0)
    limits = stats.binomtest(successes, trials).proportion_ci(confidence, method="wilson")
    return Interval(successes / trials, float(limits.low), float(limits.high))


def count_interval(events: int, exposure: float = 1.0, confidence: float = CONFIDENCE) -> Interval:
    """Exact Poisson interval (Garwood) of a rate: events per unit of exposure.

    With zero events all of the error probability goes to the upper limit, which is then ``-ln(1 - confidence)``
    events: the rule of three at 95 %.

    Args:
        events: how many happened, over all the exposure.
        exposure: what they are counted over, e.g. the number of games; must be positive.
        confidence: probability that the interval covers the true rate, at least.

    Raises:
        ConfigError: a negative count, an exposure that is not positive, or a confidence outside (0, 1).
    """
    _check_confidence(confidence)
    if events < 0 or not exposure > 0.0:
        raise ConfigError(f"a rate needs events >= 0 and exposure > 0; got {events} over {exposure}")
    if events == 0:
        return Interval(0.0, 0.0, -np.log1p(-confidence) / exposure)
    tail = (1.0 - confidence) / 2.0
    low = stats.chi2.ppf(tail, 2 * events) / 2.0
    high = stats.chi2.ppf(1.0 - tail, 2 * (events + 1)) / 2.0
    return Interval(events / exposure, float(low) / exposure, float(high) / exposure)


def mean_interval(values: ArrayLike, seed: int = 0, confidence: float = CONFIDENCE) -> Interval:
    """Bootstrap percentile interval of a mean; NaN values are left out, limits are NaN below two values.

    Args:
        values: one number per game, shape (n,).
        seed: of the resampling; the same seed gives the same limits.
        confidence: probability that the interval covers the true mean, about.

    Raises:
        ConfigError: a confidence outside (0, 1).
    """
    kept = np.asarray(values, dtype=np.float64).ravel()
    kept = kept[~np.isnan(kept)]
    return bootstrap_interval(kept[:, None], _mean_of_first, seed, confidence)


def paired_difference(off: ArrayLike, on: ArrayLike, seed: int = 0, confidence: float = CONFIDENCE) -> Interval:
    """Bootstrap interval of the mean of ``on - off``, games paired by position (same seeds).

    Raises:
        ConfigError: the two differ in length, so that they cannot be pairs.
    """
    off_values, on_values = _pair(off, on)
    return mean_interval(on_values - off_values, seed, confidence)


def paired_ratio(off: ArrayLike, on: ArrayLike, seed: int = 0, confidence: float = CONFIDENCE) -> Interval:
    """Bootstrap interval of ``sum(on) / sum(off)``, pairs resampled together; NaN where nothing happened off.

    Raises:
        ConfigError: the two differ in length, so that they cannot be pairs.
    """
    return bootstrap_interval(np.column_stack(_pair(off, on)), _ratio_of_totals, seed, confidence)


def bootstrap_interval(
    rows: NDArray[np.float64], statistic: Statistic, seed: int = 0, confidence: float = CONFIDENCE
) -> Interval:
    """Percentile bootstrap of any statistic of games.

    Args:
        rows: (n, k), one row per game, resampled as a whole.
        statistic: maps (..., n, k) to (...): computed for all resamples at once.
        seed: of the resampling.
        confidence: probability that the interval covers the true value, about.

    Raises:
        ConfigError: a confidence outside (0, 1).
    """
    _check_confidence(confidence)
    nan = float("nan")
    if len(rows) == 0:
        return Interval(nan, nan, nan)
    value = float(statistic(rows))
    if len(rows) < 2:
        return Interval(value, nan, nan)
    picks = np.random.default_rng(seed).integers(0, len(rows), size=(RESAMPLES, len(rows)))
    resampled = statistic(rows[picks])
    resampled = resampled[np.isfinite(resampled)]
    if len(resampled) == 0:
        return Interval(value, nan, nan)
    tail = (1.0 - confidence) / 2.0
    low, high = np.quantile(resampled, [tail, 1.0 - tail])
    return Interval(value, float(low), float(high))


def _mean_of_first(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    return rows[..., 0].mean(axis=-1)


def _ratio_of_totals(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    totals = rows.sum(axis=-2)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(totals[..., 1] / totals[..., 0])


def _pair(off: ArrayLike, on: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    off_values = np.asarray(off, dtype=np.float64).ravel()
    on_values = np.asarray(on, dtype=np.float64).ravel()
    if len(off_values) != len(on_values):
        raise ConfigError(f"paired games must be equally many; got {len(off_values)} off and {len(on_values)} on")
    return off_values, on_values


def _check_confidence(confidence: float) -> None:
    if not 0.0 < confidence < 1.0:
        raise ConfigError(f"confidence must be between 0 and 1; got {confidence}; use 0.95 for 95 % intervals")
