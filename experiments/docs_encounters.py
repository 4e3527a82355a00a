"""The page that compares safety filters on the same encounters, made of results of ``encounters``."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
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
COUNTS = ("encounters", "breached", "avoidable", "unavoidable", "not_judged", "deadlocked")
MEANS = ("changed_percent", "goal_time_ratio", "reversals_per_min", "decision_us")
LATER_MEANS = ("never_arrived_percent", "inactive_percent")
"""Means that results of earlier versions lack: theirs stay unknown."""
NEEDED = ("family", "guard", "own", "other", *COUNTS, *MEANS, *CONDITIONS, "seed")
NO_GUARD = "none"
RULE = "fewest avoidable or unjudged, then fewest breached, then fewest commands changed"
Cell = Mapping[str, Any]
Columns = Mapping[str, Callable[[Cell], Any]]


@dataclass(frozen=True)
class Contest:
    """Safety filters that met the same encounters.

    Attributes:
        own: platform of the own boats.
        other: platform of the others.
        conditions: radius, delay, noise and current.
        seed: of the scenes.
        cells: by filter and family.
    """

    own: str
    other: str
    conditions: tuple[float, ...]
    seed: int
    cells: Mapping[str, Mapping[str, Cell]]

    @cached_property
    def _seen(self) -> dict[str, bool]:
        """Families, and whether every filter met equally many of them."""
        seen = dict.fromkeys(family for cells in self.cells.values() for family in cells)
        met = {f: {cells[f]["encounters"] if f in cells else None for cells in self.cells.values()} for f in seen}
        return {family: len(counts) == 1 for family, counts in met.items()}

    @property
    def families(self) -> tuple[str, ...]:
        """Families that every filter met, equally many of each."""
        return tuple(family for family, common in self._seen.items() if common)

    @property
    def left_out(self) -> tuple[str, ...]:
        """The others."""
        return tuple(family for family, common in self._seen.items() if not common)

    @property
    def title(self) -> str:
        """Who meets whom, and how."""
        radius, *others = self.conditions
        extras = words_of(dict(zip(CONDITIONS[1:], others, strict=True)))
        return ", ".join(filter(None, [f"{self.own} meets {self.other}, {radius:g} m", extras]))

    @cached_property
    def totals(self) -> dict[str, dict[str, Any]]:
        """Figures of every filter over the common families."""
        return {guard: pool([cells[family] for family in self.families]) for guard, cells in self.cells.items()}

    @property
    def winner(self) -> str | None:
        """The best by `RULE`; None without any."""

        def rank(guard: str) -> tuple[int, int, float]:
            one = self.totals[guard]
            return one["avoidable"] + one["not_judged"], one["breached"], one["changed_percent"]

        return min((guard for guard in self.totals if guard != NO_GUARD), key=rank, default=None)


def cells_of(content: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Read the cells of results, flat: names, conditions, seed and figures in one mapping each.

    Raises:
        ConfigError: a cell lacks a figure.
    """
    settings, cells = content.get("settings") or {}, []
    common = {key: settings[key] for key in (*CONDITIONS, "seed", "own", "other") if key in settings}
    common |= settings.get("conditions") or {}
    for raw in content.get("cells") or []:
        cell = {**common, **raw}
        if missing := [key for key in NEEDED if key not in cell]:
            raise ConfigError(f"a cell of the encounter results has no {', '.join(missing)}; run `encounters` again")
        cells.append(cell)
    return cells


def contests_of(cells: Iterable[Cell]) -> list[Contest]:
    """Group cells by who met whom; of several results of the same cell the last counts."""
    groups: dict[tuple[Any, ...], dict[str, dict[str, Cell]]] = defaultdict(lambda: defaultdict(dict))
    for cell in cells:
        conditions = tuple(float(cell[key]) for key in CONDITIONS)
        groups[cell["own"], cell["other"], conditions, cell["seed"]][cell["guard"]][cell["family"]] = cell
    return [Contest(own, other, conditions, seed, met) for (own, other, conditions, seed), met in groups.items()]


def pool(cells: Sequence[Cell]) -> dict[str, Any]:
    """Add up counts, and weight means with encounters (None without any); what nobody judged may be avoidable.

    A mean of `LATER_MEANS` is None where a cell lacks it: of the other families alone it would be no total.
    """
    pooled: dict[str, Any] = {key: sum(cell[key] for cell in cells) for key in COUNTS}
    for key in (*MEANS, *LATER_MEANS):
        parts = [(c[key], c["encounters"]) for c in cells if c.get(key) is not None]
        weight = sum(count for _, count in parts) if all(key in cell for cell in cells) else 0
        pooled[key] = sum(value * count for value, count in parts) / weight if weight else None
    pooled["breached_upper"] = upper_bound(pooled["breached"], pooled["encounters"])
    pooled["avoidable_upper"] = upper_bound(pooled["avoidable"] + pooled["not_judged"], pooled["encounters"])
    return pooled


