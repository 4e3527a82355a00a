"""Documentation pages made of results: Markdown tables and plots, nothing typed."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from jinja2 import Environment
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.foreign import visible
from steerclear.shield.renamed import current_settings

from . import plots
from .bench import bench_tables
from .deploy.keys import FIGURES
from .encounters.attack import KEYS as ATTACK
from .encounters.figures import KEYS as ENCOUNTERS
from .markdown import MADE, line, table
from .metrics import RADII_M, game_metrics_of, violation_column
from .page import template
from .play.conditions import words_of
from .reach.pages import played_page, sets_page, tables_page
from .report import Report, Section, game_report, made_of
from .statistics import upper_bound
from .tables import Table, interval_text, number_text
from .tournament import write_markdown

Results = Mapping[str, Any]
Page = tuple[str, str, list[Path]]
"""File name, text, and pictures written beside it."""
SOURCES = "ablate, evaluate, tournament, bench, encounters, reach compare, reach play or train-study"
KEYS_WORDS = (
    "`*` stands for a name that depends on the run, `[]` for every entry. Shares are fractions, 0 to 1, "
    "unless the meaning says %."
)
PRICE_WORDS = (
    "How long an opponent may do its worst before it holds its course (`adversary_horizon_s`) decides what safety "
    "costs. Hits are entries into the distance kept, per game; differences are paired, shield on less off, same "
    "seeds; 95 % intervals. `0` takes opponents to hold their course, `inf` to hunt for ever; the second of two is for "
    "those on our side of the field (`intruder_horizon_s`), which can tag nobody there. Each row is of the version "
    "that measured it."
)
ADVICE = (
    "What to set when: `competitive` (the default) against teams that play; `ramming` where nobody may be hit, where "
    "boats often lie still, and on boats, as `FLEET.yaml` does; `constant_velocity` where opponents are traffic and "
    "not a team. "
    "Any two other settings are compared, paired, by `steerclear compare` ([settings](../settings.md))."
)
_PRICE_COLUMNS = (
    ("changed, %", "changed_share", "on"), ("captures", "captures", "on"), ("against", "captures_against", "on"),
    ("net, on - off", "net_captures", "difference"), ("tags, on - off", "tags", "difference"),
    ("primary, on - off", "primary", "difference"),
)  # fmt: skip


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


def write_pages(results: Sequence[Results], folder: Path) -> list[Path]:
    """Write the pages that results give, and the page of JSON keys; return what was written.

    Args:
        results: contents of JSON files that the commands of `SOURCES` wrote; those of commands in `POOLED` go into one
            page together. Cards of value tables are {"command": "reach", "card": JSON}.
        folder: where to.

    Raises:
        ConfigError: results of another command or cut short, or the folder cannot be written to, or holds a page of
            such a name that was not made here.
    """
    for command in (content.get("command") for content in results):
        if not isinstance(command, str) or command not in (*POOLED, "bench", "ablate", "evaluate", "tournament"):
            raise ConfigError(f"no page can be made of results of {command!r}; give results of {SOURCES}")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=folder) as made:
            pages, pictures = _pages_of(results, Path(made))
            for page in (folder / name for name in pages):
                if page.exists() and not (page.is_file() and MADE in page.read_text("utf-8", errors="replace")):
                    raise ConfigError(f"{page} was not made by steerclear docs; choose another --out, or move it")
            pictures = [picture.replace(folder / picture.name) for picture in pictures]
        for name, text in pages.items():
            (folder / name).write_text(text, encoding="utf-8")
    except ConfigError:
        raise
    except OSError as error:
        raise ConfigError(f"cannot write to {folder} ({error.strerror}); choose another --out") from error
    except Exception as error:  # content is whatever a file held
        why = visible(f"{type(error).__name__}: {error}")[:200]
        raise ConfigError(f"results are cut short or of another version ({why}); make them again") from error
    return [*(folder / name for name in pages), *pictures]


def _pages_of(results: Sequence[Results], folder: Path) -> tuple[dict[str, str], list[Path]]:
    """Text of each page by file name, and the pictures written."""
    made: list[Page] = [("json_keys.md", keys_page(), [])]
    for command, write in POOLED.items():
        if found := [content for content in results if content.get("command") == command]:
            made.append(write(found, folder))
    dials = [content for content in results if _horizon_of(content) is not None]
    if len({_horizon_of(content) for content in dials}) > 1:
        made.append(price_page(dials, folder))
    else:
        dials = []
    made += [_page_of(one, folder) for one in results if one.get("command") not in POOLED and one not in dials]
    names = [name for name, _, _ in made]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"two of the results make {name}; give them one at a time, with an --out for each")
    return {name: text for name, text, _ in made}, [picture for _, _, pictures in made for picture in pictures]


def _learning_page(found: Sequence[Results], folder: Path) -> Page:
    from .training.study import learning_page  # its training needs an extra, no other page does

    return learning_page(found, folder)


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
    "of those started outside the unavoidable set": lambda one: (
        _count(one, *reversed(OUTSIDE)) if one["started_outside"] else ""
    ),
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


POOLED: dict[str, Callable[[Sequence[Results], Path], Page]] = {
    "encounters": comparison_page,
    "reach": lambda found, folder: ("table_cards.md", tables_page([content["card"] for content in found]), []),
    "reach-play": lambda found, folder: ("played_sets.md", played_page(found), []),
    "reach-compare": lambda found, folder: ("unsafe_sets.md", sets_page(found), []),
    "train-study": _learning_page,
}
"""Commands whose results go into one page together, and what makes it."""


def _page_of(content: Results, folder: Path) -> Page:
    command, settings = content.get("command"), content["settings"]
    if command == "bench":
        tables, made = Section("", bench_tables(content)), made_of(content)
        return Report("Speed and memory", "", goals=content["goals"], sections=[tables, made]).page("bench.md")
    if command == "tournament":
        return write_markdown(content, folder)
    # what was played under conditions is kept apart from the rest: ablation_aamas2024_delay0.3_current0.5
    apart = [f"_{name.split('_')[0]}{value:g}" for name, value in (settings.get("conditions") or {}).items() if value]
    stem = f"{'ablation' if command == 'ablate' else 'evaluation'}_{settings['preset']}{''.join(apart)}"
    if re.fullmatch(r"[\w.+-]{1,200}", stem) is None:  # it becomes the name of a file
        raise ConfigError(f"results of a game {settings['preset']!r} that there is not; make them again")
    picture = None
    if command == "ablate" and content["pairings"]:
        radius_m = float((settings.get("shield") or {}).get("separation_m", RADII_M[0]))
        metrics = [(violation_column(k, radius_m), f"hits with {k}s per game, {radius_m:g} m") for k in _KINDS]
        figure = plots.off_on(content["pairings"], [*metrics, ("captures", "captures per game")])
        picture = plots.png(figure, folder / f"{stem}.png")
    return game_report(content).page(f"{stem}.md", picture)


_KINDS = ("opponent", "teammate")


def _keys() -> dict[str, dict[str, str]]:
    metrics = game_metrics_of()
    counted = [metric for metric in metrics if metric.kind not in ("percent", "least")]
    text = Environment(trim_blocks=True, lstrip_blocks=True).from_string(template("json_keys.txt"))
    keys: dict[str, dict[str, str]] = {}
    for section in text.render(
        meanings={metric.key: metric.meaning for metric in metrics},
        columns={re.sub(r"_\d+\.\d+m$", "_*", metric.column): metric.meaning for metric in counted},
        encounters=ENCOUNTERS,
        attack=ATTACK,
        figures={figure.key: figure.meaning for figure in FIGURES},
    ).split("\n## ")[1:]:
        commands, *lines = section.strip().splitlines()
        entries = dict(line.split(": ", 1) for line in lines if line)
        shown, _, part = commands.rpartition(" of ")
        keys |= {(f"{shown} of {name}" if shown else name): entries for name in part.split(", ")}
    return keys


KEYS = _keys()
"""Meaning of each key of JSON by command, of ``templates/json_keys.txt``; ``rows of COMMAND``: of its rows' columns."""


