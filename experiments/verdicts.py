"""Which separation violations were avoidable: the post-hoc analysis asked about a game, and its answers counted.

`StateLog` keeps what the analysis looks back at: all boats' full states and who drove them, about 0.6 kB a step for six
boats. Nothing is computed while the game goes on, and nothing at all when it had no breach.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from steerclear.env.core import BatchedMctf
from steerclear.env.record import Record, read_meta
from steerclear.shield.exceptions import ConfigError

from . import oracle
from .oracle import AT_ONCE, BreachVerdict, Motion, Outcome, Responsible, Verdict
from .statistics import count_interval

JUDGE = ("all", "shielded", "none")
"""Whose breaches the oracle judges: in every game, in games whose own team is shielded, in none."""
MOST_JUDGED = 500
"""Breaches of one game beyond this many are not judged."""
NOT_JUDGED = "not_judged"


def check_judge(choice: str) -> str:
    """Return the choice.

    Raises:
        ConfigError: none of `JUDGE`.
    """
    if choice not in JUDGE:
        raise ConfigError(f"--judge is {choice!r}; choose one of {', '.join(JUDGE)}")
    return choice


class StateLog:
    """Full states of a game (index 0 the start), and which boats it drove itself or had disabled, step by step."""

    def __init__(self) -> None:
        self._rows: dict[str, list[np.ndarray]] = {}

    def start(self, core: BatchedMctf) -> None:
        """Begin with a game's start."""
        self._rows = {"state": [core.state[0].copy()], "driven": [], "is_disabled": []}

    def step(self, core: BatchedMctf) -> None:
        """Add the state after a step."""
        for name, rows in self._rows.items():
            rows.append(getattr(core, name)[0].copy())

    @property
    def states(self) -> np.ndarray:
        """(T+1, n, 11) state rows."""
        return np.array(self._rows["state"])

    @property
    def driven(self) -> np.ndarray:
        """(T, n) bool."""
        return self._marks("driven")

    @property
    def disabled(self) -> np.ndarray:
        """(T, n) bool."""
        return self._marks("is_disabled")

    def _marks(self, name: str) -> np.ndarray:
        return np.array(self._rows[name], dtype=np.bool_).reshape(-1, len(self._rows["state"][0]))


def helpless(verdict: Verdict, disabled: np.ndarray | None) -> bool:
    """Whether a boat was disabled from the last moment on at which it could have prevented a breach.

    The oracle steers boats as if each obeyed; and before it was disabled nobody could know that it would be.

    Args:
        verdict: on the boat.
        disabled: (T, n) boats that the game had disabled in each step; None: nobody knows.
    """
    if verdict.last_step is None or disabled is None or verdict.last_step >= verdict.step:
        return False
    return bool(disabled[verdict.last_step : verdict.step, verdict.own].all())


def judge_game(
    log: StateLog, params: np.ndarray, record: Record, side: int, motion: Motion = AT_ONCE
) -> list[dict[str, Any]]:
    """Judge the breaches of a game that a team's boats were in, at the record's separation radius.

    Args:
        log: the game's states.
        params: (n, N_PARAM) parameter rows of its boats.
        record: the game, with its ``breaches``.
        side: the team in question.
        motion: the current that carried the boats, and how late their commands came.

    Returns:
        Per breach, in order of time, the entries that `docs_keys.BREACH` describes.
    """
    meta = read_meta(record)
    team = np.asarray(meta["team"])
    found = [row for row in record["breaches"] if side in (team[int(row[1])], team[int(row[2])])]
    if not found:
        return []
    radius_m, dt_s = float(meta["separation_m"]), float(meta["dt_s"])
    verdicts = oracle.judge_breaches(log.states, params, found[:MOST_JUDGED], radius_m, dt_s, log.driven, motion=motion)
    padded: list[BreachVerdict | None] = [*verdicts, *[None] * (len(found) - len(verdicts))]
    disabled = getattr(log, "disabled", None)
    return [
        _entry(row, verdict, meta, team, side, disabled) | {"driven": _is_driven(row, log.driven, team, side)}
        for row, verdict in zip(found, padded, strict=True)
    ]


