"""The tables of a tournament as heads and rows of text, for terminal, report and documentation alike."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..tables import number_text
from .paper import paper_row

Table = tuple[str, list[str], list[list[str]]]
"""Title, heads, rows."""
Results = Mapping[str, Any]


def all_tables(results: Results) -> list[Table]:
    """Every table, in order."""
    found: list[Table] = []
    if results["qualifying"]:
        found.append(qualifying(results))
    if results["prices"]:
        found += [kept(results), avoided(results)]
    for state in results["states"]:
        if state["standings"]:
            found += [table_3(state), table_4(state), counts(state), wins(state), alpha(state)]
    return found + agreement_tables(results)


def shown(state: str) -> str:
    """A state in words."""
    return {"off": "no shields", "all": "all shielded"}.get(state, f"{state} shielded")


def table_3(state: Mapping[str, Any]) -> Table:
    """Ranks with the penalty beside the paper's Table 3."""
    rows = []
    for line in state["standings"]:
        paper = paper_row(line["team"])
        rows.append(
            [
                line["team"],
                f"{line['rank']}{_limits(line, 'rank', 0)}",
                f"{line['score']:.2f}{_limits(line, 'score', 2)}",
                f"{line['score_0.025']:.2f}",
                f"{line['collisions']:.1f}{_limits(line, 'collisions', 1)}",
                "-" if paper is None else f"{paper.rank}",
                "-" if paper is None else f"{paper.score:g}",
                "-" if paper is None else f"{paper.collisions}",
            ]
        )
    heads = ["team", "rank", "score", "at 0.025", "collisions", "paper: rank", "score", "collisions"]
    return f"Table 3, with the penalty: {shown(state['state'])}", heads, rows


def table_4(state: Mapping[str, Any]) -> Table:
    """Ranks without the penalty beside the paper's Table 4."""
    rows = []
    for line in sorted(state["standings"], key=lambda line: (line["rank_free"], line["team"])):
        paper = paper_row(line["team"])
        rows.append(
            [
                line["team"],
                f"{line['rank_free']}",
                f"{line['net_captures']:.1f}{_limits(line, 'net_captures', 1)}",
                f"{line['captures']:.1f}",
                f"{line['captures_against']:.1f}",
                "-" if paper is None else f"{paper.rank_free}",
                "-" if paper is None else f"{paper.captures}",
            ]
        )
    heads = ["team", "rank", "net captures", "captures", "against", "paper: rank", "captures"]
    return f"Table 4, penalty off: {shown(state['state'])}", heads, rows


def counts(state: Mapping[str, Any]) -> Table:
    """What else was counted."""
    names = ("grabs", "grabs_against", "tags", "tags_against", "hits_teammate", "hits_opponent")
    rows = [[line["team"], *(f"{line[name]:.1f}" for name in names)] for line in state["standings"]]
    heads = ["team", "grabs", "grabbed", "tags", "tagged", "hits of mates", "hits of opponents"]
    return f"Counts: {shown(state['state'])}", heads, rows


def wins(state: Mapping[str, Any]) -> Table:
    """Share of games the row's team won against the column's, %."""
    rows = [
        [team, *("-" if share is None or share != share else f"{100 * share:.0f}" for share in row)]
        for team, row in zip(state["teams"], state["wins"], strict=True)
    ]
    return f"Games won against, % (a draw is half): {shown(state['state'])}", ["", *state["teams"]], rows


def alpha(state: Mapping[str, Any]) -> Table:
    """Alpha-rank at several strengths of selection, %."""
    rows = [
        [team, *(f"{100 * shares[k]:.0f}" for shares in state["alpha_rank"].values())]
        for k, team in enumerate(state["teams"])
    ]
    return (
        f"Alpha-rank, %, by strength of selection: {shown(state['state'])}",
        ["team", *(f"{strength}" for strength in state["alpha_rank"])],
        rows,
    )


def kept(results: Results) -> Table:
    """What the shield leaves of net captures, per team and game."""
    rows = [
        [
            line["team"],
            number_text(line["net_captures_off"]),
            number_text(line["net_captures_on"]),
            _interval(line["net_captures"]),
            _kept(line),
        ]
        for line in results["prices"]
    ]
    heads = ["team", "no shields", "shielded", "change, paired", "keeps 95 %"]
    return "Price of safety: net captures a game", heads, rows


