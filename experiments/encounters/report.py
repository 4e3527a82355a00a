"""The report of a run of encounters: table, bars, distributions of the closest distance, worst encounters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from .. import plots
from ..report import Plot, Report, Section, Table, Tile, made_of, plain
from ..tables import number_text
from .families import FAMILIES
from .guards import NONE

Cells = Sequence[Mapping[str, Any]]
MOST_M = 15.0
"""Distances beyond this are cut off: nobody is in danger there, m."""
COLUMNS = (
    ("guard", "guard"),
    ("encounters", "n"),
    ("breached", "breached"),
    ("avoidable", "avoidable"),
    ("avoidable_upper", "≤ at 95 %, %"),
    ("unavoidable", "unavoidable"),
    ("breaches_outside", "breached, started outside"),
    ("closest_m", "closest, m"),
    ("changed_percent", "changed, %"),
    ("inactive_percent", "left alone when safe, %"),
    ("heading_change_deg", "changed by, deg"),
    ("speed_change_mps", "changed by, m/s"),
    ("goal_time_ratio", "time to goal, ×"),
    ("reached_percent", "goal reached, %"),
    ("never_arrived_percent", "never arrived, %"),
    ("deadlocked", "deadlocked"),
    ("reversals_per_min", "reversals/min"),
    ("decision_us", "decision, µs"),
)
PERCENT = ("avoidable_upper",)
WORST_COLUMNS = (
    ("guard", "guard"),
    ("own", "own"),
    ("other", "other"),
    ("family", "family"),
    ("number", "number"),
    ("variant", "variant"),
    ("closest_m", "closest, m"),
    ("breaches", "breaches"),
    ("avoidable", "avoidable"),
    ("last_preventable_s", "until, s before"),
    ("responsible", "last chance let pass by"),
    ("start_certificate_m", "certificate at the start, m"),
)
NOTE = (
    "An encounter is breached when an own boat comes within the radius of any boat; avoidable when its own commands "
    "could have kept the radius. '≤ at 95 %' is the one-sided upper limit of the probability of an avoidable breach "
    "(Clopper and Pearson), breaches that were not judged counting as avoidable. 'Started outside' are encounters in "
    "which the shield's certificate at the first decision was at least 0 for every own boat, whatever guard played. "
    "Changes are means over the changed steps; time to the goal is against the same scenes without a guard, a boat "
    "that never arrives counting with the whole length. Closest distances beyond 15 m are cut off; the dashed line "
    "marks the radius."
)


def write_encounter_report(results: Mapping[str, Any], path: Path) -> Path:
    """Write the report.

    Args:
        results: what `results.results_of` gives; the replay is linked when ``files`` names one.
        path: file to write.

    Raises:
        ConfigError: the file cannot be written.
    """
    cells = results["cells"]
    pairs = list(dict.fromkeys((cell["own"], cell["other"]) for cell in cells))
    replay = results["files"].get("replay")
    links = [{"path": replay, "label": "the worst encounters, with the guard and without"}] if replay else []
    return Report(
        title="Encounters",
        subtitle=subtitle(results),
        tiles=_tiles(cells),
        links=links,
        goals=results["goals"],
        sections=[
            *(_platform_section(pair, cells, results["settings"]) for pair in pairs),
            Section("The worst encounters", [_worst_table(results["worst"])], NOTE, wide=True),
            made_of(results),
        ],
    ).write(path)


def subtitle(results: Mapping[str, Any]) -> str:
    """Conditions in one line."""
    settings, conditions = results["settings"], results["settings"]["conditions"]
    named = (("radius", "radius_m", "m"), ("delay", "delay_s", "s"), ("position error", "noise_m", "m"))
    parts = [
        f"{words} {conditions[name]:g} {unit}" for words, name, unit in (*named, ("current", "current_mps", "m/s"))
    ]
    return " · ".join([f"{settings['n']} encounters per cell", *parts, f"seed {settings['seed']}"])


def _tiles(cells: Cells) -> list[Tile]:
    tiles = []
    for guard in dict.fromkeys(cell["guard"] for cell in cells):
        own = [cell for cell in cells if cell["guard"] == guard]
        n, breached, avoidable = (sum(c[name] for c in own) for name in ("encounters", "breached", "avoidable"))
        judged = "no breach judged" if all(c["not_judged"] == c["breached"] for c in own) and breached else ""
        words = judged or f"avoidable: {avoidable}"
        tiles.append(Tile(f"{guard}: encounters breached", None, f"{breached} of {n:,}", words))
    return tiles


def _platform_section(pair: tuple[str, str], cells: Cells, settings: Mapping[str, Any]) -> Section:
    chosen = [cell for cell in cells if (cell["own"], cell["other"]) == pair]
    own, other = pair
    families = list(dict.fromkeys(cell["family"] for cell in chosen))
    rows = [[family, *_figures(cell)] for family in families for cell in chosen if cell["family"] == family]
    return Section(
        f"{own} meets {other}" if own != other else own,
        [Table("", ["family", *(words for _, words in COLUMNS)], rows)],
        plots=[_family_plot(name, chosen, settings) for name in families],
        wide=True,
    )


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
    series = [(name, colour, *_cut(quantiles)) for name, colour, quantiles in curves]
    figure = plots.curves(series, settings["conditions"]["radius_m"], words)
    legend = [(colour, name) for name, colour, _ in curves]
    return Plot(family, Markup(plots.svg(figure, words)), legend, [("", FAMILIES[family].words)])


def _cut(quantiles: Sequence[float]) -> tuple[list[float], list[float]]:
    """A distribution function from quantiles at equal steps of probability, up to `MOST_M`."""
    steps = max(1, len(quantiles) - 1)
    kept = [(value, k / steps) for k, value in enumerate(quantiles) if value < MOST_M]
    kept.append((MOST_M, 1.0 if len(kept) == len(quantiles) else kept[-1][1] if kept else 0.0))
    kept.insert(0, (kept[0][0], 0.0))
    return [value for value, _ in kept], [share for _, share in kept]


def _figures(cell: Mapping[str, Any]) -> list[str]:
    shown = []
    for name, _ in COLUMNS:
        value = 100.0 * cell[name] if name in PERCENT else cell[name]
        text = str(value) if isinstance(value, str | int) else number_text(value)
        if name == "avoidable" and cell["not_judged"]:
            text += f" (+{cell['not_judged']} not judged)"
        if name == "breaches_outside":
            text += f" of {cell['started_outside']}"
        shown.append(text)
    return shown


def _worst_table(worst: Cells) -> Table:
    rows = [
        [f"{row[name]:.2f}" if isinstance(row[name], float) else plain(row[name]) for name, _ in WORST_COLUMNS]
        for row in worst
    ]
    return Table("", [words for _, words in WORST_COLUMNS], rows, numbers=False)