def _is_driven(row: np.ndarray, driven: np.ndarray, team: np.ndarray, side: int) -> bool:
    """Whether the game drove every own boat of a breach when it began: then no command could prevent it."""
    step, own = int(row[0]), [boat for boat in (int(row[1]), int(row[2])) if team[boat] == side]
    return bool(driven[step - 1, own].all())


def _entry(
    row: np.ndarray,
    verdict: BreachVerdict | None,
    meta: Mapping[str, Any],
    team: np.ndarray,
    side: int,
    disabled: np.ndarray | None,
) -> dict[str, Any]:
    step, pair = int(row[0]), (int(row[1]), int(row[2]))
    own = [boat for boat in pair if team[boat] == side]
    entry = {
        "step": step,
        "time_s": step * float(meta["dt_s"]),
        "boats": [meta["agent_ids"][boat] for boat in pair],
        "kind": "teammate" if len(own) == 2 else "opponent",
        "radius_m": float(meta["separation_m"]),
        "closest_m": float(row[3]),
    }
    if verdict is None:
        empty = ("last_preventable_s", "other_last_preventable_s", "exhausted", "responsible")
        return {**entry, "verdict": NOT_JUDGED, **dict.fromkeys(empty), "responsible_boats": []}
    judged = _judged(verdict, own, meta["agent_ids"])
    could = [verdict.of(boat) for boat in own if verdict.of(boat).outcome is Outcome.AVOIDABLE]
    if could and all(helpless(one, disabled) for one in could):
        judged |= {"verdict": Outcome.UNAVOIDABLE.value, "last_preventable_s": None}
    return {**entry, **judged}


def _judged(both: BreachVerdict, own: Sequence[int], agent_ids: Sequence[str]) -> dict[str, Any]:
    ours = [both.of(boat) for boat in own]
    best = max(ours, key=lambda verdict: -1 if verdict.last_step is None else verdict.last_step)
    theirs = [verdict.last_preventable_s for verdict in (both.first, both.second) if verdict.own not in own]
    return {
        "verdict": best.outcome.value,
        "last_preventable_s": best.last_preventable_s,
        "other_last_preventable_s": theirs[0] if theirs else None,
        "exhausted": all(verdict.exhausted for verdict in ours),
        "responsible": _side(both, own),
        "responsible_boats": [agent_ids[boat] for boat in both.responsible_boats()],
    }


def _side(both: BreachVerdict, own: Sequence[int]) -> str:
    """Name the responsible side as the team sees it: own, opponent, both, game, neither or start."""
    if both.responsible in (Responsible.GAME, Responsible.NEITHER, Responsible.START):
        return both.responsible.value
    inside = [boat in own for boat in both.responsible_boats()]
    return "own" if all(inside) else "both" if any(inside) else "opponent"


OUTCOMES = tuple(outcome.value for outcome in Outcome)
AVOIDABLE = Outcome.AVOIDABLE.value


Row = Mapping[str, Any]
KINDS = (("teammate", "teammate"), ("opponent", "opponent"))
SIDES = ("own", "opponent", "both", "game", "neither", "start")
OFF, ON, COVERED = STATES = ("off", "on", "covered")
"""States of the shield; covered, where it is played beside on: also for boats that the game drives."""
_COUNTED = (*OUTCOMES, NOT_JUDGED)
HEADS = ("", "breaches", "avoidable", "unavoidable", "started inside", "not judged", "avoidable per game")
SHORT_HEADS = ("", "breaches", "avoid.", "unavoid.", "inside", "unjudged", "avoidable/game")


def verdict_column(verdict: str, kind: str, radius_m: float) -> str:
    """Name the column of a count: `avoidable_opponent_2.5m`."""
    return f"{verdict}_{kind}_{float(radius_m)}m"


