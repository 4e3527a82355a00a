"""95 % intervals for shares, counts and means, paired differences, and the summary of a tidy table.

Wilson for shares (Wilson 1927), exact Poisson limits for counts (Garwood 1936), the percentile bootstrap
for means and ratios (Efron 1979). A count of zero still has an upper limit: ``-ln(0.05) = 3.0`` events over
all games, the rule of three (Hanley and Lippman-Hand 1983). Resampling games that are all alike gives the same
number again and again, which is no interval: ratios and differences of counts then have exact limits
(Clopper and Pearson 1934), means none. `figure` chooses by the kind of a metric.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from steerclear.shield.exceptions import ConfigError

if TYPE_CHECKING:
    import pandas as pd

    from .metrics import Metric

CONFIDENCE = 0.95
TAIL = (1.0 - CONFIDENCE) / 2.0
RESAMPLES = 4000
Statistic = Callable[[NDArray[np.float64]], NDArray[np.float64]]
DIFFERENCE = "difference"


@dataclass(frozen=True)
class Interval:
    """A value and its confidence limits, in the unit of the value; limits are NaN where none can be given."""

    value: float
    low: float
    high: float


NAN = float("nan")


def _special() -> Any:
    """SciPy's quantiles, the functions behind `scipy.stats`, which takes half a second to import."""
    from scipy import special

    return special


def share_interval(successes: int, trials: int) -> Interval:
    """Wilson score interval of a share; without trials the limits are 0 and 1, and there is no value."""
    if not 0 <= successes <= trials:
        raise ConfigError(f"a share needs 0 <= successes <= trials; got {successes} of {trials}")
    if trials == 0:
        return Interval(NAN, 0.0, 1.0)
    share, z = successes / trials, float(_special().ndtri(1.0 - TAIL))
    scale = 2.0 * (trials + z**2)
    centre = (2.0 * trials * share + z**2) / scale
    reach = z / scale * math.sqrt(4.0 * trials * share * (1.0 - share) + z**2)
    return Interval(share, centre - reach if successes else 0.0, centre + reach if successes < trials else 1.0)


def count_interval(events: int, exposure: float = 1.0) -> Interval:
    """Exact Poisson interval (Garwood) of a rate: events per unit of exposure, such as per game.

    With zero events all of the error probability goes to the upper limit, which is then ``-ln(0.05)`` events: the rule
    of three.

    Raises:
        ConfigError: a negative count, or an exposure that is not positive.
    """
    if events < 0 or not exposure > 0.0:
        raise ConfigError(f"a rate needs events >= 0 and exposure > 0; got {events} over {exposure}")
    if events == 0:
        return Interval(0.0, 0.0, -np.log1p(-CONFIDENCE) / exposure)
    low, high = _special().gammaincinv([events, events + 1], [TAIL, 1.0 - TAIL])
    return Interval(events / exposure, float(low) / exposure, float(high) / exposure)


def mean_interval(values: ArrayLike, seed: int = 0) -> Interval:
    """Bootstrap percentile interval of a mean; NaN values are left out, limits are NaN below two values."""
    kept = np.asarray(values, dtype=np.float64).ravel()
    kept = kept[~np.isnan(kept)]
    return bootstrap_interval(kept[:, None], lambda rows: rows[..., 0].mean(axis=-1), seed)


def student_interval(values: ArrayLike) -> Interval:
    """Student's t interval of a mean of few values, such as of trainings; NaN limits below two, or of equal ones."""
    found = np.asarray(values, dtype=np.float64).ravel()
    mean = float(found.mean()) if len(found) else NAN
    if len(found) < 2 or np.ptp(found) == 0.0:
        return Interval(mean, NAN, NAN)
    reach = float(_special().stdtrit(len(found) - 1, 1.0 - TAIL) * found.std(ddof=1) / np.sqrt(len(found)))
    return Interval(mean, mean - reach, mean + reach)


def paired_difference(off: ArrayLike, on: ArrayLike, seed: int = 0) -> Interval:
    """Bootstrap interval of the mean of ``on - off``, games paired by position (same seeds), equally many."""
    off_values, on_values = _pair(off, on)
    return mean_interval(on_values - off_values, seed)


