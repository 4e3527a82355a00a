"""`GuardedTeam`: plays foreign code boat by boat. Whatever the code does, the game goes on, with a report on it."""

from __future__ import annotations

import contextlib
import logging
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.foreign import describe_error, plain_text

from .actions import HOLD, ActionReader, Fault, SeenGame, seen_game
from .protocol import Action

Answer = Callable[[str], Any]
"""``answer(agent_id) -> action``."""
logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Failure:
    """One kind of failure: its first occurrence, and its number in all and by boat."""

    kind: str
    agent_id: str
    game: int
    step: int
    message: str
    count: int
    boats: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class PolicyReport:
    """What a guarded policy did over all its games.

    Attributes:
        policy: its name.
        games: games begun.
        calls: calls of the code.
        held: unusable answers; the boat held for that step.
        failures: by kind, in the order of their first occurrence.
        mean_ms: mean time of a call, ms.
        max_ms: longest call, ms.
        slowest: agent id, game and step of the longest call.
        late: calls longer than a step of the game.
        step_ms: length of a step of the game, ms.
        decisions: steps in which the code was called. Code may decide for all boats in one call, so the time of a
            decision (all calls of a step) is what counts.
        mean_decision_ms: mean time of a decision, ms.
        max_decision_ms: longest decision, ms.
        late_decisions: decisions longer than a step of the game.
        steps: steps in which the policy had to act, over all games.
    """

    policy: str
    games: int
    calls: int
    held: int
    failures: tuple[Failure, ...]
    mean_ms: float
    max_ms: float
    slowest: tuple[str, int, int]
    late: int
    step_ms: float
    decisions: int = 0
    mean_decision_ms: float = 0.0
    max_decision_ms: float = 0.0
    late_decisions: int = 0
    steps: int = 0

    def failed_by_boat(self) -> dict[str, int]:
        """Return the steps in which each boat had no usable answer; boats without such steps are left out."""
        counts: dict[str, int] = {}
        for failure in self.failures:
            for agent_id, count in failure.boats.items():
                counts[agent_id] = counts.get(agent_id, 0) + count
        return dict(sorted(counts.items()))

    def as_dict(self) -> dict[str, Any]:
        """Return the report as plain values, for JSON."""
        return asdict(self)

    def lines(self) -> list[str]:
        """Return the report in sentences; the first line can be used alone."""
        agent_id, game, step = self.slowest
        timing = f"mean {self.mean_ms:.3f} ms, longest {self.max_ms:.1f} ms"
        if self.calls:
            timing += f" ({agent_id}, game {game}, step {step}), {self.late} longer than a step of {self.step_ms:g} ms"
        lines = [f"{self.policy}: {self.calls} calls in {self.games} games, {self.held} held; {timing}"]
        for failure in self.failures:
            first = f"first {failure.agent_id}, game {failure.game}, step {failure.step}"
            lines.append(f"  {failure.kind} x {failure.count}, {first}: {failure.message}")
        return lines


class _Times:
    """Statistics of times, ns: number, sum, longest, and how many exceed a limit."""

    def __init__(self) -> None:
        self.count = self.total = self.longest = self.late = 0

    def add(self, spent_ns: int, limit_ns: float) -> bool:
        """Add a time; return whether it is the longest."""
        self.count += 1
        self.total += spent_ns
        self.late += spent_ns > limit_ns
        longest, self.longest = self.longest, max(self.longest, spent_ns)
        return spent_ns > longest


