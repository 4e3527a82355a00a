"""Reports: what an experiment shows, as data, and the page that is made of it, in HTML or in Markdown."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from markupsafe import Markup

from . import plots
from .markdown import MADE, goals_table, line, table
from .metrics import RADII_M, REASONS, game_metrics_of, violation_column
from .page import render, write_page
from .play.conditions import words_of
from .tables import (
    AROUND,
    BARE,
    COVERED_HEAD,
    COVERED_WORDS,
    IN_ZIP,
    ITS_OWN,
    LEFT_HEAD,
    OWN_SHIELDS,
    columns_of,
    figure_rows,
    goal_cells,
    interval_text,
    limits_text,
    number_text,
    verdict_of,
)
from .tables import Table as Table
from .verdicts import COVERED, HEADS, OFF, ON, STATES, state_of, verdict_rows
from .words import count_text, seeds_text

Summary = Mapping[str, Any]
SHIELDS = {OFF: "off", ON: "on", COVERED: COVERED_HEAD}
OWN_COLOUR = "r4"
"""Of games without a shield round them whose boats have one in their entry: neither off nor on."""
MOST_ROWS, MOST_VIOLATIONS, MOST_BESIDE = 600, 200, 3
"""Rows of a table of games, of one of hits, and columns of figures of two tables side by side."""
STYLES = {"green": "good", "red": "bad", "yellow": "muted"}
NOTE = (
    "Whiskers and brackets are 95 % intervals. A hit is one entry of two boats into the distance it is counted at, "
    "however long it lasts."
)
HINDSIGHT = (
    "With every other boat's actual track, could own commands of the last 30 s have kept the separation? 'Last "
    "moment' is how long before the hit that was still so; who let the later of both boats' last moments pass is "
    "responsible."
)
OF_AN_ENTRY = (
    "The shield in the zip decides once a decision of the game; its games are pairings of their own. The shield round "
    "the game decides ten times a second, which nothing that is handed in can do."
)
WAYS = {
    BARE: ("As handed in (entry alone)", ""),
    ITS_OWN: ("As handed in (its own shield)", ""),
    IN_ZIP: ("With steerclear entry wrap (shield in the zip)", ""),
    AROUND: ("Shield round the game: an upper bound", "No zip can do this: it decides before every step of motion. "),
}
"""Of the ways an entry is played, by their heads: the label of the headline, and what is to be known of it."""
IMAGES = "; img-src data:"


class Tile(NamedTuple):
    """A headline: a number, what it counts where that is not the label, and the one without the shield."""

    label: str
    off: str | None
    on: str
    note: str
    unit: str = ""


class Plot(NamedTuple):
    """A plot of the page, with its legend (looks as of `plots.SERIES`, and names), and the meanings of words in it."""

    title: str
    svg: Markup
    legend: Sequence[tuple[str, str]] = ()
    meanings: Sequence[tuple[str, str]] = ()


@dataclass(frozen=True)
class Section:
    """Tables and small plots under a heading; ``wide``: each table on a line of its own."""

    title: str
    tables: Sequence[Table] = ()
    note: str = ""
    plots: Sequence[Plot] = ()
    wide: bool = False


@dataclass(frozen=True)
class Report:
    """A page: warnings, headline numbers, links (``label``, ``path``) to replays, goals, large plots, the rest."""

    title: str
    subtitle: str
    warnings: Sequence[str] = ()
    tiles: Sequence[Tile] = ()
    links: Sequence[Mapping[str, str]] = ()
    goals: Sequence[Mapping[str, Any]] = ()
    plots: Sequence[Plot] = ()
    notes: Sequence[str] = ()
    sections: Sequence[Section] = ()

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the page; ConfigError where it cannot be written."""
        shown = {**vars(self), "goals": goal_rows(self.goals)}
        return write_page(path, render("report.html", title=self.title, report=shown, sources=IMAGES))

    def page(self, name: str, picture: Path | None = None) -> tuple[str, str, list[Path]]:
        """The page in Markdown, as `docs` has it: file name, text, and the picture beside it.

        Notes are our own words, with their marks; all else is shown as it is. What is folded is left out.
        """
        lines = [f"# {line(self.title)}", "", MADE, "", f"{line(self.subtitle)}." if self.subtitle else "", ""]
        lines += [f"![{line(self.title)}]({picture.name})", ""] if picture else []
        lines += [*(f"- {line(words)}" for words in self.warnings), *[""] * bool(self.warnings)]
        lines += [part for note in self.notes for part in (note, "")]
        for section in self.sections:
            tables = [one for one in section.tables if not one.folded]
            lines += [f"## {line(section.title)}", ""] if tables and section.title else []
            lines += [line(section.note), ""] if tables and section.note else []
            for one in tables:
                lines += [f"{'###' if section.title else '##'} {line(one.title)}", ""] if one.title else []
                lines += [line(one.note), ""] if one.note else []
                lines += [*table(one.heads or [""] * len(one.rows[0]), one.rows), ""]
        lines += ["## Goals", "", *goals_table(self.goals), ""] if self.goals else []
        return name, "\n".join(lines), [picture] if picture else []