def paired_ratio(off: ArrayLike, on: ArrayLike, seed: int = 0) -> Interval:
    """Interval of a ratio of counts, ``sum(on) / sum(off)``: bootstrap, pairs resampled together.

    Where one of them never happened, or every resample gives the same ratio, the limits are those of
    `count_ratio_interval`.
    """
    rows = np.column_stack(_pair(off, on))
    if len(rows) == 0:
        return Interval(NAN, NAN, NAN)
    totals = rows.sum(axis=0)
    found = bootstrap_interval(rows, _ratio_of_totals, seed) if totals.all() else None
    if found is not None and (len(rows) < 2 or not np.isnan(found.low)):
        return found
    return count_ratio_interval(int(totals[0]), int(totals[1]))


def count_ratio_interval(off: int, on: int) -> Interval:
    """Exact limits of the ratio of two rates, ``on / off``, counted over the same exposure.

    Of all events, those counted ``on`` are a binomial share p, and the ratio is p / (1 - p). With no event on one side
    all of the error probability goes to the limit on the other; with none at all the ratio may be anything.
    """
    if min(off, on) < 0:
        raise ConfigError(f"a ratio of counts needs counts >= 0; got {on} over {off}")
    infinite = float("inf")
    if off == on == 0:
        return Interval(NAN, 0.0, infinite)
    tail = TAIL if off and on else 2.0 * TAIL
    low = float(_special().betaincinv(on, off + 1, tail)) if on else 0.0
    high = float(_special().betaincinv(on + 1, off, 1.0 - tail)) if off else 1.0
    low, high = (share / (1.0 - share) if share < 1.0 else infinite for share in (low, high))
    return Interval(on / off if off else infinite, low, high)


def count_difference(off: ArrayLike, on: ArrayLike, seed: int = 0) -> Interval:
    """Interval of the mean of ``on - off`` of counts, games paired by position.

    As `paired_difference`; where the games are all alike, the limits are those that the two rates by themselves leave.
    """
    off_values, on_values = _pair(off, on)
    found = paired_difference(off_values, on_values, seed)
    if len(off_values) < 2 or not np.isnan(found.low):
        return found
    before, after = (count_interval(int(v.sum()), len(v)) for v in (off_values, on_values))
    return Interval(found.value, after.low - before.high, after.high - before.low)


def bootstrap_interval(rows: NDArray[np.float64], statistic: Statistic, seed: int = 0) -> Interval:
    """Percentile bootstrap of any statistic of games; limits are NaN where every resample gives the same number.

    Args:
        rows: (n, k), one row per game, resampled as a whole.
        statistic: maps (..., n, k) to (...): computed for all resamples at once.
        seed: of the resampling.
    """
    if len(rows) == 0:
        return Interval(NAN, NAN, NAN)
    value = float(statistic(rows))
    if len(rows) < 2:
        return Interval(value, NAN, NAN)
    picks = np.random.default_rng(seed).integers(0, len(rows), size=(RESAMPLES, len(rows)))
    resampled = statistic(rows[picks])
    resampled = resampled[np.isfinite(resampled)]
    if len(resampled) == 0 or np.ptp(resampled) == 0.0:
        return Interval(value, NAN, NAN)
    low, high = np.quantile(resampled, [TAIL, 1.0 - TAIL])
    return Interval(value, float(low), float(high))