def comparison_page(found: Sequence[Mapping[str, Any]], folder: Path) -> tuple[str, str, list[Path]]:
    """Name and text of the page of results of ``encounters``, and its pictures, drawn into the folder.

    Raises:
        ConfigError: no cell to compare.
    """
    contests = [one for one in contests_of(cell for content in found for cell in cells_of(content)) if one.families]
    if not contests:
        raise ConfigError("the encounter results have no family that all guards met; run them with the same --families")
    panels = [(contest.title, [_point(guard, one) for guard, one in contest.totals.items()]) for contest in contests]
    words = ("commands changed, %", "encounters breached, %")
    picture = plots.png(plots.scatter(panels, words), folder / "comparison.png")
    versions = sorted({str((content.get("versions") or {}).get("steerclear")) for content in found})
    guards = {guard for contest in contests for guard in contest.cells}
    title = "Guards on the same encounters" if len(guards) > 1 else f"Encounters with {guards.pop()}"
    intro = template("comparison.txt").strip().format(versions=line(", ".join(versions)))
    return Report(title, "", notes=[intro], sections=[*map(_section, contests)]).page("comparison.md", picture)


def _section(contest: Contest) -> Section:
    best = contest.winner if len(contest.cells) > 1 else None
    totals = [
        [f"**{guard}**" if guard == best else guard, *(text(one) for text in _TOTALS.values())]
        for guard, one in contest.totals.items()
    ]
    if len(contest.cells) == 1:
        (cells,) = contest.cells.values()
        told = [{**cells[family], **pool([cells[family]])} for family in contest.families]
        rows = [[one["family"], *(text(one) for text in _FAMILY.values())] for one in told]
        families = Table("Family by family", ["", *_FAMILY], rows)
    else:
        rows = [
            [f, *(f"{c[f]['breached']}, {c[f]['changed_percent']:.0f} %" for c in contest.cells.values())]
            for f in contest.families
        ]
        families = Table("Encounters breached, and share of commands changed", ["", *contest.cells], rows)
    words = f"Families: {', '.join(contest.families)}; seed {contest.seed}."
    if contest.left_out:
        words += f" Not met equally by all guards and left out: {', '.join(contest.left_out)}."
    words = f"Best ({RULE}): **{best}**. {words}" if best else words
    return Section(contest.title, [Table("", ["guard", *_TOTALS], totals), families], words)


def _point(guard: str, one: Cell) -> tuple[str, float, float, float]:
    breached = 100.0 * one["breached"] / one["encounters"]
    return guard, one["changed_percent"], breached, 100.0 * one["breached_upper"]


def _bounded(key: str) -> Callable[[Cell], str]:
    """A count, with what was not judged beside it, and the upper limit of its probability."""

    def text(one: Cell) -> str:
        unjudged = f" to {one[key] + one['not_judged']}" if key == "avoidable" and one["not_judged"] else ""
        return _count(f"{one[key]}{unjudged}", one[f"{key}_upper"])

    return text


def _count(count: int | str, upper: float) -> str:
    percent = 100.0 * upper
    return f"{count} [{percent:.0f} %]" if percent >= 99.5 else f"{count} [{percent:.2g} %]"


def _percent(key: str) -> Callable[[Cell], str]:
    return lambda one: "" if one[key] is None else f"{number_text(one[key])} %"


def _number(key: str, digits: int) -> Callable[[Cell], str]:
    return lambda one: "" if one[key] is None else f"{one[key]:.{digits}f}"


def _outside(one: Cell) -> str:
    n = one.get("started_outside")
    return _count(one["breaches_outside"], upper_bound(one["breaches_outside"], n)) if n else ""


_CHANGED: Columns = {"commands changed": lambda one: f"{one['changed_percent']:.1f} %"}
_TOTALS: Columns = {
    "encounters": lambda one: f"{one['encounters']:,}",
    "avoidable": _bounded("avoidable"),
    "unavoidable": lambda one: one["unavoidable"],
    "not judged": lambda one: one["not_judged"],
    "breached": _bounded("breached"),
    **_CHANGED,
    "left alone": _percent("inactive_percent"),
    "time to goal": _number("goal_time_ratio", 2),
    "never arrived": _percent("never_arrived_percent"),
    "deadlocked": lambda one: one["deadlocked"],
    "reversals / min": _number("reversals_per_min", 1),
    "µs per decision": _number("decision_us", 1),
}
"""Columns of the table of totals, with what they show of a filter."""
_FAMILY: Columns = {
    "breached": _bounded("breached"),
    "avoidable": _bounded("avoidable"),
    "unavoidable": lambda one: one["unavoidable"],
    "started outside": lambda one: f"{one['started_outside']:,}" if one.get("started_outside") is not None else "",
    "of these breached": _outside,
    **_CHANGED,
    "time to goal": _number("goal_time_ratio", 2),
    "never arrived": _percent("never_arrived_percent"),
}
"""The same of one filter's families."""