class Reporter:
    """Collects a `PolicyReport` of a policy; logs each kind of failure once."""

    def __init__(self, policy: str) -> None:
        self._policy = plain_text(policy, 80)
        self._first: dict[str, tuple[str, int, int, str]] = {}
        self._counts: dict[str, dict[str, int]] = {}
        self._games = self._step = self._steps = self._decision_ns = 0
        self._calls, self._decisions = _Times(), _Times()
        self._slowest, self._step_ns = ("", 0, 0), 0.0

    def begin(self, dt_s: float) -> None:
        """Begin a new game."""
        self._games, self._step, self._step_ns = self._games + 1, 0, dt_s * 1e9

    def next_step(self) -> None:
        """Note that all boats have answered."""
        self._step += 1
        self._steps += 1
        if self._decision_ns:
            self._decisions.add(self._decision_ns, self._step_ns)
            self._decision_ns = 0

    def timed(self, agent_id: str, spent_ns: int) -> None:
        """Note a call of ``spent_ns`` ns."""
        self._decision_ns += spent_ns
        if self._calls.add(spent_ns, self._step_ns):
            self._slowest = (agent_id, self._games - 1, self._step)

    def failed(self, agent_id: str, kind: str, message: str) -> None:
        """Note a call without a usable answer."""
        kind, message = plain_text(kind, 80), plain_text(message, 900)
        counts = self._counts.setdefault(kind, {})
        counts[agent_id] = counts.get(agent_id, 0) + 1
        if kind not in self._first:
            self._first[kind] = (agent_id, self._games - 1, self._step, message)
            where = f"{agent_id}, game {self._games - 1}, step {self._step}"
            logger.warning("policy %s: %s (%s): %s; the boat holds for this step", self._policy, kind, where, message)

    def report(self) -> PolicyReport:
        """Return the report so far."""
        failures = tuple(
            Failure(kind, *first, sum(self._counts[kind].values()), dict(sorted(self._counts[kind].items())))
            for kind, first in self._first.items()
        )
        calls, decisions = self._calls, self._decisions
        return PolicyReport(
            policy=self._policy,
            games=self._games,
            calls=calls.count,
            held=sum(failure.count for failure in failures),
            failures=failures,
            mean_ms=calls.total / max(1, calls.count) * 1e-6,
            max_ms=calls.longest * 1e-6,
            slowest=self._slowest,
            late=calls.late,
            step_ms=self._step_ns * 1e-6,
            decisions=decisions.count,
            mean_decision_ms=calls.total / max(1, decisions.count) * 1e-6,
            max_decision_ms=decisions.longest * 1e-6,
            late_decisions=decisions.late,
            steps=self._steps,
        )


@dataclass(frozen=True)
class GameFacts:
    """What foreign code in another process may know of a game; it replaces the env there.

    Attributes:
        n_obs: length of an observation.
        top_speed_mps: top speed of each boat by agent id, m/s.
    """

    n_obs: int
    top_speed_mps: Mapping[str, float]


def game_facts(env: Any) -> GameFacts:
    """Return the facts of a game; facts pass through.

    Raises:
        PolicyError: no reader for this game.
    """
    if isinstance(env, GameFacts):
        return env
    game = seen_game(env)
    return GameFacts(game.n_obs, game.top_speed_mps)


