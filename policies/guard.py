"""`GuardedTeam`: plays foreign code one boat at a time, so that whatever it does the game goes on."""

from __future__ import annotations

import contextlib
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.foreign import describe_error

from .actions import HOLD, ActionReader
from .games import seen_game
from .protocol import Action
from .report import PolicyReport, Reporter

Answer = Callable[[str], Any]
"""``answer(agent_id) -> action``."""
Fault = tuple[str, str]
"""What is wrong with an answer: kind, explanation."""


@dataclass(frozen=True)
class GameFacts:
    """What foreign code in another process may know of a game; stands for its env there.

    Attributes:
        n_obs: length of an observation.
        top_speed_mps: top speed of each boat by agent id, m/s.
    """

    n_obs: int
    top_speed_mps: Mapping[str, float]


def game_facts(env: Any) -> GameFacts:
    """The facts of a game that somebody reads; facts are answered as they are.

    Raises:
        PolicyError: nobody reads it.
    """
    if isinstance(env, GameFacts):
        return env
    game = seen_game(env)
    return GameFacts(game.n_obs, game.top_speed_mps)


class ForeignCode(ABC):
    """What a `GuardedTeam` drives; the base class of the adapters in this package."""

    @abstractmethod
    def begin(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """A game begins; what is raised here ends it, since no boat could play.

        Code that comes from a file may be given `GameFacts` for ``env``: it then runs in a process of its own.
        """

    @abstractmethod
    def prepare(self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]) -> Answer:
        """What answers for each boat in this step. Not guarded: must not run foreign code."""

    def failed_within(self, agent_id: str) -> Fault | None:
        """What went wrong inside although the boat was answered for, as (kind, explanation); None: nothing."""
        return None

    def around(self) -> contextlib.AbstractContextManager[Any]:
        """What must hold while foreign code runs, such as its working directory."""
        return contextlib.nullcontext()

    def close(self) -> None:  # noqa: B027 (most code holds nothing)
        """Give back what the code holds."""


class GuardedTeam:
    """A `TeamPolicy` round foreign code. A boat whose code raises or answers nonsense holds for that step.

    `report` says which agent, game and step, what, how often, and how long calls took. Each kind of failure is logged
    once. Code that never returns is not interrupted.

    Args:
        name: name for records and reports.
        code: the code's adapter.
    """

    def __init__(self, name: str, code: ForeignCode) -> None:
        self.name = name
        self.code = code
        self.held: dict[str, str] = {}
        """Boats without a usable answer of the policy's own in this step, and why."""
        self._ids: list[str] = []
        self._reporter = Reporter(name)

    def reset(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Begin a game.

        Raises:
            PolicyError: a game that nobody reads, unusable agent ids, or the code cannot begin.
        """
        game = seen_game(env)
        game.check_team(agent_ids)
        self._ids = list(agent_ids)
        self._reader = ActionReader(game)
        self._reporter.begin(game.decision_s)
        try:
            self.code.begin(env, self._ids, seed)
        except PolicyError:
            raise
        except (Exception, SystemExit) as error:
            raise PolicyError(f"policy {self.name!r} cannot begin a game: {describe_error(error)}") from error

    def act(self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]) -> dict[str, Action]:
        """The code's own actions, unchanged; ``HOLD`` where there is no usable one.

        Raises:
            PolicyError: `reset` was not called, or observations or infos lack what the code is entitled to.
        """
        if not self._ids:
            raise PolicyError(f"policy {self.name!r} has no game; call reset(env, agent_ids, seed) first")
        check_observed(observations, self._ids)
        answer = self.code.prepare(observations, infos)
        self.held = {}
        with self.code.around():
            answers = {agent_id: self._ask(answer, agent_id) for agent_id in self._ids}
        actions = {agent_id: self._checked(agent_id, *answers[agent_id]) for agent_id in self._ids}
        self._reporter.next_step()
        return actions

    def report(self) -> PolicyReport:
        """Failures and times over all games so far."""
        return self._reporter.report()

    def close(self) -> None:
        """Give back what the code holds, such as temporary files; may be called again."""
        self.code.close()

    def _ask(self, answer: Answer, agent_id: str) -> tuple[Any, Fault | None]:
        started_ns = time.perf_counter_ns()
        try:
            action = answer(agent_id)
        except (Exception, SystemExit) as error:  # an entry that calls exit() does not end the game; Ctrl-C does
            return HOLD, (f"raised {type(error).__name__}", describe_error(error))
        finally:
            self._reporter.timed(agent_id, time.perf_counter_ns() - started_ns)
        return action, self.code.failed_within(agent_id)

    def _checked(self, agent_id: str, action: Any, fault: Fault | None) -> Action:
        unusable = self._reader.problem(agent_id, action)
        found = unusable or fault
        if found is not None:
            self.held[agent_id] = f"{found[0]}: {found[1]}"
            self._reporter.failed(agent_id, *found)
        return action if unusable is None else HOLD


def check_observed(observations: Mapping[str, Any], agent_ids: Sequence[str]) -> None:
    """Check that every boat is observed.

    Raises:
        PolicyError: one is not; an env that was never reset, or whose game is over, observes nobody.
    """
    for agent_id in agent_ids:
        if agent_id not in observations:
            raise PolicyError(f"no observation of {agent_id}; reset the game first")
