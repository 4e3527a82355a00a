"""Which separation violations were avoidable: the post-hoc analysis asked about a game, and its answers counted.

`StateLog` keeps what the analysis looks back at: all boats' full states and who drove them, about 0.6 kB a step for six
boats. Nothing is computed while the game goes on, and nothing at all when it had no violation.
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
from .oracle import AT_ONCE, Motion, Outcome, Responsible, Verdict, ViolationVerdict
from .statistics import count_interval

JUDGE = ("all", "shielded", "none")
"""Whose separation violations are judged: in every game, in games whose own team is shielded, in none."""
MOST_JUDGED = 500
"""Violations of one game beyond this many are not judged."""
NOT_JUDGED = "not_judged"


def check_judge(choice: str) -> str:
    """Return the choice; ConfigError where it is none of `JUDGE`."""
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
        return np.array(self._rows["driven"], dtype=np.bool_).reshape(-1, len(self._rows["state"][0]))

    @property
    def disabled(self) -> np.ndarray:
        """(T, n) bool."""
        return np.array(self._rows["is_disabled"], dtype=np.bool_).reshape(-1, len(self._rows["state"][0]))


def helpless(verdict: Verdict, disabled: np.ndarray | None) -> bool:
    """Whether a boat was disabled (T, n; None: nobody knows) from the last moment on at which it could have acted.

    The analysis steers boats as if each obeyed; and before it was disabled nobody could know that it would be.
    """
    if verdict.last_step is None or disabled is None or verdict.last_step >= verdict.step:
        return False
    return bool(disabled[verdict.last_step : verdict.step, verdict.own].all())


def judge_game(
    log: StateLog, params: np.ndarray, record: Record, side: int, motion: Motion = AT_ONCE
) -> list[dict[str, Any]]:
    """Judge the separation violations of a game that a team's boats were in, at the record's separation.

    Args:
        log: the game's states.
        params: (n, N_PARAM) parameter rows of its boats.
        record: the game, with its ``violations``.
        side: the team in question.
        motion: the current that carried the boats, and how late their commands came.

    Returns:
        Per violation, in order of time, the entries of ``violations[]`` in `docs.KEYS`.
    """
    meta = read_meta(record)
    team = np.asarray(meta["team"])
    found = [row for row in record["violations"] if side in (team[int(row[1])], team[int(row[2])])]
    if not found:
        return []
    radius_m, dt_s = float(meta["separation_m"]), float(meta["dt_s"])
    verdicts = oracle.judge_violations(
        log.states, params, found[:MOST_JUDGED], radius_m, dt_s, log.driven, motion=motion
    )
    padded: list[ViolationVerdict | None] = [*verdicts, *[None] * (len(found) - len(verdicts))]
    disabled, entries = getattr(log, "disabled", None), []
    for (first, *boats, closest_m), verdict in zip(found, padded, strict=True):
        step, pair = int(first), [int(boat) for boat in boats]
        own = [boat for boat in pair if team[boat] == side]
        entries.append(
            {
                "step": step,
                "time_s": step * dt_s,
                "boats": [meta["agent_ids"][boat] for boat in pair],
                "kind": "teammate" if len(own) == 2 else "opponent",
                "radius_m": radius_m,
                "closest_m": float(closest_m),
                **_judged(verdict, own, meta["agent_ids"], disabled),
                "driven": bool(log.driven[step - 1, own].all()),
            }
        )
    return entries


def _judged(
    both: ViolationVerdict | None, own: Sequence[int], agent_ids: Sequence[str], disabled: np.ndarray | None
) -> dict[str, Any]:
    if both is None:
        empty = ("last_preventable_s", "other_last_preventable_s", "exhausted", "responsible")
        return {"verdict": NOT_JUDGED, **dict.fromkeys(empty), "responsible_boats": []}
    ours, (best, side) = [both.of(boat) for boat in own], own_side(both, own)
    theirs = [verdict.last_preventable_s for verdict in (both.first, both.second) if verdict.own not in own]
    could = [verdict for verdict in ours if verdict.outcome is Outcome.AVOIDABLE]
    nobody = bool(could) and all(helpless(verdict, disabled) for verdict in could)
    return {
        "verdict": Outcome.UNAVOIDABLE.value if nobody else best.outcome.value,
        "last_preventable_s": None if nobody else best.last_preventable_s,
        "other_last_preventable_s": theirs[0] if theirs else None,
        "exhausted": all(verdict.exhausted for verdict in ours),
        "responsible": side,
        "responsible_boats": [agent_ids[boat] for boat in both.responsible_boats()],
    }


def own_side(both: ViolationVerdict, own: Sequence[int]) -> tuple[Verdict, str]:
    """The verdict on the own boat that could act the longest, and who is responsible: one of `SIDES`."""
    ours = [verdict for verdict in (both.first, both.second) if verdict.own in own]
    best = max(ours, key=lambda verdict: -1 if verdict.last_step is None else verdict.last_step)
    if both.responsible in (Responsible.GAME, Responsible.NEITHER, Responsible.START):
        return best, both.responsible.value
    inside = [boat in own for boat in both.responsible_boats()]
    return best, "own" if all(inside) else "both" if any(inside) else "opponent"


AVOIDABLE = Outcome.AVOIDABLE.value
Row = Mapping[str, Any]
KINDS = ("teammate", "opponent")
SIDES = ("own", "opponent", "both", "game", "neither", "start")
OFF, ON, COVERED = STATES = ("off", "on", "covered")
"""States of the shield; covered, where it is played beside on: also for boats that the game drives."""
_COUNTED = (*(outcome.value for outcome in Outcome), NOT_JUDGED)
HEADS = (
    *(
        "",
        "hits",
        "game-controlled",
        "avoidable",
        "unavoidable",
        "started inside the separation",
        "not judged",
        "avoidable per game",
    ),
)
SHORT_HEADS = ("", "hits", "game-controlled", "avoid.", "unavoid.", "inside", "unjudged", "avoidable/game")
"""Heads of the terminal's table; game-controlled hits are those, of all, whose own boats the game drove."""


