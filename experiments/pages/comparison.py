"""The page that compares guards on the same encounters: Markdown tables from results of ``encounters``."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from steerclear.shield.exceptions import ConfigError

from ..encounters.summary import upper_bound
from ..play.conditions import words_of

CONDITIONS = ("radius_m", "delay_s", "noise_m", "current_mps")
COUNTS = ("encounters", "breached", "avoidable", "unavoidable", "not_judged", "deadlocked")
MEANS = ("changed_percent", "goal_time_ratio", "reversals_per_min", "decision_us")
LATER_MEANS = ("never_arrived_percent", "inactive_percent")
"""Means that results of earlier versions lack: theirs stay unknown."""
NAMED = ("family", "guard", "own", "other")
NEEDED = (*NAMED, *COUNTS, *MEANS)
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
        _check_kinds(cell)
        cells.append(cell)
    return cells


def _check_kinds(cell: Mapping[str, Any]) -> None:
    """Refuse names that are none, and figures that are no numbers.

    Raises:
        ConfigError: there is one.
    """
    wrong = [name for name in NAMED if not isinstance(cell[name], str)]
    wrong += [name for name in (*COUNTS, "seed") if not _is_count(cell[name])]
    wrong += [name for name in CONDITIONS if not _is_number(cell[name])]
    means = [name for name in (*MEANS, *LATER_MEANS) if name in cell]
    wrong += [name for name in means if cell[name] is not None and not _is_number(cell[name])]
    if wrong:
        raise ConfigError(f"a cell of the encounter results has no usable {', '.join(wrong)}; run `encounters` again")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e15


def _is_count(value: Any) -> bool:
    return _is_number(value) and value >= 0 and value == int(value)


def contests_of(cells: Iterable[Cell]) -> list[Contest]:
    """Group cells by who met whom; of several results of the same cell the last counts."""
    groups: dict[tuple[Any, ...], dict[str, dict[str, Cell]]] = defaultdict(lambda: defaultdict(dict))
    for cell in cells:
        conditions = tuple(float(cell[key]) for key in CONDITIONS)
        groups[cell["own"], cell["other"], conditions, cell["seed"]][cell["guard"]][cell["family"]] = cell
    return [_contest(*key, by_guard) for key, by_guard in groups.items()]


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
