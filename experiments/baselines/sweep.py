"""Gain sweep on two-boat families of the encounter suite; ``python -m`` this module repeats it.

For each barrier it selects the gains with the fewest encounters with a violation at a separation of 2.5 m over all
families. Ties are broken by the fewest changed commands, then by order. This favours the filters: up to 109 candidates
are tried on the boats and kinds of encounter on which the filters are later compared (with other seeds). The sweep
takes minutes on one core.
"""

import logging
import sys
from typing import Any

from ..encounters import measure
from .barriers import BARRIERS, Gains
from .textbook import TextbookFilter

FAMILIES = ("head_on", "crossing_left", "crossing_right", "rammer_1")


def cost(name: str, platform: str, gains: Gains, n: int = 60, seed: int = 20_260) -> tuple[int, float]:
    """Return encounters with a violation, then the sum of changed commands, percent; smaller is better."""

    def make(config: Any, games: int, platforms: Any, team: Any, _: Any) -> TextbookFilter:
        return TextbookFilter(name, config, games, platforms, team, gains)

    figures = [measure(one, make, platform, platform, n, seed, judge=False).summary for one in FAMILIES]
    return sum(one["violated"] for one in figures), sum(one["changed_percent"] for one in figures)


def best(name: str, platform: str) -> Gains:
    """Return the best of the candidate gains."""
    return min(BARRIERS[name].tried, key=lambda gains: cost(name, platform, gains))


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    for boat in sys.argv[1:] or ("heron", "surveyor"):
        for barrier in BARRIERS:
            found = best(barrier, boat)
            logging.info("%s %s %s: %s", boat, barrier, found, cost(barrier, boat, found))
