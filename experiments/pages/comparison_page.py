"""Text of the comparison page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from steerclear.shield.exceptions import ConfigError

from ..baselines.rollouts import NAMES
from ..encounters.summary import upper_bound
from ..report.markdown import MADE, line, table
from ..report.tables import number_text
from .comparison import Cell, Contest, cells_of, contests_of, pool
from .comparison_plot import plot_contests

STEM = "comparison"
LIBRARY_STEM = "library_filters"
"""Page of results with a filter that rolls manoeuvres out: they are measured on fewer encounters."""


def has_library(content: Mapping[str, Any]) -> bool:
    """Whether results of ``encounters`` hold a filter that rolls manoeuvres out."""
    cells = content.get("cells") or []
    return any(str(cell.get("guard")).partition(":")[0] in NAMES for cell in cells if isinstance(cell, Mapping))


def write_comparison(results: Sequence[Mapping[str, Any]], folder: Path, stem: str = STEM) -> tuple[str, list[Path]]:
    """Make the page of results of ``encounters``, and draw its plot into the folder.

    Args:
        results: contents of their JSON files; guards may be spread over several.
        folder: which exists.
        stem: of the picture's name.

    Returns:
        The text, and the pictures written.

    Raises:
        ConfigError: no cell to compare.
    """
    contests = [contest for contest in contests_of(c for content in results for c in cells_of(content))
                if contest.families]  # fmt: skip
    if not contests:
        raise ConfigError("the encounter results have no family that all guards met; run them with the same --families")
    picture = plot_contests(contests, folder / f"{stem}.png")
    versions = sorted({str((content.get("versions") or {}).get("steerclear")) for content in results})
    return comparison_page(contests, picture, versions), [picture]


def comparison_page(contests: Sequence[Contest], picture: Path, versions: Sequence[str]) -> str:
    """Write the page."""
    lines = [_heading(contests), "", MADE, "", _intro(versions), "", f"![plot]({picture.name})", ""]
    for contest in contests:
        lines += [f"## {contest.title}", "", _winner_line(contest), "", *_totals_table(contest), ""]
        if len(contest.cells) == 1:
            lines += ["Family by family:", "", *_one_guards_families_table(contest), ""]
        else:
            lines += ["Encounters breached, and share of commands changed:", "", *_families_table(contest), ""]
    return "\n".join(lines)


def _heading(contests: Sequence[Contest]) -> str:
    guards = {guard for contest in contests for guard in contest.cells}
    return "# Guards on the same encounters" if len(guards) > 1 else f"# Encounters with {guards.pop()}"


def _intro(versions: Sequence[str]) -> str:
    return (
        f"Results of `steerclear encounters`, steerclear {line(', '.join(versions))}. "
        "All guards of a section met the same encounters. "
        "*Breached* counts encounters in which an own boat came within the radius of another boat, *avoidable* "
        "those that some own command of the last 30 s would have prevented; [ ] is the one-sided 95 % upper limit "
        "of the probability. *Started outside* are encounters at whose first decision every own boat had a "
        "backup by the default shield's certificate. *Time to goal* is that without a guard times the number; own "
        "boats that *never arrived* had not reached their goal by the end of an encounter, though without a guard "
        "they do. *Left alone*: of states sampled along the encounters without a guard that are safe by the value "
        "tables, how many wanted commands pass (both empty: results of an earlier version). The textbook filters are "
        "those of `steerclear.experiments.baselines.textbook`, with gains chosen by their own sweep on these "
        "platforms; `reach` is `steerclear.experiments.baselines.reach_guard`, the value tables alone; `gatekeeper` "
        "and `pl-cbf` are `steerclear.experiments.baselines.rollouts`, whose modules say what the papers leave open "
        "and what was filled in."
    )


def _winner_line(contest: Contest) -> str:
    families = line(f"Families: {', '.join(contest.families)}; seed {contest.seed}.")
    if contest.left_out:
        families += line(f" Not met equally by all guards and left out: {', '.join(contest.left_out)}.")
    if contest.winner is None or len(contest.cells) == 1:
        return families
    rule = "fewest avoidable or unjudged, then fewest breached, then fewest commands changed"
    return f"Best ({rule}): **{line(contest.winner)}**. {families}"


def _totals_table(contest: Contest) -> list[str]:
    heads = ["guard", "encounters", "avoidable", "unavoidable", "not judged", "breached", "commands changed",
             "left alone", "time to goal", "never arrived", "deadlocked", "reversals / min",
             "µs per decision"]  # fmt: skip
    rows = []
    for guard, one in contest.totals.items():
        name = f"**{guard}**" if guard == contest.winner and len(contest.cells) > 1 else guard
        rows.append([
            name, f"{one['encounters']:,}", _bounded(one, "avoidable"), one["unavoidable"], one["not_judged"],
            _bounded(one, "breached"), f"{one['changed_percent']:.1f} %", _percent(one["inactive_percent"]),
            _number(one["goal_time_ratio"], 2), _percent(one["never_arrived_percent"]), one["deadlocked"],
            _number(one["reversals_per_min"], 1), _number(one["decision_us"], 1),
        ])  # fmt: skip
    return table(heads, rows)


def _families_table(contest: Contest) -> list[str]:
    rows = [
        [
            family,
            *(
                f"{cells[family]['breached']}, {cells[family]['changed_percent']:.0f} %"
                for cells in contest.cells.values()
            ),
        ]
        for family in contest.families
    ]
    return table(["", *contest.cells], rows)


def _one_guards_families_table(contest: Contest) -> list[str]:
    heads = ["", "breached", "avoidable", "unavoidable", "started outside", "of these breached", "commands changed",
             "time to goal", "never arrived"]  # fmt: skip
    (cells,) = contest.cells.values()
    return table(heads, [_family_row(family, cells[family]) for family in contest.families])


def _family_row(family: str, cell: Cell) -> list[Any]:
    one, outside = pool([cell]), cell.get("started_outside")
    return [
        family, _bounded(one, "breached"), _bounded(one, "avoidable"), one["unavoidable"],
        "" if outside is None else f"{outside:,}",
        _count(cell["breaches_outside"], upper_bound(cell["breaches_outside"], outside)) if outside else "",
        f"{one['changed_percent']:.1f} %", _number(one["goal_time_ratio"], 2),
        _percent(one["never_arrived_percent"]),
    ]  # fmt: skip


def _bounded(figures: Mapping[str, Any], key: str) -> str:
    count = str(figures[key])
    if key == "avoidable" and figures["not_judged"]:
        count += f" to {figures[key] + figures['not_judged']}"
    return _count(count, figures[f"{key}_upper"])


def _count(count: int | str, upper: float) -> str:
    """A count and the upper limit of its probability."""
    percent = 100.0 * upper
    return f"{count} [{percent:.0f} %]" if percent >= 99.5 else f"{count} [{percent:.2g} %]"


def _percent(value: float | None) -> str:
    return "" if value is None else f"{number_text(value)} %"


def _number(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"
