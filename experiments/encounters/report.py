"""The report of a run of encounters: table, bars, distributions of the closest distance, worst encounters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..report.page import as_text, report_page, template, write_page
from ..report.parts import bars_table, legend, replay_links, values_table
from ..report.tables import number_text
from .cdf import Curve, distribution_plot
from .families import FAMILIES
from .guards import NONE

Cells = Sequence[Mapping[str, Any]]
STYLES = 6
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
STYLE = """
svg .curve { fill: none !important; stroke-width: 2; stroke-linejoin: round; }
.curve.off { stroke: var(--off); } .curve.reason-0 { stroke: var(--r0); } .curve.reason-1 { stroke: var(--r1); }
.curve.reason-2 { stroke: var(--r2); } .curve.reason-3 { stroke: var(--r3); } .curve.reason-4 { stroke: var(--r4); }
.curve.reason-5 { stroke: var(--r5); }
.small { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 300px), 1fr)); gap: 12px;
  margin: 12px 0; }
td.first, th.first { text-align: left; white-space: nowrap; }
th.number { white-space: normal; vertical-align: bottom; }
tr.family td { padding-top: 10px; color: var(--muted); border-bottom: none; }
"""


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
    parts = {
        "TITLE": "Encounters",
        "STYLE": template("report.css") + STYLE,
        "SUBTITLE": as_text(subtitle(results)),
        "HEADLINES": _headlines(cells),
        "REPLAYS": replay_links(links),
        "BARS": bars_table(results["bars"]),
        "PLATFORMS": "".join(_platform_section(pair, cells, results["settings"]) for pair in pairs),
        "WORST": _worst_table(results["worst"]),
        "SETTINGS": values_table(results["settings"]),
        "VERSIONS": values_table({**results["versions"], **results["machine"]}),
    }
    return write_page(path, report_page("encounters.html", parts))


def subtitle(results: Mapping[str, Any]) -> str:
    """Conditions in one line."""
    settings, conditions = results["settings"], results["settings"]["conditions"]
    named = (("radius", "radius_m", "m"), ("delay", "delay_s", "s"), ("position error", "noise_m", "m"))
    parts = [
        f"{words} {conditions[name]:g} {unit}" for words, name, unit in (*named, ("current", "current_mps", "m/s"))
    ]
    return " · ".join([f"{settings['n']} encounters per cell", *parts, f"seed {settings['seed']}"])


def _headlines(cells: Cells) -> str:
    tiles = []
    for guard in dict.fromkeys(cell["guard"] for cell in cells):
        own = [cell for cell in cells if cell["guard"] == guard]
        n, breached, avoidable = (sum(c[name] for c in own) for name in ("encounters", "breached", "avoidable"))
        judged = "no breach judged" if all(c["not_judged"] == c["breached"] for c in own) and breached else ""
        words = judged or f"avoidable: {avoidable}"
        tiles.append(
            f'<div class="tile"><h3>{as_text(guard)}: encounters breached</h3><p class="numbers">'
            f'<span class="on">{breached}</span><span class="arrow">of</span>'
            f'<span class="off">{n:,}</span></p><p class="note">{words}</p></div>'
        )
    return "".join(tiles)


def _platform_section(pair: tuple[str, str], cells: Cells, settings: Mapping[str, Any]) -> str:
    chosen = [cell for cell in cells if (cell["own"], cell["other"]) == pair]
    own, other = pair
    title = f"{own} meets {other}" if own != other else own
    families = list(dict.fromkeys(cell["family"] for cell in chosen))
    guards = list(settings["guards"])
    key = legend([("off", "without a guard"), *((_style(guards, g), g) for g in guards if g != NONE)])
    plots = "".join(_family_plot(name, chosen, guards, settings) for name in families)
    return (
        f"<h2>{as_text(title)}</h2><section class='card wide'>{_cells_table(chosen, families)}</section>"
        f"<h3 style='margin-top:16px'>Closest distance: share of encounters that came closer</h3>{key}"
        f"<section class='small'>{plots}</section>"
    )


def _style(guards: Sequence[str], guard: str) -> str:
    named = [name for name in guards if name != NONE]
    return "off" if guard == NONE else f"reason-{named.index(guard) % STYLES}"


def _family_plot(family: str, cells: Cells, guards: Sequence[str], settings: Mapping[str, Any]) -> str:
    own = [cell for cell in cells if cell["family"] == family]
    curves: list[Curve] = [("off", "without a guard", own[0]["unshielded_closest_quantiles_m"])]
    curves += [
        (_style(guards, cell["guard"]), cell["guard"], cell["closest_quantiles_m"])
        for cell in own
        if cell["guard"] != NONE
    ]
    plot = distribution_plot(curves, "closest distance, m", settings["conditions"]["radius_m"])
    words = FAMILIES[family].words
    return f'<figure class="card"><h3>{as_text(family)}</h3><p class="note">{as_text(words)}</p>{plot}</figure>'


def _cells_table(cells: Cells, families: Sequence[str]) -> str:
    head = "".join(
        f"<th class='{'first' if k == 0 else 'number'}'>{as_text(text)}</th>" for k, (_, text) in enumerate(COLUMNS)
    )
    rows = []
    for family in families:
        rows.append(f"<tr class='family'><td colspan='{len(COLUMNS)}'>{as_text(family)}</td></tr>")
        for cell in (cell for cell in cells if cell["family"] == family):
            rows.append("<tr>" + "".join(_cell(cell, name) for name, _ in COLUMNS) + "</tr>")
    return f"<table><tr>{head}</tr>{''.join(rows)}</table>"


def _cell(cell: Mapping[str, Any], name: str) -> str:
    value = cell[name]
    if name == "guard":
        return f'<td class="first">{as_text(value)}</td>'
    if name in PERCENT:
        value = 100.0 * value
    bad = " bad" if name in ("avoidable", "deadlocked") and value else ""
    text = str(value) if isinstance(value, int) else number_text(value)
    if name == "avoidable" and cell["not_judged"]:
        text += f" (+{cell['not_judged']} not judged)"
    if name == "breaches_outside":
        text += f" of {cell['started_outside']}"
    return f'<td class="number{bad}">{text}</td>'


def _worst_table(worst: Cells) -> str:
    head = "".join(f"<th>{as_text(text)}</th>" for _, text in WORST_COLUMNS)
    rows = "".join(
        "<tr>" + "".join(f"<td>{_plain(row[name])}</td>" for name, _ in WORST_COLUMNS) + "</tr>" for row in worst
    )
    return f"<table><tr>{head}</tr>{rows}</table>"


def _plain(value: object) -> str:
    return as_text("–" if value is None else f"{value:.2f}" if isinstance(value, float) else value)
