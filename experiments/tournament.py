"""A tournament: every pair of teams on both sides, without shields and with them, and a qualifying before."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from steerclear import policies
from steerclear.shield.exceptions import ConfigError

from .game_metrics import DEFAULT_PENALTY, tally
from .metrics import RADII_M, breach_column, judged
from .play.match import Match, MatchResult
from .play.spec import ANSWER_S, SIDES, MatchSpec, near
from .rankings import SCRIPTED, prices, qualifying_table, seats, state_results
from .result_files import table_name
from .runner import RESULTS_FILE, Experiment, Notice, Run, execute
from .warming import compile_game, compile_judge, compile_shield
from .workers import Job, Row, Workers

if TYPE_CHECKING:
    import pandas as pd

OFF, ALL = "off", "all"
FINAL, QUALIFYING = "final", "qualifying"
EXAMINERS = ("easy", "medium", "hidden", "hidden", "hidden")
"""Opponents of the qualifying; of the hidden team all three compositions."""
NEVER_GRAB = ("ohto", "alamer")
KINDS = ("teammate", "opponent")


@dataclass(frozen=True)
class TournamentSettings:
    """Settings of a tournament; they are the command line and what results.json keeps; as `MatchSpec`, and.

    Attributes:
        teams: policies, each a name or a submission's path.
        states: which teams are shielded: "off", "all", or names with commas; each state plays all games.
        repetitions: times each pair meets on each side.
        seed: repetition r is played from seed + r, in all pairs, on both sides and in all states.
        qualifying: play it.
        finalists: how many teams of the qualifying go on; None for all.

    Raises:
        ConfigError: fewer than two teams, equal names, an unknown team in a state, or a number out of range.
    """

    teams: tuple[str, ...] = SCRIPTED
    preset: str = "aamas2024"
    states: tuple[str, ...] = (OFF, ALL)
    repetitions: int = 1
    seed: int = 0
    qualifying: bool = False
    finalists: int | None = None
    penalty: float = DEFAULT_PENALTY
    judge: str = "shielded"
    shield: Mapping[str, Any] = field(default_factory=dict)
    rules: Mapping[str, Any] = field(default_factory=dict)
    fixed_start: bool = False
    trust: bool = False
    answer_s: float = ANSWER_S

    def __post_init__(self) -> None:
        names = self.labels
        if len(names) < 2 or len(set(names)) != len(names):
            raise ConfigError(f"--teams are {', '.join(names) or 'none'}; give two or more of different names")
        if not 1 <= self.repetitions <= 10_000:
            raise ConfigError(f"--repetitions must be 1 to 10,000; got {self.repetitions:,}")
        if self.finalists is not None and not (self.qualifying and 2 <= self.finalists <= len(names)):
            raise ConfigError(f"--finalists goes with --qualifying and is 2 to {len(names)}; got {self.finalists}")
        for name in (name for state in self.states for name in shielded_in(state, names)):
            if name not in names:
                raise ConfigError(f"--shield names {name!r}, which does not play; {near(name, [OFF, ALL, *names])}")
        if not self.states or len(set(self.states)) != len(self.states):
            raise ConfigError("--shield is given twice with the same teams, or not at all; give each state once")

    @property
    def labels(self) -> list[str]:
        """Names of the teams in tables."""
        return [label(team) for team in self.teams]

    @property
    def separation_m(self) -> float:
        """Radius the shields keep and hits are counted at, m."""
        return float(self.shield.get("separation_m", RADII_M[0]))

    @property
    def expected(self) -> int:
        """Games there are to play, all in all."""
        qualifying = len(self.qualifying_games()) if self.qualifying else 0
        return qualifying + len(self.final(self.teams[: self.finalists]))

    def final(self, teams: Sequence[str]) -> list[Job]:
        """All games of the final: every repetition of every pair on both sides, the states of a game side by side."""
        return [
            self._job(FINAL, state, blue, red, repetition, repetition)
            for repetition in range(self.repetitions)
            for pair in combinations(teams, 2)
            for blue, red in (pair, pair[::-1])
            for state in self.states
        ]

    def qualifying_games(self) -> list[Job]:
        """Every team against the organisers' opponents, on both sides."""
        hidden = EXAMINERS.index("hidden")  # that team chooses its composition by the number of the game
        return [
            self._job(QUALIFYING, state, *teams, max(number - hidden, 0), number, side)
            for team in self.teams
            for number, examiner in enumerate(EXAMINERS)
            for side, teams in zip(SIDES, ((team, examiner), (examiner, team)), strict=True)
            for state in self.states
        ]

    def _job(self, phase: str, state: str, blue: str, red: str, game: int, turn: int, examined: str = "") -> Job:
        """One game; the own team of its spec is blue, ``examined`` the side whose qualifying game it is."""
        shielded = shielded_in(state, self.labels)
        covers = [dict(self.shield) if label(team) in shielded else None for team in (blue, red)]
        names = ("preset", "fixed_start", "penalty", "judge", "trust", "answer_s")
        spec = MatchSpec(
            own=blue,
            opponent=red,
            game=game,
            seed=self.seed + turn,
            shield=covers[0],
            opponent_shield=covers[1],
            rules=dict(self.rules),
            radii_m=tuple(sorted({*RADII_M, self.separation_m})),
            files=(policies.fingerprint(blue), policies.fingerprint(red)),
            **{name: getattr(self, name) for name in names},
        )
        about = {"phase": phase, "state": state, "examined": examined, "separation_m": self.separation_m}
        return {**about, **spec.as_job()}


