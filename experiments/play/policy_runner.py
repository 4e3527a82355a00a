"""A policy's seat in a game: whatever the policy does, the game goes on and the result says what went wrong."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from steerclear.env.mctf import MctfEnv
from steerclear.policies.actions import HOLD, ActionReader
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.wrappers.actions import team_answer

KEPT = 5
"""Failures whose text is kept; all are counted."""
logger = logging.getLogger(__name__)


@dataclass
class Failures:
    """What went wrong with one team's policy in one game: how often, and the first few texts.

    ``usable_steps`` counts the steps in which some boat of the team had a usable answer.
    """

    count: int = 0
    texts: list[str] = field(default_factory=list)
    usable_steps: int = 0

    def add(self, text: str, times: int = 1) -> None:
        """Note a failure."""
        self.count += times
        if len(self.texts) < KEPT:
            self.texts.append(text)


class PolicyRunner:
    """Asks a `TeamPolicy` in the bare env, and answers in its stead when it fails: then its boats stop for that step.

    Policies of foreign code report what went wrong with single boats themselves; the seat adds what they report.
    """

    def __init__(self, policy: Any, env: MctfEnv, agent_ids: Sequence[str]) -> None:
        self.policy = policy
        self.agent_ids = list(agent_ids)
        self._env = env
        self._reader = ActionReader(env)
        self._own = Failures()
        self._answered: set[str] = set()
        self._step = 0

    def reset(self, env: Any, seed: int) -> None:
        """Begin a game in the env the policy sees; SteerclearError where it cannot play this game at all."""
        self.policy.reset(env, self.agent_ids, seed)

    def act(self, observations: Mapping[str, Any], infos: Mapping[str, Any]) -> dict[str, Any]:
        """Return the actions of the seat's boats."""
        self._step += 1
        try:
            actions, faults = team_answer(self.policy.act(observations, infos), self.agent_ids)
        except Exception as error:  # a user's policy may raise anything
            self._answered = set()
            self._note(str(error) if isinstance(error, PolicyError) else f"{type(error).__name__}: {error}")
            return dict.fromkeys(self.agent_ids, HOLD)
        for fault in faults.values():
            self._note(fault)
        held = getattr(self.policy, "held", None)  # boats whose guarded code gave nothing usable
        self._answered = set(actions) - set(held if isinstance(held, Mapping) else ())
        self._own.usable_steps += bool(self._answered)
        return {agent_id: actions.get(agent_id, HOLD) for agent_id in self.agent_ids}

    def mended(self, actions: Mapping[str, Any]) -> dict[str, Any]:
        """Return the seat's part of ``actions`` with a stop in place of each action that the game refuses."""
        mended: dict[str, Any] = {}
        refused: set[str] = set()
        for agent_id in self.agent_ids:
            problem = self._reader.problem(agent_id, actions[agent_id])
            if problem is not None:
                self._note(f"{agent_id}: {problem[0]}: {problem[1]}")
                refused.add(agent_id)
            mended[agent_id] = actions[agent_id] if problem is None else HOLD
        if self._answered and self._answered <= refused:
            self._own.usable_steps -= 1
        return mended

    def failures(self) -> Failures:
        """Return what went wrong so far."""
        found = Failures(self._own.count, list(self._own.texts), self._own.usable_steps)
        if hasattr(self.policy, "report"):
            for failure in self.policy.report().failures:
                where = f"step {failure.step + 1}: {failure.agent_id}"
                found.add(f"{where}: {failure.kind}: {failure.message}", failure.count)
        return found

    def close(self) -> None:
        """Let the policy give back what it holds."""
        if hasattr(self.policy, "close"):
            self.policy.close()

    def _note(self, text: str) -> None:
        if not self._own.count:
            logger.warning("policy failed at step %d: %s; boats without an action stop", self._step, text)
        self._own.add(f"step {self._step}: {text}")
