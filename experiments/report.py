"""Reports: what an experiment shows, as data, and the one HTML page that is made of it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from markupsafe import Markup

from . import plots
from .metrics import RADII_M, REASONS, breach_column, game_metrics_of, meanings_of
from .page import render, write_page
from .play.conditions import words_of
from .tables import COVERED_WORDS, columns_of, goal_cells, interval_text, limits_text, number_text
from .verdicts import COVERED, HEADS, OFF, ON, state_of, verdict_rows

Summary = Mapping[str, Any]
SHIELDS = ((OFF, "shield off"), (ON, "shield on"), (COVERED, "shield on, covering boats that the game drives"))
MOST_ROWS, MOST_BREACHES = 600, 200
CHANGED_SHARE_GOAL = 5.0
VERDICTS = {True: ("met", "good"), False: ("not met", "bad"), None: ("no data", "muted")}
NOTE = (
    "Whiskers and brackets are 95 % intervals. A hit is one entry of two boats into the radius, however long it lasts. "
    "The dashed line marks the separation radius, and in the plot of steps changed the goal of 5 %."
)
HINDSIGHT = (
    "With every other boat's actual track, could own commands of the last 30 s have kept the radius? 'Last moment' is "
    "how long before the breach that was still so; who let the later of both boats' last moments pass is responsible."
)
IMAGES = "; img-src data:"


class Cell(NamedTuple):
    """A table's cell with words below it."""

    text: str
    note: str


class Tile(NamedTuple):
    """A headline: a number, and the one without the shield."""

    label: str
    off: str | None
    on: str
    note: str


class Plot(NamedTuple):
    """A plot of the page.

    Attributes:
        title: above it.
        svg: the plot.
        legend: colour's name and what it stands for.
        meanings: words in it and what they mean.
    """

    title: str
    svg: Markup
    legend: Sequence[tuple[str, str]] = ()
    meanings: Sequence[tuple[str, str]] = ()


@dataclass(frozen=True)
class Table:
    """A table of the page; ``folded`` ones are opened by a click, ``numbers`` are those with right columns."""

    title: str
    heads: Sequence[str]
    rows: Sequence[Sequence[Any]]
    note: str = ""
    more: str = ""
    folded: bool = False
    numbers: bool = True


@dataclass(frozen=True)
class Section:
    """Tables and small plots under a heading; ``wide`` puts each table on a line of its own."""

    title: str
    tables: Sequence[Table] = ()
    note: str = ""
    plots: Sequence[Plot] = ()
    wide: bool = False


@dataclass(frozen=True)
class Report:
    """A page.

    Attributes:
        title: of it.
        subtitle: what was measured, in a line.
        warnings: sentences that a reader has to know first.
        tiles: headline numbers.
        links: ``label`` and ``path`` of each replay.
        goals: as `metrics.check` returns them.
        plots: large ones.
        notes: sentences below them.
        sections: the rest.
    """

    title: str
    subtitle: str
    warnings: Sequence[str] = ()
    tiles: Sequence[Tile] = ()
    links: Sequence[Mapping[str, str]] = ()
    goals: Sequence[Mapping[str, Any]] = ()
    plots: Sequence[Plot] = ()
    notes: Sequence[str] = ()
    sections: Sequence[Section] = field(default_factory=tuple)

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the page.

        Raises:
            ConfigError: the file cannot be written.
        """
        shown = {**{name: getattr(self, name) for name in self.__dataclass_fields__}, "goals": goal_rows(self.goals)}
        return write_page(path, render("report.html", title=self.title, report=shown, sources=IMAGES))


def goal_rows(goals: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """What was asked, what was measured, and whether it is met, in words."""
    rows = []
    for goal in goals:
        verdict, style = VERDICTS[goal["met"]]
        name, measured, asked = goal_cells(goal)
        asked = asked.replace("<=", "≤").replace(">=", "≥")
        measured += limits_text(goal)
        rows.append({"name": name, "measured": measured, "asked": asked, "verdict": verdict, "style": style})
    return rows


def made_of(results: Mapping[str, Any], failed: Sequence[Mapping[str, Any]] | None = None) -> Section:
    """How it was made: settings, versions, machine, and what could not be played."""
    machine = {**results["versions"], **(results.get("machine") or {})}
    tables = [values_table("Settings and seeds", results["settings"]), values_table("Versions and machine", machine)]
    if failed is not None:
        title = "Games that could not be played"
        tables.append(rows_table(title, failed) if failed else Table(title, [], [["None."]]))
    return Section("How it was made", tables)


def values_table(title: str, values: Mapping[str, Any]) -> Table:
    """Names and values."""
    return Table(title, [], [[name, plain(value)] for name, value in values.items()], numbers=False)


def plain(value: Any) -> str:
    """A value of settings in words."""
    if isinstance(value, Mapping):
        return ", ".join(f"{name}: {plain(entry)}" for name, entry in value.items()) or "defaults"
    if isinstance(value, list | tuple):
        return ", ".join(map(plain, value))
    return "–" if value is None or value != value else str(value)


def rows_table(title: str, rows: Sequence[Mapping[str, Any]], folded: bool = False) -> Table:
    """The rows of games, the first `MOST_ROWS` of them; columns that no row has are left out."""
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
    """Write the report of games off and on.

    Args:
        results: ``settings`` (with ``separation_m``, its own or in ``shield``; 2.5 m when left out), ``versions``,
            ``pairings`` (as `ablation.pairings_of` returns them), ``games`` (rows of games); and, where there are any,
            ``goals``, ``warnings`` (sentences shown first), ``machine``, ``title``, ``quick``, ``failed`` (games that
            could not be played) and ``replays`` ({"label", "path"}, the path seen from the report).
        path: File to write.

    Raises:
        ConfigError: The file cannot be written.
    """
    separation_m = separation_of(results)
    breaches = results.get("breaches") or ()
    return Report(
        title=results.get("title") or _played(results["settings"])[0],
        subtitle=_subtitle(results, separation_m),
        warnings=results.get("warnings") or (),
        tiles=_tiles(results["pairings"], separation_m),
        links=results.get("replays") or (),
        goals=results.get("goals") or (),
        plots=_plots(results, separation_m),
        notes=[NOTE],
        sections=[
            Section("Pairings", [_pairing_table(pairing) for pairing in results["pairings"]]),
            Section(
                "Breaches judged in hindsight",
                [
                    *(_verdict_table(pairing) for pairing in results["pairings"]),
                    *([_breaches_table(breaches)] if breaches else []),
                ],
                HINDSIGHT,
            ),
            made_of(results, results.get("failed") or []),
            Section("", [rows_table("Every game", results["games"], folded=True)], wide=True),
        ],
    ).write(path)


def separation_of(results: Mapping[str, Any]) -> float:
    """Return the shield's separation radius, m."""
    settings = results.get("settings") or {}
    return float(settings.get("separation_m") or (settings.get("shield") or {}).get("separation_m") or RADII_M[0])


