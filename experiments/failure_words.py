"""Saying it first when a policy failed while games were played: what such games show is not the policy."""

from __future__ import annotations

from .summary import Row

SIDES = {"policy_failures": "own policy", "opponent_policy_failures": "opponents' policy"}


def failure_warnings(rows: list[Row]) -> list[str]:
    """Sentences about failures of policies, for people.

    Args:
        rows: the games.

    Returns:
        One for each side that failed: how often, in how many games, and the first text; empty when none did.
    """
    return [_sentence(words, column, rows) for column, words in SIDES.items() if any(row[column] for row in rows)]


def _sentence(words: str, column: str, rows: list[Row]) -> str:
    failed = [row for row in rows if row[column]]
    times = sum(int(row[column]) for row in failed)
    first = next((row["first_failure"] for row in failed if row["first_failure"]), "no text")
    return (
        f"The {words} failed {times:,} times, in {len(failed)} of {len(rows)} games; its boats stopped for those "
        f"steps, so the figures are not those of a working policy. First failure: {first}"
    )
