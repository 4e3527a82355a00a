"""Rankings of a tournament: standings, who beats whom, what the shield costs each team, and the paper's ranks.

All of it is made of `seats`: a line per team and game. The paper is that of the first International Maritime Capture
the Flag Competition (2024).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import permutations
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from steerclear.shield.jit import Array

from .play.spec import SIDES
from .statistics import bootstrap_interval, count_interval, mean_interval, paired_ratio

if TYPE_CHECKING:
    import pandas as pd

Row = Mapping[str, Any]
RESAMPLES = 2000
WEIGHTS = (0.25, 0.025)
"""Both weights of a collision: the one that fits the paper's Table 3, and the one its rules name."""
FIGURES = tuple(["captures", "grabs", "tags", "collisions", "hits_teammate", "hits_opponent"]) + tuple(
    f"{name}_against" for name in ("captures", "grabs", "tags")
)
CAPTURES, COLLISIONS, AGAINST = (FIGURES.index(name) for name in ("captures", "collisions", "captures_against"))
GAME = ("blue", "red", "repetition")
POPULATION = 50
STRENGTHS = (0.1, 1.0, 10.0)
"""Selection strengths that are looked at: a ranking that holds at all of them is no artefact of one."""
KEPT = 0.95
"""Share of its own net captures that a shielded team is to keep."""


class PaperRow(NamedTuple):
    """A team of the paper: ours by that name, its figures in Table 3 (with the penalty) and Table 4 (without)."""

    team: str
    entrant: str
    rank: int
    score: float
    collisions: int
    rank_free: int
    captures: int


PAPER = (
    PaperRow("Lucas-QMU", "lucas", 1, -1.0, 4, 6, 0),
    PaperRow("Ohto-Indep", "ohto", 2, -3.0, 12, 6, 0),
    PaperRow("Alamer-EJUST", "alamer", 2, -3.0, 12, 6, 0),
    PaperRow("Meo-Indep", "meo", 3, -4.25, 17, 6, 0),
    PaperRow("Chao-NIWC-PAC", "chao", 4, -6.75, 11, 4, 4),
    PaperRow("Richley-NIWC-ATL", "richley", 5, -10.0, 109, 3, 15),
    PaperRow("Jin-Indep", "jin", 6, -10.25, 226, 1, 31),
    PaperRow("Crowley-BU-LL", "crowley", 7, -15.5, 183, 2, 19),
    PaperRow("Leprell-USMA", "leprell", 8, -49.5, 153, 5, 0),
)
"""The learned ones (richley, jin, crowley, leprell) count here as soon as somebody enters them under these names."""
SCRIPTED = ("lucas", "ohto", "alamer", "meo", "chao")


def paper_row(name: str) -> PaperRow | None:
    """The paper's row of one of our teams, None where it has none."""
    return next((row for row in PAPER if row.entrant == name), None)


def seats(rows: Sequence[Row]) -> pd.DataFrame:
    """Both sides of each game as a line each: what the side did, under its plain name.

    Beside the columns of rows: ``team``, ``side``, ``*_against`` of the other side, ``net_captures``, ``hits``,
    ``avoidable`` (NaN where not judged).
    """
    import pandas as pd

    lines = []
    for row in rows:
        for own, other in zip(SIDES, SIDES[::-1], strict=True):
            line = {name: value for name, value in row.items() if not name.startswith(("blue_", "red_"))}
            line |= {name.removeprefix(f"{own}_"): row[name] for name in row if name.startswith(f"{own}_")}
            line |= {f"{name}_against": row.get(f"{other}_{name}") for name in ("captures", "grabs", "tags")}
            lines.append({"team": row[own], "side": own, **line})
    table = pd.DataFrame(lines)
    if len(table):
        table["net_captures"] = table["captures"] - table["captures_against"]
        for name, parts in (("hits", "hits_{}"), ("avoidable", "avoidable_{}")):
            columns = [parts.format(kind) for kind in ("teammate", "opponent")]
            if set(columns) <= set(table):
                table[name] = table[columns].astype(float).sum(axis=1, skipna=False)
    return table