def verdict_columns(breaches: Sequence[Row] | None, radius_m: float) -> dict[str, int | None]:
    """Count a game's verdicts per kind of pair.

    Args:
        breaches: as `judge_game` returns them; None when the game was not judged.
        radius_m: at which they were.

    Returns:
        ``avoidable`` of both kinds, of them ``avoidable_driven`` of boats that the game drove, and a count per outcome
        and kind; None in all when the game was not judged.
    """
    found = None if breaches is None else [breach for breach in breaches if breach["verdict"] == AVOIDABLE]
    driven = None if found is None else sum(bool(breach.get("driven")) for breach in found)
    return {"avoidable": None if found is None else len(found), "avoidable_driven": driven} | {
        verdict_column(verdict, kind, radius_m): None if breaches is None else _number(breaches, kind, verdict)
        for kind, _ in KINDS
        for verdict in _COUNTED
    }


def summarise_verdicts(rows: Sequence[Row]) -> dict[str, Any]:
    """Summarise the verdicts of a pairing's games.

    Args:
        rows: games; those without ``breaches`` (stored by an earlier version, or not asked for) were not judged.

    Returns:
        Per shield state off, on and, where there are such games, covered: ``games`` and ``games_judged``; per kind the
        number of breaches per outcome, ``breaches``, ``avoidable_per_game`` (value, low, high; None when no game was
        judged) and ``responsible`` (number per side).
    """
    summary = {}
    for state in STATES:
        games = [row for row in rows if state_of(row) == state]
        if state == COVERED and not games:
            continue
        judged = [row["breaches"] for row in games if row.get("breaches") is not None]
        found = [breach for breaches in judged for breach in breaches]
        kinds = {kind: _kind(found, kind, len(judged)) for kind, _ in KINDS}
        summary[state] = {"games": len(games), "games_judged": len(judged), **kinds}
    return summary


def state_of(row: Row) -> str:
    """The state of the shield that a row counts for: as it says, else off or on."""
    return str(row.get("state") or (ON if row["shielded"] else OFF))


def _kind(breaches: Sequence[Row], kind: str, games: int) -> dict[str, Any]:
    counts = {verdict: _number(breaches, kind, verdict) for verdict in _COUNTED}
    sides = [breach["responsible"] for breach in breaches if breach["kind"] == kind]
    return {
        "breaches": sum(counts.values()),
        **counts,
        "avoidable_per_game": asdict(count_interval(counts["avoidable"], games)) if games else None,
        "responsible": {side: sides.count(side) for side in SIDES},
    }


def _number(breaches: Sequence[Row], kind: str, verdict: str) -> int:
    return sum(breach["kind"] == kind and breach["verdict"] == verdict for breach in breaches)


def all_breaches(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """List the breaches of all judged games, each with the game it happened in."""
    named = ("pairing", "game", "shielded")
    return [
        {**{name: row[name] for name in named}, "state": state_of(row), **breach}
        for row in rows
        for breach in row.get("breaches") or ()
    ]


def verdict_rows(verdicts: Mapping[str, Any], interval_text: Any) -> list[list[str]]:
    """Lay out a summary of verdicts, a line per shield state and kind, under `HEADS`.

    There are none where no game was judged.

    Args:
        verdicts: as `summarise_verdicts` returns them; empty for results of an earlier version.
        interval_text: writes a figure.
    """
    lines: list[list[str]] = []
    if not any((verdicts.get(state) or {}).get("games_judged") for state in STATES):
        return lines
    for state in STATES:
        part = verdicts.get(state) or {}
        if part.get("games"):
            lines += [_line(state, part, kind, words, interval_text) for kind, words in KINDS]
    return lines


def _line(state: str, part: Mapping[str, Any], kind: str, words: str, interval_text: Any) -> list[str]:
    label = f"{words}, {state}"
    if not part["games_judged"]:
        return [label, "not judged", *["-"] * (len(HEADS) - 2)]
    counts = part[kind]
    numbers = [str(counts[name]) for name in ("breaches", *_COUNTED)]
    return [label, *numbers, interval_text(counts["avoidable_per_game"])]