def keys_page() -> str:
    """Write the page of JSON keys."""
    lines = ["# JSON keys", "", MADE, "", KEYS_WORDS, ""]
    for command, keys in KEYS.items():
        part, _, of = command.rpartition(" of ")
        title = f"`{part}.jsonl` of `steerclear {of}`" if part else f"`steerclear {command} --json`"
        rows = [(f"`{name}`", words) for name, words in keys.items()]
        lines += [f"## {title}", "", *table(["key", "meaning"], rows), ""]
    return "\n".join(lines)


def _horizon_of(content: Results) -> tuple[float, float] | None:
    """How long an ablation's shield takes opponents for adversaries, s, also on our side; None: no such results."""
    shield = (content.get("settings") or {}).get("shield")
    if content.get("command") != "ablate" or not isinstance(shield, Mapping):
        return None
    told = {
        k: math.inf if v == "inf" else v
        for k, v in current_settings(shield).items()
        if k in ("adversary_horizon_s", "intruder_horizon_s", "profile")
    }
    config = ShieldConfig.of(**told)
    return config.effective_adversary_horizon_s, config.effective_intruder_horizon_s


def price_page(found: Sequence[Results], folder: Path) -> Page:
    """What safety costs: how long opponents are taken for adversaries, against hits and play.

    Args:
        found: results of ablations that differ in it.
        folder: where the picture goes.
    """
    groups: dict[tuple[str, float, str], list[tuple[tuple[float, float], Results, Results]]] = {}
    for content in found:
        radius_m = float(content["settings"]["shield"].get("separation_m", RADII_M[0]))
        for summary in content["pairings"]:
            key = (content["settings"]["preset"], radius_m, summary["pairing"])
            groups.setdefault(key, []).append((_horizon_of(content) or (0.0, 0.0), content, summary))
    sections: list[Section] = []
    panels: dict[str, list[tuple[str, float, float, float]]] = {}
    for (preset, radius_m, pairing), runs in sorted(groups.items()):
        runs.sort(key=lambda run: run[0])
        hits = {kind: violation_column(kind, radius_m) for kind in _KINDS}
        columns = (
            *_PRICE_COLUMNS,
            ("hits opponents", hits["opponent"], "on"),
            ("hits teammates", hits["teammate"], "on"),
        )
        rows = []
        for (always, visiting), content, summary in runs:
            figures = [summary["metrics"].get(key, {}).get(state) for _, key, state in columns]
            told = f"{always:g}" if always == visiting else f"{always:g} / {visiting:g}"
            version = str(content.get("versions", {}).get("steerclear", "-"))
            rows.append([told, *map(interval_text, figures), str(summary["games_on"]), version])
            changed, hit = (summary["metrics"][key]["on"] for key in ("changed_share", hits["opponent"]))
            point = (pairing, changed["value"], hit["value"], hit["high"])
            panels.setdefault(f"{preset}, {radius_m:g} m", []).append(point)
        heads = ("horizon, s", *(head for head, _, _ in columns), "games", "version")
        sections.append(Section(f"{preset}, {radius_m:g} m: {pairing}", [Table("", heads, rows)]))
    words = ("commands changed, %", "hits with opponents, per game")
    picture = plots.png(plots.scatter(list(panels.items()), words, lines=True), folder / "price.png")
    return Report("Safety and its price", "", notes=[PRICE_WORDS, ADVICE], sections=sections).page("price.md", picture)
