"""A tournament's tables for terminal, report and documentation alike, its figure, its pages and its replays."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from markupsafe import Markup

from .markdown import goals_of
from .play.match import play_again
from .play.spec import MatchSpec
from .plots import COLOURS, text
from .rankings import GAME, paper_row
from .replay_html import write_replay
from .report import Plot, Report, Section, made_of
from .runner import Run
from .tables import Table, number_text
from .tournament import FINAL, names_of
from .workers import Job, Workers

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
COUNTED = {
    "grabs": "grabs",
    "grabs_against": "grabbed",
    "tags": "tags",
    "tags_against": "tagged",
    "hits_teammate": "hits of mates",
    "hits_opponent": "hits of opponents",
}


def _report(results: Results, **more: Any) -> Report:
    cycles = " ".join(cycle_lines(results))
    sections = [Section("", all_tables(results), cycles), made_of(results)]
    about: dict[str, Any] = {
        "warnings": results["warnings"],
        "goals": goals_of(results),
        "notes": [NOTE],
        "sections": sections,
    }
    return Report(TITLE, subtitle(results), **{**about, **more})


def write_html(results: Results, path: Path, replays: Sequence[Mapping[str, str]] = ()) -> Path:
    """Write the report of results.json, with ``label`` and ``path`` of each replay; ConfigError where it cannot be."""
    plots = []
    if _drawn_states(results):
        draw(results, buffer := BytesIO())
        data = base64.b64encode(buffer.getvalue()).decode()
        image = f'<img alt="{FIGURE_WORDS}" style="max-width:100%" src="data:image/png;base64,{data}">'
        plots = [Plot("What the shield changes for each team", Markup(image))]
    return _report(results, links=replays, plots=plots).write(path)


def write_markdown(results: Results, folder: Path) -> tuple[str, str, list[Path]]:
    """The documentation page: its name, its text, and the figure written beside it."""
    stem = f"tournament_{results['settings']['preset']}"
    picture = folder / f"{stem}.png" if _drawn_states(results) else None
    if picture is not None:
        draw(results, picture)
    return _report(results).page(f"{stem}.md", picture)


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
    found = ((shown(state["state"]), "; ".join(state["cycles"])) for state in results["states"])
    return [f"Cycles, {state}: {cycles}." for state, cycles in found if cycles]


def all_tables(results: Results) -> list[Table]:
    """Every table, in order."""
    found = list[Table]()
    if results["qualifying"]:
        rows = [
            [one["team"], shown(one["state"]), f"{one['games']}", f"{one['score']:.2f}", f"{one['captures']}"]
            for one in results["qualifying"]
        ]
        heads = ["team", "state", "games", "score a game", "captures"]
        found.append(Table("Qualifying against easy, medium and hidden", heads, rows, numbers=False))
    if results["prices"]:
        found += _price_tables(results["prices"])
    return found + [one for state in results["states"] if state["standings"] for one in _state_tables(state)]


def _price_tables(prices: Sequence[Row]) -> list[Table]:
    """What the shield leaves of net captures and of hits, per team and game."""
    kept = [kept_words(one) for one in prices]
    avoided = ["-" if one["avoidable"] is None else f"{one['avoidable']} in {one['judged']}" for one in prices]
    found = []
    for name, words, head, last in (
        ("net_captures", "net captures", "keeps 95 %", kept),
        ("hits", "hits", "avoidable, in judged games", avoided),
    ):
        rows = []
        for one, end in zip(prices, last, strict=True):
            value, low, high = (number_text(one[name].get(part)) for part in ("value", "low", "high"))
            change = value if "-" in (low, high) else f"{value} ({low} to {high})"
            rows.append([one["team"], *(number_text(one[f"{name}_{k}"]) for k in ("off", "on")), change, end])
        heads = ["team", "no shields", "shielded", "change, paired", head]
        found.append(Table(f"Price of safety: {words} a game", heads, rows, numbers=False))
    return found


def kept_words(one: Row) -> str:
    """Whether net captures are kept; "unsure" where too few, but the interval reaches what is to be kept."""
    if one["kept"] is not False:
        return "yes" if one["kept"] else "-"
    high = one["margin"]["high"]
    return "unsure" if high is not None and high >= 0.0 else "no"


def _state_tables(state: Row) -> list[Table]:
    """Ranks with the penalty and without, beside the paper's; what else was counted; who beats whom."""
    ranked, teams = state["standings"], state["teams"]
    free = sorted(ranked, key=lambda one: (one["rank_free"], one["team"]))
    tables = {
        "Table 3, with the penalty": (
            ["team", "rank", "score", "at 0.025", "collisions", "paper: rank", "score", "collisions"],
            [
                [
                    one["team"],
                    _limited(one, "rank", 0),
                    _limited(one, "score", 2),
                    f"{one['score_0.025']:.2f}",
                    _limited(one, "collisions", 1),
                    *_paper(one["team"], "rank", "score", "collisions"),
                ]
                for one in ranked
            ],
        ),
        "Table 4, penalty off": (
            ["team", "rank", "net captures", "captures", "against", "paper: rank", "captures"],
            [
                [
                    one["team"],
                    f"{one['rank_free']}",
                    _limited(one, "net_captures", 1),
                    *(f"{one[name]:.1f}" for name in ("captures", "captures_against")),
                    *_paper(one["team"], "rank_free", "captures"),
                ]
                for one in free
            ],
        ),
        "Counts": (
            ["team", *COUNTED.values()],
            [[one["team"], *(f"{one[name]:.1f}" for name in COUNTED)] for one in ranked],
        ),
        "Games won against, % (a draw is half)": (
            ["", *teams],
            [
                [team, *("-" if one is None or one != one else f"{100 * one:.0f}" for one in row)]
                for team, row in zip(teams, state["wins"], strict=True)
            ],
        ),
        "Alpha-rank, %, by strength of selection": (
            ["team", *state["alpha_rank"]],
            [[team, *(f"{100 * s[k]:.0f}" for s in state["alpha_rank"].values())] for k, team in enumerate(teams)],
        ),
    }
    words = shown(state["state"])
    return [Table(f"{title}: {words}", heads, rows, numbers=False) for title, (heads, rows) in tables.items()]


