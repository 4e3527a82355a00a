"""Saying it first when a policy failed while games were played: what such games show is not the policy."""

from __future__ import annotations

from collections.abc import Sequence

from .summary import Row

SIDES = (("own policy", "policy_failures", "own: "), ("opponents' policy", "opponent_policy_failures", "opponent: "))
"""Words, column of the count, and how the texts of its failures begin."""


def failure_warnings(rows: Sequence[Row]) -> list[str]:
    """Sentences about failures of policies, for people.

    Args:
        rows: the games.

    Returns:
        One for each side that failed: how often, in how many games, and its first text; empty when none did.
    """
    return [_sentence(*side, rows) for side in SIDES if any(row[side[1]] for row in rows)]


def _sentence(words: str, column: str, begin: str, rows: Sequence[Row]) -> str:
    failed = [row for row in rows if row[column]]
    count = sum(int(row[column]) for row in failed)
    texts = [text for row in failed if (text := row["first_failure"] or "").startswith(begin)]
    times = f"{count:,} time{'s' if count > 1 else ''}"
    return (
        f"The {words} failed {times}, in {len(failed)} of {len(rows)} games; its boats "
        "stopped for those steps, so the figures are not those of a working policy."
        + (f" First failure: {texts[0].removeprefix(begin)}" if texts else "")
    )
