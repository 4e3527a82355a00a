"""Checking an entry: does it load, what does it import, how long does an action take, does it play."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from steerclear.env.config import GameConfig
from steerclear.policies.foreign import PolicyReport
from steerclear.policies.submissions.made_for import made_for
from steerclear.shield.exceptions import PolicyError

from ..play.match import Match
from ..play.spec import MatchSpec
from ..words import count_text
from .imports import imports_of
from .team import EntryTeam

OPPONENT = "hold"
"""Stands still: what goes wrong in the game is the entry's doing."""


def headline(found: dict[str, Any]) -> str:
    """Whether an entry plays, which boats failed how often and whether it is in time; in one sentence."""
    but = [
        f"{boat} failed in {count} of {count_text(found['steps'], 'step')}"
        for boat, count in found["failed_steps"].items()
    ]
    if always_late(found):
        but.append(f"all {count_text(found['decisions'], 'decision')} took longer than the game gives")
    return f"{found['entry']} loads in {found['load_s']:.1f} s and plays{', but ' if but else ''}{', '.join(but)}"


def always_late(found: dict[str, Any]) -> bool:
    """Whether no decision that `check_entry` saw was made in time."""
    return 0 < found["decisions"] == found["late_decisions"]


def check_entry(path: str, preset: str, max_time_s: float | None, answer_s: float) -> dict[str, Any]:
    """Load an entry in a process of its own and let it play against boats that hold.

    Args:
        path: a folder or zip with solution.py.
        preset: rules of the game.
        max_time_s: length of the game, s; None: a whole one.
        answer_s: time it has for the actions of a decision, s.

    Returns:
        What `docs.KEYS` describes.
    """
    imports, made = imports_of(path), made_for(path)
    started = time.perf_counter()
    EntryTeam(path, answer_s).close()
    load_s = time.perf_counter() - started
    whole = GameConfig.preset(preset)
    rules = {"max_time_s": whole.max_time_s if max_time_s is None else max_time_s}
    match = Match(MatchSpec(preset, path, OPPONENT, rules=rules, judge="none", answer_s=answer_s))
    try:
        row = match.play().row
        report: PolicyReport = match.teams[0].policy.report()
    finally:
        match.close()
    if not row["policy_usable_steps"]:
        raise PolicyError(f"{Path(path).name} gave nothing usable throughout the game; {row['first_failure']}")
    return {
        "entry": path,
        "load_s": load_s,
        "imports": asdict(imports),
        "made_for": None if made is None else {"preset": made.preset, "shield": dict(made.shield) or None},
        "calls": report.calls,
        "mean_ms": report.mean_ms,
        "max_ms": report.max_ms,
        "late": report.late,
        "decision_ms": report.step_ms,
        "decisions": report.decisions,
        "mean_decision_ms": report.mean_decision_ms,
        "max_decision_ms": report.max_decision_ms,
        "late_decisions": report.late_decisions,
        "failures": [
            {"kind": one.kind, "count": one.count, "boats": one.boats, "message": one.message}
            for one in report.failures
        ],
        "held": report.held,
        "steps": report.steps,
        "game_steps": round(whole.max_time_s / whole.decision_s),
        "failed_steps": report.failed_by_boat(),
        "game": {
            name: row[name] for name in ("captures", "grabs", "tags", "collisions", "duration_s", "first_failure")
        },
    }
