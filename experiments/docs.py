"""Documentation pages made of results: Markdown tables and plots, nothing typed."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.foreign import visible
from steerclear.shield.renamed import current_settings

from . import plots
from .bench import bench_tables
from .docs_encounters import comparison_page
from .docs_keys import KEYS
from .markdown import MADE, goals_of, goals_table, line, table
from .metrics import RADII_M, breach_column
from .play.conditions import words_of, words_of_settings
from .reach.pages import played_page, sets_page, tables_page
from .tables import COVERED_WORDS, columns_of, interval_text
from .tournament_pages import write_markdown
from .training.study_page import learning_page
from .verdicts import HEADS, verdict_rows

Page = tuple[str, str, list[Path]]
"""File name, text, and pictures written beside it."""
SOURCES = "ablate, evaluate, tournament, bench, encounters, reach compare, reach play or train-study"
_TIMES = ("decision_p50_us", "decision_p99_us")


def write_pages(results: Sequence[Mapping[str, Any]], folder: Path) -> list[Path]:
    """Write the pages that results give, and the page of JSON keys.

    Args:
        results: contents of JSON files that the commands of `SOURCES` wrote; those of commands in `POOLED` go into one
            page together. Cards of value tables are {"command": "reach", "card": JSON}.
        folder: where to.

    Returns:
        What was written.

    Raises:
        ConfigError: results of another command or cut short, or the folder cannot be written to, or holds a page of
            such a name that was not made here.
    """
    for content in results:
        check_source(content)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=folder) as made:
            pages, pictures = _pages_of(results, Path(made))
            check_ours([folder / name for name in pages])
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


def check_ours(pages: Sequence[Path]) -> None:
    """Refuse to write over pages that `write_pages` did not make: those it made it makes anew.

    Raises:
        ConfigError: there is one.
    """
    for page in pages:
        if page.exists() and not (page.is_file() and MADE in page.read_text(encoding="utf-8", errors="replace")):
            raise ConfigError(f"{page} was not made by steerclear docs; choose another --out, or move it")


def check_source(content: Mapping[str, Any]) -> None:
    """Refuse results that no page is made of.

    Raises:
        ConfigError: they are of another command.
    """
    command = content.get("command")
    if not isinstance(command, str) or command not in (*POOLED, "bench", "ablate", "evaluate", "tournament"):
        raise ConfigError(f"no page can be made of results of {command!r}; give results of {SOURCES}")


def _pages_of(results: Sequence[Mapping[str, Any]], folder: Path) -> tuple[dict[str, str], list[Path]]:
    """Text of each page by file name, and the pictures written."""
    made: list[Page] = [("json_keys.md", keys_page(), [])]
    for command, write in POOLED.items():
        found = [content for content in results if content.get("command") == command]
        if found:
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


POOLED: dict[str, Callable[[Sequence[Mapping[str, Any]], Path], Page]] = {
    "encounters": comparison_page,
    "reach": lambda found, folder: ("table_cards.md", tables_page([content["card"] for content in found]), []),
    "reach-play": lambda found, folder: ("played_sets.md", played_page(found), []),
    "reach-compare": lambda found, folder: ("unsafe_sets.md", sets_page(found), []),
    "train-study": learning_page,
}
"""Commands whose results go into one page together, and what makes it."""


def _page_of(content: Mapping[str, Any], folder: Path) -> Page:
    command = content.get("command")
    if command == "bench":
        return "bench.md", bench_page(content), []
    if command == "tournament":
        return write_markdown(content, folder)
    stem = f"{'ablation' if command == 'ablate' else 'evaluation'}_{content['settings']['preset']}"
    stem += _apart(content["settings"].get("conditions") or {})
    if re.fullmatch(r"[\w.+-]{1,200}", stem) is None:  # it becomes the name of a file
        raise ConfigError(f"results of a game {content['settings']['preset']!r} that there is not; make them again")
    plots = _plots(content, folder, stem) if command == "ablate" and content["pairings"] else []
    return f"{stem}.md", runs_page(content, plots), plots


def _apart(conditions: Mapping[str, float]) -> str:
    """What keeps the page of games under conditions apart from that of the others: ``_delay0.3_current0.5``."""
    return "".join(f"_{name.split('_')[0]}{value:g}" for name, value in conditions.items() if value)


def _plots(content: Mapping[str, Any], folder: Path, stem: str) -> list[Path]:
    radius_m = float((content["settings"].get("shield") or {}).get("separation_m", RADII_M[0]))
    metrics = [
        (breach_column("opponent", radius_m), f"hits with opponents per game, {radius_m:g} m"),
        (breach_column("teammate", radius_m), f"hits with teammates per game, {radius_m:g} m"),
        ("captures", "captures per game"),
    ]
    return [plots.png(plots.off_on(content["pairings"], metrics), folder / f"{stem}.png")]


def runs_page(content: Mapping[str, Any], plots: Sequence[Path] = ()) -> str:
    """Write the page of an ablation or evaluation."""
    settings = content["settings"]
    lines = [f"# {line(settings['own'])} on {line(settings['preset'])}", "", MADE, "", _what_was_played(content), ""]
    lines += [COVERED_WORDS, ""] if settings.get("covered") else []
    lines += [f"![off and on]({path.name})\n" for path in plots]
    for summary in content["pairings"]:
        lines += [f"## {line(summary['pairing'])}", "", *_metrics_table(summary), ""]
        if verdicts := verdict_rows(summary.get("verdicts") or {}, interval_text):
            lines += ["Breaches judged in hindsight:", "", *table(HEADS, verdicts), ""]
        if summary["reasons"]:
            lines += [_reasons_line(summary["reasons"]), ""]
    if goals_of(content):
        lines += ["## Goals", "", *goals_table(goals_of(content)), ""]
    return "\n".join(lines)


def bench_page(content: Mapping[str, Any]) -> str:
    """Write the page of a benchmark."""
    lines = ["# Speed and memory", "", MADE, "", _machine_line(content), ""]
    for one in bench_tables(content):
        lines += [f"## {line(one.title)}", "", *table(one.heads, one.rows), ""]
    return "\n".join([*lines, "## Goals", "", *goals_table(goals_of(content)), ""])


KEYS_WORDS = (
    "`*` stands for a name that depends on the run, `[]` for every entry. Shares are fractions, 0 to 1, "
    "unless the meaning says %."
)


def keys_page() -> str:
    """Write the page of JSON keys."""
    lines = ["# JSON keys", "", MADE, "", KEYS_WORDS, ""]
    for command, keys in KEYS.items():
        rows = [(f"`{name}`", words) for name, words in keys.items()]
        lines += [f"## `steerclear {command} --json`", "", *table(["key", "meaning"], rows), ""]
    return "\n".join(lines)


def _what_was_played(content: Mapping[str, Any]) -> str:
    settings = content["settings"]
    length = settings["rules"].get("max_time_s")
    conditions, shield = words_of(settings.get("conditions") or {}), settings.get("shield") or {}
    size = "the small version, " if content["quick"] else ""
    return (
        f"{size}{settings['games']} games per pairing and shield state"
        + (f" of {length:g} s" if length else "")
        + (f" under {conditions}" if conditions else "")
        + (f", shield with {line(words_of_settings(shield))}" if shield else "")
        + f", seeds {content['seeds'][0]} to {content['seeds'][-1]}, "
        f"steerclear {line(content['versions']['steerclear'])}. "
        "Means per game with 95 % intervals (Poisson for counts, Wilson for shares, bootstrap for means)."
    )


def _machine_line(content: Mapping[str, Any]) -> str:
    machine, versions = content["machine"], content["versions"]
    packages = ", ".join(f"{name} {version}" for name, version in versions.items() if version)
    hardware = f"{machine['processor']}, {machine['cores']} cores, {machine['memory_gib']} GiB, {machine['system']}"
    return line(f"{hardware}. {packages}.")


def _metrics_table(summary: Mapping[str, Any]) -> list[str]:
    columns = columns_of(summary)
    rows = [
        [figures["label"], *(interval_text(figures.get(key)) for key in columns)]
        for name, figures in summary["metrics"].items()
        if name not in _TIMES  # of a machine that did other things as well: the page of the benchmark has them
    ]
    return table(["", *columns.values()], rows)


def _reasons_line(reasons: Mapping[str, int]) -> str:
    total = sum(reasons.values()) or 1
    parts = [f"{name} {100 * count / total:.2f} %" for name, count in reasons.items() if count]
    return line(f"Decisions: {', '.join(parts)} of {total:,} boat-steps.")


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


def _horizon_of(content: Mapping[str, Any]) -> tuple[float, float] | None:
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


def price_page(found: Sequence[Mapping[str, Any]], folder: Path) -> Page:
    """The page of what safety costs: how long opponents are taken for adversaries, against hits and play.

    Args:
        found: results of ablations that differ in it.
        folder: where the picture goes.
    """
    groups: dict[tuple[str, float, str], list[tuple[tuple[float, float], Mapping[str, Any], Mapping[str, Any]]]] = {}
    for content in found:
        radius_m = float(content["settings"]["shield"].get("separation_m", RADII_M[0]))
        for summary in content["pairings"]:
            key = (content["settings"]["preset"], radius_m, summary["pairing"])
            groups.setdefault(key, []).append((_horizon_of(content) or (0.0, 0.0), content, summary))
    lines = ["# Safety and its price", "", MADE, "", PRICE_WORDS, "", ADVICE, ""]
    panels: dict[str, list[tuple[str, float, float, float]]] = {}
    for (preset, radius_m, pairing), runs in sorted(groups.items()):
        runs.sort(key=lambda run: run[0])
        hits = {kind: breach_column(kind, radius_m) for kind in ("opponent", "teammate")}
        columns = (*_PRICE_COLUMNS, ("hits opp.", hits["opponent"], "on"), ("hits mates", hits["teammate"], "on"))
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
        lines += [f"## {line(preset)}, {radius_m:g} m: {line(pairing)}", "", *table(heads, rows), ""]
    words = ("commands changed, %", "hits with opponents, per game")
    picture = plots.png(plots.scatter(list(panels.items()), words, lines=True), folder / "price.png")
    lines[8:8] = [f"![hits against changed commands]({picture.name})", ""]
    return "price.md", "\n".join(lines), [picture]
