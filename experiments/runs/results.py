"""Putting together and writing what a run of games gave: results.json, the table of games, report and replay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..measure.summary import Row
from ..measure.tally import breach_column
from ..measure.verdicts import all_breaches, without_breaches
from ..play.match import play_match
from ..play.spec import MatchSpec
from ..report.ablation_html import write_report
from ..report.replay_html import write_replay
from .ablation import AblationSettings, ablation_bars, most_instructive, spec_of, summaries
from .campaign import Played
from .failure_words import failure_warnings, held_games
from .pool import Engine, run_all
from .provenance import machine, versions
from .store import told_settings, write_json, write_table

NAMES = {"games": "games", "replay": "replay.html", "report": "report.html", "results": "results.json"}


def results_of(
    command: str, settings: AblationSettings, played: Played, wall_s: float, quick: bool = False
) -> dict[str, Any]:
    """Put together the content of results.json; `keys.RESULTS` describes it.

    Args:
        command: which command this is.
        settings: of the run.
        played: its games; fewer than the settings ask for when it was interrupted.
        wall_s: how long it took, s.
        quick: whether it is the small version.
    """
    expected = settings.games * len(settings.opponents) * len(settings.states)
    return {
        "command": command,
        "complete": len(played.rows) == expected,
        "quick": quick,
        "settings": told_settings(asdict(settings)),
        "policy_files": _policy_files(played.rows),
        "seeds": [settings.seed + game for game in range(settings.games)],
        "versions": versions(),
        "machine": machine(),
        "wall_s": wall_s,
        "games_played": len(played.rows),
        "games_resumed": played.resumed,
        "failed": played.failed,
        "warnings": failure_warnings(played.rows),
        "held": held_games(played.rows),
        "pairings": summaries(played.rows, settings),
        "bars": ablation_bars(played.rows, settings.separation_m),
        "breaches": all_breaches(played.rows),
    }


def _policy_files(rows: Sequence[Row]) -> dict[str, str]:
    """Digests of the files that were played, by policy; none of named policies."""
    pairs = {(row[side], row.get(f"{side}_files")) for row in rows for side in ("own", "opponent")}
    return {name: digest for name, digest in sorted(pairs, key=str) if digest}


def write_results(folder: Path, results: dict[str, Any], rows: Sequence[Row], records: Sequence[Any] = ()) -> Path:
    """Write everything into the folder and note the names under ``files``.

    Args:
        folder: where to.
        results: from `results_of`; gains ``files``.
        rows: the games.
        records: games for the replay, unshielded first; none, no replay.

    Returns:
        The path of results.json.
    """
    flat = without_breaches(rows)
    files = {"results": NAMES["results"], "games": write_table(folder, flat, NAMES["games"]).name}
    results["files"] = files
    links = []
    if records:
        files["replay"] = write_replay(records, folder / NAMES["replay"]).name
        links = [{"label": _replay_label(results["replay"]), "path": files["replay"]}]
    files["report"] = write_report({**results, "games": flat, "replays": links}, folder / NAMES["report"]).name
    path = folder / NAMES["results"]
    write_json(path, results)
    return path


def replay_of(
    rows: Sequence[Row], specs: Sequence[MatchSpec], separation_m: float, processes: int | Engine
) -> tuple[dict[str, Any], list[Any]] | None:
    """Play the most instructive pair of games again, for its records.

    Returns:
        The ``replay`` entry of results.json and the records off and on; None without a pair of games.
    """
    pair = most_instructive(rows, separation_m)
    if pair is None:
        return None
    chosen = [spec_of(row, specs) for row in pair]
    outcomes = {outcome.job.key: outcome.answer for outcome in run_all(play_match, chosen, processes)}
    again = [outcomes[spec.key] for spec in chosen]
    if any(result is None for result in again):
        return None
    entry = {
        "pairing": pair[0]["pairing"],
        "game": pair[0]["game"],
        "breaches_off": _breaches(pair[0], separation_m),
        "breaches_on": _breaches(pair[1], separation_m),
        "same_as_played": all(same_game(row, result.row) for row, result in zip(pair, again, strict=True) if result),
    }
    return entry, [result.record for result in again if result is not None]


def same_game(first: Row, second: Row) -> bool:
    """Tell whether two rows are the same game; times of computing may differ."""
    timed = ("wall_s", "decision_p50_us", "decision_p99_us", "decision_max_us")
    return all(first.get(name) == value for name, value in second.items() if name not in timed)


def _replay_label(replay: Mapping[str, Any]) -> str:
    return f"{replay['pairing']}, game {replay['game']}: without the shield and with it"


def _breaches(row: Mapping[str, Any], separation_m: float) -> int:
    return sum(int(row[breach_column(kind, separation_m)]) for kind in ("teammate", "opponent"))
