"""Decisions of real games, kept to be timed: what the shield was asked, step by step, and its programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from steerclear.shield import Commands, Decisions, Fleet, Shield, ShieldConfig, Surroundings
from steerclear.shield.filter.program import Program, Solver, solve
from steerclear.shield.jit import Array

from ..play.match import Match
from ..play.spec import MatchSpec

REFERENCE = "daqp"
"""The backend that programs are collected with and others are compared with."""

OPPONENTS = ("easy", "medium", "hidden", "rammer")


@dataclass(frozen=True)
class Question:
    """One call of `Shield.decide`."""

    fleet: Fleet
    wanted: Commands
    surroundings: Surroundings | None


class KeepingShield(Shield):
    """A shield that keeps what it is asked."""

    def __init__(self, config: ShieldConfig) -> None:
        super().__init__(config)
        self.questions: list[Question] = []

    def decide(self, fleet: Fleet, wanted: Commands, surroundings: Surroundings | None = None) -> Decisions:
        """Keep a copy of the question (the game changes its arrays in place), then answer it."""
        kept = replace(fleet, state=fleet.state.copy(), controlled=fleet.controlled.copy())
        self.questions.append(Question(kept, replace(wanted, values=wanted.values.copy()), surroundings))
        return super().decide(fleet, wanted, surroundings)


class ProgramKeepingShield(Shield):
    """A shield that keeps the programs it solves."""

    def __init__(self, config: ShieldConfig) -> None:
        super().__init__(config)
        self.programs: list[Program] = []

    def _solver(self) -> Solver:
        return self._keep

    def _keep(self, program: Program) -> Array | None:
        """Keep a copy, whose arrays stay as they are, and answer it."""
        self.programs.append(Program(program.C.copy(), program.d.copy(), program.z0.copy()))
        return solve(program, REFERENCE)


def questions_of_games(preset: str, game_s: float, seed: int, config: ShieldConfig) -> list[list[Question]]:
    """Play one shielded game of `medium` against each of `OPPONENTS` and keep every question, game by game."""
    return [_questions(preset, opponent, game_s, seed + k, config) for k, opponent in enumerate(OPPONENTS)]


def _questions(preset: str, opponent: str, game_s: float, seed: int, config: ShieldConfig) -> list[Question]:
    rules = {"max_time_s": game_s}
    match = Match(MatchSpec(preset, "medium", opponent, game=seed, seed=seed, shield={}, rules=rules))
    keeping = KeepingShield(replace(config, dt_s=match.env.config.dt_s))
    match.shielding.env.shield = keeping
    match.play()
    match.close()
    return keeping.questions


def answer_all(shield: Shield, games: Sequence[Sequence[Question]]) -> list[Decisions]:
    """Let a shield answer every question of every game, in order."""
    answers = []
    for game in games:
        shield.reset()
        answers += [shield.decide(q.fleet, q.wanted, q.surroundings) for q in game]
    return answers


def programs_of(games: Sequence[Sequence[Question]], config: ShieldConfig, most: int, seed: int) -> list[Program]:
    """Collect the programs the shield solves on these questions, at most ``most``, drawn at random."""
    shield = ProgramKeepingShield(config)
    answer_all(shield, games)
    chosen = np.random.default_rng(seed).permutation(len(shield.programs))[:most]
    return [shield.programs[k] for k in sorted(chosen)]


def scene(boats: int, seed: int, platform: str = "heron", area_per_boat_m2: float = 533.0) -> tuple[Fleet, Any]:
    """Draw a fleet, half of it ours, as dense as six boats in an 80 x 40 m field, all wanting to go somewhere.

    Returns:
        The fleet and its wanted commands.
    """
    rng = np.random.default_rng([boats, seed])
    side_m = float(np.sqrt(boats * area_per_boat_m2))
    places: list[Array] = []
    while len(places) < boats:
        place = rng.uniform(0.0, side_m, 2)
        if all(np.hypot(*(place - other)) > 4.0 for other in places):
            places.append(place)
    fleet = Fleet.of(
        position_m=np.array(places),
        heading_rad=rng.uniform(-np.pi, np.pi, boats),
        speed_mps=rng.uniform(0.0, 2.0, boats),
        team=np.arange(boats) % 2,
        platforms=platform,
    )
    wanted = np.column_stack([np.full(boats, 2.0), rng.uniform(-180.0, 180.0, boats)])
    return fleet, Commands.relative_deg(wanted)
