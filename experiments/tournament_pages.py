"""A tournament's tables for terminal, report and documentation alike, its figure, its pages and its replays."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from markupsafe import Markup

from .markdown import MADE, goals_of, goals_table, table
from .markdown import line as one_line
from .play.match import play_match
from .play.spec import MatchSpec
from .plots import COLOURS, text
from .rankings import GAME, paper_row
from .replay_html import write_replay
from .report import Plot, Report, Section, made_of
from .report import Table as HtmlTable
from .runner import Run
from .tables import number_text
from .tournament import FINAL, names_of
from .workers import Job, Workers, outcomes

Table = tuple[str, list[str], list[list[str]]]
"""Title, heads, rows."""
Results = Mapping[str, Any]
Row = Mapping[str, Any]
Chosen = tuple[str, list[Job]]
TITLE = "The competition, with the shield and without"
NOTE = (
    "All figures are per double round robin (every pair once on each side); brackets are 95 % intervals of a bootstrap "
    "that draws repetitions anew within each pair and side. The paper's scores fit no single penalty, so its ranks are "
    "compared, not its scores."
)
FIGURE_WORDS = "net captures against collisions, an arrow per team from unshielded to shielded"


def write_html(results: Results, path: Path, replays: Sequence[Mapping[str, str]] = ()) -> Path:
    """Write the report.

    Args:
        results: the content of results.json.
        path: file to write.
        replays: ``label`` and ``path`` of each replay.

    Raises:
        ConfigError: the file cannot be written.
    """
    plots = []
    if can_be_drawn(results):
        draw(results, buffer := BytesIO())
        data = base64.b64encode(buffer.getvalue()).decode()
        image = f'<img alt="{FIGURE_WORDS}" style="max-width:100%" src="data:image/png;base64,{data}">'
        plots = [Plot("What the shield changes for each team", Markup(image))]
    tables = [HtmlTable(title, heads, rows, numbers=False) for title, heads, rows in all_tables(results)]
    return Report(
        title=TITLE,
        subtitle=subtitle(results),
        warnings=results["warnings"],
        links=replays,
        goals=results["goals"],
        plots=plots,
        notes=[NOTE, *cycle_lines(results)],
        sections=[Section("", tables), made_of(results)],
    ).write(path)


def write_markdown(results: Results, folder: Path) -> tuple[str, str, list[Path]]:
    """The documentation page: its name, its text, and the figure written beside it."""
    stem, pictures = f"tournament_{results['settings']['preset']}", list[Path]()
    lines = [f"# {TITLE}", "", MADE, "", one_line(subtitle(results)) + ".", ""]
    if can_be_drawn(results):
        pictures = [folder / f"{stem}.png"]
        draw(results, pictures[0])
        lines += [f"![net captures against collisions]({stem}.png)", ""]
    notes = [*cycle_lines(results), *results["warnings"]]
    lines += [one_line(NOTE), "", *(f"- {one_line(words)}" for words in notes), *[""] * bool(notes)]
    for title, heads, rows in all_tables(results):
        lines += [f"## {one_line(title)}", "", *table(heads, rows), ""]
    if goals := goals_of(results):
        lines += ["## Goals", "", *goals_table(goals), ""]
    return f"{stem}.md", "\n".join(lines), pictures


def subtitle(results: Results) -> str:
    """What was played, in a line."""
    settings = results["settings"]
    length, repetitions = (settings["rules"] or {}).get("max_time_s"), settings["repetitions"]
    there = (
        f"{shown(state['state'])} {state['games']} games, repetitions of every pair that met: {state['repetitions']}"
        for state in results["states"]
    )
    return (
        f"{settings['preset']}, {results['games_played']} games"
        + (f" of {length:g} s" if length else "")
        + f", {repetitions} repetition{'' if repetitions == 1 else 's'} of every pair on both sides in every state, "
        + f"seeds {settings['seed']} to {settings['seed'] + repetitions - 1}, penalty {settings['penalty']:g}, "
        + f"steerclear {results['versions']['steerclear']}"
        + ("" if results["complete"] else f"; not complete: {'; '.join(there)}")
    )


def shown(state: str) -> str:
    """A state in words."""
    return {"off": "no shields", "all": "all shielded"}.get(state, f"{state} shielded")


def cycle_lines(results: Results) -> list[str]:
    """Teams each of which beats the next, in sentences."""
    return [
        f"Cycles, {shown(state['state'])}: {'; '.join(state['cycles'])}."
        for state in results["states"]
        if state["cycles"]
    ]


def all_tables(results: Results) -> list[Table]:
    """Every table, in order."""
    found: list[Table] = []
    if results["qualifying"]:
        rows = [
            [line["team"], shown(line["state"]), f"{line['games']}", f"{line['score']:.2f}", f"{line['captures']}"]
            for line in results["qualifying"]
        ]
        heads = ["team", "state", "games", "score a game", "captures"]
        found.append(("Qualifying against easy, medium and hidden", heads, rows))
    if results["prices"]:
        found += _price_tables(results["prices"])
    return found + [one for state in results["states"] if state["standings"] for one in _state_tables(state)]


def _price_tables(prices: Sequence[Row]) -> list[Table]:
    """What the shield leaves of net captures and of hits, per team and game."""
    heads = ["team", "no shields", "shielded", "change, paired"]

    def rows(name: str, last: Mapping[str, str]) -> list[list[str]]:
        means = ((line, [number_text(line[f"{name}_{state}"]) for state in ("off", "on")]) for line in prices)
        return [[line["team"], *cells, _interval(line[name]), last[line["team"]]] for line, cells in means]

    kept = {line["team"]: kept_words(line) for line in prices}
    avoided = {
        line["team"]: "-" if line["avoidable"] is None else f"{line['avoidable']} in {line['judged']}"
        for line in prices
    }
    return [
        ("Price of safety: net captures a game", [*heads, "keeps 95 %"], rows("net_captures", kept)),
        ("Price of safety: hits a game", [*heads, "avoidable, in judged games"], rows("hits", avoided)),
    ]


def kept_words(line: Row) -> str:
    """Whether net captures are kept; "unsure" where too few, but the interval reaches what is to be kept."""
    if line["kept"] is not False:
        return "yes" if line["kept"] else "-"
    high = line["margin"]["high"]
    return "unsure" if high is not None and high >= 0.0 else "no"


def _state_tables(state: Row) -> list[Table]:
    """Ranks with the penalty and without, beside the paper's; what else was counted; who beats whom."""
    words, lines = shown(state["state"]), state["standings"]
    free = sorted(lines, key=lambda line: (line["rank_free"], line["team"]))
    names = ("grabs", "grabs_against", "tags", "tags_against", "hits_teammate", "hits_opponent")
    return [
        (
            f"Table 3, with the penalty: {words}",
            ["team", "rank", "score", "at 0.025", "collisions", "paper: rank", "score", "collisions"],
            [
                [
                    line["team"],
                    *(_limited(line, name, digits) for name, digits in (("rank", 0), ("score", 2))),
                    f"{line['score_0.025']:.2f}",
                    _limited(line, "collisions", 1),
                    *_paper(line["team"], "rank", "score", "collisions"),
                ]
                for line in lines
            ],
        ),
        (
            f"Table 4, penalty off: {words}",
            ["team", "rank", "net captures", "captures", "against", "paper: rank", "captures"],
            [
                [
                    line["team"],
                    f"{line['rank_free']}",
                    _limited(line, "net_captures", 1),
                    *(f"{line[name]:.1f}" for name in ("captures", "captures_against")),
                    *_paper(line["team"], "rank_free", "captures"),
                ]
                for line in free
            ],
        ),
        (
            f"Counts: {words}",
            ["team", "grabs", "grabbed", "tags", "tagged", "hits of mates", "hits of opponents"],
            [[line["team"], *(f"{line[name]:.1f}" for name in names)] for line in lines],
        ),
        (
            f"Games won against, % (a draw is half): {words}",
            ["", *state["teams"]],
            [
                [team, *("-" if one is None or one != one else f"{100 * one:.0f}" for one in row)]
                for team, row in zip(state["teams"], state["wins"], strict=True)
            ],
        ),
        (
            f"Alpha-rank, %, by strength of selection: {words}",
            ["team", *state["alpha_rank"]],
            [
                [team, *(f"{100 * shares[k]:.0f}" for shares in state["alpha_rank"].values())]
                for k, team in enumerate(state["teams"])
            ],
        ),
    ]


