"""Time of one decision: on states of real games, and against the number of boats."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.shield import Shield, ShieldConfig

from .sampling import Question, answer_all, scene
from .timing import quantiles_us, time_calls

COUNTS = (6, 20, 100, 500)


def decide_times(games: Sequence[Sequence[Question]], config: ShieldConfig, repeats: int) -> dict[str, Any]:
    """Time `Shield.decide` on every question of real games, in their order.

    Returns:
        Quantiles in us for ``all`` decisions, those in which every command ``passes`` and those in which the shield
        ``intervenes``, each with the median of its repeats; ``decisions`` and ``share_intervening`` count them.
    """
    shield = Shield(config)
    changed = np.array([bool(answer.intervened.any()) for answer in answer_all(shield, games)])  # warms up, too
    runs = [_time_once(shield, games) for _ in range(repeats)]
    return {
        "decisions": len(changed),
        "share_intervening": float(changed.mean()),
        "all": quantiles_us(runs),
        "passes": quantiles_us([run[~changed] for run in runs]),
        "intervenes": quantiles_us([run[changed] for run in runs]),
    }


def _time_once(shield: Shield, games: Sequence[Sequence[Question]]) -> NDArray[np.float64]:
    times = []
    for game in games:
        shield.reset()
        shield.decide(game[0].fleet, game[0].wanted, game[0].surroundings)  # makes working memory for the fleet

        def call(k: int, game: Sequence[Question] = game) -> None:
            shield.decide(game[k].fleet, game[k].wanted, game[k].surroundings)

        times.append(time_calls(call, len(game)))
    return np.concatenate(times)


def scaling(config: ShieldConfig, scenes: int, seed: int, counts: Sequence[int] = COUNTS) -> list[dict[str, Any]]:
    """Time one decision for fleets of several sizes, half of the boats ours, at the density of the game.

    Returns:
        Per size `boats`, `ours`, quantiles in us, and `us_per_own_boat`, over random scenes (fewer for large fleets).
    """
    return [_one_size(config, boats, max(3, scenes * min(counts) // boats), seed) for boats in counts]


def _one_size(config: ShieldConfig, boats: int, scenes: int, seed: int) -> dict[str, Any]:
    shield = Shield(config)
    drawn = [scene(boats, seed + k) for k in range(scenes)]
    times = np.zeros(scenes)
    for k, (fleet, wanted) in enumerate(drawn):
        shield.reset()
        shield.decide(fleet, wanted)  # makes working memory and the backups the timed decision goes on from

        def call(_: int, fleet: Any = fleet, wanted: Any = wanted) -> None:
            shield.decide(fleet, wanted)

        times[k] = time_calls(call, 1)[0]
    ours = int(drawn[0][0].controlled.sum())
    figures = quantiles_us([times])
    return {
        "boats": boats,
        "ours": ours,
        "scenes": scenes,
        **figures,
        "us_per_own_boat": (figures["p50_us"] or 0) / ours,
    }
