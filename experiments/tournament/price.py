"""What the shield costs each team and what it brings, from games that were played off and on from the same seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..play.spec import SIDES
from ..statistics import Interval, bootstrap_interval, count_interval, mean_interval, paired_ratio

Row = Mapping[str, Any]
KEPT = 0.95
"""Share of its own net captures that a shielded team is to keep."""


def prices(rows: Sequence[Row], teams: Sequence[str], off: str, on: str, seed: int) -> list[dict[str, Any]]:
    """Compare two states team by team, per game.

    Args:
        rows: games of all states.
        teams: names.
        off: the state without shields.
        on: the state with them.
        seed: of the bootstrap.

    Returns:
        Per team the figures `keys.TOURNAMENT` describes under ``prices[]``.
    """
    games = {state: {_number(row): row for row in rows if row["state"] == state} for state in (off, on)}
    both = sorted(set(games[off]) & set(games[on]))
    return [_price(team, [(games[off][k], games[on][k]) for k in both], seed) for team in teams]


def _price(team: str, pairs: Sequence[tuple[Row, Row]], seed: int) -> dict[str, Any]:
    seen = [(before, after, side) for before, after in pairs for side in SIDES if before[side] == team]
    net = np.array([(_net(before, side), _net(after, side)) for before, after, side in seen]).reshape(-1, 2)
    hits = np.array([(_hits(before, side), _hits(after, side)) for before, after, side in seen]).reshape(-1, 2)
    captures = np.array([(b[f"{s}_captures"], a[f"{s}_captures"]) for b, a, s in seen]).reshape(-1, 2)
    return {
        "team": team,
        "games": len(seen),
        "net_captures_off": float(net[:, 0].mean()) if len(seen) else None,
        "net_captures_on": float(net[:, 1].mean()) if len(seen) else None,
        "net_captures": _plain(mean_interval(net[:, 1] - net[:, 0], seed)),
        "captures_kept": _plain(paired_ratio(captures[:, 0], captures[:, 1], seed)),
        "hits_off": float(hits[:, 0].mean()) if len(seen) else None,
        "hits_on": float(hits[:, 1].mean()) if len(seen) else None,
        "hits": _plain(mean_interval(hits[:, 1] - hits[:, 0], seed)),
        "kept": keeps(net) if net.any() or captures.any() else None,
        "margin": _plain(bootstrap_interval(net.astype(np.float64), _margin, seed)),
        **avoidable([(after, side) for _, after, side in seen]),
    }


def keeps(net: Any) -> bool | None:
    """Whether net captures stay at 95 % or more of those without (a loss may grow by 5 %); None without games."""
    return None if len(net) == 0 else bool(_margin(np.asarray(net, dtype=np.float64)) >= -1e-9)


def _margin(net: Any) -> Any:
    """Net captures per game above what is to be kept, from (..., games, [off, on])."""
    off, on = np.moveaxis(net.mean(axis=-2), -1, 0)
    return on - off + (1.0 - KEPT) * np.abs(off)


def avoidable(seen: Sequence[tuple[Row, str]]) -> dict[str, Any]:
    """Avoidable hits over judged games: total and per game, and their share of all hits."""
    judged = [(row, side) for row, side in seen if row[f"{side}_avoidable_opponent"] is not None]
    found = sum(int(row[f"{s}_avoidable_{kind}"]) for row, s in judged for kind in ("teammate", "opponent"))
    hits = sum(_hits(row, side) for row, side in judged)
    rate = count_interval(found, len(judged)) if judged else None
    return {
        "judged": len(judged),
        "avoidable": found if judged else None,
        "avoidable_per_game": None if rate is None else _plain(rate),
        "avoidable_share": found / hits if hits else None,
    }


def _number(row: Row) -> tuple[str, str, int]:
    return row["blue"], row["red"], row["repetition"]


def _net(row: Row, side: str) -> int:
    other = SIDES[1 - SIDES.index(side)]
    return int(row[f"{side}_captures"]) - int(row[f"{other}_captures"])


def _hits(row: Row, side: str) -> int:
    return int(row[f"{side}_hits_teammate"]) + int(row[f"{side}_hits_opponent"])


def _plain(interval: Interval) -> dict[str, float]:
    return {"value": interval.value, "low": interval.low, "high": interval.high}
