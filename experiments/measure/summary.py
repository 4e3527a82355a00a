"""From the rows of many games to one summary per pairing, every figure with its 95 % interval."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .statistics import (
    Interval,
    bootstrap_interval,
    count_difference,
    count_interval,
    mean_interval,
    paired_difference,
    share_interval,
)
from .tally import breach_column
from .verdicts import summarise_verdicts

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Metric:
    """A figure of a pairing.

    Attributes:
        name: key in results.json.
        label: words of the tables.
        interval: from the rows of games to the figure.
        per_game: from one row to the number whose paired difference is meaningful; None where there is none.
        only_on: it describes the shield, so that there is nothing to show for games without.
        counted: it is a number of events per game.
    """

    name: str
    label: str
    interval: Callable[[Sequence[Row]], Interval]
    per_game: Callable[[Row], float | None] | None = None
    only_on: bool = False
    counted: bool = False


def summarise(rows: Sequence[Row], radii_m: Sequence[float], seed: int = 0) -> dict[str, Any]:
    """Summarise one pairing.

    Args:
        rows: its games; with a shield or without by ``shielded``, paired by ``game``.
        radii_m: radii at which breaches were counted.
        seed: of the bootstrap.

    Returns:
        JSON-ready: ``pairing``, ``games_off``, ``games_on``, ``metrics`` (per name ``label``, ``off``, ``on``,
        ``difference``, each with value, low, high; absent where there is none), ``verdicts`` (as
        `verdicts.summarise_verdicts`), ``reasons``, ``policy_failures``.
    """
    off, on = (by_game(rows, shielded) for shielded in (False, True))
    metrics = {m.name: _figures(m, off, on, seed) for m in metrics_of(radii_m, seed)}
    return {
        "pairing": rows[0]["pairing"],
        "games_off": len(off),
        "games_on": len(on),
        "metrics": metrics,
        "verdicts": summarise_verdicts([*off.values(), *on.values()]),
        "reasons": _reasons(on.values()),
        "policy_failures": sum(int(row["policy_failures"]) for row in rows),
    }


def by_game(rows: Sequence[Row], shielded: bool) -> dict[int, Row]:
    """Return the rows with or without a shield by game number, in order."""
    chosen = {int(row["game"]): row for row in rows if bool(row["shielded"]) is shielded}
    return dict(sorted(chosen.items()))


def metrics_of(radii_m: Sequence[float], seed: int = 0) -> list[Metric]:
    """List every figure of a pairing, in the order of the tables."""
    counts = [
        ("captures", "captures"),
        ("captures_against", "captures against"),
    ]
    more = [
        ("grabs", "grabs"),
        ("tags", "tags"),
        ("tags_against", "times tagged"),
        *((breach_column("teammate", r), f"hits mates {r:g} m") for r in radii_m),
        *((breach_column("opponent", r), f"hits opp. {r:g} m") for r in radii_m),
    ]
    return [
        *(_counted(name, label) for name, label in counts),
        Metric("net_captures", "net of captures", partial(_net, seed), _net_captures),
        *(_counted(name, label) for name, label in more),
        Metric("clean_games", "games without hit", partial(_clean_games, min(radii_m))),
        Metric("closest_m", "closest, mean m", partial(_mean, "closest_m", seed), partial(_number, "closest_m")),
        Metric("closest_of_all_m", "closest of all, m", _closest_of_all),
        Metric("changed_share", "steps changed, %", partial(_changed_percent, seed), only_on=True),
        *_shield_means(seed),
        _counted("deadlocks", "deadlocks"),
        _averaged("reversals_per_boat_minute", "reversals/min", seed),
        _counted("collisions", "collisions scored"),
        _averaged("primary", "primary score", seed),
        _averaged("secondary", "secondary score", seed),
    ]


def _counted(name: str, label: str) -> Metric:
    return Metric(name, label, partial(_count, name), partial(_number, name), counted=True)


def _averaged(name: str, label: str, seed: int) -> Metric:
    return Metric(name, label, partial(_mean, name, seed), partial(_number, name))


def _shield_means(seed: int) -> list[Metric]:
    return [
        Metric(name, label, partial(_mean, name, seed), only_on=True)
        for name, label in (
            ("mean_heading_change_deg", "mean change, deg"),
            ("mean_speed_change_mps", "mean change, m/s"),
            ("decision_p50_us", "decision p50, us"),
            ("decision_p99_us", "decision p99, us"),
        )
    ]


def _figures(metric: Metric, off: Mapping[int, Row], on: Mapping[int, Row], seed: int) -> dict[str, Any]:
    figures: dict[str, Any] = {"label": metric.label}
    if off and not metric.only_on:
        figures["off"] = asdict(metric.interval(list(off.values())))
    if on:
        figures["on"] = asdict(metric.interval(list(on.values())))
    both = sorted(set(off) & set(on))
    if metric.per_game is not None and both:
        pairs = [(metric.per_game(off[game]), metric.per_game(on[game])) for game in both]
        values = np.array([pair for pair in pairs if None not in pair], dtype=np.float64).reshape(-1, 2)
        difference = count_difference if metric.counted else paired_difference
        figures["difference"] = asdict(difference(values[:, 0], values[:, 1], seed))
    return figures


def _number(name: str, row: Row) -> float | None:
    value = row.get(name)
    return None if value is None or value != value else float(value)


def _present(name: str, rows: Sequence[Row]) -> list[float]:
    return [value for row in rows if (value := _number(name, row)) is not None]


def _net_captures(row: Row) -> float | None:
    """Captures less those of the other team."""
    own, other = _number("captures", row), _number("captures_against", row)
    return None if own is None or other is None else own - other


def _net(seed: int, rows: Sequence[Row]) -> Interval:
    return mean_interval([value for row in rows if (value := _net_captures(row)) is not None], seed)


def _count(name: str, rows: Sequence[Row]) -> Interval:
    """Mean per game over the rows that have the column: an older version's may lack it."""
    counts, nan = _present(name, rows), float("nan")
    return count_interval(int(sum(counts)), len(counts)) if counts else Interval(nan, nan, nan)


def _mean(name: str, seed: int, rows: Sequence[Row]) -> Interval:
    return mean_interval(_present(name, rows), seed)


def _clean_games(radius_m: float, rows: Sequence[Row]) -> Interval:
    columns = [breach_column(kind, radius_m) for kind in ("teammate", "opponent")]
    return share_interval(sum(not any(row[name] for name in columns) for row in rows), len(rows))


def _closest_of_all(rows: Sequence[Row]) -> Interval:
    nan = float("nan")
    return Interval(min(_present("closest_m", rows), default=nan), nan, nan)


def _changed_percent(seed: int, rows: Sequence[Row]) -> Interval:
    """Percent of all boats' steps, games resampled: steps of one game are too alike to count as trials."""
    table = np.array([(row["changed_steps"], row["covered_steps"]) for row in rows], dtype=np.float64)
    return bootstrap_interval(table, _percent_of_totals, seed)


def _percent_of_totals(table: NDArray[np.float64]) -> NDArray[np.float64]:
    totals = table.sum(axis=-2)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(100.0 * totals[..., 0] / totals[..., 1])


def _reasons(rows: Any) -> dict[str, int]:
    totals: dict[str, int] = {}
    for row in rows:
        for name, value in row.items():
            if name.startswith("reason_") and value is not None:
                totals[name.removeprefix("reason_")] = totals.get(name.removeprefix("reason_"), 0) + int(value)
    return totals