def _subtitle(results: Mapping[str, Any], separation_m: float) -> str:
    settings = results["settings"]
    parts = [str(settings["preset"])] if settings.get("preset") else []
    if settings.get("own"):
        against = ", ".join(settings.get("opponents") or ())
        parts.append(f"{settings['own']} against {against}" if against else str(settings["own"]))
    count = len(results["games"])
    parts.append(f"{count} game{'' if count == 1 else 's'}, {_played(settings)[1]}")
    parts.append(f"separation {separation_m:g} m")
    parts.append(words_of(settings.get("conditions") or {}))
    parts.append("small version (--quick): its intervals are wide" if results.get("quick") else "")
    return " · ".join(filter(None, parts))


def _played(settings: Mapping[str, Any]) -> tuple[str, str]:
    """Title, and words for the states of the shield that the games were played in."""
    states = set(settings.get("states") or (False, True))
    if len(states) > 1:
        return "What the shield changes", "each start played without and with the shield"
    how = "with" if True in states else "without"
    return f"Games {how} the shield", f"played {how} the shield"


def _tiles(pairings: Sequence[Summary], separation_m: float) -> list[Tile]:
    """The numbers that matter most, means over all games."""
    hits = f"centres within {separation_m:g} m, per game"
    chosen = [
        ("hits with opponents", breach_column("opponent", separation_m), hits),
        ("hits with teammates", breach_column("teammate", separation_m), hits),
        ("captures", "captures", "per game"),
        ("closest distance", "closest_m", "m, mean of the games"),
        ("steps changed", "changed_share", "% of the commands decided"),
    ]
    tiles = []
    for label, key, note in chosen:
        off, on = (_overall(pairings, key, state) for state in ("off", "on"))
        tiles.append(Tile(label, None if off is None else number_text(off), number_text(on), note))
    return tiles


def _overall(pairings: Sequence[Summary], key: str, state: str) -> float | None:
    """The mean of a figure over all games of a state."""
    found = [((p["metrics"][key].get(state) or {}).get("value"), p[f"games_{state}"]) for p in pairings]
    found = [(value, games) for value, games in found if value is not None and value == value]
    games = sum(n for _, n in found)
    return sum(value * n for value, n in found) / games if games else None


def _plots(results: Mapping[str, Any], separation_m: float) -> list[Plot]:
    pairings = results["pairings"]
    hits = "hits with {} per game, centres within " + f"{separation_m:g} m"
    mates, opponents = (breach_column(kind, separation_m) for kind in ("teammate", "opponent"))
    return [
        _bars("Hits with opponents", pairings, opponents, hits.format("opponents")),
        _bars("Hits with teammates", pairings, mates, hits.format("teammates")),
        _bars("Captures", pairings, "captures", "captures per game"),
        _closest(results["games"], separation_m),
        _bars("Steps changed", pairings, "changed_share", "steps changed, %", CHANGED_SHARE_GOAL),
        _reasons(pairings),
    ]


