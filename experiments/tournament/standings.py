"""Standings of a tournament: what each team did per double round robin, its rank, and how sure that is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ..play.spec import SIDES

Row = Mapping[str, Any]
RESAMPLES = 2000
WEIGHTS = (0.25, 0.025)
"""Both weights of a collision: the one that fits the paper's Table 3, and the one its rules name."""
COUNTED = ("captures", "grabs", "tags", "collisions", "hits_teammate", "hits_opponent")
FIGURES = (*COUNTED, "captures_against", "grabs_against", "tags_against")


@dataclass(frozen=True)
class Totals:
    """What teams did, game by game, arranged for resampling.

    Attributes:
        teams: names, in order.
        values: (strata, repetitions, teams, figures): a stratum is a pair on given sides; the figures are `FIGURES`;
            zero for teams that are not in it.
        strata: blue and red of each stratum.
    """

    teams: tuple[str, ...]
    values: NDArray[np.float64]
    strata: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, rows: Sequence[Row], teams: Sequence[str]) -> Totals:
        """Arrange the games of one state; only repetitions that all pairs have played count."""
        found: dict[tuple[str, str], dict[int, Row]] = {}
        for row in rows:
            found.setdefault((row["blue"], row["red"]), {})[row["repetition"]] = row
        common = sorted(set.intersection(*(set(games) for games in found.values()))) if found else []
        values = np.zeros((len(found), len(common), len(teams), len(FIGURES)))
        for s, (pair, games) in enumerate(found.items()):
            for r, repetition in enumerate(common):
                for name, own, other in zip(pair, SIDES, SIDES[::-1], strict=True):
                    values[s, r, list(teams).index(name)] = _figures(games[repetition], own, other)
        return cls(tuple(teams), values, tuple(found))

    def among(self, names: Sequence[str]) -> Totals:
        """The same, of the games among some teams alone."""
        kept = [s for s, pair in enumerate(self.strata) if set(pair) <= set(names)]
        return Totals(self.teams, self.values[kept], tuple(self.strata[s] for s in kept))

    @property
    def repetitions(self) -> int:
        """Repetitions that all pairs have played."""
        return int(self.values.shape[1])

    def sums(self) -> NDArray[np.float64]:
        """(teams, figures) per double round robin."""
        return np.asarray(self.values.sum(axis=(0, 1)) / max(self.repetitions, 1))

    def resampled(self, seed: int, resamples: int = RESAMPLES) -> NDArray[np.float64]:
        """(resamples, teams, figures) of a bootstrap that draws repetitions anew within each pair and side."""
        strata, repetitions = self.values.shape[:2]
        rng = np.random.default_rng([seed, 0x7AB1E])
        total = np.zeros((resamples, *self.values.shape[2:]))
        for stratum in range(strata):
            picks = rng.integers(0, repetitions, size=(resamples, repetitions))
            total += self.values[stratum][picks].sum(axis=1)
        return np.asarray(total / repetitions)


def _figures(row: Row, own: str, other: str) -> list[float]:
    against = ("captures", "grabs", "tags")
    return [*(float(row[f"{own}_{name}"]) for name in COUNTED), *(float(row[f"{other}_{name}"]) for name in against)]


def column(name: str) -> int:
    """Place of a figure."""
    return FIGURES.index(name)


def score_of(figures: NDArray[np.float64], penalty: float) -> NDArray[np.float64]:
    """Primary score of (..., figures): captures for minus against, minus the penalty for collisions."""
    net = figures[..., column("captures")] - figures[..., column("captures_against")]
    return np.asarray(net - penalty * figures[..., column("collisions")])


def ranks_of(figures: NDArray[np.float64], penalty: float) -> NDArray[np.float64]:
    """(..., teams) ranks by score from (..., teams, figures); equal scores share the best rank, as in the paper."""
    return np.asarray(stats.rankdata(-np.round(score_of(figures, penalty), 9), method="min", axis=-1))


def standings(totals: Totals, penalty: float, seed: int) -> list[dict[str, Any]]:
    """The table of one state, best first; limits are None with fewer than two repetitions.

    Args:
        totals: its games.
        penalty: weight that ranks.
        seed: of the bootstrap.
    """
    sums, ranks = totals.sums(), ranks_of(totals.sums(), penalty)
    drawn = totals.resampled(seed) if totals.repetitions > 1 else None
    table = [_line(totals, k, sums, ranks, drawn, penalty) for k in range(len(totals.teams))]
    return sorted(table, key=lambda line: (line["rank"], line["team"]))


def _line(
    totals: Totals,
    team: int,
    sums: NDArray[np.float64],
    ranks: NDArray[np.float64],
    drawn: NDArray[np.float64] | None,
    penalty: float,
) -> dict[str, Any]:
    own = sums[team]
    line = {
        "team": totals.teams[team],
        "rank": int(ranks[team]),
        "score": float(score_of(own, penalty)),
        **{f"score_{weight:g}": float(score_of(own, weight)) for weight in WEIGHTS},
        "net_captures": float(score_of(own, 0.0)),
        "rank_free": int(ranks_of(sums, 0.0)[team]),
        **{name: float(own[k]) for k, name in enumerate(FIGURES)},
    }
    for name, values in (
        ("rank", None if drawn is None else ranks_of(drawn, penalty)[:, team]),
        ("score", None if drawn is None else score_of(drawn[:, team], penalty)),
        ("net_captures", None if drawn is None else score_of(drawn[:, team], 0.0)),
        ("collisions", None if drawn is None else drawn[:, team, column("collisions")]),
    ):
        line[f"{name}_low"], line[f"{name}_high"] = limits(values)
    return line


def limits(values: NDArray[np.float64] | None) -> tuple[float | None, float | None]:
    """95 % limits of resampled values; None where there are none."""
    if values is None or not np.isfinite(values).any():
        return None, None
    low, high = np.quantile(values[np.isfinite(values)], [0.025, 0.975])
    return float(low), float(high)
