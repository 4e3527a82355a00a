"""The page that compares safety filters on the same encounters, made of results of ``encounters``."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from steerclear.shield.exceptions import ConfigError

from . import plots
from .markdown import MADE, line, table
from .play.conditions import words_of
from .statistics import upper_bound
from .tables import number_text

CONDITIONS = ("radius_m", "delay_s", "noise_m", "current_mps")
COUNTS = ("encounters", "breached", "avoidable", "unavoidable", "not_judged", "deadlocked")
MEANS = ("changed_percent", "goal_time_ratio", "reversals_per_min", "decision_us")
LATER_MEANS = ("never_arrived_percent", "inactive_percent")
"""Means that results of earlier versions lack: theirs stay unknown."""
NEEDED = ("family", "guard", "own", "other", *COUNTS, *MEANS)
NO_GUARD = "none"

Cell = Mapping[str, Any]


@dataclass(frozen=True)
class Contest:
    """Guards that met the same encounters.

    Attributes:
        own: platform of the own boats.
        other: platform of the others.
        conditions: radius, delay, noise and current.
        seed: of the scenes.
        families: that every guard met, equally many of each.
        left_out: families that only some guards met.
        cells: by guard and family.
    """

    own: str
    other: str
    conditions: tuple[float, ...]
    seed: int
    families: tuple[str, ...]
    left_out: tuple[str, ...]
    cells: Mapping[str, Mapping[str, Cell]]

    @property
    def title(self) -> str:
        """Who meets whom, and how."""
        radius, delay, noise, current = self.conditions
        extras = words_of({"delay_s": delay, "noise_m": noise, "current_mps": current})
        return ", ".join(filter(None, [f"{self.own} meets {self.other}, {radius:g} m", extras]))

    @property
    def totals(self) -> dict[str, dict[str, Any]]:
        """Figures of every guard over the common families."""
        return {guard: pool([cells[family] for family in self.families]) for guard, cells in self.cells.items()}

    @property
    def winner(self) -> str | None:
        """Fewest encounters with an avoidable (or unjudged) breach, then with any, then fewest commands changed."""
        totals = {guard: figures for guard, figures in self.totals.items() if guard != NO_GUARD}
        return min(totals, key=lambda guard: _rank(totals[guard])) if totals else None


def cells_of(content: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Read the cells of a results file, flat: names, conditions, seed and figures in one mapping each.

    Raises:
        ConfigError: a cell lacks a figure.
    """
    settings, cells = content.get("settings") or {}, []
    common = {key: settings[key] for key in (*CONDITIONS, "seed", "own", "other") if key in settings}
    common |= settings.get("conditions") or {}
    for raw in content.get("cells") or []:
        cell = {**common, **raw, **(raw.get("conditions") or {}), **(raw.get("summary") or {})}
        missing = [key for key in (*NEEDED, *CONDITIONS, "seed") if key not in cell]
        if missing:
            raise ConfigError(f"a cell of the encounter results has no {', '.join(missing)}; run `encounters` again")
        cells.append(cell)
    return cells


def contests_of(cells: Iterable[Cell]) -> list[Contest]:
    """Group cells by who met whom; of several results of the same cell the last counts."""
    groups: dict[tuple[Any, ...], dict[str, dict[str, Cell]]] = defaultdict(lambda: defaultdict(dict))
    for cell in cells:
        conditions = tuple(float(cell[key]) for key in CONDITIONS)
        groups[cell["own"], cell["other"], conditions, cell["seed"]][cell["guard"]][cell["family"]] = cell
    return [
        _contest(own, other, conditions, seed, by_guard) for (own, other, conditions, seed), by_guard in groups.items()
    ]


def _contest(
    own: str, other: str, conditions: tuple[float, ...], seed: int, by_guard: Mapping[str, Mapping[str, Cell]]
) -> Contest:
    seen = list(dict.fromkeys(family for cells in by_guard.values() for family in cells))
    common = [
        family
        for family in seen
        if len({cells[family]["encounters"] if family in cells else None for cells in by_guard.values()}) == 1
    ]
    left_out = tuple(family for family in seen if family not in common)
    return Contest(own, other, conditions, seed, tuple(common), left_out, by_guard)


def pool(cells: Sequence[Cell]) -> dict[str, Any]:
    """Add up counts, and weight means with encounters (None without any); what nobody judged may be avoidable.

    A mean of `LATER_MEANS` is None where a cell lacks it: of the other families alone it would be no total.
    """
    pooled: dict[str, Any] = {key: sum(cell[key] for cell in cells) for key in COUNTS}
    pooled |= {key: _mean(cells, key) for key in MEANS}
    pooled |= {key: _mean(cells, key) if all(key in cell for cell in cells) else None for key in LATER_MEANS}
    pooled["breached_upper"] = upper_bound(pooled["breached"], pooled["encounters"])
    pooled["avoidable_upper"] = upper_bound(pooled["avoidable"] + pooled["not_judged"], pooled["encounters"])
    return pooled


def _mean(cells: Sequence[Cell], key: str) -> float | None:
    parts = [(cell[key], cell["encounters"]) for cell in cells if cell[key] is not None]
    weight = sum(count for _, count in parts)
    return sum(value * count for value, count in parts) / weight if weight else None


def _rank(figures: Mapping[str, Any]) -> tuple[int, int, float]:
    return figures["avoidable"] + figures["not_judged"], figures["breached"], figures["changed_percent"]


def comparison_page(found: Sequence[Mapping[str, Any]], folder: Path) -> tuple[str, str, list[Path]]:
    """Name and text of the page of results of ``encounters``, and its pictures, drawn into the folder.

    Raises:
        ConfigError: no cell to compare.
    """
    contests = [one for one in contests_of(cell for content in found for cell in cells_of(content)) if one.families]
    if not contests:
        raise ConfigError("the encounter results have no family that all guards met; run them with the same --families")
    picture = plots.png(_plot(contests), folder / "comparison.png")
    versions = sorted({str((content.get("versions") or {}).get("steerclear")) for content in found})
    return "comparison.md", _text(contests, picture, versions), [picture]


def _plot(contests: Sequence[Contest]) -> Any:
    """Share of encounters breached over share of commands changed, with its one-sided 95 % upper limit."""
    panels = []
    for contest in contests:
        points = [
            (guard, one["changed_percent"], 100.0 * one["breached"] / one["encounters"], 100.0 * one["breached_upper"])
            for guard, one in contest.totals.items()
        ]
        panels.append((contest.title, points))
    return plots.scatter(panels, ("commands changed, %", "encounters breached, %"))


def _text(contests: Sequence[Contest], picture: Path, versions: Sequence[str]) -> str:
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
        "tables, how many nominal commands pass (both empty: results of an earlier version). The textbook filters are "
        "those of `steerclear.experiments.baselines.textbook`, with gains chosen by their own sweep on these "
        "platforms; `reach` is `steerclear.experiments.baselines.reach`, the value tables alone; `gatekeeper` "
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
