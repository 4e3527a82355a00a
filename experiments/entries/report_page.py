"""One page that shows a team what the shield does to its entry: whom it hits, what it wins and gives up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..measure.statistics import Interval, paired_difference
from ..measure.summary import Row, by_game
from ..measure.tally import breach_column
from ..report.page import as_text, html_page, template, write_page
from ..report.tables import number_text
from ..runs.ablation import AblationSettings, by_pairing

PAGE = "entry.html"


def paired(rows: Sequence[Row]) -> tuple[list[Row], list[Row]]:
    """Games of one pairing that were played off and on, in the same order."""
    off, on = by_game(rows, False), by_game(rows, True)
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
    parts = {
        "TITLE": as_text(f"{name} and the shield"),
        "STYLE": template("report.css"),
        "SUBTITLE": as_text(subtitle),
        "WARNINGS": "".join(f'<p class="card bad">{as_text(words)}</p>' for words in warnings),
        "TILES": "".join(
            _tile(*tile) for tile in _tiles([row for group in groups.values() for row in group], settings)
        ),
        "ROWS": "".join(_opponent(group, settings) for group in groups.values()),
        "RADIUS": as_text(radius),
        "LINKS": "".join(f'<a class="button" href="{as_text(file)}">{as_text(label)}</a>' for label, file in links),
    }
    return write_page(folder / PAGE, html_page("entry.html", parts))


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


def _tiles(rows: Sequence[Row], settings: AblationSettings) -> list[tuple[str, str, str]]:
    groups = [paired(group) for group in by_pairing(rows).values()]
    off, on = [row for pair in groups for row in pair[0]], [row for pair in groups for row in pair[1]]
    before, after = _sums(off, settings), _sums(on, settings)
    games = max(1, len(on))
    nets = [np.mean([net(row) for row in side]) if side else 0.0 for side in (off, on)]
    return [
        (
            "hits with opponents",
            _change(before["opponents"] / games, after["opponents"] / games),
            "a game, every step looked at",
        ),
        (
            "hits with team-mates",
            _change(before["mates"] / games, after["mates"] / games),
            "a game, every step looked at",
        ),
        (
            "counted by the game",
            _change(before["counted"] / games, after["counted"] / games),
            "a game, once a decision",
        ),
        ("captures", _change(before["captures"] / games, after["captures"] / games), "a game"),
        ("net of captures", _change(float(nets[0]), float(nets[1])), "made less given up, a game"),
    ]


def _change(off: float, on: float) -> str:
    return (
        f'<span class="off">{number_text(off)}</span><span class="arrow">→</span>'
        f'<span class="on">{number_text(on)}</span>'
    )


def _tile(label: str, numbers: str, note: str) -> str:
    return f'<div class="tile"><h3>{label}</h3><p class="numbers">{numbers}</p><p class="note">{note}</p></div>'


def _opponent(group: Sequence[Row], settings: AblationSettings) -> str:
    """Row of the table: one opponent, totals of all paired games off and on."""
    off, on = paired(group)
    before, after = _sums(off, settings), _sums(on, settings)
    change = net_change(off, on, settings.seed) if off else Interval(float("nan"), float("nan"), float("nan"))
    cells = [as_text(Path(group[0]["opponent"]).name), str(len(off))]
    for name in ("captures", "against", "mates", "opponents", "counted"):
        cells.append(f"{before[name]:g} → {after[name]:g}")
    limits = "" if change.low != change.low else f" [{number_text(change.low)}, {number_text(change.high)}]"
    cells.insert(4, f"{number_text(change.value)}{limits}")
    return (
        "<tr>"
        + "".join(f'<td class="{"" if k == 0 else "number"}">{cell}</td>' for k, cell in enumerate(cells))
        + "</tr>"
    )


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
