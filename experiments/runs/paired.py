"""Two results set beside one another, game by game from the same seeds: what one setting changes against another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.shield.exceptions import ConfigError

from ..measure.statistics import bootstrap_interval, count_difference, paired_difference
from ..measure.summary import Metric, Row, metrics_of
from .json_file import read_json
from .store import LINES_FILE, RESULTS_FILE, read_line

COMMANDS = ("ablate", "evaluate", "entry report")
SAME = ("preset", "rules", "fixed_start", "penalty")
"""Settings without which games of one seed are no pairs."""
BESIDE = ("opponents", "games", "seed", "sides", "states", "judge", "trust", "answer_s")
"""Settings that say which games there are, or change nothing in them."""
Game = tuple[str, int, str]
"""Opponent, seed and own colour: what makes two games a pair."""


@dataclass(frozen=True)
class Run:
    """Results of a run.

    Attributes:
        folder: where they are.
        settings: of the run, as its results keep them.
        version: of steerclear that played it.
        code: digests of the code that played its games.
        shielded: whether its games are those with the shield: where there are any, they are.
        games: its rows.
    """

    folder: Path
    settings: Mapping[str, Any]
    version: str
    code: frozenset[str]
    shielded: bool
    games: Mapping[Game, Row]


def read_run(folder: Path) -> Run:
    """Read a results folder.

    Raises:
        ConfigError: it holds no results of games, or games of several settings.
    """
    remedy = "give a results folder of ablate or evaluate"
    if not folder.is_dir():
        raise ConfigError(f"{folder} is no folder; {remedy}")
    content = read_json(folder / RESULTS_FILE, "results", remedy)
    command = content.get("command") if isinstance(content, dict) else None
    if command not in COMMANDS:
        raise ConfigError(f"{folder} holds results of {command!r}, not of games; {remedy}")
    try:
        settings, seeds = content["settings"], content["seeds"]
        shielded = any(settings["states"])
        rows, code = _rows(folder / LINES_FILE, settings, seeds, shielded)
        return Run(folder, settings, content["versions"]["steerclear"], code, shielded, rows)
    except (KeyError, TypeError, IndexError) as error:
        raise ConfigError(f"{folder} holds results of another version ({error!r}); make them again") from error


def _rows(
    path: Path, settings: Mapping[str, Any], seeds: Sequence[int], shielded: bool
) -> tuple[dict[Game, Row], frozenset[str]]:
    """Rows of a run by game, and digests of the code that played them."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"cannot read the games of {path} ({error}); give a results folder as it was made") from error
    found: dict[Game, Row] = {}
    keys: dict[Game, str] = {}
    code = set()
    for row in filter(None, map(read_line, lines)):
        if row["own"] != settings["own"] or row["opponent"] not in settings["opponents"]:
            continue
        if row["shielded"] is not shielded or row["seed"] not in seeds:
            continue
        game = row["opponent"], row["seed"], row["side"]
        if keys.setdefault(game, row["key"]) != row["key"]:
            raise ConfigError(
                f"{path} holds games of several settings, or of a policy before its files changed; play into a folder "
                "of its own (--out)"
            )
        found[game] = row
        code.add(row["code"])
    return found, frozenset(code)


def compare_runs(first: Run, second: Run, seed: int = 0) -> dict[str, Any]:
    """Set two runs beside one another.

    Args:
        first: what the other is compared with.
        second: the other.
        seed: of the bootstrap.

    Returns:
        What `keys.COMPARE` describes, but for where and when it was made.

    Raises:
        ConfigError: their games are no pairs: of other rules, or none from the same seed.
    """
    for name in SAME:
        if first.settings[name] != second.settings[name]:
            raise ConfigError(
                f"{first.folder} and {second.folder} have another {name} ({first.settings[name]!r} and "
                f"{second.settings[name]!r}), so their games are no pairs; play both alike but for what you compare"
            )
    pairs = {opponent: _pairs(first, second, opponent) for opponent in first.settings["opponents"]}
    pairs = {opponent: found for opponent, found in pairs.items() if found}
    if not pairs:
        raise ConfigError(
            f"{first.folder} and {second.folder} have no game of the same opponent, seed and side; play both with the "
            "same --opponents and --seed"
        )
    metrics = metrics_of(_radii_m(first, second), seed)
    return {
        "first": _about(first),
        "second": _about(second),
        "differs": differs(first, second),
        "pairings": [
            {"opponent": opponent, "pairs": len(found), "metrics": _figures(metrics, found, seed)}
            for opponent, found in pairs.items()
        ],
    }


