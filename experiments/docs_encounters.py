"""The page that compares safety filters on the same encounters, made of results of ``encounters``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from steerclear.shield.exceptions import ConfigError

from . import plots
from .markdown import line
from .page import template
from .play.conditions import words_of
from .report import Report, Section
from .statistics import upper_bound
from .tables import Table, number_text

CONDITIONS = ("radius_m", "delay_s", "noise_m", "current_mps")
COUNTS = ("encounters", "violated", "avoidable", "unavoidable", "not_judged", "deadlocked")
OUTSIDE = ("started_outside", "violations_outside")
MEANS: tuple[str, ...] = ("changed_percent", "goal_time_ratio", "reversals_per_min", "decision_us")
MEANS += ("never_arrived_percent", "inactive_percent")
NEEDED = ("family", "filter", "own", "other", "seed", *CONDITIONS, *COUNTS, *OUTSIDE, *MEANS)
NO_FILTER = "none"
RULE = "fewest avoidable or unjudged, then fewest with violations, then fewest commands changed"
Cell = Mapping[str, Any]
Met = dict[str, dict[str, Cell]]
"""Cells of encounters that are alike but for the filter: by filter and family."""


def _count(one: Cell, key: str, of: str = "encounters") -> str:
    """A count, with what was not judged beside it, and the upper limit of its probability."""
    unjudged = f" to {one[key] + one['not_judged']}" if key == "avoidable" and one["not_judged"] else ""
    percent = 100.0 * upper_bound(one[key] + (one["not_judged"] if key == "avoidable" else 0), one[of])
    return f"{one[key]}{unjudged} [{f'{percent:.0f}' if percent >= 99.5 else f'{percent:.2g}'} %]"


def _number(value: float | None, unit: str = " %") -> str:
    return "" if value is None else number_text(value) + unit


COLUMNS: dict[str, Callable[[Cell], Any]] = {
    "encounters": lambda one: f"{one['encounters']:,}",
    "avoidable": lambda one: _count(one, "avoidable"),
    "unavoidable": lambda one: one["unavoidable"],
    "not judged": lambda one: one["not_judged"],
    "violated": lambda one: _count(one, "violated"),
    "of those started outside": lambda one: _count(one, *reversed(OUTSIDE)) if one["started_outside"] else "",
    "commands changed": lambda one: f"{one['changed_percent']:.1f} %",
    "left alone": lambda one: _number(one["inactive_percent"]),
    "time to goal": lambda one: _number(one["goal_time_ratio"], ""),
    "never arrived": lambda one: _number(one["never_arrived_percent"]),
    "deadlocked": lambda one: one["deadlocked"],
    "reversals / min": lambda one: _number(one["reversals_per_min"], ""),
    "µs per decision": lambda one: _number(one["decision_us"], ""),
}
"""Columns of the tables, with what they show of a filter's encounters."""


def comparison_page(found: Sequence[Mapping[str, Any]], folder: Path) -> tuple[str, str, list[Path]]:
    """Name and text of the page of results of ``encounters``, and its pictures, drawn into the folder.

    Raises:
        ConfigError: no cell to compare, or one that lacks a figure.
    """
    sections, panels, filters = (
        list[Section](),
        list[tuple[str, list[tuple[str, float, float, float]]]](),
        dict[str, Met](),
    )
    for (own, other, seed, *conditions), met in _contests(found).items():
        families = [f for f in _families(met) if len({_size(cells, f) for cells in met.values()}) == 1]
        if not families:
            continue
        radius, *extras = conditions
        given = words_of(dict(zip(CONDITIONS[1:], extras, strict=True)))
        title = ", ".join(filter(None, [f"{own} meets {other}, {radius:g} m", given]))
        totals = {safety_filter: pool([cells[family] for family in families]) for safety_filter, cells in met.items()}
        sections.append(_section(title, seed, met, families, totals))
        panels.append((title, [_point(safety_filter, one) for safety_filter, one in totals.items()]))
        filters |= dict.fromkeys(met, met)
    if not sections:
        raise ConfigError(
            "the encounter results have no family that all filters met; run them with the same --families"
        )
    words = ("commands changed, %", "encounters with violations, %")
    picture = plots.png(plots.scatter(panels, words), folder / "comparison.png")
    versions = sorted({str((content.get("versions") or {}).get("steerclear")) for content in found})
    title = "Filters on the same encounters" if len(filters) > 1 else f"Encounters with {next(iter(filters))}"
    intro = template("comparison.txt").strip().format(versions=line(", ".join(versions)))
    return Report(title, "", notes=[intro], sections=sections).page("comparison.md", picture)