def label(team: str) -> str:
    """How a team is called in tables: its name, or that of its file or folder."""
    if team in policies.names() or not ("/" in team or "\\" in team or "." in team):
        return team
    path = Path(team.removeprefix("sb3:").removeprefix("weights:"))
    return path.parent.name if path.name == "solution.py" else path.stem


def shielded_in(state: str, teams: Sequence[str]) -> tuple[str, ...]:
    """Names of the teams that are shielded in a state."""
    if state == OFF:
        return ()
    return tuple(teams) if state == ALL else tuple(name.strip() for name in state.split(",") if name.strip())


def quick(settings: TournamentSettings, max_time_s: float) -> TournamentSettings:
    """The small version: short games, once each."""
    return replace(settings, repetitions=1, rules={"max_time_s": max_time_s, **settings.rules})


def play(
    settings: TournamentSettings,
    folder: Path,
    workers: Workers,
    resume: bool,
    notice: Notice = lambda done, of: None,
    tell: Callable[[str], None] = lambda words: None,
) -> Run:
    """Play a tournament into a folder (see `runner.execute`): the qualifying, then the final of those that go on."""
    warm = (compile_game, compile_shield, compile_judge)
    first = settings.qualifying_games() if settings.qualifying else settings.final(settings.teams)
    experiment = Experiment("tournament", asdict(settings), first, play_game, "games", warm)
    run = execute(experiment, folder, workers, resume, notice, tell)
    if not settings.qualifying or run.interrupted or run.failed:
        return run
    final = settings.final(finalists(seats(run.rows), settings))
    whole = execute(replace(experiment, jobs=[*first, *final]), folder, workers, True, notice, lambda words: None)
    return replace(whole, resumed=whole.resumed - len(run.rows) + run.resumed, wall_s=whole.wall_s + run.wall_s)


def play_game(job: Job) -> list[Row]:
    """Play a game; its row, ``rows of tournament`` in `docs_keys.KEYS`; SteerclearError where it is unusable."""
    match = Match(MatchSpec.of_job(job))
    try:
        result = match.play()
        played = {name: result.row[name] for name in ("preset", "steps", "duration_s", "wall_s")}
        about = {**names_of(job), "examined": job["examined"], "seed": job["seed"], **played}
        sides = (_counts(match, result, job["separation_m"], team) for team in (0, 1))
        both = zip(SIDES, sides, strict=True)
        return [about | {f"{side}_{name}": value for side, counts in both for name, value in counts.items()}]
    finally:
        match.close()


def names_of(job: Mapping[str, Any]) -> dict[str, Any]:
    """What a game is called."""
    teams = {"blue": label(job["own"]), "red": label(job["opponent"])}
    return {"phase": job["phase"], "state": job["state"], **teams, "repetition": job["game"]}