def _about(run: Run) -> dict[str, Any]:
    return {"folder": str(run.folder), "own": run.settings["own"], "shielded": run.shielded, "games": len(run.games)}


def differs(first: Run, second: Run) -> dict[str, list[Any]]:
    """Settings, and versions of the code, that differ, each with both values; None: not given."""
    before, after = (_flat(run) for run in (first, second))
    names = [*before, *(name for name in after if name not in before)]
    return {name: [before.get(name), after.get(name)] for name in names if before.get(name) != after.get(name)}


def _flat(run: Run) -> dict[str, Any]:
    """What may differ between two runs, by name."""
    settings = {name: value for name, value in run.settings.items() if name not in (*SAME, *BESIDE)}
    shield, conditions = settings.pop("shield"), settings.pop("conditions")
    found = {**settings, "shielded": run.shielded, **{f"conditions.{k}": v for k, v in conditions.items()}}
    if run.shielded:
        found |= {f"shield.{name}": value for name, value in shield.items()}
    files = sorted({str(row.get("own_files") or "") for row in run.games.values()})
    return {**found, "policy_files": files, "version": run.version, "code": sorted(run.code)}


def _pairs(first: Run, second: Run, opponent: str) -> list[tuple[Row, Row]]:
    """Games of both from the same seeds, against the same files of the opponent."""
    games = [game for game in first.games if game[0] == opponent and game in second.games]
    found = [(first.games[game], second.games[game]) for game in sorted(games)]
    if any(one.get("opponent_files") != other.get("opponent_files") for one, other in found):
        raise ConfigError(f"the files of {opponent} changed between both runs, so their games are no pairs; play again")
    return found


def _radii_m(first: Run, second: Run) -> tuple[float, ...]:
    """Radii at which both counted breaches, m."""
    return tuple(sorted(set.intersection(*(_counted_m(run) for run in (first, second)))))


def _counted_m(run: Run) -> set[float]:
    begin = "breaches_opponent_"
    row = next(iter(run.games.values()), {})
    return {float(name.removeprefix(begin).removesuffix("m")) for name in row if name.startswith(begin)}


def _figures(metrics: Sequence[Metric], pairs: Sequence[tuple[Row, Row]], seed: int) -> dict[str, Any]:
    """Per metric its label, both figures over the pairs, and the paired difference."""
    found = {}
    for metric in metrics:
        if metric.name == "changed_share" or metric.per_game is not None:
            both = [asdict(metric.interval(rows)) for rows in zip(*pairs, strict=True)]
            figures = {"first": both[0], "second": both[1], "difference": asdict(_difference(metric, pairs, seed))}
            if any(figure["value"] == figure["value"] for figure in both):  # the share changed by no shield is none
                found[metric.name] = {"label": metric.label, **figures}
    return found


def _difference(metric: Metric, pairs: Sequence[tuple[Row, Row]], seed: int) -> Any:
    """Second less first, games resampled as pairs."""
    if metric.per_game is None:
        columns = [[row[name] for row in pair for name in ("changed_steps", "covered_steps")] for pair in pairs]
        return bootstrap_interval(np.array(columns, dtype=np.float64), _percent_difference, seed)
    told = [(metric.per_game(one), metric.per_game(other)) for one, other in pairs]
    values = np.array([pair for pair in told if None not in pair], dtype=np.float64).reshape(-1, 2)
    difference = count_difference if metric.counted else paired_difference
    return difference(values[:, 0], values[:, 1], seed)


def _percent_difference(table: NDArray[np.float64]) -> NDArray[np.float64]:
    totals = table.sum(axis=-2)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(100.0 * (totals[..., 2] / totals[..., 3] - totals[..., 0] / totals[..., 1]))
