"""An ablation's report: one HTML file with headline numbers, plots, tables and all that is needed to repeat it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from steerclear.shield.exceptions import ConfigError

from ..measure.tally import RADII_M, breach_column
from ..play.conditions import words_of
from .ablation_plots import closest_plot, figure_plot, reason_plot, reasons_of, words
from .ablation_verdicts import breaches_table, verdict_tables
from .meanings import reasons_told
from .page import as_text, report_page, template, write_page
from .parts import (
    bars_table,
    games_table,
    headlines,
    legend,
    meanings,
    pairing_tables,
    replay_links,
    values_table,
)

REQUIRED = ("settings", "versions", "pairings", "games")
PAIRING_KEYS = ("pairing", "games_off", "games_on", "metrics", "reasons")
GAME_KEYS = ("pairing", "game", "shielded", "seed", "closest_m")
CHANGED_SHARE_GOAL = 5.0


def write_report(results: Mapping[str, Any], path: str | os.PathLike[str]) -> Path:
    """Write the report.

    Args:
        results: ``settings`` (with ``separation_m``, its own or in ``shield``; 2.5 m when left out), ``versions``,
            ``pairings`` (as `summary.summarise` returns them), ``games`` (rows of games); and, where there are any,
            ``bars`` (as `ablation.ablation_bars`), ``warnings`` (sentences shown first), ``machine``, ``title``,
            ``quick``, ``failed`` (games that could not be played) and ``replays`` ({"label", "path"}, the path seen
            from the report). Further figures are shown, further keys ignored.
        path: File to write.

    Returns:
        The path written.

    Raises:
        ConfigError: Something is missing, or the file cannot be written.
    """
    separation_m = separation_of(results)
    check_results(results, separation_m)
    replays = results.get("replays") or ()
    parts = {
        "TITLE": as_text(results.get("title") or _played(results["settings"])[0]),
        "STYLE": template("report.css"),
        "SUBTITLE": as_text(_subtitle(results, separation_m)),
        "WARNINGS": "".join(f'<p class="card bad">{as_text(words)}</p>' for words in results.get("warnings") or ()),
        "HEADLINES": headlines(results["pairings"], separation_m),
        "BARS": bars_table(results.get("bars") or ()),
        "REPLAYS": replay_links(replays),
        "PLOTS": _plots(results, separation_m),
        "PAIRINGS": pairing_tables(results["pairings"]),
        "VERDICTS": verdict_tables(results["pairings"]),
        "BREACHES": breaches_table(results.get("breaches") or ()),
        "SETTINGS": values_table(results["settings"]),
        "VERSIONS": values_table({**results["versions"], **(results.get("machine") or {})}),
        "GAMES": games_table(results["games"]),
        "FAILED": games_table(results["failed"]) if results.get("failed") else "<p>None.</p>",
    }
    return write_page(path, report_page("report.html", parts))


def separation_of(results: Mapping[str, Any]) -> float:
    """Return the shield's separation radius, m."""
    settings = results.get("settings") or {}
    return float(settings.get("separation_m") or (settings.get("shield") or {}).get("separation_m") or RADII_M[0])


def check_results(results: Mapping[str, Any], separation_m: float) -> None:
    """Check that everything the report shows is there.

    Args:
        results: See `write_report`.
        separation_m: Radius at which breaches are shown.

    Raises:
        ConfigError: Names all that is missing.
    """
    missing = [name for name in REQUIRED if name not in results]
    if not missing:
        figures = [breach_column(kind, separation_m) for kind in ("teammate", "opponent")]
        figures += ["captures", "closest_m", "changed_share"]
        for number, pairing in enumerate(results["pairings"]):
            missing += [f"pairings[{number}].{name}" for name in _lacking(pairing, PAIRING_KEYS)]
            missing += [f"pairings[{number}].metrics.{name}" for name in _lacking(pairing.get("metrics", {}), figures)]
        for number, row in enumerate(results["games"]):
            missing += [f"games[{number}].{name}" for name in _lacking(row, GAME_KEYS)]
    if not missing and not results["pairings"]:
        missing = ["any pairing"]
    if missing:
        shown = ", ".join(missing[:8]) + (f" and {len(missing) - 8} more" if len(missing) > 8 else "")
        raise ConfigError(f"the results lack {shown}; pass what `steerclear ablate` writes to results.json.")


def _lacking(content: Mapping[str, Any], names: Sequence[str]) -> list[str]:
    return [name for name in names if name not in content]


def _subtitle(results: Mapping[str, Any], separation_m: float) -> str:
    settings = results["settings"]
    parts = [str(settings["preset"])] if settings.get("preset") else []
    if settings.get("own"):
        parts.append(
            f"{settings['own']} against {', '.join(settings.get('opponents') or ())}".removesuffix(" against ")
        )
    count = len(results["games"])
    parts.append(f"{count} game{'' if count == 1 else 's'}, {_played(settings)[1]}")
    parts.append(f"separation {separation_m:g} m")
    parts.append(words_of(settings.get("conditions") or {}))
    parts.append("small version (--quick): its intervals are wide" if results.get("quick") else "")
    return " · ".join(filter(None, parts))


def _played(settings: Mapping[str, Any]) -> tuple[str, str]:
    """Title, and words for the states of the shield that the games were played in."""
    states = set(settings.get("states") or (False, True))
    if len(states) > 1:
        return "What the shield changes", "each start played without and with the shield"
    how = "with" if True in states else "without"
    return f"Games {how} the shield", f"played {how} the shield"


def _plots(results: Mapping[str, Any], separation_m: float) -> str:
    pairings = results["pairings"]
    reasons, names = reason_plot(pairings)
    told = meanings([(words(name), meaning) for name, meaning in reasons_told(reasons_of(pairings))])
    off_on = legend([("off", "shield off"), ("on", "shield on")])
    hits = "hits with {} per game, centres within " + f"{separation_m:g} m"
    figures = [
        ("Hits with opponents", off_on, _hits(pairings, "opponent", separation_m, hits.format("opponents"))),
        ("Hits with team-mates", off_on, _hits(pairings, "teammate", separation_m, hits.format("team-mates"))),
        ("Captures", off_on, figure_plot(pairings, "captures", "captures per game")),
        ("Closest distance", off_on, closest_plot(pairings, results["games"], separation_m)),
        ("Steps changed", "", figure_plot(pairings, "changed_share", "steps changed, %", CHANGED_SHARE_GOAL)),
        ("Why commands were changed", legend(names), reasons + told),
    ]
    return "".join(f'<figure class="card"><h3>{title}</h3>{key}{plot}</figure>' for title, key, plot in figures)


def _hits(pairings: Sequence[Mapping[str, Any]], kind: str, separation_m: float, axis: str) -> str:
    return figure_plot(pairings, breach_column(kind, separation_m), axis)
