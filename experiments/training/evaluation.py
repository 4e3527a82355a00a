"""Games of a learned network against an opponent, many at once, counted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from steerclear.policies.entrants.learned import batch_of
from steerclear.policies.entrants.learned.network import Network
from steerclear.shield.wrappers.tallies import EVENTS, Tallies, changed_by

from ..statistics import mean_interval
from .config import Learning
from .env import core_of, shield_of
from .opponents import opponent_of

FIGURES = ("net", *EVENTS)


def play_games(
    config: Learning, own: Any, opponent: str, games: int, seed: int, shielded: bool, side: str = "blue"
) -> list[dict[str, float]]:
    """One row per game: captures for less against (``net``) and the counts of `EVENTS`, hits over the whole team.

    Args:
        config: whose rules are played.
        own: network, batch policy or name of one.
        opponent: name of the opponent.
        games: how many.
        seed: of starts and policies.
        shielded: the team has the config's shield.
        side: colour of the team.
    """
    core = core_of(config, games, seed)
    team = 0 if side == "blue" else 1
    core.reset(seed=seed)
    ours = batch_of(own) if isinstance(own, Network) else opponent_of(own) if isinstance(own, str) else own
    foe = opponent_of(opponent)
    ours.reset(core, team, seed)
    foe.reset(core, 1 - team, seed + 1)
    shield = shield_of(config, core, side) if shielded else None
    return _played(core, ours, foe, team, shield)


def _played(core: Any, ours: Any, foe: Any, team: int, shield: Any) -> list[dict[str, float]]:
    boats, others = np.flatnonzero(core.team == team), np.flatnonzero(core.team != team)
    tallies = Tallies(core, team, boats)
    command_filter = None if shield is None else shield.filter_for(team)
    going = np.ones(core.n_games, np.bool_)
    commands = np.zeros((core.n_games, core.n_boats, 2))
    shape = (core.n_games, len(boats))
    while going.any():
        commands[:, boats] = ours.act(core, team)
        commands[:, others] = foe.act(core, 1 - team)
        core.step(commands, command_filter)
        tallies.count(going, changed_by(shield, boats, shape))
        going &= ~(core.terminated | core.truncated)
    return _rows(tallies.step)


def _rows(counts: Any) -> list[dict[str, float]]:
    team = counts.mean(axis=2)
    team[6:] = counts[6:].sum(axis=2)
    rows = [dict(zip(EVENTS, column.tolist(), strict=True)) for column in team.T]
    return [{"net": row["captures"] - row["captures_against"], **row} for row in rows]


def summary_of(rows: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    """Means per game, and the 95 % interval of the net captures."""
    if not rows:
        return {"games": 0}
    found: dict[str, Any] = {name: float(np.mean([row[name] for row in rows])) for name in FIGURES}
    interval = mean_interval([row["net"] for row in rows])
    for name, limit in (("net_low", interval.low), ("net_high", interval.high)):
        found[name] = limit if np.isfinite(limit) else None  # none where all games ended alike
    return {"games": len(rows), **found}


def evaluation_of(config: Learning, network: Network) -> dict[str, Any]:
    """Summaries by opponent of the games that a training's config asks for."""
    wanted, shielded = config.evaluation, config.shield != "none"
    return {
        name: summary_of(play_games(config, network, name, wanted.games, wanted.seed, shielded))
        for name in wanted.opponents
    }
