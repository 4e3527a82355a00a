"""What the words of tables and plots mean, said where they stand."""

from __future__ import annotations

from collections.abc import Sequence

REASONS = {
    "qp": "the least change that leaves every boat a backup, found by the quadratic program",
    "qp_relaxed": "the program's answer where not all could be kept, better than any backup",
    "backup": "no small change was safe: the boat carries out the turn and straight run that it kept ready",
    "escape": "the same, as results of 0.2.0 and before name it",
    "best_effort": "no manoeuvre keeps the radius: the one that keeps most of it",
    "held": "the policy asked for nothing usable (no number, or absurdly large): the boat is told to stop on course",
    "right_of_way": "two team-mates kept each other from turning: one gives way, one stands on",
    "limited": "the wanted speed is beyond what the boat does: cut to that, and so it is safe",
}
"""By name of the reason, small letters."""

FIGURES = {
    "clean_games": "share of games without any hit",
    "closest_of_all_m": "smallest of all games",
    "changed_share": "commands sent otherwise than wanted, of all that the shield decided",
    "mean_heading_change_deg": "|sent − wanted| heading, over changed commands",
    "mean_speed_change_mps": "|sent − wanted| speed, over changed commands",
    "decision_p50_us": "half of the decisions took no longer, microseconds",
    "decision_p99_us": "99 of 100 decisions took no longer, microseconds",
    "deadlocks": "pairs of own boats that wanted to move and stood still for over 10 s",
    "reversals_per_boat_minute": "changes of the commanded side of turn (beyond 5°), per boat and minute",
    "collisions": "as the game counts them for the score: once a decision and for each own boat in one",
    "primary": "captures − captures against − penalty × collisions",
    "secondary": "grabs + tags − grabs against − tags against",
}
"""By name of the figure; those that say it themselves are left out."""


def reasons_told(names: Sequence[str]) -> list[tuple[str, str]]:
    """Name and meaning of the reasons that have one, in the order given."""
    return [(name, REASONS[name.lower()]) for name in names if name.lower() in REASONS]
