"""The games worth seeing: best, worst and most changed, played again for their records."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..play.match import play_match
from ..play.spec import SIDES
from ..replay_html import write_replay
from ..workers import Workers, outcomes
from .settings import GameJob, label

Row = Mapping[str, Any]
Chosen = tuple[str, list[GameJob]]


def chosen_games(rows: Sequence[Row], jobs: Sequence[GameJob], states: tuple[str, str] | None) -> list[Chosen]:
    """Label and games of each replay: of two states both, side by side; without two, single games."""
    by_game = {(job.state, label(job.spec.own), label(job.spec.opponent), job.spec.game): job for job in jobs}
    first = states[0] if states else (rows[0]["state"] if rows else "")
    before = [row for row in rows if row["state"] == first]
    pairs = [(row, _partner(row, rows, states)) for row in before]
    measures: list[tuple[str, Callable[[Row, Row], float]]] = [
        ("best: most captures for the fewest hits", lambda a, b: captures(a) - 0.25 * hits(a)),
        ("worst: most hits", lambda a, b: hits(a)),
    ]
    if states:
        changed = (
            "most changed by the shield",
            lambda a, b: abs(hits(a) - hits(b)) + 2 * abs(captures(a) - captures(b)),
        )
        measures.append(changed)
    found = []
    for words, measure in measures:
        full = [(a, b) for a, b in pairs if b is not None]
        if full:
            a, b = max(full, key=lambda pair: measure(*pair))
            games = list({id(job): job for job in (_job(by_game, a), _job(by_game, b))}.values())
            found.append((f"{words} ({a['blue']} against {a['red']}, repetition {a['repetition']})", games))
    return found


def write_replays(chosen: Sequence[Chosen], folder: Path, workers: Workers) -> list[dict[str, str]]:
    """Play the games again and write a replay of each choice; return labels and file names."""
    specs = list({job.spec.key: job.spec for _, jobs in chosen for job in jobs}.values())
    records = {o.job.key: o.answer.record for o in outcomes(play_match, specs, workers) if o.answer is not None}
    links = []
    for number, (words, jobs) in enumerate(chosen, start=1):
        games = [records[job.spec.key] for job in jobs if job.spec.key in records]
        if games:
            name = f"replay-{number}.html"
            write_replay(games, folder / name, title=f"Tournament, {words}")
            links.append({"label": words, "path": name})
    return links


def hits(row: Row) -> float:
    """Hits of both teams in a game."""
    mates = sum(row[f"{side}_hits_teammate"] for side in SIDES)
    return float(mates + row["blue_hits_opponent"])


def captures(row: Row) -> float:
    """Captures of both teams in a game."""
    return float(sum(row[f"{side}_captures"] for side in SIDES))


def _partner(row: Row, rows: Sequence[Row], states: tuple[str, str] | None) -> Row | None:
    if states is None:
        return row
    same = ("blue", "red", "repetition")
    return next((r for r in rows if r["state"] == states[1] and all(r[k] == row[k] for k in same)), None)


def _job(by_game: Mapping[tuple[str, str, str, int], GameJob], row: Row) -> GameJob:
    return by_game[row["state"], row["blue"], row["red"], row["repetition"]]
