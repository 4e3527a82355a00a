"""The sweep that chose the gains: every filter, every platform, on two-boat families of the encounter suite.

Run it again with ``python -m steerclear.experiments.textbook.sweep``. It takes the gains with the fewest breached
encounters over all families, among these the fewest commands changed, among these the first; it logs a table of the
winners, which `parameters.TUNED` holds. It takes a few minutes on one core.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator, Sequence
from typing import Any

from steerclear.shield.config import ShieldConfig
from steerclear.shield.surroundings import Surroundings

from ..encounters import measure
from .guard import TextbookGuard
from .parameters import NAMES, PUBLISHED, Gains

log = logging.getLogger(__name__)

FAMILIES = ("head_on", "crossing_left", "crossing_right", "rammer_1")
PLATFORMS = ("heron", "surveyor")
SEED = 20_260
ENCOUNTERS = 60
RATES_PER_S = (0.025, 0.05, 0.075, 0.1, 0.15, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0)
PAIRS_PER_S = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0)
ALPHAS_PER_S = (0.05, 0.1, 0.25, 0.5, 1.0, 4.0)
LAMBDA_SHARES = (0.1, 0.5, 2.0)
MU_SHARES = (0.25, 0.5, 1.0, 2.0, 8.0, 16.0)


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
                yield from (Gains(alpha, lambda_share=bend, mu_share=reach) for reach in MU_SHARES)


def try_out(
    name: str, platform: str, gains: Gains, encounters: int = ENCOUNTERS, seed: int = SEED
) -> dict[str, dict[str, Any]]:
    """Figures of every family, as `encounters.summary.summarise` gives them, breaches not judged."""

    def make(
        config: ShieldConfig, games: int, platforms: tuple[str, ...], team: tuple[int, ...], around: Surroundings
    ) -> TextbookGuard:
        return TextbookGuard(name, config, games, platforms, team, gains)

    return {
        family: measure(family, make, platform, platform, encounters, seed, judge=False).summary for family in FAMILIES
    }


def cost(figures: dict[str, dict[str, Any]]) -> tuple[int, float]:
    """Encounters breached, then commands changed: smaller is better."""
    return sum(one["breached"] for one in figures.values()), sum(one["changed_percent"] for one in figures.values())


def best(name: str, platform: str, encounters: int = ENCOUNTERS, seed: int = SEED) -> Gains:
    """The winner among `candidates`."""
    return min(candidates(name), key=lambda gains: cost(try_out(name, platform, gains, encounters, seed)))


def sweep(platforms: Sequence[str] = PLATFORMS) -> dict[tuple[str, str], Gains]:
    """Winners of all filters on all platforms; each is logged with what it did per family."""
    winners = {}
    for platform in platforms:
        for name in NAMES:
            winners[name, platform] = best(name, platform)
            for family, one in try_out(name, platform, winners[name, platform]).items():
                log.info(
                    "%s %s %s: %d of %d breached, %.1f %% of commands changed, goal time x %.2f",
                    platform,
                    name,
                    family,
                    one["breached"],
                    one["encounters"],
                    one["changed_percent"],
                    one["goal_time_ratio"],
                )
            log.info("    (%r, %r): %r,", name, platform, winners[name, platform])
    return winners


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    sweep(sys.argv[1:] or PLATFORMS)
