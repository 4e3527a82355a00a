"""The sweep that chose the gains, on two-boat families of the encounter suite: ``python -m`` this module runs it again.

It takes the gains with the fewest encounters breached at a separation of 2.5 m over all families, among these the
fewest commands changed, among these the first. That is in the filters' favour: a grid of up to 109 candidates, tried
on the boats and the kinds of encounter they are then compared on (with other seeds). Minutes on one core.
"""

from __future__ import annotations

import logging
import sys
from typing import Any

from steerclear.shield.config import ShieldConfig

from ..encounters import measure
from .barriers import BARRIERS, Gains
from .registry import Guard
from .textbook import TextbookGuard

FAMILIES = ("head_on", "crossing_left", "crossing_right", "rammer_1")


def try_out(name: str, platform: str, gains: Gains, n: int = 60, seed: int = 20_260) -> dict[str, dict[str, Any]]:
    """Figures of every family, as `encounters.figures.summarise` gives them, breaches not judged."""

    def make(config: ShieldConfig, games: int, platforms: tuple[str, ...], team: tuple[int, ...], _: Any) -> Guard:
        return TextbookGuard(name, config, games, platforms, team, gains)

    return {one: measure(one, make, platform, platform, n, seed, judge=False).summary for one in FAMILIES}


def cost(figures: dict[str, dict[str, Any]]) -> tuple[int, float]:
    """Encounters breached, then commands changed: smaller is better."""
    return sum(one["breached"] for one in figures.values()), sum(one["changed_percent"] for one in figures.values())


def best(name: str, platform: str) -> Gains:
    """The winner among the gains that are tried."""
    return min(BARRIERS[name].tried, key=lambda gains: cost(try_out(name, platform, gains)))


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    for platform in sys.argv[1:] or ("heron", "surveyor"):
        for name in BARRIERS:
            gains = best(name, platform)
            logging.info("%s %s %s: %s", platform, name, gains, cost(try_out(name, platform, gains)))
