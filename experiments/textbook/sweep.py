"""The sweep that chose the gains: every filter, every platform, on the encounters of `drill`.

Run it again with ``python -m steerclear.experiments.textbook.sweep``. It takes the gains with the fewest breaches
over all families, among these the fewest commands changed, among these the first; it logs a table of the winners,
which `parameters.TUNED` holds. It takes a few minutes on one core.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import replace

from steerclear.shield.config import ShieldConfig

from .drill import FAMILIES, Outcome, run_drill
from .guard import TextbookGuard
from .parameters import NAMES, PUBLISHED, Gains

log = logging.getLogger(__name__)

PLATFORMS = ("heron", "surveyor")
SEED = 20_260
GAMES = 60
RATES_PER_S = (0.025, 0.05, 0.075, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0)
PAIRS_PER_S = (0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.75, 1.0, 2.0)
ALPHAS_PER_S = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
LAMBDA_SHARES = (0.1, 0.5, 2.0, 4.0)
MU_SHARES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)


def candidates(name: str) -> Iterator[Gains]:
    """Gains that are tried; the published ones first."""
    yield PUBLISHED[name]
    if name in ("velocity_cbf", "collision_cone"):
        yield from (Gains(rate) for rate in RATES_PER_S)
    elif name == "exponential_cbf":
        yield from (Gains(second, first_per_s=first) for first in PAIRS_PER_S for second in PAIRS_PER_S)
    else:
        for alpha in ALPHAS_PER_S:
            for bend in LAMBDA_SHARES:
                for reach in MU_SHARES:
                    yield replace(Gains(alpha), lambda_share=bend, mu_share=reach)


def measure(name: str, platform: str, gains: Gains, games: int = GAMES, seed: int = SEED) -> list[Outcome]:
    """Outcomes of every family."""
    config = ShieldConfig(edge_m=None)
    guard = TextbookGuard(name, config, games, (platform, platform), (0, 1), gains)
    return [run_drill(guard, family, platform, games, seed, config) for family in FAMILIES]


def cost(outcomes: Sequence[Outcome]) -> tuple[int, float]:
    """Breaches, then share of commands changed: smaller is better."""
    return sum(int(one.breached.sum()) for one in outcomes), round(sum(one.changed.mean() for one in outcomes), 9)


def best(name: str, platform: str, games: int = GAMES, seed: int = SEED) -> Gains:
    """The winner among `candidates`."""
    return min(candidates(name), key=lambda gains: cost(measure(name, platform, gains, games, seed)))


def sweep(platforms: Sequence[str] = PLATFORMS) -> dict[tuple[str, str], Gains]:
    """Winners of all filters on all platforms; each is logged with what it did per family."""
    winners = {}
    for platform in platforms:
        for name in NAMES:
            winners[name, platform] = best(name, platform)
            for family, one in zip(FAMILIES, measure(name, platform, winners[name, platform]), strict=True):
                log.info(
                    "%s %s %s: %d of %d breached, %.1f %% of commands changed, %.1f %% relaxed, progress %.2f",
                    platform,
                    name,
                    family,
                    one.breached.sum(),
                    len(one.breached),
                    100.0 * one.changed.mean(),
                    100.0 * one.relaxed.mean(),
                    one.progress.mean(),
                )
            log.info("    (%r, %r): %r,", name, platform, winners[name, platform])
    return winners


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    sweep()