def _paper(team: str, *names: str) -> list[str]:
    row = paper_row(team)
    return ["-" if row is None else f"{getattr(row, name):g}" for name in names]


def _limited(one: Row, name: str, digits: int) -> str:
    """A figure of a standing with its limits."""
    low, high = one[f"{name}_low"], one[f"{name}_high"]
    return f"{one[name]:.{digits}f}" + ("" if low is None else f" ({low:.{digits}f} to {high:.{digits}f})")


def _drawn_states(results: Results) -> list[Sequence[Row]]:
    """Standings of the first and the last state, to draw arrows between; none without two."""
    states = [state["standings"] for state in results["states"] if state["standings"]]
    return [states[0], states[-1]] if len(states) >= 2 else []


def draw(results: Results, target: Path | BytesIO) -> None:
    """Draw net captures against collisions as PNG, an arrow per team from the first state to the last."""
    from matplotlib.figure import Figure  # without pyplot: no window system is touched

    first, last = ({one["team"]: one for one in standings} for standings in _drawn_states(results))
    canvas = Figure(figsize=(7.5, 4.6), layout="constrained", dpi=150)
    axis = canvas.subplots()
    teams = sorted(set(first) & set(last), key=lambda team: (first[team]["net_captures"], first[team]["collisions"]))
    for number, team in enumerate(teams):  # teams whose labels could meet follow each other
        start, end = ((one[team]["collisions"], one[team]["net_captures"]) for one in (first, last))
        axis.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": "#555555", "shrinkA": 4, "shrinkB": 4})
        for place, colour in ((start, "off"), (end, "on")):
            axis.scatter(*place, color=COLOURS[colour], zorder=3)
        above = 7 if number % 2 == 0 else -13
        axis.annotate(text(team), start, (4, above), textcoords="offset points", fontsize=9)
    for colour, words in (("off", "without shields"), ("on", "shielded")):
        axis.scatter([], [], color=COLOURS[colour], label=words)
    axis.set(xlabel="collisions per double round robin", ylabel="net captures per double round robin")
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
    first, second = states or ((rows[0]["state"],) * 2 if rows else ("", ""))
    after = {_game(row): row for row in rows if row["state"] == second}
    pairs = [(row, after[_game(row)]) for row in rows if row["state"] == first and _game(row) in after]
    measures: dict[str, Any] = {
        "best: most captures for the fewest hits": lambda a, b: _captures(a) - 0.25 * _hits(a),
        "worst: most hits": lambda a, b: _hits(a),
    }
    if states:
        measures["most changed by the shield"] = lambda a, b: (
            abs(_hits(a) - _hits(b)) + 2 * abs(_captures(a) - _captures(b))
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


def _hits(row: Row) -> float:
    return float(row["blue_hits_teammate"] + row["red_hits_teammate"] + row["blue_hits_opponent"])


def _captures(row: Row) -> float:
    return float(row["blue_captures"] + row["red_captures"])


def write_replays(chosen: Sequence[Chosen], folder: Path, workers: Workers) -> list[dict[str, str]]:
    """Play the games again and write a replay of each choice; return labels and file names."""
    specs = {spec.key: spec for _, jobs in chosen for spec in map(MatchSpec.of_job, jobs)}
    played, links = play_again(specs.values(), workers), []
    for number, (words, jobs) in enumerate(chosen, start=1):
        games = [played[key].record for job in jobs if (key := MatchSpec.of_job(job).key) in played]
        if games:
            name = f"replay-{number}.html"
            write_replay(games, folder / name, title=f"Tournament, {words}")
            links.append({"label": words, "path": name})
    return links
