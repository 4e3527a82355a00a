"""What went wrong in foreign code and how long it took, for the log and the reports."""

from __future__ import annotations

import logging
from dataclasses import asdict, dataclass
from typing import Any

from .words import plain_text

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Failure:
    """One kind of failure: when it was seen first, and how often in all."""

    kind: str
    agent_id: str
    game: int
    step: int
    message: str
    count: int


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
        self._counts: dict[str, int] = {}
        self._games = self._calls = self._late = self._step = 0
        self._total_ns = self._max_ns = 0
        self._slowest = ("", 0, 0)
        self._step_ns = 0.0

    def begin(self, dt_s: float) -> None:
        """A new game begins."""
        self._games += 1
        self._step = 0
        self._step_ns = dt_s * 1e9

    def next_step(self) -> None:
        """All boats have answered."""
        self._step += 1

    def timed(self, agent_id: str, spent_ns: int) -> None:
        """A call took ``spent_ns`` ns."""
        self._calls += 1
        self._total_ns += spent_ns
        self._late += spent_ns > self._step_ns
        if spent_ns > self._max_ns:
            self._max_ns = spent_ns
            self._slowest = (agent_id, self._games - 1, self._step)

    def failed(self, agent_id: str, kind: str, message: str) -> None:
        """A call gave nothing usable."""
        kind, message = plain_text(kind, 80), plain_text(message, 900)
        self._counts[kind] = self._counts.get(kind, 0) + 1
        if kind not in self._first:
            self._first[kind] = (agent_id, self._games - 1, self._step, message)
            where = f"{agent_id}, game {self._games - 1}, step {self._step}"
            logger.warning("policy %s: %s (%s): %s; the boat holds for this step", self._policy, kind, where, message)

    def report(self) -> PolicyReport:
        """The report so far."""
        failures = tuple(Failure(kind, *self._first[kind], self._counts[kind]) for kind in self._first)
        return PolicyReport(
            policy=self._policy,
            games=self._games,
            calls=self._calls,
            held=sum(self._counts.values()),
            failures=failures,
            mean_ms=self._total_ns / max(1, self._calls) * 1e-6,
            max_ms=self._max_ns * 1e-6,
            slowest=self._slowest,
            late=self._late,
            step_ms=self._step_ns * 1e-6,
        )