@dataclass(frozen=True)
class Totals:
    """What teams did in the games of one state, arranged for resampling.

    Attributes:
        teams: names, in order.
        values: (strata, repetitions, teams, figures): a stratum is a pair on given sides; the figures are `FIGURES`;
            zero for teams that are not in it.
        strata: blue and red of each stratum.
    """

    teams: tuple[str, ...]
    values: Array
    strata: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, table: pd.DataFrame, teams: Sequence[str]) -> Totals:
        """Arrange `seats`; only repetitions that all pairs have played count."""
        if table.empty:
            return cls(tuple(teams), np.zeros((0, 0, len(teams), len(FIGURES))), ())
        strata = list(dict.fromkeys(zip(table["blue"], table["red"], strict=True)))
        played = table.groupby(["blue", "red"])["repetition"].agg(set)
        common = sorted(set.intersection(*played))
        values = np.zeros((len(strata), len(common), len(teams), len(FIGURES)))
        for line in table[table["repetition"].isin(common)].to_dict("records"):
            place = strata.index((line["blue"], line["red"])), common.index(line["repetition"])
            values[(*place, list(teams).index(line["team"]))] = [line[name] for name in FIGURES]
        return cls(tuple(teams), values, tuple(strata))

    @property
    def repetitions(self) -> int:
        """Repetitions that all pairs have played."""
        return int(self.values.shape[1])

    def sums(self) -> Array:
        """(teams, figures) per double round robin."""
        return np.asarray(self.values.sum(axis=(0, 1)) / max(self.repetitions, 1))

    def resampled(self, seed: int, resamples: int = RESAMPLES) -> Array:
        """(resamples, teams, figures) of a bootstrap that draws repetitions anew within each pair and side."""
        rng, repetitions = np.random.default_rng([seed, 0x7AB1E]), self.repetitions
        total = np.zeros((resamples, *self.values.shape[2:]))
        for stratum in self.values:
            picks = rng.integers(0, repetitions, size=(resamples, repetitions))
            total += stratum[picks].sum(axis=1)
        return np.asarray(total / repetitions)


def score_of(figures: Array, penalty: float) -> Array:
    """Primary score of (..., figures): captures for minus against, minus the penalty for collisions."""
    return np.asarray(figures[..., CAPTURES] - figures[..., AGAINST] - penalty * figures[..., COLLISIONS])


def ranks_of(figures: Array, penalty: float) -> Array:
    """(..., teams) ranks by score from (..., teams, figures); equal scores share the best rank, as in the paper."""
    from scipy.stats import rankdata  # importing it takes half a second

    return np.asarray(rankdata(-np.round(score_of(figures, penalty), 9), method="min", axis=-1))


def standings(totals: Totals, penalty: float, seed: int) -> list[dict[str, Any]]:
    """The table of one state, best first by the penalty; limits are None with fewer than two repetitions."""
    sums = totals.sums()
    found: dict[str, Any] = {
        "rank": ranks_of(sums, penalty).astype(int),
        "score": score_of(sums, penalty),
        **{f"score_{weight:g}": score_of(sums, weight) for weight in WEIGHTS},
        "net_captures": score_of(sums, 0.0),
        "rank_free": ranks_of(sums, 0.0).astype(int),
        **dict(zip(FIGURES, sums.T, strict=True)),
    }
    drawn = totals.resampled(seed) if totals.repetitions > 1 else None
    for name, measure in (
        ("rank", lambda figures: ranks_of(figures, penalty)),
        ("score", lambda figures: score_of(figures, penalty)),
        ("net_captures", lambda figures: score_of(figures, 0.0)),
        ("collisions", lambda figures: figures[..., COLLISIONS]),
    ):
        low, high = (None, None) if drawn is None else np.quantile(measure(drawn), [0.025, 0.975], axis=0)
        found |= {f"{name}_low": low, f"{name}_high": high}
    lines = [
        {"team": team, **{name: None if values is None else values[k].item() for name, values in found.items()}}
        for k, team in enumerate(totals.teams)
    ]
    return sorted(lines, key=lambda line: (line["rank"], line["team"]))


def state_results(table: pd.DataFrame, state: str, teams: Sequence[str], penalty: float, seed: int) -> dict[str, Any]:
    """Tables of one state, from `seats` of the final."""
    mine = table[table["state"] == state] if len(table) else table
    playing = [team for team in teams if len(mine) and (mine["team"] == team).any()]
    totals = Totals.of(mine, playing)
    wins = win_matrix(totals, penalty)
    return {
        "state": state,
        "games": len(mine) // 2,
        "repetitions": totals.repetitions,
        "standings": standings(totals, penalty, seed) if playing else [],
        "teams": playing,
        "wins": wins.tolist(),
        "alpha_rank": {f"{k:g}": alpha_rank(wins, k).tolist() for k in STRENGTHS} if playing else {},
        "cycles": cycles(wins, playing),
    }


def qualifying_table(
    table: pd.DataFrame, states: Sequence[str], teams: Sequence[str], penalty: float
) -> list[dict[str, Any]]:
    """Mean primary score per game of each team in each state, best first; each is scored by its own games alone."""
    found: list[dict[str, Any]] = []
    own = table[table["examined"] == table["side"]] if len(table) else table
    for state in states:
        lines = []
        for team in teams if len(own) else ():
            games = own[(own["state"] == state) & (own["team"] == team)]
            if len(games):
                score = float((games["net_captures"] - penalty * games["collisions"]).mean())
                line = {"team": team, "state": state, "games": len(games), "score": score}
                lines.append(line | {"captures": int(games["captures"].sum())})
        found += sorted(lines, key=lambda line: -line["score"])
    return found


