"""A tournament: every pair of teams on both sides, without shields and with them; its games, results and report."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from io import BytesIO
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup
from steerclear import policies
from steerclear.shield.exceptions import ConfigError

from . import plots
from .game_metrics import DEFAULT_PENALTY, tally
from .metrics import RADII_M, judged, violation_column
from .play.match import Match, MatchResult, play_again
from .play.spec import ANSWER_S, SIDES, MatchSpec, near
from .rankings import KEPT, SCRIPTED, all_tables, prices, seats, shown, state_results
from .replay_html import write_replay
from .report import Plot, Report, Section, made_of
from .result_files import table_name
from .runner import RESULTS_FILE, Experiment, Run
from .warming import compile_game, compile_judge, compile_shield
from .words import count_text, seeds_text
from .workers import Job, Row, Workers

if TYPE_CHECKING:
    import pandas as pd

OFF, ALL = "off", "all"
NEVER_GRAB = ("ohto", "alamer")
KINDS = ("teammate", "opponent")
TITLE = "The competition, with the shield and without"
NOTE = (
    "Standings are per double round robin (every pair once on each side), prices per game; brackets are 95 % "
    "intervals, of standings by a bootstrap that draws repetitions anew within each pair and side. The paper's scores "
    "fit no single penalty, so its ranks are compared, not its scores."
)
Results = Mapping[str, Any]


@dataclass(frozen=True)
class TournamentSettings:
    """Settings of a tournament; they are the command line and what results.json keeps; as `MatchSpec`, and.

    Attributes:
        teams: policies, each a name or a submission's path.
        states: which teams are shielded: "off", "all", or names with commas; each state plays all games.
        repetitions: times each pair meets on each side.
        seed: repetition r is played from seed + r, in all pairs, on both sides and in all states.

    Raises:
        ConfigError: fewer than two teams, equal names, an unknown team in a state, or a number out of range.
    """

    teams: tuple[str, ...] = SCRIPTED
    preset: str = "aamas2024"
    states: tuple[str, ...] = (OFF, ALL)
    repetitions: int = 1
    seed: int = 0
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
    def compared(self) -> tuple[str, str] | None:
        """The states that are set beside each other: off, and all or the first other; None without both."""
        others = [state for state in self.states if state != OFF]
        return (OFF, ALL if ALL in others else others[0]) if OFF in self.states and others else None

    def experiment(self) -> Experiment:
        """Every repetition of every pair on both sides, the states of a game side by side."""
        jobs = [
            self._job(state, blue, red, repetition)
            for repetition in range(self.repetitions)
            for pair in combinations(self.teams, 2)
            for blue, red in (pair, pair[::-1])
            for state in self.states
        ]
        warm = (compile_game, compile_shield, compile_judge)
        return Experiment("tournament", asdict(self), jobs, play_game, "games", warm)

    def _job(self, state: str, blue: str, red: str, repetition: int) -> Job:
        """One game; the own team of its spec is blue."""
        shielded = shielded_in(state, self.labels)
        covers = [dict(self.shield) if label(team) in shielded else None for team in (blue, red)]
        names = ("preset", "fixed_start", "penalty", "judge", "trust", "answer_s")
        spec = MatchSpec(
            own=blue,
            opponent=red,
            game=repetition,
            seed=self.seed + repetition,
            shield=covers[0],
            opponent_shield=covers[1],
            rules=dict(self.rules),
            radii_m=tuple(sorted({*RADII_M, self.separation_m})),
            files=(policies.fingerprint(blue), policies.fingerprint(red)),
            **{name: getattr(self, name) for name in names},
        )
        return {"state": state, "separation_m": self.separation_m, **spec.as_job()}


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


def play_game(job: Job) -> list[Row]:
    """Play a game; its row, ``rows of tournament`` in `docs.KEYS`; SteerclearError where it is unusable."""
    match = Match(MatchSpec.of_job(job))
    try:
        result = match.play()
        played = {name: result.row[name] for name in ("preset", "steps", "duration_s", "wall_s")}
        about = {**names_of(job), "seed": job["seed"], **played}
        sides = (_counts(match, result, job["separation_m"], team) for team in (0, 1))
        both = zip(SIDES, sides, strict=True)
        return [about | {f"{side}_{name}": value for side, counts in both for name, value in counts.items()}]
    finally:
        match.close()


def names_of(job: Mapping[str, Any]) -> dict[str, Any]:
    """What a game is called."""
    teams = {"blue": label(job["own"]), "red": label(job["opponent"])}
    return {"state": job["state"], **teams, "repetition": job["game"]}


def _counts(match: Match, result: MatchResult, separation_m: float, team: int) -> dict[str, Any]:
    """What a side did, and what its code did."""
    spec, core, seat = match.spec, match.env.core, match.teams[team]
    shielded = spec.shields[team] is not None
    counts, failures = tally(result.record, team, spec.radii_m), seat.failures()
    violations = None
    if spec.judge == "all" or shielded:  # the own team's are in the row already
        violations = result.row["violations"] if team == spec.own_team else match.violations(result.record, team)
    avoidable = [violation["kind"] for violation in violations or () if violation["verdict"] == "avoidable"]
    times_s = getattr(seat.policy, "think_times_s", None)
    return {
        "shielded": shielded,
        **{name: int(getattr(core, name)[0, team]) for name in ("captures", "grabs", "tags")},
        **{f"hits_{kind}": counts[violation_column(kind, separation_m)] for kind in KINDS},
        **{f"avoidable_{kind}": None if violations is None else avoidable.count(kind) for kind in KINDS},
        **{name: counts[name] for name in ("collisions", "closest_m", "changed_share", "deadlocks")},
        "failures": failures.count,
        "usable_steps": failures.usable_steps,
        "first_failure": failures.texts[0] if failures.texts else None,
        "missed_deadlines": getattr(seat.policy, "missed_deadlines", 0),
        "think_p95_ms": float(1e3 * np.quantile(times_s, 0.95)) if times_s else None,
    }


def results_of(run: Run, settings: TournamentSettings) -> dict[str, Any]:
    """The content of results.json; `docs.KEYS` describes it."""
    table, compared, seed = seats(run.rows), settings.compared, settings.seed
    playing = [team for team in settings.labels if len(table) and (table["team"] == team).any()]
    priced = prices(table, playing, *compared, seed) if compared and playing else []
    goals = _goals(table, priced)
    return {
        **run.head(),
        "failed": [{**names_of(job), "error": job["error"], "fault": job["fault"]} for job in run.failed],
        "games_played": len(run.rows),
        "games_resumed": run.resumed,
        "warnings": warnings_of(table),
        "silent": sorted(set(table[(table["steps"] > 0) & (table["usable_steps"] == 0)]["team"])) if len(table) else [],
        "states": [state_results(table, state, settings.labels, settings.penalty, seed) for state in settings.states],
        "prices": priced,
        "goals": goals,
        "files": {"results": RESULTS_FILE, **({"games": table_name()} if run.rows else {})},
    }


def warnings_of(table: pd.DataFrame) -> list[str]:
    """A sentence per team whose code failed, forfeited moves or missed a deadline."""
    found = []
    for team, own in table.groupby("team", sort=False) if len(table) else ():
        failed = own[own["failures"] > 0]
        if len(failed):
            times, games = count_text(int(failed["failures"].sum()), "time"), count_text(len(own), "game")
            found.append(
                f"{team} failed {times}, in {len(failed)} of {games}; its boats held for those moves. First: "
                f"{failed['first_failure'].iloc[0]}"
            )
        if missed := int(own["missed_deadlines"].sum()):
            found.append(
                f"{team} missed {count_text(missed, 'deadline')}; its games may come out otherwise on another machine."
            )
    return found


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
        name = f"teams that keep {100 * KEPT:g} % of their net captures, of those shielded"
        goals.append(judged(name, float(sum(kept)), ">=", float(len(kept))))
    return goals


def subtitle(results: Results) -> str:
    """What was played, in a line."""
    settings = results["settings"]
    length, repetitions = (settings["rules"] or {}).get("max_time_s"), settings["repetitions"]
    there = (
        f"{shown(state['state'])} {count_text(state['games'], 'game')}, repetitions of every pair that met: "
        f"{state['repetitions']}"
        for state in results["states"]
    )
    return (
        f"{settings['preset']}, {count_text(results['games_played'], 'game')}"
        + (f" of {length:g} s" if length else "")
        + f", {count_text(repetitions, 'repetition')} of every pair on both sides in every state, "
        + f"{seeds_text(settings['seed'], settings['seed'] + repetitions - 1)}, penalty {settings['penalty']:g}, "
        + f"steerclear {results['versions']['steerclear']}"
        + ("" if results["complete"] else f"; not complete: {'; '.join(there)}")
    )


def draw(results: Results, target: Any) -> Any:
    """Draw net captures against collisions of every team, a panel a state, as PNG into a file."""
    panels = [
        (
            shown(state["state"]),
            [
                (one["team"], one["collisions"], one["net_captures"], one["net_captures_high"] or one["net_captures"])
                for one in state["standings"]
            ],
        )
        for state in results["states"]
        if state["standings"]
    ]
    return plots.png(plots.scatter(panels, ("collisions", "net captures, per double round robin")), target)


def _report(results: Results, **more: Any) -> Report:
    sections = [Section("", all_tables(results)), made_of(results)]
    about = {"warnings": results["warnings"], "goals": results["goals"], "notes": [NOTE], "sections": sections}
    return Report(TITLE, subtitle(results), **about, **more)


def write_html(results: Results, path: Path, replays: Sequence[Mapping[str, str]] = ()) -> Path:
    """Write the report of results.json, with ``label`` and ``path`` of each replay; ConfigError where it cannot be."""
    draw(results, buffer := BytesIO())
    source = f"data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}"
    image = Markup(f'<img alt="net captures against collisions" style="max-width:100%" src="{source}">')
    return _report(results, links=replays, plots=[Plot("What the shield changes for each team", image)]).write(path)


def write_markdown(results: Results, folder: Path) -> tuple[str, str, list[Path]]:
    """The documentation page: its name, its text, and the figure written beside it."""
    stem = f"tournament_{results['settings']['preset']}"
    return _report(results).page(f"{stem}.md", draw(results, folder / f"{stem}.png"))


def most_changed(run: Run, states: tuple[str, str] | None) -> tuple[str, list[Job]] | None:
    """The game that the shield changed most, in words, and its jobs off and on; of one state that with most hits."""
    games: dict[tuple[Any, ...], dict[str, Row]] = {}
    for row in run.rows:
        games.setdefault((row["blue"], row["red"], row["repetition"]), {})[row["state"]] = row
    first, second = states or (run.rows[0]["state"],) * 2 if run.rows else ("", "")
    pairs = {game: (rows[first], rows[second]) for game, rows in games.items() if {first, second} <= set(rows)}
    if not pairs:
        return None

    def worth(game: tuple[Any, ...]) -> float:
        (hits, captures), (hits_on, captures_on) = map(_score, pairs[game])
        return abs(hits - hits_on) + 2 * abs(captures - captures_on) if states else hits

    blue, red, repetition = chosen = max(pairs, key=worth)
    jobs = {(job["state"], *list(names_of(job).values())[1:]): job for job in run.experiment.jobs}
    words = f"{'most changed by the shield' if states else 'most hits'} ({blue} against {red}, repetition {repetition})"
    return words, [jobs[(state, *chosen)] for state in dict.fromkeys((first, second))]


def _score(row: Row) -> tuple[float, float]:
    """Hits and captures of both sides."""
    hits = row["blue_hits_teammate"] + row["red_hits_teammate"] + row["blue_hits_opponent"]
    return float(hits), float(row["blue_captures"] + row["red_captures"])


def write_most_changed(run: Run, settings: TournamentSettings, workers: Workers) -> list[dict[str, str]]:
    """Play `most_changed` again and write its replay; its label and file name, none where it cannot be played."""
    words, jobs = most_changed(run, settings.compared) or ("", [])
    specs = [MatchSpec.of_job(job) for job in jobs]
    played = play_again(specs, workers)
    games = [played[spec.key].record for spec in specs if spec.key in played]
    if not games:
        return []
    write_replay(games, run.folder / "replay.html", title=f"Tournament, {words}")
    return [{"label": words, "path": "replay.html"}]