def _counts(match: Match, result: MatchResult, separation_m: float, team: int) -> dict[str, Any]:
    """What a side did, and what its code did."""
    spec, core, seat = match.spec, match.env.core, match.teams[team]
    shielded = spec.shields[team] is not None
    counts, failures = tally(result.record, team, spec.radii_m), seat.failures()
    breaches = None
    if spec.judge == "all" or shielded:  # the own team's are in the row already
        breaches = result.row["breaches"] if team == spec.own_team else match.breaches(result.record, team)
    avoidable = [breach["kind"] for breach in breaches or () if breach["verdict"] == "avoidable"]
    times_s = getattr(seat.policy, "think_times_s", None)
    return {
        "shielded": shielded,
        **{name: int(getattr(core, name)[0, team]) for name in ("captures", "grabs", "tags")},
        **{f"hits_{kind}": counts[breach_column(kind, separation_m)] for kind in KINDS},
        **{f"avoidable_{kind}": None if breaches is None else avoidable.count(kind) for kind in KINDS},
        **{name: counts[name] for name in ("collisions", "closest_m", "changed_share", "deadlocks")},
        "failures": failures.count,
        "usable_steps": failures.usable_steps,
        "first_failure": failures.texts[0] if failures.texts else None,
        "missed_deadlines": getattr(seat.policy, "missed_deadlines", 0),
        "think_p95_ms": float(1e3 * np.quantile(times_s, 0.95)) if times_s else None,
    }


def results_of(run: Run, settings: TournamentSettings) -> dict[str, Any]:
    """The content of results.json; `docs_keys.KEYS` describes it."""
    table = seats(run.rows)
    final, before = (table[table["phase"] == phase] if len(table) else table for phase in (FINAL, QUALIFYING))
    teams, penalty, seed, compared = settings.labels, settings.penalty, settings.seed, compared_states(settings)
    playing = [team for team in teams if len(final) and (final["team"] == team).any()]
    priced = [] if compared is None else prices(final, playing, *compared, seed)
    goals = _goals(final, priced)
    return {
        **run.head(),
        "complete": len(run.rows) == settings.expected,
        "failed": [{**names_of(job), "error": job["error"], "fault": job["fault"]} for job in run.failed],
        "games_played": len(run.rows),
        "games_resumed": run.resumed,
        "warnings": warnings_of(table),
        "silent": silent_teams(table),
        "qualifying": qualifying_table(before, settings.states, teams, penalty),
        "states": [state_results(final, state, teams, penalty, seed) for state in settings.states],
        "prices": priced,
        "goals": goals,
        "deprecated": {"bars": goals},
        "files": {"results": RESULTS_FILE, **({"games": table_name()} if run.rows else {})},
    }


def finalists(table: pd.DataFrame, settings: TournamentSettings) -> tuple[str, ...]:
    """The teams that go on, as given on the command line: the best of the qualifying (`seats`) in the first state."""
    if settings.finalists is None:
        return settings.teams
    ranked = qualifying_table(table, settings.states[:1], settings.labels, settings.penalty)
    best = {line["team"] for line in ranked[: settings.finalists]}
    return tuple(team for team in settings.teams if label(team) in best)


def compared_states(settings: TournamentSettings) -> tuple[str, str] | None:
    """The states that are set beside each other: off, and all or the first other; None without both."""
    others = [state for state in settings.states if state != OFF]
    if OFF not in settings.states or not others:
        return None
    return OFF, ALL if ALL in others else others[0]


def warnings_of(table: pd.DataFrame) -> list[str]:
    """A sentence per team whose code failed, forfeited moves or missed a deadline."""
    found = []
    for team, own in table.groupby("team", sort=False) if len(table) else ():
        failed = own[own["failures"] > 0]
        if len(failed):
            found.append(
                f"{team} failed {failed['failures'].sum():,} times, in {len(failed)} of {len(own)} games; its boats "
                f"held for those moves. First: {failed['first_failure'].iloc[0]}"
            )
        if missed := int(own["missed_deadlines"].sum()):
            found.append(f"{team} missed {missed:,} deadlines; its games may come out otherwise on another machine.")
    return found


def silent_teams(table: pd.DataFrame) -> list[str]:
    """Teams that gave nothing usable throughout some game."""
    if table.empty:
        return []
    return sorted(set(table[(table["steps"] > 0) & (table["usable_steps"] == 0)]["team"]))


def _goals(table: pd.DataFrame, priced: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """What is asked of the tournament; no goal where its games were not played."""
    if table.empty:
        return []
    goals = []
    never, shielded = table[table["team"].isin(NEVER_GRAB)], table[table["shielded"]].dropna(subset=["avoidable"])
    if len(never):
        goals.append(judged("grabs of Ohto and Alamer, all games", float(never["grabs"].sum()), "<=", 0.0))
    if len(shielded):
        found = float(shielded["avoidable"].sum())
        goals.append(judged("avoidable hits of shielded teams, all games", found, "<=", 0.0))
    kept = [line["kept"] for line in priced if line["kept"] is not None]
    if kept:
        name = "teams that keep 95 % of their net captures, of those shielded"
        goals.append(judged(name, float(sum(kept)), ">=", float(len(kept))))
    return goals
