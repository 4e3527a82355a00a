"""One page that shows a team what the shield does to its entry: whom it hits, what it wins and gives up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..ablation import AblationSettings
from ..metrics import breach_column
from ..page import render, write_page
from ..statistics import Interval, paired_difference
from ..tables import number_text
from ..workers import Row

PAGE = "entry.html"


def by_pairing(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Group rows by pairing, in the order the pairings come."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(row["pairing"], []).append(row)
    return groups


def paired(rows: Sequence[Row]) -> tuple[list[Row], list[Row]]:
    """Games of one pairing that were played off and on, in the same order."""
    off, on = ({row["game"]: row for row in rows if bool(row["shielded"]) is state} for state in (False, True))
    both = sorted(set(off) & set(on))
    return [off[game] for game in both], [on[game] for game in both]


def net(row: Row) -> float:
    """Captures made less those of the other team."""
    return float(row["captures"] - row["captures_against"])


def net_change(off: Sequence[Row], on: Sequence[Row], seed: int = 0) -> Interval:
    """Mean change of the net of captures by the shield, with its 95 % interval over pairs of games."""
    return paired_difference([net(row) for row in off], [net(row) for row in on], seed)


def write_entry_page(
    rows: Sequence[Row],
    settings: AblationSettings,
    folder: Path,
    links: Sequence[tuple[str, str]],
    warnings: Sequence[str],
) -> Path:
    """Write the page.

    Args:
        rows: the games.
        settings: what was played.
        folder: where to.
        links: label and file name of each game to look at, and of what else there is.
        warnings: sentences that a reader has to know first.

    Returns:
        The path written.

    Raises:
        ConfigError: the file cannot be written.
    """
    name = Path(settings.own).name
    groups = by_pairing(rows)
    radius = f"{settings.separation_m:g} m"
    count = f"{settings.games} game{'s' if settings.games != 1 else ''}"
    subtitle = (
        f"{settings.preset}: {count} against each opponent from the same seeds, without the shield and "
        f"with it; the shield keeps {radius}."
    )
    page = render(
        "entry.html",
        title=f"{name} and the shield",
        subtitle=subtitle,
        warnings=warnings,
        tiles=_tiles([row for group in groups.values() for row in group], settings),
        rows=[_opponent(group, settings) for group in groups.values()],
        radius=radius,
        links=links,
    )
    return write_page(folder / PAGE, page)


def _sums(rows: Sequence[Row], settings: AblationSettings) -> dict[str, float]:
    """Totals of some games."""
    names = {
        "captures": "captures",
        "against": "captures_against",
        "counted": "collisions",
        "mates": breach_column("teammate", settings.separation_m),
        "opponents": breach_column("opponent", settings.separation_m),
    }
    return {short: float(sum(row[column] for row in rows)) for short, column in names.items()}


def _tiles(rows: Sequence[Row], settings: AblationSettings) -> list[tuple[str, str, str, str]]:
    groups = [paired(group) for group in by_pairing(rows).values()]
    off, on = [row for pair in groups for row in pair[0]], [row for pair in groups for row in pair[1]]
    before, after = _sums(off, settings), _sums(on, settings)
    games = max(1, len(on))
    looked = "a game, every step looked at"
    shown = (
        ("hits with opponents", "opponents", looked),
        ("hits with team-mates", "mates", looked),
        ("counted by the game", "counted", "a game, once a decision"),
        ("captures", "captures", "a game"),
    )
    tiles = [
        (label, number_text(before[name] / games), number_text(after[name] / games), note)
        for label, name, note in shown
    ]
    nets = [number_text(float(np.mean([net(row) for row in side])) if side else 0.0) for side in (off, on)]
    return [*tiles, ("net of captures", nets[0], nets[1], "made less given up, a game")]


def _opponent(group: Sequence[Row], settings: AblationSettings) -> list[str]:
    """Row of the table: one opponent, totals of all paired games off and on."""
    off, on = paired(group)
    before, after = _sums(off, settings), _sums(on, settings)
    change = net_change(off, on, settings.seed) if off else Interval(float("nan"), float("nan"), float("nan"))
    cells = [Path(group[0]["opponent"]).name, str(len(off))]
    for name in ("captures", "against", "mates", "opponents", "counted"):
        cells.append(f"{before[name]:g} → {after[name]:g}")
    limits = "" if change.low != change.low else f" [{number_text(change.low)}, {number_text(change.high)}]"
    cells.insert(4, f"{number_text(change.value)}{limits}")
    return cells


def games_to_look_at(rows: Sequence[Row], settings: AblationSettings, most: int) -> list[tuple[str, Row, Row]]:
    """Pairs of games off and on with why they are worth a look: most hits off, hits on, most captures lost.

    Each pair once, at most so many.
    """
    pairs = [pair for group in by_pairing(rows).values() for pair in zip(*paired(group), strict=True)]
    columns = [breach_column(kind, settings.separation_m) for kind in ("teammate", "opponent")]

    def hits(row: Mapping[str, Any]) -> int:
        return sum(int(row[column]) for column in columns)

    rated = [
        ("most hits without the shield", lambda pair: hits(pair[0])),
        ("hits with the shield", lambda pair: hits(pair[1])),
        ("captures lost with the shield", lambda pair: net(pair[0]) - net(pair[1])),
    ]
    chosen: list[tuple[str, Row, Row]] = []
    for words, worth in rated:
        best = max(pairs, key=worth, default=None)
        if best is None or worth(best) <= 0 or any(best[1] is row for _, _, row in chosen):
            continue
        chosen.append((words, *best))
    return chosen[:most]
