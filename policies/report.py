"""What went wrong in foreign code and how long it took, for the log and the reports."""

from __future__ import annotations

import logging
from dataclasses import asdict, dataclass, field
from typing import Any

from steerclear.shield.foreign import plain_text

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Failure:
    """One kind of failure: when it was seen first, how often in all, and how often by boat."""

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
        calls: answers asked for.
        held: answers that could not be used; the boat held for that step.
        failures: by kind, first seen first.
        mean_ms: mean time of a call, ms.
        max_ms: longest call, ms.
        slowest: agent id, game and step of the longest call.
        late: calls that took longer than a step of the game.
        step_ms: length of a step of the game, ms.
        decisions: steps in which a boat was answered for. Code may decide for all boats in one call, so that the time
            of a decision, all calls of a step, is what counts.
        mean_decision_ms: mean time of a decision, ms.
        max_decision_ms: longest, ms.
        late_decisions: those that took longer than a step of the game.
        steps: in which the policy was asked for actions, over all games.
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
        """Steps in which each boat had no usable answer; boats that always had one are left out."""
        counts: dict[str, int] = {}
        for failure in self.failures:
            for agent_id, count in failure.boats.items():
                counts[agent_id] = counts.get(agent_id, 0) + count
        return dict(sorted(counts.items()))

    def as_dict(self) -> dict[str, Any]:
        """The report as plain values, for JSON."""
        return asdict(self)

    def lines(self) -> list[str]:
        """The report in sentences; the first line stands for itself."""
        agent_id, game, step = self.slowest
        timing = f"mean {self.mean_ms:.3f} ms, longest {self.max_ms:.1f} ms"
        if self.calls:
            timing += f" ({agent_id}, game {game}, step {step}), {self.late} longer than a step of {self.step_ms:g} ms"
        lines = [f"{self.policy}: {self.calls} calls in {self.games} games, {self.held} held; {timing}"]
        for failure in self.failures:
            first = f"first {failure.agent_id}, game {failure.game}, step {failure.step}"
            lines.append(f"  {failure.kind} x {failure.count}, {first}: {failure.message}")
        return lines


class Reporter:
    """Collects a `PolicyReport`; each kind of failure is logged once.

    Args:
        policy: name of the policy.
    """

    def __init__(self, policy: str) -> None:
        self._policy = plain_text(policy, 80)
        self._first: dict[str, tuple[str, int, int, str]] = {}
        self._counts: dict[str, dict[str, int]] = {}
        self._games = self._calls = self._late = self._step = 0
        self._total_ns = self._max_ns = 0
        self._slowest = ("", 0, 0)
        self._step_ns = 0.0
        self._steps = self._decisions = self._late_decisions = 0
        self._decision_ns = self._longest_ns = 0

    def begin(self, dt_s: float) -> None:
        """A new game begins."""
        self._games += 1
        self._step = 0
        self._step_ns = dt_s * 1e9

    def next_step(self) -> None:
        """All boats have answered."""
        self._step += 1
        self._steps += 1
        if self._decision_ns:
            self._decisions += 1
            self._late_decisions += self._decision_ns > self._step_ns
            self._longest_ns = max(self._longest_ns, self._decision_ns)
            self._decision_ns = 0

    def timed(self, agent_id: str, spent_ns: int) -> None:
        """A call took ``spent_ns`` ns."""
        self._calls += 1
        self._total_ns += spent_ns
        self._decision_ns += spent_ns
        self._late += spent_ns > self._step_ns
        if spent_ns > self._max_ns:
            self._max_ns = spent_ns
            self._slowest = (agent_id, self._games - 1, self._step)

    def failed(self, agent_id: str, kind: str, message: str) -> None:
        """A call gave nothing usable."""
        kind, message = plain_text(kind, 80), plain_text(message, 900)
        counts = self._counts.setdefault(kind, {})
        counts[agent_id] = counts.get(agent_id, 0) + 1
        if kind not in self._first:
            self._first[kind] = (agent_id, self._games - 1, self._step, message)
            where = f"{agent_id}, game {self._games - 1}, step {self._step}"
            logger.warning("policy %s: %s (%s): %s; the boat holds for this step", self._policy, kind, where, message)

    def report(self) -> PolicyReport:
        """The report so far."""
        failures = tuple(
            Failure(kind, *first, sum(self._counts[kind].values()), dict(sorted(self._counts[kind].items())))
            for kind, first in self._first.items()
        )
        return PolicyReport(
            policy=self._policy,
            games=self._games,
            calls=self._calls,
            held=sum(failure.count for failure in failures),
            failures=failures,
            mean_ms=self._total_ns / max(1, self._calls) * 1e-6,
            max_ms=self._max_ns * 1e-6,
            slowest=self._slowest,
            late=self._late,
            step_ms=self._step_ns * 1e-6,
            decisions=self._decisions,
            mean_decision_ms=self._total_ns / max(1, self._decisions) * 1e-6,
            max_decision_ms=self._longest_ns * 1e-6,
            late_decisions=self._late_decisions,
            steps=self._steps,
        )
