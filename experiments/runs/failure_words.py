"""Saying it first when a policy failed while games were played: what such games show is not the policy."""

from __future__ import annotations

from collections.abc import Sequence

from ..measure.summary import Row

SIDES = (("own policy", "", "own: "), ("opponents' policy", "opponent_", "opponent: "))
"""Words, how the columns begin, and how the texts of its failures do."""


def failure_warnings(rows: Sequence[Row]) -> list[str]:
    """Sentences about failures of policies, for people.

    Args:
        rows: the games.

    Returns:
        One for each side that failed: how often, in how many games, and its first text; empty when none did.
    """
    return [_sentence(*side, rows) for side in SIDES if any(row[side[1] + "policy_failures"] for row in rows)]


def _sentence(words: str, columns: str, begin: str, rows: Sequence[Row]) -> str:
    column = columns + "policy_failures"
    failed = [row for row in rows if row[column]]
    count = sum(int(row[column]) for row in failed)
    texts = [text for row in failed if (text := row["first_failure"] or "").startswith(begin)]
    times = f"{count:,} time{'s' if count > 1 else ''}"
    return (
        f"The {words} failed {times}, in {len(failed)} of {len(rows)} games; its boats "
        "stopped for those steps, so the figures are not those of a working policy."
        + (f" First failure: {texts[0].removeprefix(begin)}" if texts else "")
    )


def held_games(rows: Sequence[Row]) -> list[str]:
    """Sentences about policies that did not play: in no step of a game had a boat of theirs a usable answer.

    Args:
        rows: the games.

    Returns:
        One for each side with such games; empty when there are none.
    """
    return [words for side in SIDES if (words := _held(*side, rows))]


def _held(words: str, columns: str, begin: str, rows: Sequence[Row]) -> str:
    held = [row for row in rows if row["steps"] > 0 and row[columns + "policy_usable_steps"] == 0]
    if not held:
        return ""
    texts = [text for row in held if (text := row["first_failure"] or "").startswith(begin)]
    return (
        f"the {words} gave no usable answer throughout {len(held)} of {len(rows)} games; its boats lay still, so these "
        f"are figures of no policy{f' ({texts[0].removeprefix(begin)})' if texts else ''}; mend it or leave it out"
    )
