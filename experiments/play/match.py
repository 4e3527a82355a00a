"""Playing one game and counting what happened in it."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.env.record import GameRecorder, Record, absolute_commands, find_violations, meta_of
from steerclear.policies.entrants.play import EntrantTeam
from steerclear.policies.registry import KEYBOARD
from steerclear.policies.scripted.team import ScriptedTeam
from steerclear.shield.exceptions import GameError, SteerclearError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L
from steerclear.shield.renamed import Renamed

from ..entries.team import make_team
from ..game_metrics import reason_counts, scores, tally
from ..verdicts import StateLog, judge_game, verdict_columns
from ..workers import Workers, outcomes
from .policy_runner import PolicyRunner
from .shielding import Seen, Shielding, shield_game
from .spec import SIDES, MatchSpec, opening

Watcher = Callable[[MctfEnv], bool]
"""Called after every step with the env; False ends the game early (a closed window)."""


@dataclass(frozen=True)
class MatchResult:
    """One game.

    Attributes:
        spec: what was to be played.
        row: flat columns, as ``rows of ablate`` in `docs.KEYS` describes them.
        record: everything that happened, see `steerclear.env.record`.
    """

    spec: MatchSpec
    row: dict[str, Any]
    record: Record


class PlayingEnv(MctfEnv):
    """An `MctfEnv` that can leave its infos out (``tells``): they take a fifth of a step's time."""

    tells = True

    def infos(self) -> dict[str, dict[str, Any]]:
        """Infos by agent id; empty where nobody reads them."""
        return super().infos() if self.tells else {}


def read_infos(teams: Iterable[Any]) -> bool:
    """Whether one of these policies may read infos: all but our own scripted teams and entrants, which see the game."""
    ours = (EntrantTeam, ScriptedTeam)
    return not all(any(isinstance(p, team) and type(p).act is team.act for team in ours) for p in teams)


def live_view(core: BatchedMctf) -> Any:
    """What a recorder reads, as the game's own arrays: always of this moment, never copied; valid until a reset."""
    names = ("state", "has_flag", "is_tagged", "oob", "is_disabled", "flag_position", "captures")
    return SimpleNamespace(**{name: getattr(core.games, name)[0] for name in names})


