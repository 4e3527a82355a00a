"""Playing one game of a tournament and counting what happened, for both teams."""

from __future__ import annotations

from typing import Any

import numpy as np
from steerclear.policies.protocol import TeamPolicy

from ..game_metrics import tally
from ..metrics import breach_column
from ..play.match import Match, MatchResult
from ..play.seat import Failures
from ..play.spec import SIDES, MatchSpec
from .settings import GameJob, label

KINDS = ("teammate", "opponent")


def play_game(job: GameJob) -> dict[str, Any]:
    """Play a game; its row, as `keys.TOURNAMENT_GAME` describes it.

    Raises:
        SteerclearError: a setting or policy is unusable.
    """
    match = Match(job.spec)
    try:
        result = match.play()
        return {**_header(job, result), **_both(match, result, job)}
    finally:
        match.close()


def _header(job: GameJob, result: MatchResult) -> dict[str, Any]:
    spec, row = job.spec, result.row
    return {
        "phase": job.phase,
        "state": job.state,
        "examined": job.examined,
        "blue": label(spec.own),
        "red": label(spec.opponent),
        "repetition": spec.game,
        "seed": spec.seed,
        **{name: row[name] for name in ("preset", "steps", "duration_s", "wall_s")},
    }


def _both(match: Match, result: MatchResult, job: GameJob) -> dict[str, Any]:
    columns: dict[str, Any] = {}
    for team, side in enumerate(SIDES):
        covered = (job.spec.shield, job.spec.opponent_shield)[team] is not None
        counted = {"shielded": covered, **_counts(match, result, job, team, covered)}
        columns |= {f"{side}_{name}": value for name, value in counted.items()}
    return columns


def _counts(match: Match, result: MatchResult, job: GameJob, team: int, covered: bool) -> dict[str, Any]:
    counts = tally(result.record, team, job.spec.radii_m)
    core, seat = match.env.core, match.teams[team]
    judged = _judged(match, result, job.spec, team) if job.spec.judge == "all" or covered else None
    hits = {f"hits_{kind}": counts[breach_column(kind, job.separation_m)] for kind in KINDS}
    return {
        **{name: int(getattr(core, name)[0, team]) for name in ("captures", "grabs", "tags")},
        "collisions": counts["collisions"],
        **hits,
        "closest_m": counts["closest_m"],
        **{f"avoidable_{kind}": None if judged is None else _avoidable(judged, kind) for kind in KINDS},
        "changed_share": counts["changed_share"],
        "deadlocks": counts["deadlocks"],
        **_behaviour(seat.policy, seat.failures()),
    }


def _judged(match: Match, result: MatchResult, spec: MatchSpec, team: int) -> list[dict[str, Any]] | None:
    """A team's judged breaches; the own team's are in the row already."""
    breaches: list[dict[str, Any]] | None = result.row["breaches"]
    return breaches if team == spec.own_team else match.breaches(result.record, team)


def _avoidable(judged: list[dict[str, Any]], kind: str) -> int:
    return sum(breach["kind"] == kind and breach["verdict"] == "avoidable" for breach in judged)


def _behaviour(policy: TeamPolicy, failures: Failures) -> dict[str, Any]:
    """What a team's code did: failures, missed deadlines of a planner, the time it thought for."""
    times_s = getattr(policy, "think_times_s", None)
    return {
        "failures": failures.count,
        "usable_steps": failures.usable_steps,
        "first_failure": failures.texts[0] if failures.texts else None,
        "missed_deadlines": getattr(policy, "missed_deadlines", 0),
        "think_p95_ms": float(1e3 * np.quantile(times_s, 0.95)) if times_s else None,
    }