def _ratio_of_totals(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    totals = rows.sum(axis=-2)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(totals[..., 1] / totals[..., 0])


def _pair(off: ArrayLike, on: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    off_values, on_values = (np.asarray(values, dtype=np.float64).ravel() for values in (off, on))
    if len(off_values) != len(on_values):
        raise ConfigError(f"paired games must be equally many; got {len(off_values)} off and {len(on_values)} on")
    return off_values, on_values


def upper_bound(events: int, trials: int) -> float:
    """One-sided upper limit of a probability (Clopper and Pearson 1934); 1 without trials."""
    if trials == 0 or events >= trials:
        return 1.0
    return float(_special().betaincinv(events + 1, trials - events, CONFIDENCE))


def figure(table: pd.DataFrame, metric: Metric, seed: int = 0) -> tuple[Interval, int]:
    """A metric over the rows of a table, and how many rows have it (an older version's may lack it).

    The interval is chosen here and nowhere else: Garwood of a count, Wilson of a share, the bootstrap of a mean and of
    a percent (of totals), none of a least.
    """
    values = _values(table, metric)
    n = len(values)
    if metric.kind == "least":
        return Interval(float(values.min(initial=np.inf)) if n else NAN, NAN, NAN), n
    kinds: dict[str, Callable[[], Interval]] = {
        "count": lambda: count_interval(int(values.sum()), n),
        "share": lambda: share_interval(int(values.sum()), n),
        "mean": lambda: mean_interval(values, seed),
        "percent": lambda: bootstrap_interval(values, _percent, seed),
    }
    if metric.kind not in kinds:
        raise ConfigError(f"unknown kind of metric {metric.kind!r}; choose count, share, mean, percent or least")
    return (kinds[metric.kind]() if n else Interval(NAN, NAN, NAN)), n


def difference(pairs: pd.DataFrame, metric: Metric, seed: int = 0) -> tuple[Interval, int]:
    """Second less first of a metric, rows resampled as pairs: columns ``_a`` and ``_b``."""
    if metric.kind == "percent":
        names = [name + end for end in ("_a", "_b") for name in (metric.column, metric.per)]
        rows = pairs[names].to_numpy(np.float64)
        return bootstrap_interval(rows, lambda r: _percent(r[..., 2:]) - _percent(r[..., :2]), seed), len(pairs)
    both = pairs[[metric.column + "_a", metric.column + "_b"]].astype(np.float64).dropna().to_numpy()
    judge = count_difference if metric.kind == "count" else paired_difference
    return judge(both[:, 0], both[:, 1], seed), len(both)


def summarise(
    table: pd.DataFrame,
    metrics: Sequence[Metric],
    by: Sequence[str],
    versus: tuple[str, Any, Any] | None = None,
    pair_on: Sequence[str] = (),
    seed: int = 0,
) -> pd.DataFrame:
    """Every metric of every group, with intervals.

    Args:
        table: one line per game, encounter, boat.
        metrics: what to summarise; those whose column the table lacks are left out.
        by: columns that make the groups, in the order they come.
        versus: column, first value, second value: also the paired difference, second less first, as ``difference``.
        pair_on: columns by which rows of the two are pairs; rows are resampled in their order.
        seed: of the bootstrap.

    Returns:
        Columns ``by``, the column of ``versus``, ``metric``, ``value``, ``low``, ``high``, ``n``. A metric of the
        shield has no line where no row has it.
    """
    import pandas as pd

    lines = []
    for key, group in table.groupby(list(by), sort=False):
        group = group.sort_values(list(pair_on), kind="stable") if pair_on else group
        parts = {None: group} if versus is None else {v: group[group[versus[0]] == v] for v in versus[1:]}
        both = _pairs(parts, versus, pair_on) if versus else None
        for metric in metrics:
            if metric.column not in group:
                continue
            found = [(value, *figure(part, metric, seed)) for value, part in parts.items() if len(part)]
            there = all(n for _, _, n in found) or not metric.of_shield
            if both is not None and len(both) and metric.paired and there:
                found.append((DIFFERENCE, *difference(both, metric, seed)))
            for value, interval, n in found:
                if n or not metric.of_shield:
                    lines.append((*key, value, metric.key, interval.value, interval.low, interval.high, n))
    state = versus[0] if versus else "all"
    return pd.DataFrame(lines, columns=[*by, state, "metric", "value", "low", "high", "n"])


def _pairs(parts: Mapping[Any, pd.DataFrame], versus: tuple[str, Any, Any], pair_on: Sequence[str]) -> pd.DataFrame:
    first, second = (parts[value].drop_duplicates(list(pair_on), keep="last") for value in versus[1:])
    return first.merge(second, on=list(pair_on), suffixes=("_a", "_b"))


def _values(table: pd.DataFrame, metric: Metric) -> NDArray[np.float64]:
    """The numbers there are, (n,), or (n, 2) part and whole."""
    if metric.kind == "percent":
        both = table[[metric.column, metric.per]].astype(np.float64).dropna().to_numpy()
        return both if both[:, 1].any() else both[:0]
    return table[metric.column].astype(np.float64).dropna().to_numpy()


def _percent(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """First of the totals of two columns, % of the second."""
    totals = rows.sum(axis=-2)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(100.0 * totals[..., 0] / totals[..., 1])
