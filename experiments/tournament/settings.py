"""What a tournament is to be: who plays, under which rules, which teams are shielded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Any

from steerclear import policies
from steerclear.shield.exceptions import ConfigError

from ..game_metrics import DEFAULT_PENALTY
from ..metrics import RADII_M
from ..play.spec import ANSWER_S, SIDES, MatchSpec, near
from ..runner import job_id
from .paper import SCRIPTED

OFF, ALL = "off", "all"
FINAL, QUALIFYING = "final", "qualifying"
EXAMINERS = ("easy", "medium", "hidden", "hidden", "hidden")
"""Opponents of the qualifying; of the hidden team all three compositions."""


@dataclass(frozen=True)
class GameJob:
    """One game of a tournament: the own team of ``spec`` is blue.

    Attributes:
        phase: qualifying or final.
        state: which teams are shielded, as given on the command line.
        spec: the game.
        separation_m: radius at which hits are counted.
        examined: side of the team whose qualifying game this is; empty in the final.
    """

    phase: str
    state: str
    spec: MatchSpec
    separation_m: float = RADII_M[0]
    examined: str = ""

    @property
    def key(self) -> str:
        """Name under which the result is kept; which state asked for the game does not matter."""
        return job_id({"phase": self.phase, "state": self.state, "examined": self.examined, "game": self.spec.key})


@dataclass(frozen=True)
class TournamentSettings:
    """Settings of a tournament; they are the command line and what results.json keeps.

    Attributes:
        teams: policies, each a name or a submission's path.
        preset: rules of the game.
        states: which teams are shielded: "off", "all", or names with commas; each state plays all games.
        repetitions: times each pair meets on each side.
        seed: repetition r is played from seed + r, in all pairs, on both sides and in all states.
        qualifying: play it.
        finalists: how many teams of the qualifying go on; None for all.
        penalty: weight of a collision in the score that ranks.
        judge: "shielded" for the breaches of shielded teams, "all" or "none".
        shield: settings of the shields.
        rules: settings of the game that replace the preset's.
        fixed_start: see `MatchSpec`; as the rest.

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
        names = [label(team) for team in self.teams]
        if len(names) < 2 or len(set(names)) != len(names):
            raise ConfigError(f"--teams are {', '.join(names) or 'none'}; give two or more of different names")
        if not 1 <= self.repetitions <= 10_000:
            raise ConfigError(f"--repetitions must be 1 to 10,000; got {self.repetitions:,}")
        if self.finalists is not None and not (self.qualifying and 2 <= self.finalists <= len(names)):
            raise ConfigError(f"--finalists goes with --qualifying and is 2 to {len(names)}; got {self.finalists}")
        for state in self.states:
            for name in shielded_in(state, names):
                if name not in names:
                    raise ConfigError(f"--shield names {name!r}, which does not play; {near(name, [OFF, ALL, *names])}")
        if not self.states or len(set(self.states)) != len(self.states):
            raise ConfigError("--shield is given twice with the same teams, or not at all; give each state once")

    @property
    def separation_m(self) -> float:
        """Radius the shields keep and hits are counted at, m."""
        return float(self.shield.get("separation_m", RADII_M[0]))

    def final(self, teams: Sequence[str]) -> list[GameJob]:
        """All games of the final: every repetition of every pair on both sides, the states of a game side by side."""
        return [
            self._job(FINAL, state, blue, red, repetition, repetition)
            for repetition in range(self.repetitions)
            for pair in combinations(teams, 2)
            for blue, red in (pair, pair[::-1])
            for state in self.states
        ]

    def qualifying_games(self) -> list[GameJob]:
        """Every team against the organisers' opponents, on both sides."""
        return [
            self._job(QUALIFYING, state, *(pair if side == 0 else pair[::-1]), self._round(number), number, SIDES[side])
            for team in self.teams
            for number, examiner in enumerate(EXAMINERS)
            for pair in [(team, examiner)]
            for side in (0, 1)
            for state in self.states
        ]

    def as_dict(self) -> dict[str, Any]:
        """JSON-ready."""
        return asdict(self)

    def _round(self, number: int) -> int:
        """Number by which the hidden team chooses its composition."""
        return max(number - EXAMINERS.index("hidden"), 0)

    def _job(self, phase: str, state: str, blue: str, red: str, game: int, turn: int, examined: str = "") -> GameJob:
        shielded = shielded_in(state, [label(team) for team in self.teams])
        covers = [dict(self.shield) if label(team) in shielded else None for team in (blue, red)]
        spec = MatchSpec(
            preset=self.preset,
            own=blue,
            opponent=red,
            game=game,
            seed=self.seed + turn,
            shield=covers[0],
            opponent_shield=covers[1],
            rules=dict(self.rules),
            fixed_start=self.fixed_start,
            penalty=self.penalty,
            radii_m=tuple(sorted({*RADII_M, self.separation_m})),
            judge=self.judge,
            files=(policies.fingerprint(blue), policies.fingerprint(red)),
            trust=self.trust,
            answer_s=self.answer_s,
        )
        return GameJob(phase, state, spec, self.separation_m, examined)


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