def win_matrix(totals: Totals, penalty: float) -> Array:
    """(teams, teams) share of their games that the row's team won against the column's, a draw counting half.

    NaN on the diagonal and for pairs that have not met.
    """
    n = len(totals.teams)
    wins, games = np.zeros((n, n)), np.zeros((n, n))
    for pair, values in zip(totals.strata, totals.values, strict=True):
        i, j = (totals.teams.index(name) for name in pair)
        scored = values[..., CAPTURES] - penalty * values[..., COLLISIONS]
        lead = scored[:, i] - scored[:, j]
        won = float((lead > 1e-9).sum() + 0.5 * (np.abs(lead) <= 1e-9).sum())
        wins[[i, j], [j, i]] += won, len(lead) - won
        games[[i, j], [j, i]] += len(lead)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(games > 0, wins / games, np.nan))


def alpha_rank(wins: Array, strength: float, population: int = POPULATION) -> Array:
    """Share of time that evolving players spend on each team (Omidshafiei et al. 2019, arXiv 1903.01373).

    One population whose members all play one team but for a mutant; the mutant takes over with the Moran process'
    fixation probability of its payoff against the residents', and the chain's stationary distribution is the ranking.

    Args:
        wins: (n, n) payoffs of the row against the column.
        strength: of selection, per unit of payoff.
        population: members.
    """
    n = len(wins)
    payoffs = np.where(np.isfinite(wins), wins, 0.5)
    chain = np.zeros((n, n))
    for resident, mutant in permutations(range(n), 2):
        gain = payoffs[mutant, resident] - payoffs[resident, mutant]
        chain[resident, mutant] = _fixation(strength * gain, population) / (n - 1)
    np.fill_diagonal(chain, 1.0 - chain.sum(axis=1))
    # the stationary distribution: pi (P - I) = 0 with shares that add up to 1
    system = np.vstack([chain.T - np.eye(n), np.ones(n)])
    found = np.linalg.lstsq(system, np.r_[np.zeros(n), 1.0], rcond=None)[0]
    return np.asarray(np.clip(found, 0.0, None) / np.clip(found, 0.0, None).sum())


def _fixation(advantage: float, population: int) -> float:
    """Probability that a mutant takes over; ``1 / population`` without an advantage."""
    if abs(advantage) < 1e-9:
        return 1.0 / population
    return float(np.expm1(-advantage) / np.expm1(-population * advantage)) if advantage > -14.0 else 0.0


def cycles(wins: Array, teams: Sequence[str]) -> list[str]:
    """Three teams each of which beats the next."""
    return [
        f"{teams[i]} beats {teams[j]} beats {teams[k]} beats {teams[i]}"
        for i, j, k in permutations(range(len(teams)), 3)
        if i == min(i, j, k) and wins[i, j] > 0.5 and wins[j, k] > 0.5 and wins[k, i] > 0.5
    ]


def prices(table: pd.DataFrame, teams: Sequence[str], off: str, on: str, seed: int) -> list[dict[str, Any]]:
    """What the shield costs each team and what it brings, from games (`seats`) of two states from the same seeds.

    Returns:
        Per team the figures of ``prices[]`` in `docs_keys.KEYS`.
    """
    if table.empty:
        return []
    keys = [*GAME, "side", "team"]
    pairs = table[table["state"] == off].merge(table[table["state"] == on], on=keys, suffixes=("_off", "_on"))
    pairs = pairs.sort_values([*GAME, "side"])
    return [_price(team, pairs[pairs["team"] == team], seed) for team in teams]


def _price(team: str, pairs: pd.DataFrame, seed: int) -> dict[str, Any]:
    net = pairs[["net_captures_off", "net_captures_on"]].to_numpy(np.float64)
    change = {name: pairs[f"{name}_on"] - pairs[f"{name}_off"] for name in ("net_captures", "hits")}
    columns = [f"{name}_{state}" for name in change for state in ("off", "on")]
    means = {name: float(pairs[name].mean()) if len(pairs) else None for name in columns}
    captured = bool(net.any() or pairs[["captures_off", "captures_on"]].any(axis=None))
    judged = pairs.dropna(subset=["avoidable_on"])
    found, hits = int(judged["avoidable_on"].sum()), int(judged["hits_on"].sum())
    return {
        "team": team,
        "games": len(pairs),
        **means,
        **{name: asdict(mean_interval(values, seed)) for name, values in change.items()},
        "captures_kept": asdict(paired_ratio(pairs["captures_off"], pairs["captures_on"], seed)),
        "kept": keeps(net) if captured else None,
        "margin": asdict(bootstrap_interval(net, _margin, seed)),
        "judged": len(judged),
        "avoidable": found if len(judged) else None,
        "avoidable_per_game": asdict(count_interval(found, len(judged))) if len(judged) else None,
        "avoidable_share": found / hits if hits else None,
    }


def keeps(net: Array) -> bool | None:
    """Whether net captures (games, [off, on]) stay at 95 % or more of those without; a loss may grow by 5 %."""
    return None if len(net) == 0 else bool(_margin(np.asarray(net, dtype=np.float64)) >= -1e-9)


def _margin(net: Array) -> Array:
    """Net captures per game above what is to be kept, from (..., games, [off, on])."""
    off, on = np.moveaxis(net.mean(axis=-2), -1, 0)
    return np.asarray(on - off + (1.0 - KEPT) * np.abs(off))