class Match:
    """A game being played.

    Args:
        spec: what to play.
        render_mode: of the env; None draws nothing.
        speedup: times faster than the game that a window goes at most.

    Raises:
        SteerclearError: a setting or policy of the spec is unusable.
    """

    def __init__(self, spec: MatchSpec, render_mode: str | None = None, speedup: float = 1.0) -> None:
        self.spec = spec
        self.speedup = speedup
        self.env = PlayingEnv(spec.config(), render_mode=render_mode)
        self.shielding: Shielding = shield_game(self.env, spec)
        names = [spec.own, spec.opponent] if spec.side == "blue" else [spec.opponent, spec.own]
        self.names = dict(zip(SIDES, names, strict=True))
        with contextlib.ExitStack() as stack:  # a policy that cannot be built leaves none open
            policies = []
            for name in names:
                policies.append(make_team(name, spec.game, spec.trust, spec.answer_s))
                if hasattr(policies[-1], "close"):
                    stack.callback(policies[-1].close)
            stack.pop_all()
        self.teams = [PolicyRunner(policy, self.env, self._boats_of(team)) for team, policy in enumerate(policies)]
        self._recorder = GameRecorder()
        self._view: Any = None
        self._log = StateLog() if spec.judged else None
        self._driven: list[NDArray[np.bool_]] = []
        self._decision_us: list[float] = []
        self._moment: tuple[Array, Array, Seen] | None = None

    def _boats_of(self, team: int) -> list[str]:
        size = self.env.config.team_size
        return self.env.possible_agents[team * size : (team + 1) * size]

    def play(self, watcher: Watcher | None = None) -> MatchResult:
        """Play to the end; the watcher is called after every step."""
        started = time.perf_counter()
        observations, infos = self._start()
        while self.env.agents:
            actions = self.teams[0].act(observations, infos) | self.teams[1].act(observations, infos)
            try:
                observations, _, _, _, infos = self.shielding.step(actions)
            except GameError:  # an answer the game refuses; nothing has moved yet
                self._moment = None
                mended = self.teams[0].mended(actions) | self.teams[1].mended(actions)
                observations, _, _, _, infos = self.shielding.step(mended)
            self._record_step()
            if watcher is not None and not watcher(self.env):
                break
        record = self._recorder.finish()
        record["violations"] = find_violations(record["position"], self.shielding.separation_m)
        return MatchResult(self.spec, self._row(record, time.perf_counter() - started), record)

    def seat(self, team: int, policy: Any) -> None:
        """Let a policy object play a team, 0 blue or 1 red, in place of the named one; before the game begins."""
        self.teams[team].close()
        self.teams[team] = PolicyRunner(policy, self.env, self._boats_of(team))

    def close(self) -> None:
        """Close the window and let the policies give back what they hold."""
        for team in self.teams:
            team.close()
        self.env.close()

    def violations(self, record: Record, team: int) -> list[dict[str, Any]] | None:
        """Judge the hits of a team, 0 blue or 1 red, of the game just played; None where none are judged."""
        if self._log is None:
            return None
        return judge_game(self._log, self.env.core.params, record, team, self.shielding.motion)

    def _start(self) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
        spec = self.spec
        self.env.tells = read_infos(seat.policy for seat in self.teams)
        options = None if spec.fixed_start else {"init_dict": opening(self.env.config, spec.seed)}
        answer = self.shielding.env.reset(seed=spec.seed, options=options)
        self.shielding.listen(self._note_commands)
        for number, team in enumerate(self.teams):
            team.reset(self.shielding.env, 2 * spec.seed + number)
        conditions = spec.conditions.words
        meta = meta_of(
            self.env.config,
            separation_m=self.shielding.separation_m,
            policies=self.names,
            shielded=self.shielding.agent_ids,
            seed=spec.seed,
            reason_names=self.shielding.reason_names,
            title=f"{self.names['blue']} – {self.names['red']}, {conditions}" if conditions else "",
        )
        self._view = live_view(self.env.core)
        self._recorder.start(self._view, meta)
        if self._log is not None:
            self._log.start(self.env.core)
        if self.env.renderer is not None:
            from steerclear.env.render import Arena  # draws with pygame: only where there is a window

            self.env.renderer.describe(replace(Arena.from_meta(meta), steered=self._steered()))
            self.env.renderer.speedup = self.speedup
        return answer

    def _steered(self) -> frozenset[str]:
        """Boats that a human steers: the first of a team whose policy is the keyboard."""
        return frozenset(self._boats_of(k)[0] for k, name in enumerate(self.names.values()) if name == KEYBOARD)

    def _note_commands(self, nominal: Array, filtered: Array) -> None:
        if self._moment is not None:  # an earlier step of motion of the same decision is over
            self._record_step()
        heading_deg = self.env.core.state[0, :, L.HEADING]
        commands = absolute_commands(nominal[0], heading_deg), absolute_commands(filtered[0], heading_deg)
        seen = self.shielding.read()
        self._moment = (*commands, seen)
        if self.env.renderer is not None:
            from steerclear.env.render import Overlay  # draws with pygame: only where there is a window

            self.env.renderer.overlay = Overlay(*commands, seen.reason, seen.intervened, seen.safety_margin_m)

    def _record_step(self) -> None:
        if self._moment is None:
            raise SteerclearError("the game moved without asking for commands; build the Match anew")
        nominal, filtered, seen = self._moment
        self._recorder.step(self._view, nominal, filtered, seen.reason, seen.intervened, seen.safety_margin_m)
        self._driven.append(self.env.core.driven[0].copy())
        if self._log is not None:
            self._log.step(self.env.core)
        if seen.solve_time_s is not None:
            self._decision_us.append(1e6 * seen.solve_time_s)
        self._moment = None

    def _row(self, record: Record, wall_s: float) -> dict[str, Any]:
        spec, core, steps, own = self.spec, self.env.core, len(record["nominal"]), self.spec.own_team
        counts: dict[str, Any] = {
            name + suffix: int(getattr(core, name)[0, team])
            for name in ("captures", "grabs", "tags")
            for suffix, team in (("", own), ("_against", 1 - own))
        }
        counts |= tally(record, own, spec.radii_m, np.array(self._driven))
        timed = self._decision_us[1:]  # the first one loads compiled code
        quantiles = np.quantile(timed, [0.5, 0.99, 1.0]).tolist() if timed else [None] * 3
        failed = [self.teams[team].failures() for team in (own, 1 - own)]
        texts = [f"{who}: {text}" for who, one in zip(("own", "opponent"), failed, strict=True) for text in one.texts]
        violations = self.violations(record, own)
        row = {
            "pairing": spec.pairing,
            "game": spec.game,
            "shielded": spec.shield is not None,
            "covered": spec.covered,
            **{name: getattr(spec, name) for name in ("preset", "own", "opponent", "side", "seed", "penalty")},
            **dict(zip(("own_files", "opponent_files"), spec.files, strict=True)),
            "steps": steps,
            "duration_s": steps * self.env.config.dt_s,
            **counts,
            **scores(counts, spec.penalty),
            **dict(zip(("decision_p50_us", "decision_p99_us", "decision_max_us"), quantiles, strict=True)),
            **{f"reason_{name}": count for name, count in reason_counts(record, own).items()},
            "policy_failures": failed[0].count,
            "opponent_policy_failures": failed[1].count,
            "policy_usable_steps": failed[0].usable_steps,
            "opponent_policy_usable_steps": failed[1].usable_steps,
            "first_failure": texts[0] if texts else None,
            **verdict_columns(violations, self.shielding.separation_m),
            "violations": violations,
            "wall_s": wall_s,
        }
        return Renamed(row)


def play_match(
    spec: MatchSpec, watcher: Watcher | None = None, render_mode: str | None = None, speedup: float = 1.0
) -> MatchResult:
    """Play one game.

    Args:
        spec: what to play.
        watcher: called after every step with the env; False ends the game.
        render_mode: "human" shows a window.
        speedup: times faster than the game that a window goes at most.

    Raises:
        SteerclearError: a setting or policy of the spec is unusable. A policy that fails later does not end the game.
    """
    match = Match(spec, render_mode, speedup)
    try:
        return match.play(watcher)
    finally:
        match.close()


def play_again(specs: Iterable[MatchSpec], workers: Workers) -> dict[str, MatchResult]:
    """Play games again for their records, by key of the spec; those that cannot be played are missing."""
    played = outcomes(play_match, list(specs), workers)
    return {outcome.job.key: outcome.answer for outcome in played if outcome.answer is not None}


def play_job(job: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Play a game (`MatchSpec.as_job`); its row alone, small enough to travel between processes by the thousand."""
    return [play_match(MatchSpec.of_job(job)).row]