class ForeignCode(ABC):
    """Interface of the code that a `GuardedTeam` runs; base class of the adapters in this package."""

    @abstractmethod
    def begin(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Begin a game. An exception ends the game, because no boat could play.

        Code from a file may receive `GameFacts` as ``env``: it then runs in a process of its own.
        """

    @abstractmethod
    def prepare(self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]) -> Answer:
        """Return the function that answers for each boat in this step. Not guarded: it must not run foreign code."""

    def failed_within(self, agent_id: str) -> Fault | None:
        """Return a fault inside the code although the boat has an answer; None if there is none."""
        return None

    def told(self, text: str) -> str:
        """Return a text about a failure with places as its user knows them; the default leaves it as it is."""
        return text

    def around(self) -> contextlib.AbstractContextManager[Any]:
        """Return a context for running foreign code, such as its working directory."""
        return contextlib.nullcontext()

    def close(self) -> None:  # noqa: B027 (most code holds nothing)
        """Release the resources of the code."""


class ForeignTeam(ABC):
    """A `TeamPolicy` around foreign code. A boat whose code raises or answers nonsense holds for that step.

    `report` tells agent, game and step, kind and number of failures, and the times of calls. Each kind of failure is
    logged once.

    Attributes:
        name: for records and reports.
        held: boats without a usable answer of their own in this step, and why.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.held: dict[str, str] = {}
        self._ids: list[str] = []
        self._reporter = Reporter(name)

    def reset(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Begin a game.

        Raises:
            PolicyError: no reader for the game, unusable agent ids, or the code cannot begin.
        """
        game = seen_game(env)
        game.check_team(agent_ids)
        self._ids = list(agent_ids)
        self._reader = ActionReader(game)
        self._reporter.begin(game.decision_s)
        self._begin(env, game, seed)

    def act(self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]) -> dict[str, Action]:
        """Return the code's own actions, unchanged; ``HOLD`` where there is no usable one.

        Raises:
            PolicyError: `reset` was not called, or observations or infos are incomplete.
        """
        if not self._ids:
            raise PolicyError(f"policy {self.name!r} has no game; call reset(env, agent_ids, seed) first")
        if missing := [agent_id for agent_id in self._ids if agent_id not in observations]:
            raise PolicyError(f"no observation of {missing[0]}; reset the game first")
        self.held = {}
        answers = self._answers(observations, infos)
        actions = {agent_id: self._checked(agent_id, *answers[agent_id]) for agent_id in self._ids}
        self._reporter.next_step()
        return actions

    def report(self) -> PolicyReport:
        """Return failures and times over all games so far."""
        return self._reporter.report()

    @abstractmethod
    def close(self) -> None:
        """Release the resources of the code; may be called again."""

    @abstractmethod
    def _begin(self, env: Any, game: SeenGame, seed: int) -> None:
        """Let the code begin a game."""

    @abstractmethod
    def _answers(
        self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]
    ) -> dict[str, tuple[Any, Fault | None]]:
        """Return each boat's action, and a fault if there is one in spite of the action; calls are timed."""

    def _checked(self, agent_id: str, action: Any, fault: Fault | None) -> Action:
        unusable = self._reader.problem(agent_id, action)
        if (found := unusable or fault) is not None:
            kind, text = found[0], plain_text(found[1], 500)
            self.held[agent_id] = f"{kind}: {text}"
            self._reporter.failed(agent_id, kind, text)
        return action if unusable is None else HOLD


class GuardedTeam(ForeignTeam):
    """Foreign code in this process. Code that never returns is not interrupted.

    Args:
        name: name for records and reports.
        code: the code's adapter.
    """

    def __init__(self, name: str, code: ForeignCode) -> None:
        super().__init__(name)
        self.code = code

    def close(self) -> None:
        """Release the resources of the code, such as temporary files; may be called again."""
        self.code.close()

    def _begin(self, env: Any, game: SeenGame, seed: int) -> None:
        try:
            self.code.begin(env, self._ids, seed)
        except PolicyError:
            raise
        except (Exception, SystemExit) as error:
            raise PolicyError(
                f"policy {self.name!r} cannot begin a game: {self.code.told(describe_error(error))}"
            ) from error

    def _answers(
        self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]
    ) -> dict[str, tuple[Any, Fault | None]]:
        answer = self.code.prepare(observations, infos)
        with self.code.around():
            return {agent_id: self._ask(answer, agent_id) for agent_id in self._ids}

    def _ask(self, answer: Answer, agent_id: str) -> tuple[Any, Fault | None]:
        started_ns = time.perf_counter_ns()
        try:
            action = answer(agent_id)
        except (Exception, SystemExit) as error:  # an entry that calls exit() does not end the game; Ctrl-C does
            return HOLD, (f"raised {type(error).__name__}", self.code.told(describe_error(error)))
        finally:
            self._reporter.timed(agent_id, time.perf_counter_ns() - started_ns)
        return action, self.code.failed_within(agent_id)