def _paper(team: str, *names: str) -> list[str]:
    row = paper_row(team)
    return ["-" if row is None else f"{getattr(row, name):g}" for name in names]


def _limited(line: Row, name: str, digits: int) -> str:
    """A figure of a standing with its limits."""
    low, high = line[f"{name}_low"], line[f"{name}_high"]
    return f"{line[name]:.{digits}f}" + ("" if low is None else f" ({low:.{digits}f} to {high:.{digits}f})")


def _interval(entry: Mapping[str, float | None]) -> str:
    value, low, high = (number_text(entry.get(name)) for name in ("value", "low", "high"))
    return value if "-" in (low, high) else f"{value} ({low} to {high})"


def can_be_drawn(results: Results) -> bool:
    """Whether two states are there to draw arrows between."""
    return len([state for state in results["states"] if state["standings"]]) >= 2


def draw(results: Results, target: Path | BytesIO) -> None:
    """Draw net captures against collisions as PNG, an arrow per team from the first state to the last.

    Args:
        results: with two or more states.
        target: file, or buffer.
    """
    from matplotlib.figure import Figure  # without pyplot: no window system is touched

    states = [state["standings"] for state in results["states"] if state["standings"]]
    first, last = ({line["team"]: line for line in lines} for lines in (states[0], states[-1]))
    canvas = Figure(figsize=(7.5, 4.6), layout="constrained", dpi=150)
    axis = canvas.subplots()
    teams = sorted(set(first) & set(last), key=lambda team: (first[team]["net_captures"], first[team]["collisions"]))
    for number, team in enumerate(teams):  # teams whose labels could meet follow each other
        start, end = ((one[team]["collisions"], one[team]["net_captures"]) for one in (first, last))
        arrow = {"arrowstyle": "->", "color": "#555555", "shrinkA": 4, "shrinkB": 4}
        axis.annotate("", end, start, arrowprops=arrow)
        for place, colour in ((start, "off"), (end, "on")):
            axis.scatter(*place, color=COLOURS[colour], zorder=3)
        above = 7 if number % 2 == 0 else -13
        axis.annotate(text(team), start, (4, above), textcoords="offset points", fontsize=9)
    for colour, words in (("off", "without shields"), ("on", "shielded")):
        axis.scatter([], [], color=COLOURS[colour], label=words)
    axis.set_xlabel("collisions per double round robin")
    axis.set_ylabel("net captures per double round robin")
    axis.axhline(0.0, color="#999999", linewidth=0.7, zorder=0)
    axis.margins(x=0.09, y=0.12)
    axis.set_ylim(min(-1.0, axis.get_ylim()[0]), max(1.0, axis.get_ylim()[1]))  # no captures: no ticks of hundredths
    axis.set_xlim(left=min(-0.5, axis.get_xlim()[0]))
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)  # above: arrows go everywhere
    canvas.savefig(target, format="png")