def goal_rows(goals: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """What was asked, what was measured, and whether it is met, in words."""
    rows = []
    for goal in goals:
        verdict, colour = verdict_of(goal)
        name, measured, asked = goal_cells(goal)
        asked = asked.replace("<=", "≤").replace(">=", "≥")
        measured += limits_text(goal)
        rows.append({"name": name, "measured": measured, "asked": asked, "verdict": verdict, "style": STYLES[colour]})
    return rows


def made_of(results: Mapping[str, Any], failed: Sequence[Mapping[str, Any]] | None = None) -> Section:
    """How it was made: settings, versions, machine, and what could not be played."""
    machine = {**results["versions"], **(results.get("machine") or {})}
    named = {"Settings and seeds": results["settings"], "Versions and machine": machine}
    tables = [Table(t, [], [[k, plain(v)] for k, v in values.items()], numbers=False) for t, values in named.items()]
    if failed is not None:
        title = "Games that could not be played"
        tables.append(_rows_table(title, failed) if failed else Table(title, [], [["None."]]))
    return Section("How it was made", tables)


def plain(value: Any) -> str:
    """A value of settings in words."""
    if isinstance(value, Mapping):
        return ", ".join(f"{name}: {plain(entry)}" for name, entry in value.items()) or "defaults"
    if isinstance(value, list | tuple):
        return ", ".join(map(plain, value))
    return "–" if value is None or value != value else str(value)


def _rows_table(title: str, rows: Sequence[Mapping[str, Any]], folded: bool = False) -> Table:
    """The first `MOST_ROWS` rows of games; columns that no row has are left out."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    names = [name for name in names if any(row.get(name) is not None for row in rows)]
    body = [[_cell(row.get(name)) for name in names] for row in rows[:MOST_ROWS]]
    more = f"{len(rows) - MOST_ROWS} more in the table of games." if len(rows) > MOST_ROWS else ""
    return Table(title, [name.replace("_", " ") for name in names], body, "", more, folded, False)


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return number_text(value) if isinstance(value, float) else plain(value)


def write_report(results: Mapping[str, Any], path: str | os.PathLike[str]) -> Path:
    """Write `game_report`; ConfigError where it cannot be written."""
    return game_report(results).write(path)


def game_report(results: Mapping[str, Any]) -> Report:
    """The report of games off and on.

    Args:
        results: ``settings`` (with ``separation_m``, its own or in ``shield``; 2.5 m when left out), ``versions``,
            ``pairings`` (as `ablation.pairings_of` returns them); and, where there are any, ``games`` (rows of games,
            without which nothing is drawn), ``goals``, ``warnings`` (sentences shown first), ``machine``, ``title``,
            ``quick``, ``failed`` (games that could not be played) and ``replays`` ({"label", "path"}, the path seen
            from the report).
    """
    settings, pairings = results["settings"], results["pairings"]
    separation_m = float(
        settings.get("separation_m") or (settings.get("shield") or {}).get("separation_m") or RADII_M[0]
    )
    violations, games = results.get("violations") or (), results.get("games") or ()
    is_entry = "zip_file" in settings
    beside = all(len(columns_of(pairing)) <= MOST_BESIDE for pairing in pairings)
    return Report(
        title=results.get("title") or _played(results)[0],
        subtitle=_subtitle(results, separation_m),
        warnings=results.get("warnings") or (),
        tiles=_way_tiles(pairings, settings, separation_m) if is_entry else _tiles(pairings, separation_m),
        links=results.get("replays") or (),
        goals=results.get("goals") or (),
        plots=_plots(pairings, games, separation_m) if games else (),
        notes=[NOTE, *([OF_AN_ENTRY] if settings.get("zip_file") else [])],
        sections=[
            Section(
                "Pairings",
                [*map(_pairing_table, pairings), _meanings_table(pairings, separation_m)],
                COVERED_WORDS if settings.get("covered") else "",
                wide=not beside,
            ),
            Section(
                "Hits judged in hindsight",
                [*map(_verdict_table, pairings)],
                HINDSIGHT,
            ),
            made_of(results, results.get("failed") or []),
            Section(
                "",
                [
                    *([_violations_table(violations)] if violations else []),
                    _rows_table("Every game", games, folded=True),
                ],
                wide=True,
            ),
        ],
    )


def _subtitle(results: Mapping[str, Any], separation_m: float) -> str:
    settings, count = results["settings"], results.get("games_played", len(results.get("games") or ()))
    seeds, version = results.get("seeds"), results["versions"].get("steerclear")
    own, against = settings.get("own"), ", ".join(settings.get("opponents") or ())
    parts = [
        settings.get("preset"),
        f"{own} against {against}" if own and against else own,
        f"{count_text(count, 'game')}, {_played(results)[1]}",
        f"separation {separation_m:g} m",
        words_of(settings.get("conditions") or {}),
        seeds_text(seeds[0], seeds[-1]) if seeds else "",
        f"steerclear {version}" if version else "",
        "small version (--quick): its intervals are wide" if results.get("quick") else "",
    ]
    return " · ".join(str(part) for part in parts if part)


def _played(results: Mapping[str, Any]) -> tuple[str, str]:
    """Title, and words for the states of the shield that the games were played in."""
    states = set(results["settings"].get("states") or (False, True))
    heads = [_head(one, state) for one in results["pairings"] for state in (OFF, ON) if one.get(f"games_{state}")]
    if "zip_file" in results["settings"]:
        ways = ", ".join(way for way in WAYS if way in heads)
        return f"{Path(results['settings']['own']).name} and the shield", f"each start played in these ways: {ways}"
    own = any(_head(pairing, OFF) == ITS_OWN for pairing in results["pairings"])
    if len(states) > 1:
        how = "with its own shield and with ours round it" if own else "without and with the shield"
        return "What the shield changes", f"each start played {how}"
    how = "with the shield" if True in states else "with its own shield" if own else "without the shield"
    return f"Games {how}", f"played {how}"


def _tiles(pairings: Sequence[Summary], separation_m: float) -> list[Tile]:
    """The numbers that matter most, means over all games."""
    hits = f"centres within {separation_m:g} m, per game"
    pairings = [one for one in pairings if one["games_off"] and one["games_on"]] or pairings
    tiles = []
    for label, key, note in (
        ("hits with opponents", violation_column("opponent", separation_m), hits),
        ("hits with teammates", violation_column("teammate", separation_m), hits),
        ("captures", "captures", "per game"),
        ("closest distance", "closest_m", "m, mean of the games"),
        ("steps changed", "changed_share", "% of the commands decided"),
    ):
        off, on = (_overall(pairings, key, state) for state in ("off", "on"))
        tiles.append(Tile(label, None if off is None else number_text(off), number_text(on), note))
    return tiles


def way_tiles(ways: Mapping[str, Mapping[str, float | None]], separation_m: float) -> list[Tile]:
    """The headlines of an entry: what it does as handed in, with the shield in its zip, with one round the game.

    Args:
        ways: by the head of a way, means of a game: ``captures``, ``captures_against``, hits with ``teammates`` and
            ``opponents``, and ``collisions`` that the game counts.
        separation_m: distance within which two boats hit.
    """
    tiles = []
    for way, means in ways.items():
        label, more = WAYS[way]
        hits = (means["teammates"] or 0.0) + (means["opponents"] or 0.0)
        told = {name: number_text(value) for name, value in means.items()}
        note = (
            f"{told['teammates']} with teammates, {told['opponents']} with opponents, within {separation_m:g} m; "
            f"{told['captures']} captures, {told['captures_against']} given up; the game counts "
            f"{told['collisions']} collisions. {more}"
        )
        tiles.append(Tile(label, None, number_text(hits), note.strip(), "hits a game"))
    return tiles


def _way_tiles(pairings: Sequence[Summary], settings: Summary, separation_m: float) -> list[Tile]:
    """The same of all games that were played in a way."""
    keys = {f"{kind}s": violation_column(kind, separation_m) for kind in ("teammate", "opponent")}
    keys |= {key: key for key in ("captures", "captures_against", "collisions")}
    found: dict[str, list[Summary]] = {}
    for one in pairings:
        for state in (OFF, ON):
            if one.get(f"games_{state}"):
                found.setdefault(_head(one, state), []).append(one)
    means = {}
    for way in (name for name in WAYS if name in found):
        state = ON if way == AROUND else OFF
        means[way] = {name: _overall(found[way], key, state) for name, key in keys.items()}
    return way_tiles(means, separation_m)


def _overall(pairings: Sequence[Summary], key: str, state: str) -> float | None:
    """The mean of a figure over all games of a state."""
    found = [((p["metrics"][key].get(state) or {}).get("value"), p[f"games_{state}"]) for p in pairings]
    found = [(value, games) for value, games in found if value is not None and value == value]
    games = sum(n for _, n in found)
    return sum(value * n for value, n in found) / games if games else None


def _plots(pairings: Sequence[Summary], games: Sequence[Mapping[str, Any]], separation_m: float) -> list[Plot]:
    hits = "hits with {}s per game, centres within " + f"{separation_m:g} m"
    return [
        *(
            _bars(f"Hits with {kind}s", pairings, violation_column(kind, separation_m), hits.format(kind))
            for kind in ("opponent", "teammate")
        ),
        _bars("Captures", pairings, "captures", "captures per game"),
        _closest(pairings, games, separation_m),
        _bars("Steps changed", pairings, "changed_share", "steps changed, %"),
        _reasons(pairings),
    ]


def _bars(title: str, pairings: Sequence[Summary], key: str, words: str) -> Plot:
    groups = _coloured(pairings, [one["metrics"][key] for one in pairings])
    legend = _legend(pairings, groups) if any(len(group) > 1 for _, group in groups) else ()
    return Plot(title, Markup(plots.svg(plots.bars(groups, words), words)), legend)


def _closest(pairings: Sequence[Summary], games: Sequence[Mapping[str, Any]], separation_m: float) -> Plot:
    words = f"closest distance in each game, m; dashed: the separation, {separation_m:g} m"
    found: dict[str, dict[str, list[float]]] = {one["pairing"]: {} for one in pairings}
    for row in games:
        if row["closest_m"] is not None and row["closest_m"] == row["closest_m"]:
            found[row["pairing"]].setdefault(state_of(row), []).append(float(row["closest_m"]))
    groups = _coloured(pairings, list(found.values()))
    figure = plots.dots(groups, words, separation_m)
    return Plot("Closest distance", Markup(plots.svg(figure, words)), _legend(pairings, groups))


def _coloured(pairings: Sequence[Summary], values: Sequence[Mapping[str, Any]]) -> list[tuple[str, list[Any]]]:
    """Per pairing that has any its name and, state by state, the colour and what there is by the state."""
    groups = [
        (one["pairing"], [(_colour(one, state), found[state]) for state in STATES if state in found])
        for one, found in zip(pairings, values, strict=True)
    ]
    return [group for group in groups if group[1]]


def _head(pairing: Summary, state: str) -> str:
    """What tables call a state of a pairing."""
    return str((pairing.get("heads") or {}).get(state, SHIELDS[state]))


def _words(pairing: Summary, state: str) -> str:
    """The same where no head of a column stands above it."""
    head = _head(pairing, state)
    return f"shield {head}" if head in (*SHIELDS.values(), LEFT_HEAD) else head


def _colour(pairing: Summary, state: str) -> str:
    return OWN_COLOUR if state == OFF and _head(pairing, state) in OWN_SHIELDS else state


def _legend(
    pairings: Sequence[Summary], groups: Sequence[tuple[str, Sequence[tuple[str, Any]]]]
) -> list[tuple[str, str]]:
    """What the colours that are drawn stand for."""
    drawn = {colour for _, group in groups for colour, _ in group}
    played = [(one, state) for state in STATES for one in pairings if one.get(f"games_{state}")]
    words = {_colour(one, state): _words(one, state) for one, state in played}
    return [(colour, words[colour]) for colour in words if colour in drawn]


def _reasons(pairings: Sequence[Summary]) -> Plot:
    """Why commands were changed, as shares of all commands the shield decided."""
    counted = dict.fromkeys(name for p in pairings for name, count in p["reasons"].items() if count)
    names = [name for name in counted if name.lower() != "passed"]
    groups = [
        (p["pairing"], [(name, 100.0 * p["reasons"].get(name, 0) / total) for name in names])
        for p in pairings
        if (total := sum(p["reasons"].values()))
    ]
    words = "commands the shield changed, % of all it decided"
    legend = [(look, reason_words(name)) for look, name in zip(plots.SERIES, names, strict=False)]
    meanings = [(reason_words(name), REASONS[name.lower()]) for name in names if name.lower() in REASONS]
    return Plot("Why commands were changed", Markup(plots.svg(plots.shares(groups, words), words)), legend, meanings)


def reason_words(name: str) -> str:
    """The name of a reason as it is read."""
    return name.replace("_", " ").lower().replace("qp", "QP")


def _pairing_table(pairing: Summary) -> Table:
    columns = columns_of(pairing)
    named = {state: count_text(count, "game") for state in STATES if (count := pairing.get(f"games_{state}"))}
    note = "; ".join(f"{_words(pairing, state)}: {count}" for state, count in named.items())
    note += "; per game [95 % interval]"
    if total := sum(pairing["reasons"].values()):
        parts = [
            f"{reason_words(name)} {100 * count / total:.2f} %" for name, count in pairing["reasons"].items() if count
        ]
        note += f". Decisions: {', '.join(parts)} of {total:,} boat-steps"
    rows = figure_rows(pairing["metrics"].values(), columns)
    return Table(pairing["pairing"], ["", *columns.values()], rows, f"{note}.")


def _meanings_table(pairings: Sequence[Summary], separation_m: float) -> Table:
    """What each figure of the pairings is, once for all."""
    labels = {key: figures["label"] for one in pairings for key, figures in one["metrics"].items()}
    meanings = {metric.key: metric.meaning for metric in game_metrics_of({*RADII_M, separation_m})}
    rows = [[label, meanings[key]] for key, label in labels.items() if key in meanings]
    return Table("What the figures are", [], rows, folded=True, numbers=False)


def _verdict_table(pairing: Summary) -> Table:
    rows = verdict_rows(pairing.get("verdicts") or {}, interval_text)
    return Table(pairing["pairing"], HEADS if rows else [], rows or [["Not judged."]], numbers=False)


def _violations_table(violations: Sequence[Mapping[str, Any]]) -> Table:
    """The judged hits, avoidable ones of shielded games first, the first `MOST_VIOLATIONS` of them."""
    order = sorted(violations, key=lambda violation: (not violation["shielded"], violation["verdict"] != "avoidable"))
    rows = []
    for violation in order[:MOST_VIOLATIONS]:
        who = ", ".join(violation["responsible_boats"])
        shown = {
            "game": f"{violation['pairing']}, {violation['game']}",
            "shield": state_of(violation),
            "time, s": number_text(violation["time_s"]),
            "boats": ", ".join(violation["boats"]),
            "closest, m": number_text(violation["closest_m"]),
            "verdict": violation["verdict"].replace("_", " "),
            "last moment, s": number_text(violation["last_preventable_s"]),
            "theirs, s": number_text(violation["other_last_preventable_s"]),
            "responsible": (violation["responsible"] or "-") + (f" ({who})" if who else ""),
        }
        rows.append(shown)
    more = f"{len(order) - len(rows)} more in results.json." if len(order) > len(rows) else ""
    return Table("Every judged hit", list(rows[0]), [list(row.values()) for row in rows], "", more, True, False)