def verdict_columns(violations: Sequence[Row] | None, radius_m: float) -> dict[str, int | None]:
    """Count a game's verdicts (of `judge_game`; None: it was not judged, and neither is any column).

    Returns:
        ``avoidable`` of both kinds, of them ``avoidable_driven`` of boats that the game drove, and a count per outcome
        and kind, such as ``avoidable_opponent_2.5m``.
    """
    found = [violation for violation in violations or () if violation["verdict"] == AVOIDABLE]
    counts = {"avoidable": len(found), "avoidable_driven": sum(bool(violation.get("driven")) for violation in found)}
    for kind in KINDS:
        for verdict in _COUNTED:
            counts[f"{verdict}_{kind}_{float(radius_m)}m"] = _number(violations or (), kind, verdict)
    return {name: None if violations is None else count for name, count in counts.items()}


def summarise_verdicts(rows: Sequence[Row]) -> dict[str, Any]:
    """Summarise the verdicts of a pairing's games; those without ``violations`` were not judged.

    Returns:
        Per shield state off, on and, where there are such games, covered: ``games`` and ``games_judged``; per kind the
        number of violations per outcome, ``violations``, ``avoidable_per_game`` (value, low, high; None when no game
        was judged) and ``responsible`` (number per side).
    """
    summary = {}
    for state in STATES:
        games = [row for row in rows if state_of(row) == state]
        if state == COVERED and not games:
            continue
        judged = [row["violations"] for row in games if row.get("violations") is not None]
        found = [violation for violations in judged for violation in violations]
        kinds = {kind: _kind(found, kind, len(judged)) for kind in KINDS}
        summary[state] = {"games": len(games), "games_judged": len(judged), **kinds}
    return summary


def state_of(row: Row) -> str:
    """The state of the shield that a row counts for: as it says, else off or on."""
    return str(row.get("state") or (ON if row["shielded"] else OFF))


def _kind(violations: Sequence[Row], kind: str, games: int) -> dict[str, Any]:
    counts = {verdict: _number(violations, kind, verdict) for verdict in _COUNTED}
    sides = [violation["responsible"] for violation in violations if violation["kind"] == kind]
    return {
        "violations": sum(counts.values()),
        "game_controlled": sum(violation["kind"] == kind and bool(violation.get("driven")) for violation in violations),
        **counts,
        "avoidable_per_game": asdict(count_interval(counts["avoidable"], games)) if games else None,
        "responsible": {side: sides.count(side) for side in SIDES},
    }


def _number(violations: Sequence[Row], kind: str, verdict: str) -> int:
    return sum(violation["kind"] == kind and violation["verdict"] == verdict for violation in violations)


def all_violations(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """List the separation violations of all judged games, each with the game it happened in."""
    named = ("pairing", "game", "shielded")
    return [
        {**{name: row[name] for name in named}, "state": state_of(row), **violation}
        for row in rows
        for violation in row.get("violations") or ()
    ]


def verdict_rows(verdicts: Mapping[str, Any], interval_text: Any) -> list[list[str]]:
    """Lay out `summarise_verdicts`, a line per shield state and kind, under `HEADS`; none where no game was judged."""
    parts = [(state, part) for state in STATES if (part := verdicts.get(state) or {}).get("games")]
    lines = []
    for state, part in parts if any(part["games_judged"] for _, part in parts) else ():
        for kind in KINDS:
            told = ["not judged", *["-"] * (len(HEADS) - 2)]
            if part["games_judged"]:
                counts = part[kind]
                told = [str(counts.get(name, "-")) for name in ("violations", "game_controlled", *_COUNTED)]
                told.append(interval_text(counts["avoidable_per_game"]))
            lines.append([f"{kind}, {state}", *told])
    return lines
