"""What a run of encounters shows: the files of its folder, the report, the table of the terminal."""

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
from .figures import FIGURES, WORST
from .replay import replay_worst
from .results import Settings
from .scenarios import FAMILIES

Cell = Mapping[str, Any]
Cells = Sequence[Cell]
MOST_M = 15.0
"""Distances beyond this are cut off: nobody is in danger there, m."""
SHOWN = {"guard": "guard", **{one.key: one.label for one in FIGURES if one.label}}
NOTE = (
    "An encounter is breached when an own boat comes within the radius of any boat; avoidable when its own commands "
    "could have kept the radius. '≤ at 95 %' is the one-sided upper limit of the probability of an avoidable breach "
    "(Clopper and Pearson), breaches that were not judged counting as avoidable. 'Started outside' are encounters in "
    "which the shield's certificate at the first decision was at least 0 for every own boat, whatever guard played. "
    "Changes are means over the changed steps; time to the goal is against the same scenes without a guard, a boat "
    "that never arrives counting with the whole length. Closest distances beyond 15 m are cut off; the dashed line "
    "marks the radius."
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
    """Write the report.

    Args:
        results: what `results.results_of` gives; the replay is linked when ``files`` names one.
        path: file to write.

    Raises:
        ConfigError: the file cannot be written.
    """
    cells, settings = results["cells"], results["settings"]
    replay = results["files"].get("replay")
    worst = [[_worst_text(row[name]) for name in WORST] for row in results["worst"]]
    heads = [label for label, _ in WORST.values()]
    pairs = dict.fromkeys((cell["own"], cell["other"]) for cell in cells)
    return Report(
        title="Encounters",
        subtitle=subtitle(settings),
        tiles=[_tile(guard, cells) for guard in dict.fromkeys(cell["guard"] for cell in cells)],
        links=[{"path": replay, "label": "the worst encounters, with the guard and without"}] if replay else [],
        goals=results["goals"],
        sections=[
            *(_platform_section(pair, cells, settings) for pair in pairs),
            Section("The worst encounters", [Table("", heads, worst, numbers=False)], NOTE, wide=True),
            made_of(results),
        ],
    ).write(path)


def subtitle(settings: Mapping[str, Any]) -> str:
    """Conditions in one line."""
    conditions = settings["conditions"]
    units = {"radius": ("radius_m", "m"), "delay": ("delay_s", "s"), "position error": ("noise_m", "m")}
    units["current"] = ("current_mps", "m/s")
    parts = [f"{words} {conditions[name]:g} {unit}" for words, (name, unit) in units.items()]
    return " · ".join([f"{settings['n']} encounters per cell", *parts, f"seed {settings['seed']}"])


def _tile(guard: str, cells: Cells) -> Tile:
    own = [cell for cell in cells if cell["guard"] == guard]
    n, breached, avoidable = (sum(c[name] for c in own) for name in ("encounters", "breached", "avoidable"))
    unjudged = breached and all(c["not_judged"] == c["breached"] for c in own)
    words = "no breach judged" if unjudged else f"avoidable: {avoidable}"
    return Tile(f"{guard}: encounters breached", None, f"{breached} of {n:,}", words)


def _platform_section(pair: tuple[str, str], cells: Cells, settings: Mapping[str, Any]) -> Section:
    chosen = [cell for cell in cells if (cell["own"], cell["other"]) == pair]
    own, other = pair
    families = list(dict.fromkeys(cell["family"] for cell in chosen))
    rows = [
        [family, *(_report_text(cell, name) for name in SHOWN)]
        for family in families
        for cell in chosen
        if cell["family"] == family
    ]
    return Section(
        f"{own} meets {other}" if own != other else own,
        [Table("", ["family", *SHOWN.values()], rows)],
        plots=[_family_plot(name, chosen, settings) for name in families],
        wide=True,
    )


def _report_text(cell: Cell, name: str) -> str:
    value = 100.0 * cell[name] if name == "avoidable_upper" else cell[name]
    text = str(value) if isinstance(value, str | int) else number_text(value)
    if name == "avoidable" and cell["not_judged"]:
        text += f" (+{cell['not_judged']} not judged)"
    return f"{text} of {cell['started_outside']}" if name == "breaches_outside" else text


def _worst_text(value: Any) -> str:
    return f"{value:.2f}" if isinstance(value, float) else plain(value)


def _family_plot(family: str, cells: Cells, settings: Mapping[str, Any]) -> Plot:
    """Share of encounters that came closer than a distance."""
    own = [cell for cell in cells if cell["family"] == family]
    named = [name for name in settings["guards"] if name != NONE]
    curves = [("without a guard", "off", own[0]["unshielded_closest_quantiles_m"])]
    curves += [
        (cell["guard"], plots.SERIES[named.index(cell["guard"]) % len(plots.SERIES)], cell["closest_quantiles_m"])
        for cell in own
        if cell["guard"] != NONE
    ]
    words = "closest distance, m: share that came closer"
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
    words = f"{cell['avoidable']}" + (f"+{cell['not_judged']}?" if cell["not_judged"] else "")
    return Text(words, "red" if cell["avoidable"] and is_shield(cell["guard"]) else "")


HEADS = {
    "bare": ("encounters breached without a guard", lambda c: f"{c['unshielded_breached']}"),
    "hit": ("breached with it", lambda c: f"{c['breached']}"),
    "avoid": ("of these avoidable in hindsight (+ not judged?)", _avoidable_text),
    "<=%": (
        "95 % upper limit of the avoidable ones, % of the encounters",
        lambda c: number_text(100.0 * c["avoidable_upper"]),
    ),
    "unav": ("unavoidable, or begun inside the radius", lambda c: f"{c['unavoidable'] + c['started_inside']}"),
    "out": (
        "breached of those that started outside the unavoidable set",
        lambda c: f"{c['breaches_outside']}/{c['started_outside']}",
    ),
    "near": ("closest distance, m", lambda c: number_text(c["closest_m"])),
    "chg%": ("commands changed, %", lambda c: number_text(c["changed_percent"])),
    "time": ("to the goal, over that without a guard", lambda c: number_text(c["goal_time_ratio"])),
    "lost": (
        "own boats not at their goal by the end that get there without a guard, %",
        lambda c: number_text(c["never_arrived_percent"]),
    ),
    "dead": ("deadlocks", lambda c: f"{c['deadlocked']}"),
    "rev": ("reversals per boat and minute", lambda c: number_text(c["reversals_per_min"])),
    "us": ("microseconds per decision", lambda c: f"{c['decision_us']:.0f}"),
}
"""Columns of the terminal's table, and what they mean: of a thousand encounters they just fit 80 characters."""


def heads_legend() -> str:
    """What the columns of the terminal's table mean, in a sentence."""
    return "; ".join(f"{head}: {words}" for head, (words, _) in HEADS.items())


def cells_table(results: Mapping[str, Any]) -> list[Group]:
    """Tables for the terminal, one per pair of platforms and guard."""
    groups: dict[tuple[str, str, str], list[Cell]] = {}
    for cell in results["cells"]:
        groups.setdefault((cell["own"], cell["other"], cell["guard"]), []).append(cell)
    return [_table(*names, cells) for names, cells in groups.items()]


def _table(own: str, other: str, guard: str, cells: Cells) -> Group:
    rows = [[cell["family"], *(text(cell) for _, text in HEADS.values())] for cell in cells]
    counts = sorted({cell["encounters"] for cell in cells})
    title = f"{own} meets {other}, guard {guard}, {'-'.join(f'{n}' for n in (*counts[:1], *counts[1:][-1:]))} each"
    return titled(title, ["", *HEADS], rows)
