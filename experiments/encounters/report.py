"""What a run of encounters shows: the report, and the table of the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup
from rich.console import Group
from rich.text import Text

from .. import plots
from ..baselines.registry import NONE, is_shield
from ..report import Plot, Report, Section, Table, Tile, made_of, plain
from ..runner import RESULTS_FILE, Run
from ..tables import number_text, titled
from ..words import count_text
from .figures import FIGURES, WORST
from .replay import replay_worst
from .results import Settings
from .scenarios import FAMILIES

Cell = Mapping[str, Any]
Cells = Sequence[Cell]
MOST_M = 15.0
"""Distances beyond this are cut off: nobody is in danger there, m."""
SHOWN = {"filter": "filter", **{key: one.label for key, one in FIGURES.items() if one.label}}
CONDITIONS = {"radius_m": "separation {:g} m", "delay_s": "delay {:g} s", "noise_m": "position error {:g} m"}
CONDITIONS |= {"current_mps": "current {:g} m/s"}
NOTE = (
    "An encounter has a violation when an own boat comes within the separation of any boat. It is avoidable when the "
    "own boat's commands could have kept it. '≤ at 95 %' is the one-sided upper limit of the probability of an "
    "avoidable violation (Clopper and Pearson); those not judged count as avoidable. An encounter starts outside the "
    "unavoidable set when the shield's safety margin at the first decision is at least 0 for every own boat, whatever "
    "filter plays. Changes are means over the changed steps; time to the goal is against the same scenes without a "
    "filter, a boat that never arrives counting with the whole length. Closest distances beyond 15 m are cut off."
)


def write_all(run: Run, settings: Settings, results: dict[str, Any]) -> None:
    """Write replay, report and results.json into the folder; names are noted under ``files``."""
    results["files"] |= {"report": "report.html", "results": RESULTS_FILE}
    if results["worst"] and not run.interrupted:
        replay_worst(results["worst"], settings.conditions, settings.seed, run.folder / "replay.html")
        results["files"]["replay"] = "replay.html"
    write_encounter_report(results, run.folder / "report.html")
    run.write(results)


def write_encounter_report(results: Mapping[str, Any], path: Path) -> Path:
    """Write the report of what `results.results_of` gives; the replay is linked when ``files`` names one."""
    cells, settings, replay = results["cells"], results["settings"], results["files"].get("replay")
    pairs = dict.fromkeys((cell["own"], cell["other"]) for cell in cells)
    worst = [[row[name] for name in WORST] for row in results["worst"]]
    worst = [[f"{value:.2f}" if isinstance(value, float) else plain(value) for value in row] for row in worst]
    each = count_text(settings["n"], "encounter")
    conditions = [words.format(settings["conditions"][name]) for name, words in CONDITIONS.items()]
    return Report(
        title="Encounters",
        subtitle=" · ".join([f"{each} of each family, with each filter", *conditions, f"seed {settings['seed']}"]),
        tiles=[_tile(safety_filter, cells) for safety_filter in dict.fromkeys(cell["filter"] for cell in cells)],
        links=[{"path": replay, "label": "the worst encounters, with the filter and without"}] if replay else [],
        goals=results["goals"],
        notes=[NOTE],
        sections=[
            *(_section(pair, cells, settings) for pair in pairs),
            Section(
                "The worst encounters of each filter",
                [Table("", [head for head, _ in WORST.values()], worst, numbers=False)],
                "Avoidable violations first, then the closest.",
                wide=True,
            ),
            made_of(results),
        ],
    ).write(path)


def _tile(safety_filter: str, cells: Cells) -> Tile:
    own = [cell for cell in cells if cell["filter"] == safety_filter]
    n, violated, avoidable = (sum(c[name] for c in own) for name in ("encounters", "violated", "avoidable"))
    unjudged = violated and all(c["not_judged"] == c["violated"] for c in own)
    words = "no violation judged" if unjudged else f"avoidable: {avoidable}"
    return Tile(f"{safety_filter}: encounters with violations", None, f"{violated} of {n:,}", words)


def _section(pair: tuple[str, str], cells: Cells, settings: Mapping[str, Any]) -> Section:
    """Table and plots of a pair of platforms."""
    chosen = [cell for cell in cells if (cell["own"], cell["other"]) == pair]
    families = {name: [cell for cell in chosen if cell["family"] == name] for name in (c["family"] for c in chosen)}
    rows = [[name, *(_text(cell, key) for key in SHOWN)] for name, own in families.items() for cell in own]
    shown = [_plot(name, own, settings) for name, own in families.items()]
    title = pair[0] if pair[0] == pair[1] else f"{pair[0]} meets {pair[1]}"
    return Section(title, [Table("", ["family", *SHOWN.values()], rows)], plots=shown, wide=True)


def _text(cell: Cell, name: str) -> str:
    value = 100.0 * cell[name] if name == "avoidable_upper" else cell[name]
    text = str(value) if isinstance(value, str | int) else number_text(value)
    if name == "avoidable" and cell["not_judged"]:
        text += f" (+{cell['not_judged']} not judged)"
    return f"{text} of {cell['started_outside']}" if name == "violations_outside" else text


def _plot(family: str, cells: Cells, settings: Mapping[str, Any]) -> Plot:
    """Share of encounters that came closer than a distance."""
    named = [name for name in settings["filters"] if name != NONE]
    curves = [("without a filter", "off", cells[0]["unshielded_closest_quantiles_m"])]
    curves += [
        (cell["filter"], plots.SERIES[named.index(cell["filter"]) % len(plots.SERIES)], cell["closest_quantiles_m"])
        for cell in cells
        if cell["filter"] != NONE
    ]
    words = "share that came closer than that, m; dashed: the separation"
    series = [(name, colour, *distribution(quantiles)) for name, colour, quantiles in curves]
    figure = plots.curves(series, settings["conditions"]["radius_m"], words)
    legend = [(colour, name) for name, colour, _ in curves]
    return Plot(family, Markup(plots.svg(figure, words)), legend, [("", FAMILIES[family].words)])


def distribution(quantiles: Sequence[float]) -> tuple[list[float], list[float]]:
    """A distribution function from quantiles at equal steps of probability, up to `MOST_M`."""
    steps = max(1, len(quantiles) - 1)
    kept = [(value, k / steps) for k, value in enumerate(quantiles) if value < MOST_M]
    kept.append((MOST_M, 1.0 if len(kept) == len(quantiles) else kept[-1][1] if kept else 0.0))
    kept.insert(0, (kept[0][0], 0.0))
    return [value for value, _ in kept], [share for _, share in kept]


def _avoidable_text(cell: Cell) -> Text:
    told = [str(cell["avoidable"])] if cell["avoidable"] or not cell["not_judged"] else []
    words = "+".join(told + ([f"{cell['not_judged']}?"] if cell["not_judged"] else []))
    return Text(words, "red" if cell["avoidable"] and is_shield(cell["filter"]) else "")


HEADS: dict[str, tuple[str, Any]] = {
    "bare": ("encounters with violations without a filter", "unshielded_violated"),
    "hit": ("with the filter", "violated"),
    "avoid": ("of these avoidable in hindsight (?: not judged)", _avoidable_text),
    "<=%": ("95 % upper limit of the avoidable ones, % of the encounters", lambda c: _text(c, "avoidable_upper")),
    "unav": ("unavoidable, or begun inside the separation", lambda c: f"{c['unavoidable'] + c['started_inside']}"),
    "out%": (
        "with violations, % of those that started outside the unavoidable set",
        lambda c: number_text(100.0 * c["violations_outside"] / c["started_outside"] if c["started_outside"] else None),
    ),
    "near": ("closest distance, m", "closest_m"),
    "chg%": ("commands changed, %", "changed_percent"),
    "time": ("to the goal, over that without a filter", "goal_time_ratio"),
    "lost": ("own boats not at their goal by the end that get there without a filter, %", "never_arrived_percent"),
    "dead": ("deadlocks", "deadlocked"),
    "rev": ("reversals per boat and minute", "reversals_per_min"),
    "us": ("microseconds per decision", lambda c: f"{c['decision_us']:.0f}"),
}
"""Columns of the terminal's table, what they mean, and the figure or how it is written.