def avoided(results: Results) -> Table:
    """What the shield leaves of hits, per team and game."""
    rows = [
        [
            line["team"],
            number_text(line["hits_off"]),
            number_text(line["hits_on"]),
            _interval(line["hits"]),
            "-" if line["avoidable"] is None else f"{line['avoidable']} in {line['judged']}",
        ]
        for line in results["prices"]
    ]
    heads = ["team", "no shields", "shielded", "change, paired", "avoidable, in judged games"]
    return "Price of safety: hits a game", heads, rows


def _kept(line: Mapping[str, Any]) -> str:
    """Whether net captures are kept; "unsure" where too few, but the interval reaches what is to be kept."""
    if line["kept"] is not False:
        return "yes" if line["kept"] else "-"
    high = line["margin"]["high"]
    return "unsure" if high is not None and high >= 0.0 else "no"


def qualifying(results: Results) -> Table:
    """The qualifying."""
    rows = [
        [line["team"], shown(line["state"]), f"{line['games']}", f"{line['score']:.2f}", f"{line['captures']}"]
        for line in results["qualifying"]
    ]
    return "Qualifying against easy, medium and hidden", ["team", "state", "games", "score a game", "captures"], rows


def cycle_lines(results: Results) -> list[str]:
    """Teams each of which beats the next, in sentences."""
    return [
        f"Cycles, {shown(state['state'])}: {'; '.join(state['cycles'])}."
        for state in results["states"]
        if state["cycles"]
    ]


def _compared(results: Results) -> list[tuple[str, Mapping[str, Any]]]:
    """What ranks are compared with, and how they agree."""
    return [
        (f"{words}, {shown(state['state'])}", state[name])
        for state in results["states"]
        for name, words in (("table_3", "Table 3"), ("table_4", "Table 4"))
        if state[name] is not None
    ]


def agreement_tables(results: Results) -> list[Table]:
    """How far the ranks agree with the paper's, and which pairs do not; none without three of its teams."""
    compared = _compared(results)
    if not compared:
        return []
    rows = [
        [name, over, _interval(one["spearman"]), _interval(one["kendall"]), f"{len(one['disagree'])}"]
        for name, entry in compared
        for over, one in _agreed(entry)
    ]
    heads = ["paper's ranks, our games", "over", "Spearman's rho", "Kendall's tau-b", "pairs turned"]
    among = [(name, entry["scripted"]["among"]) for name, entry in compared if entry["scripted"] is not None]
    return [
        ("Agreement with the paper's ranks", heads, rows),
        *_turned("Pairs that the paper ranks the other way round: share of resamples", compared),
        *_turned("The same of the scripted teams, games among them", among),
    ]


def _turned(title: str, compared: list[tuple[str, Mapping[str, Any]]]) -> list[Table]:
    """Pairs that some ranking has the other way round than the paper, and how sure that is; no table without any."""
    sure = [dict(zip(entry["disagree"], entry["sure"], strict=True)) for _, entry in compared]
    pairs = sorted({pair for one in sure for pair in one})
    rows = [[pair, *(_share(one[pair]) if pair in one else "-" for one in sure)] for pair in pairs]
    return [(title, ["ours", *(name for name, _ in compared)], rows)] if rows else []


def _share(value: float | None) -> str:
    return "yes" if value is None else f"{100.0 * value:.0f} %"


def _agreed(entry: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    """Over all of the paper's teams, where others than the scripted ones are among them; then over those."""
    scripted = entry["scripted"]
    found = [(f"all {len(entry['teams'])}", entry)]
    if scripted is None:
        return found
    words = f"the {len(scripted['all_games']['teams'])} scripted"
    if scripted["all_games"]["teams"] == entry["teams"]:
        found = []
    found.append((words, scripted["all_games"]))
    if scripted["among"] != scripted["all_games"]:
        found.append((f"{words}, games among them", scripted["among"]))
    return found


def _interval(entry: Mapping[str, float | None]) -> str:
    value = number_text(entry["value"])
    low, high = entry.get("low"), entry.get("high")
    if low is None or high is None or low != low or high != high:
        return value
    return f"{value} ({number_text(low)} to {number_text(high)})"


def _limits(line: Mapping[str, Any], name: str, digits: int) -> str:
    low, high = line[f"{name}_low"], line[f"{name}_high"]
    return "" if low is None else f" ({low:.{digits}f} to {high:.{digits}f})"
