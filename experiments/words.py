"""How many things there are, in words, for tables, pages and messages alike."""

from __future__ import annotations


def count_text(number: int, one: str, many: str = "") -> str:
    """Write how many things there are: ``1 game``, ``2,000 games``; ``many``: where it is not ``one`` with an s."""
    return f"{number:,} {one if number == 1 else many or f'{one}s'}"


def seeds_text(first: int, last: int) -> str:
    """Write the seeds from the first to the last: ``seed 4``, ``seeds 4 to 8``."""
    return f"seed {first}" if first == last else f"seeds {first} to {last}"