Of a thousand encounters they just fit 80 characters, the family in `FAMILY_LETTERS`."""
FAMILY_LETTERS = 14
LEGEND = "; ".join(f"{head}: {words}" for head, (words, _) in HEADS.items())


def cells_table(results: Mapping[str, Any]) -> list[Group]:
    """Tables for the terminal, one per pair of platforms and filter."""
    groups: dict[tuple[str, str, str], list[Cell]] = {}
    for cell in results["cells"]:
        groups.setdefault((cell["own"], cell["other"], cell["filter"]), []).append(cell)
    tables = []
    for (own, other, safety_filter), cells in groups.items():
        rows = [
            [_broken(c["family"]), *(_text(c, of) if isinstance(of, str) else of(c) for _, of in HEADS.values())]
            for c in cells
        ]
        counts = sorted({cell["encounters"] for cell in cells})
        each = count_text(counts[0], "encounter") if len(counts) == 1 else f"{counts[0]}-{counts[-1]} encounters"
        tables.append(titled(f"{own} meets {other}, filter {safety_filter}, {each} each", ["", *HEADS], rows))
    return tables


def _broken(family: str) -> str:
    """A family's name, a long one in two lines."""
    at = family.rfind("_", 0, FAMILY_LETTERS) + 1
    return family if len(family) <= FAMILY_LETTERS or not at else f"{family[:at]}\n {family[at:]}"
