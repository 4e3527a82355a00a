"""Rankings of a tournament: standings, what the shield costs each team, the paper's ranks; their tables.

All of it is made of `seats`: a line per team and game. The paper is that of the first International Maritime Capture
the Flag Competition (2024).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from steerclear.shield.jit import Array

from .play.spec import SIDES
from .statistics import bootstrap_interval, mean_interval
from .tables import Table, interval_text, number_text

if TYPE_CHECKING:
    import pandas as pd

Row = Mapping[str, Any]
RESAMPLES = 2000
FIGURES = tuple(["captures", "grabs", "tags", "collisions", "hits_teammate", "hits_opponent"]) + tuple(
    f"{name}_against" for name in ("captures", "grabs", "tags")
)
CAPTURES, COLLISIONS, AGAINST = (FIGURES.index(name) for name in ("captures", "collisions", "captures_against"))
GAME = ("blue", "red", "repetition")
KEPT = 0.95
"""Share of its own net captures that a shielded team is to keep."""


PAPER = {
    "lucas": (1, 4),
    "ohto": (2, 12),
    "alamer": (2, 12),
    "meo": (3, 17),
    "chao": (4, 11),
    "richley": (5, 109),
    "jin": (6, 226),
    "crowley": (7, 183),
    "leprell": (8, 153),
}
"""Rank and collisions of the paper's Table 3 (with the penalty), by the name that its team has here.

The learned ones (richley, jin, crowley, leprell) count as soon as somebody enters them under these names.
"""
SCRIPTED = ("lucas", "ohto", "alamer", "meo", "chao")


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
    score = np.round(score_of(figures, penalty), 9)
    return np.asarray(1 + (score[..., None, :] > score[..., :, None]).sum(axis=-1))


def standings(totals: Totals, penalty: float, seed: int) -> list[dict[str, Any]]:
    """The table of one state, best first by the penalty; limits are None with fewer than two repetitions."""
    sums = totals.sums()
    found: dict[str, Any] = {
        "rank": ranks_of(sums, penalty).astype(int),
        "score": score_of(sums, penalty),
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
    return {
        "state": state,
        "games": len(mine) // 2,
        "repetitions": totals.repetitions,
        "standings": standings(totals, penalty, seed) if playing else [],
    }


def prices(table: pd.DataFrame, teams: Sequence[str], off: str, on: str, seed: int) -> list[dict[str, Any]]:
    """What the shield costs each team and what it brings, from games (`seats`) of two states from the same seeds.

    Returns:
        Per team the figures of ``prices[]`` in `docs.KEYS`.
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
    return {
        "team": team,
        "games": len(pairs),
        **means,
        **{name: asdict(mean_interval(values, seed)) for name, values in change.items()},
        "kept": keeps(net) if captured else None,
        "margin": asdict(bootstrap_interval(net, _margin, seed)),
        "judged": len(judged),
        "avoidable": int(judged["avoidable_on"].sum()) if len(judged) else None,
    }


def keeps(net: Array) -> bool | None:
    """Whether net captures (games, [off, on]) stay at 95 % or more of those without; a loss may grow by 5 %."""
    return None if len(net) == 0 else bool(_margin(np.asarray(net, dtype=np.float64)) >= -1e-9)


def _margin(net: Array) -> Array:
    """Net captures per game above what is to be kept, from (..., games, [off, on])."""
    off, on = np.moveaxis(net.mean(axis=-2), -1, 0)
    return np.asarray(on - off + (1.0 - KEPT) * np.abs(off))


def shown(state: str) -> str:
    """A state in words."""
    return {"off": "no shields", "all": "all shielded"}.get(state, f"{state} shielded")


def all_tables(results: Mapping[str, Any]) -> list[Table]:
    """What the shield costs each team and brings it, then the standings of each state beside the paper's."""
    tables = []
    if results["prices"]:
        rows = [
            [
                one["team"],
                *(number_text(one[f"net_captures_{state}"]) for state in ("off", "on")),
                interval_text(one["net_captures"]),
                kept_words(one),
                *(number_text(one[f"hits_{state}"]) for state in ("off", "on")),
                interval_text(one["hits"]),
                "-" if one["avoidable"] is None else f"{one['avoidable']} in {one['judged']}",
            ]
            for one in results["prices"]
        ]
        heads = ["team", "net captures", "shielded", "change, paired", "keeps 95 %"]
        heads += ["hits", "shielded", "change, paired", "avoidable, in judged games"]
        tables.append(Table("Price of safety, a game", heads, rows, numbers=False))
    figures = ("rank", "score", "collisions", "net_captures")
    heads = ["team", "rank", "score", "collisions", "net captures", "hits of mates", "of opponents"]
    heads += ["paper: rank", "collisions"]
    for state in results["states"]:
        rows = [
            [
                one["team"],
                *(interval_text({part: one[name + end] for part, end in _PARTS.items()}) for name in figures),
                *(number_text(float(one[f"hits_{kind}"])) for kind in ("teammate", "opponent")),
                *map(str, PAPER.get(one["team"], ("-", "-"))),
            ]
            for one in state["standings"]
        ]
        if rows:
            tables.append(Table(f"Standings, {shown(state['state'])}", heads, rows, numbers=False))
    return tables


_PARTS = {"value": "", "low": "_low", "high": "_high"}


def kept_words(one: Row) -> str:
    """Whether net captures are kept; "unsure" where too few, but the interval reaches what is to be kept."""
    if one["kept"] is not False:
        return "yes" if one["kept"] else "-"
    high = one["margin"]["high"]
    return "unsure" if high is not None and high >= 0.0 else "no"
