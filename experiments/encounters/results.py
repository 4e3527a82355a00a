"""Putting together what a run of encounters gave: results.json, report, replay, the table of the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Group
from rich.text import Text

from ..metrics import judged
from ..result_files import table_name
from ..runner import RESULTS_FILE, Run
from ..tables import number_text, titled
from .campaign import Settings, cell_summaries, columns_of
from .families import FAMILIES
from .guards import SHIELD
from .report import write_encounter_report
from .worst import replay_worst, worst_encounters

ONE_RAMMER = "rammer_1"
UNAVOIDABLE_PERCENT = 1.0
"""Most encounters with several others that may be breached unavoidably, %."""


def results_of(run: Run) -> dict[str, Any]:
    """Content of results.json, of what is on disk."""
    columns = columns_of(run.rows)
    cells = cell_summaries(columns)
    failed = [{**job["cell"], **{name: job[name] for name in ("first", "error", "fault")}} for job in run.failed]
    played = sum(cell["encounters"] for cell in cells)
    goals = goals_of(cells)
    return {
        **run.head(),
        "encounters_played": played,
        "encounters_resumed": run.resumed,
        "failed": failed,
        "cells": cells,
        "goals": goals,
        "worst": worst_encounters(columns),
        "files": {"games": table_name()},
        "deprecated": {"bars": goals},
    }


def goals_of(cells: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Goals of every shield: no avoidable breach, few unavoidable ones among several others.

    One rammer of the same platform must not breach at all where the start was outside the unavoidable set. A count
    that the oracle was not asked about leaves the goal without data.
    """
    goals = []
    for guard in dict.fromkeys(cell["guard"] for cell in cells if is_shield(cell["guard"])):
        own = [cell for cell in cells if cell["guard"] == guard]
        many = [cell for cell in own if FAMILIES[cell["family"]].others > 1]
        goals.append(_goal(f"{guard}: encounters with avoidable breaches", _total(own, "avoidable"), 0.0, own))
        same = [cell for cell in own if cell["family"] == ONE_RAMMER and cell["own"] == cell["other"]]
        if same:
            goals.append(
                _goal(f"{guard}: started outside, breached by one rammer", _total(same, "breaches_outside"), 0.0)
            )
        if many:
            share = 100.0 * max(cell["unavoidable"] / cell["encounters"] for cell in many)
            goals.append(_goal(f"{guard}: unavoidable, worst of several others, %", share, UNAVOIDABLE_PERCENT, many))
    return goals


def is_shield(guard: str) -> bool:
    """Whether a guard is the shield, with whatever settings."""
    return guard.partition(":")[0] == SHIELD


def _total(cells: Sequence[Mapping[str, Any]], name: str) -> float:
    return float(sum(cell[name] for cell in cells))


def _goal(name: str, value: float, limit: float, cells: Sequence[Mapping[str, Any]] = ()) -> dict[str, Any]:
    """A goal; ``cells`` are those whose verdicts it hangs on: what was not judged leaves it without data."""
    return judged(name, value, "<=", limit, open_=any(cell["not_judged"] for cell in cells))


def write_all(run: Run, settings: Settings, results: dict[str, Any]) -> None:
    """Write replay, report and results.json into the folder; names are noted under ``files``."""
    results["files"] |= {"report": "report.html", "results": RESULTS_FILE}
    if results["worst"] and not run.interrupted:
        replay_worst(results["worst"], settings.conditions, settings.seed, run.folder / "replay.html")
        results["files"]["replay"] = "replay.html"
    write_encounter_report(results, run.folder / "report.html")
    run.write(results)


HEADS = (
    ("bare", "encounters breached without a guard"),
    ("hit", "breached with it"),
    ("avoid", "of these avoidable in hindsight (+ not judged?)"),
    ("<=%", "95 % upper limit of the avoidable ones, % of the encounters"),
    ("unav", "unavoidable, or begun inside the radius"),
    ("out", "breached of those that started outside the unavoidable set"),
    ("near", "closest distance, m"),
    ("chg%", "commands changed, %"),
    ("time", "to the goal, over that without a guard"),
    ("lost", "own boats not at their goal by the end that get there without a guard, %"),
    ("dead", "deadlocks"),
    ("rev", "reversals per boat and minute"),
    ("us", "microseconds per decision"),
)
"""Columns of the terminal's table and what they mean: of a thousand encounters they just fit 80 characters."""


def heads_legend() -> str:
    """What the columns of the terminal's table mean, in a sentence."""
    return "; ".join(f"{head}: {words}" for head, words in HEADS)


def cells_table(results: Mapping[str, Any]) -> list[Group]:
    """Tables for the terminal, one per pair of platforms and guard."""
    cells = results["cells"]
    groups = dict.fromkeys((cell["own"], cell["other"], cell["guard"]) for cell in cells)
    return [_table(*group, [c for c in cells if (c["own"], c["other"], c["guard"]) == group]) for group in groups]


def _table(own: str, other: str, guard: str, cells: Sequence[Mapping[str, Any]]) -> Group:
    heads = ["", *(head for head, _words in HEADS)]
    rows: list[list[str | Text]] = [[cell["family"], *_figures(cell)] for cell in cells]
    counts = sorted({cell["encounters"] for cell in cells})
    title = f"{own} meets {other}, guard {guard}, {'-'.join(f'{n}' for n in (*counts[:1], *counts[1:][-1:]))} each"
    return titled(title, heads, rows)


def _figures(cell: Mapping[str, Any]) -> list[str | Text]:
    """Cells of the terminal's table; "out" is breached of those that started outside the unavoidable set."""
    avoidable = f"{cell['avoidable']}" + (f"+{cell['not_judged']}?" if cell["not_judged"] else "")
    return [
        f"{cell['unshielded_breached']}",
        f"{cell['breached']}",
        Text(avoidable, "red" if cell["avoidable"] and is_shield(cell["guard"]) else ""),
        number_text(100.0 * cell["avoidable_upper"]),
        f"{cell['unavoidable'] + cell['started_inside']}",
        f"{cell['breaches_outside']}/{cell['started_outside']}",
        number_text(cell["closest_m"]),
        number_text(cell["changed_percent"]),
        number_text(cell["goal_time_ratio"]),
        number_text(cell["never_arrived_percent"]),
        f"{cell['deadlocked']}",
        number_text(cell["reversals_per_min"]),
        f"{cell['decision_us']:.0f}",
    ]