def chosen_games(run: Run, states: tuple[str, str] | None) -> list[Chosen]:
    """The games worth seeing: label and jobs; of two states both, side by side; without two, single games."""
    rows = [row for row in run.rows if row["phase"] == FINAL]
    if not rows:
        return []
    first, second = states or (rows[0]["state"],) * 2
    after = {_game(row): row for row in rows if row["state"] == second}
    pairs = [(row, after[_game(row)]) for row in rows if row["state"] == first and _game(row) in after]
    measures: dict[str, Any] = {
        "best: most captures for the fewest hits": lambda a, b: captures(a) - 0.25 * hits(a),
        "worst: most hits": lambda a, b: hits(a),
    }
    if states:
        measures["most changed by the shield"] = lambda a, b: (
            abs(hits(a) - hits(b)) + 2 * abs(captures(a) - captures(b))
        )
    jobs = {(job["state"], *_game(names_of(job))): job for job in run.experiment.jobs if job["phase"] == FINAL}
    found = []
    for words, measure in measures.items() if pairs else ():
        best = max(pairs, key=lambda pair: measure(*pair))
        games = {(row["state"], *_game(row)): None for row in best}
        who = f"{best[0]['blue']} against {best[0]['red']}, repetition {best[0]['repetition']}"
        found.append((f"{words} ({who})", [jobs[game] for game in games]))
    return found


def _game(names: Row) -> tuple[Any, ...]:
    return tuple(names[name] for name in GAME)


def hits(row: Row) -> float:
    """Hits of both teams in a game."""
    return float(row["blue_hits_teammate"] + row["red_hits_teammate"] + row["blue_hits_opponent"])


def captures(row: Row) -> float:
    """Captures of both teams in a game."""
    return float(row["blue_captures"] + row["red_captures"])


def write_replays(chosen: Sequence[Chosen], folder: Path, workers: Workers) -> list[dict[str, str]]:
    """Play the games again and write a replay of each choice; return labels and file names."""
    specs = {spec.key: spec for _, jobs in chosen for spec in map(MatchSpec.of_job, jobs)}
    answers = outcomes(play_match, list(specs.values()), workers)
    records = {one.job.key: one.answer.record for one in answers if one.answer is not None}
    links = []
    for number, (words, jobs) in enumerate(chosen, start=1):
        games = [records[key] for job in jobs if (key := MatchSpec.of_job(job).key) in records]
        if games:
            name = f"replay-{number}.html"
            write_replay(games, folder / name, title=f"Tournament, {words}")
            links.append({"label": words, "path": name})
    return links
