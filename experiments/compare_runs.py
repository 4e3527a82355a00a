"""Two results set beside one another, game by game from the same seeds: what one setting changes against another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from steerclear.shield.exceptions import ConfigError
from steerclear.shield.renamed import current_keys

from .metrics import Metric, game_metrics_of
from .result_files import read_json
from .runner import RESULTS_FILE, ROWS_FILE, check_version, read_line
from .statistics import DIFFERENCE, summarise

if TYPE_CHECKING:
    import pandas as pd

COMMANDS = ("ablate", "evaluate", "entry report")
SAME = ("preset", "rules", "fixed_start", "penalty")
"""Settings without which games of one seed are no pairs."""
BESIDE = ("opponents", "games", "seed", "sides", "states", "covered", "judge", "trust", "answer_s")
"""Settings that say which games there are, or change nothing in them."""
GAME = ("opponent", "seed", "side")
"""What makes two games a pair."""


@dataclass(frozen=True)
class PlayedRun:
    """Results of a run: its games (those with the shield, where there are any) and what played them."""

    folder: Path
    settings: Mapping[str, Any]
    version: str
    code: frozenset[str]
    shielded: bool
    table: pd.DataFrame


def read_run(folder: Path) -> PlayedRun:
    """Read a results folder; ConfigError where it holds no results of games, or games of several settings."""
    remedy = "give a results folder of ablate or evaluate"
    if not folder.is_dir():
        raise ConfigError(f"{folder} is no folder; {remedy}")
    check_version(folder)
    content = current_keys(read_json(folder / RESULTS_FILE, "results", remedy))
    command = content.get("command") if isinstance(content, dict) else None
    if command not in COMMANDS:
        raise ConfigError(f"{folder} holds results of {command!r}, not of games; {remedy}")
    try:
        settings, seeds = content["settings"], content["seeds"]
        shielded = any(settings["states"])
        table, code = _games(folder, settings, seeds, shielded)
        return PlayedRun(folder, settings, content["versions"]["steerclear"], code, shielded, table)
    except (KeyError, TypeError, IndexError) as error:
        raise ConfigError(f"{folder} holds results of another version ({error!r}); make them again") from error


def _games(
    folder: Path, settings: Mapping[str, Any], seeds: Sequence[int], shielded: bool
) -> tuple[pd.DataFrame, frozenset[str]]:
    """The games of a run that count, and digests of the code that played them."""
    import pandas as pd

    path = folder / ROWS_FILE
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"cannot read the games of {path} ({error}); give a results folder as it was made") from error
    found: dict[tuple[Any, ...], Mapping[str, Any]] = {}
    keys: dict[tuple[Any, ...], str] = {}
    code = set()
    entries = filter(None, map(read_line, lines))
    for entry, row in ((one, row) for one in entries for row in current_keys(one["rows"])):
        if row["own"] != settings["own"] or row["opponent"] not in settings["opponents"] or row["seed"] not in seeds:
            continue
        if row["shielded"] is not shielded or (settings.get("covered") and row["covered"]):  # beside the state on
            continue
        game = tuple(row[part] for part in GAME)
        if keys.setdefault(game, entry["job"]) != entry["job"]:
            raise ConfigError(
                f"{path} holds games of several settings, or of a policy before its files changed; play into a folder "
                "of its own (--out)"
            )
        found[game] = row
        code.add(entry["code"])
    return pd.DataFrame([*found.values()]), frozenset(code)


def compare_runs(first: PlayedRun, second: PlayedRun, seed: int = 0) -> dict[str, Any]:
    """Set a second run beside a first: ``compare`` in `docs.KEYS`, but for where and when it was made.

    Raises:
        ConfigError: their games are no pairs: of other rules, or none from the same seed.
    """
    for name in SAME:
        if first.settings[name] != second.settings[name]:
            raise ConfigError(
                f"{first.folder} and {second.folder} have another {name} ({first.settings[name]!r} and "
                f"{second.settings[name]!r}), so their games are no pairs; play both alike but for what you compare"
            )
    pairs = _paired(first, second)
    begin = "violations_opponent_"  # radii at which both counted
    counted = ({name for name in run.table if name.startswith(begin)} for run in (first, second))
    radii_m = sorted(float(name.removeprefix(begin).removesuffix("m")) for name in set.intersection(*counted))
    metrics = [metric for metric in game_metrics_of(radii_m) if metric.paired]
    order = [name for name in first.settings["opponents"] if (pairs["opponent"] == name).any()]
    lines = summarise(pairs, metrics, ["opponent"], ("run", "first", "second"), ["seed", "side"], seed)
    return {
        **{
            which: {
                "folder": str(run.folder),
                "own": run.settings["own"],
                "shielded": run.shielded,
                "games": len(run.table),
            }
            for which, run in (("first", first), ("second", second))
        },
        "differs": differs(first, second),
        "pairings": [
            {
                "opponent": opponent,
                "pairs": int(((pairs["opponent"] == opponent) & (pairs["run"] == "first")).sum()),
                "metrics": _figures(lines[lines["opponent"] == opponent], metrics),
            }
            for opponent in order
        ],
    }


def _paired(first: PlayedRun, second: PlayedRun) -> pd.DataFrame:
    """Games of both from the same seeds, against the same files of the opponent, one below the other."""
    import pandas as pd

    for run in (first, second):
        if run.table.empty:
            raise ConfigError(f"{run.folder} holds no game of its settings; play it again into a folder of its own")
    both = first.table[list(GAME)].merge(second.table[list(GAME)], on=list(GAME))
    if both.empty:
        raise ConfigError(
            f"{first.folder} and {second.folder} have no game of the same opponent, seed and side; play both with the "
            "same --opponents and --seed"
        )
    named = (("first", first), ("second", second))
    chosen = [run.table.merge(both, on=list(GAME)).assign(run=name) for name, run in named]
    files = [table.set_index(list(GAME))["opponent_files"] for table in chosen]
    changed = files[0] != files[1].reindex(files[0].index)
    if changed.any():
        opponent = changed[changed].index[0][0]
        raise ConfigError(f"the files of {opponent} changed between both runs, so their games are no pairs; play again")
    return pd.concat(chosen, ignore_index=True)


def differs(first: PlayedRun, second: PlayedRun) -> dict[str, list[Any]]:
    """Settings, and versions of the code, that differ, each with both values; None: not given."""
    before, after = (_flat(run) for run in (first, second))
    names = [*before, *(name for name in after if name not in before)]
    return {name: [before.get(name), after.get(name)] for name in names if before.get(name) != after.get(name)}


def _flat(run: PlayedRun) -> dict[str, Any]:
    """What may differ between two runs, by name."""
    settings = {name: value for name, value in run.settings.items() if name not in (*SAME, *BESIDE)}
    shield, conditions = settings.pop("shield"), settings.pop("conditions")
    found = {
        "policy": settings.pop("own"),
        **settings,
        "shielded": run.shielded,
        **{f"conditions.{k}": v for k, v in conditions.items()},
    }
    if run.shielded:
        found |= {f"shield.{name}": value for name, value in shield.items()}
    files = sorted(set(run.table["own_files"].fillna(""))) if len(run.table) else []
    return {**found, "policy_files": files, "version": run.version, "code": sorted(run.code)}


def _figures(lines: pd.DataFrame, metrics: Sequence[Metric]) -> dict[str, Any]:
    """Per metric its label, both figures over the pairs, and the paired difference."""
    found = {}
    none = {"value": float("nan"), "low": float("nan"), "high": float("nan"), "n": 0}
    for metric in metrics:
        chosen = lines[lines["metric"] == metric.key].set_index("run")[["value", "low", "high", "n"]].to_dict("index")
        parts = {part: chosen.get(part, none) for part in ("first", "second", DIFFERENCE)}
        if any(parts[part]["value"] == parts[part]["value"] for part in ("first", "second")):
            found[metric.key] = {"label": metric.label, **parts}
    return found