def _contests(found: Sequence[Mapping[str, Any]]) -> dict[tuple[Any, ...], Met]:
    """Cells by who met whom under which conditions; of several results of the same cell the last counts."""
    groups: dict[tuple[Any, ...], Met] = {}
    for content in found:
        settings = content.get("settings") or {}
        common = {key: settings[key] for key in (*CONDITIONS, "seed", "own", "other") if key in settings}
        for raw in content.get("cells") or []:
            cell = {**common, **(settings.get("conditions") or {}), **raw}
            if missing := [key for key in NEEDED if key not in cell]:
                words = f"a cell of the encounter results has no {', '.join(missing)}; run `encounters` again"
                raise ConfigError(words)
            key = (cell["own"], cell["other"], cell["seed"], *(float(cell[name]) for name in CONDITIONS))
            groups.setdefault(key, {}).setdefault(cell["filter"], {})[cell["family"]] = cell
    return groups


def _families(met: Met) -> list[str]:
    return list(dict.fromkeys(family for cells in met.values() for family in cells))


def _size(cells: Mapping[str, Cell], family: str) -> int | None:
    return cells[family]["encounters"] if family in cells else None


def pool(cells: Sequence[Cell]) -> dict[str, Any]:
    """Add up counts, and weight means with encounters (None without any)."""
    pooled: dict[str, Any] = {key: sum(cell[key] for cell in cells) for key in (*COUNTS, *OUTSIDE)}
    for key in MEANS:
        parts = [(cell[key], cell["encounters"]) for cell in cells if cell[key] is not None]
        weight = sum(count for _, count in parts)
        pooled[key] = sum(value * count for value, count in parts) / weight if weight else None
    return pooled


def best_of(totals: Mapping[str, Cell]) -> str | None:
    """The best filter by `RULE`; None without any."""

    def rank(safety_filter: str) -> tuple[int, int, float]:
        one = totals[safety_filter]
        return one["avoidable"] + one["not_judged"], one["violated"], one["changed_percent"]

    return min((safety_filter for safety_filter in totals if safety_filter != NO_FILTER), key=rank, default=None)


def _section(title: str, seed: int, met: Met, families: Sequence[str], totals: Mapping[str, Cell]) -> Section:
    best = best_of(totals) if len(met) > 1 else None
    rows = [
        _row(f"**{safety_filter}**" if safety_filter == best else safety_filter, one)
        for safety_filter, one in totals.items()
    ]
    tables = [Table("", ["filter", *COLUMNS], rows)]
    if len(met) == 1:
        (cells,) = met.values()
        rows = [_row(family, cells[family]) for family in families]
        tables.append(Table("Family by family", ["", *COLUMNS], rows))
    else:
        rows = [[f, *(f"{c[f]['violated']}, {c[f]['changed_percent']:.0f} %" for c in met.values())] for f in families]
        tables.append(Table("Encounters with violations, and share of commands changed", ["", *met], rows))
    words = f"Families: {', '.join(families)}; seed {seed}."
    if left_out := [family for family in _families(met) if family not in families]:
        words += f" Not met equally by all filters and left out: {', '.join(left_out)}."
    return Section(title, tables, f"Best ({RULE}): **{best}**. {words}" if best else words)


def _row(name: str, one: Cell) -> list[Any]:
    return [name, *(text(one) for text in COLUMNS.values())]


def _point(safety_filter: str, one: Cell) -> tuple[str, float, float, float]:
    upper = upper_bound(one["violated"], one["encounters"])
    return safety_filter, one["changed_percent"], 100.0 * one["violated"] / one["encounters"], 100.0 * upper