def _bars(title: str, pairings: Sequence[Summary], key: str, words: str, reference: float | None = None) -> Plot:
    found = [(pairing["pairing"], pairing["metrics"][key]) for pairing in pairings]
    groups = [(name, [(state, figures[state]) for state, _ in SHIELDS if state in figures]) for name, figures in found]
    figure = plots.bars([group for group in groups if group[1]], words, reference)
    legend = _legend(groups) if any(len(group) > 1 for _, group in groups) else ()
    return Plot(title, Markup(plots.svg(figure, words)), legend)


def _legend(groups: Sequence[tuple[str, Sequence[tuple[str, Any]]]]) -> list[tuple[str, str]]:
    """Colours of the states that are drawn."""
    drawn = {state for _, group in groups for state, _ in group}
    return [(state, words) for state, words in SHIELDS if state in drawn]


def _closest(games: Sequence[Mapping[str, Any]], separation_m: float) -> Plot:
    words = "closest distance in each game, m"
    found: dict[str, dict[str, list[float]]] = {}
    for row in games:
        if row["closest_m"] is not None and row["closest_m"] == row["closest_m"]:
            states = found.setdefault(row["pairing"], {state: [] for state, _ in SHIELDS})
            states[state_of(row)].append(float(row["closest_m"]))
    groups = [(name, [(state, values) for state, values in states.items() if values]) for name, states in found.items()]
    figure = plots.dots(groups, words, separation_m)
    return Plot("Closest distance", Markup(plots.svg(figure, words)), _legend(groups))


def _reasons(pairings: Sequence[Summary]) -> Plot:
    """Why commands were changed, as shares of all commands the shield decided."""
    names = [name for name in dict.fromkeys(n for p in pairings for n in p["reasons"]) if name.lower() != "passed"]
    groups = [
        (p["pairing"], [(name, 100.0 * p["reasons"].get(name, 0) / total) for name in names])
        for p in pairings
        if (total := sum(p["reasons"].values()))
    ]
    words = "commands the shield changed, % of all it decided"
    legend = [(plots.SERIES[k % len(plots.SERIES)], reason_words(name)) for k, name in enumerate(names)]
    meanings = [(reason_words(name), REASONS[name.lower()]) for name in names if name.lower() in REASONS]
    figure = plots.shares(groups, words)
    return Plot("Why commands were changed", Markup(plots.svg(figure, words)), legend, meanings)


def reason_words(name: str) -> str:
    """A reason's name as words."""
    return name.replace("_", " ").lower().replace("qp", "QP")


def _pairing_table(pairing: Summary) -> Table:
    told = meanings_of(game_metrics_of())
    columns = {key: head.replace(" - ", " − ") for key, head in columns_of(pairing).items()}
    covered = pairing.get("games_covered")
    note = f"{pairing['games_off']} games without, {pairing['games_on']} with the shield; per game [95 % interval]"
    note += f". {COVERED_WORDS} {covered} games covered." if covered else ""
    rows = [
        [Cell(figures.get("label", key), told.get(key, "")), *(interval_text(figures.get(part)) for part in columns)]
        for key, figures in pairing["metrics"].items()
    ]
    return Table(pairing["pairing"], ["", *columns.values()], rows, note)


def _verdict_table(pairing: Summary) -> Table:
    rows = verdict_rows(pairing.get("verdicts") or {}, interval_text)
    if not rows:
        return Table(pairing["pairing"], [], [["Not judged."]], numbers=False)
    return Table(pairing["pairing"], HEADS, rows, numbers=False)


def _breaches_table(breaches: Sequence[Mapping[str, Any]]) -> Table:
    """The judged breaches, avoidable ones of shielded games first, the first `MOST_BREACHES` of them."""
    order = sorted(breaches, key=lambda breach: (not breach["shielded"], breach["verdict"] != "avoidable"))
    rows = []
    for breach in order[:MOST_BREACHES]:
        who = ", ".join(breach["responsible_boats"])
        rows.append(
            [
                f"{breach['pairing']}, {breach['game']}",
                state_of(breach),
                number_text(breach["time_s"]),
                ", ".join(breach["boats"]),
                number_text(breach["closest_m"]),
                breach["verdict"].replace("_", " "),
                number_text(breach["last_preventable_s"]),
                number_text(breach["other_last_preventable_s"]),
                (breach["responsible"] or "-") + (f" ({who})" if who else ""),
            ]
        )
    heads = (
        "game",
        "shield",
        "time, s",
        "boats",
        "closest, m",
        "verdict",
        "last moment, s",
        "theirs, s",
        "responsible",
    )
    more = f"{len(order) - len(rows)} more in results.json." if len(order) > len(rows) else ""
    return Table("Every judged breach", heads, rows, "", more, True, False)
