"""`EntryTeam`: an entry in its own process as a team policy; `make_team`: any policy, isolated if it is an entry."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from steerclear import policies
from steerclear.policies.actions import HOLD, ActionReader
from steerclear.policies.games import seen_game
from steerclear.policies.guard import Fault, check_observed, game_facts
from steerclear.policies.protocol import Action, TeamPolicy
from steerclear.policies.registry import SB3_PREFIX, WEIGHTS_PREFIX, looks_like_path
from steerclear.policies.report import PolicyReport, Reporter
from steerclear.policies.sb3 import trained_here
from steerclear.policies.submissions.made_for import check_game, made_for
from steerclear.policies.submissions.stage import ENTRY_FILE
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.foreign import plain_text

from ..play.spec import ANSWER_S
from .answers import from_plain
from .process import EntryProcess, Lost
from .sandbox import Limits, unlimited

MOST_NS = 10**15
LIMITS = Limits()
logger = logging.getLogger(__name__)


class EntryTeam:
    """A `TeamPolicy` in a process of its own. It plays as `steerclear.policies.make` of the same path does in ours.

    When its process ends, hangs or exceeds a limit, its boats hold for the rest of the game, and `report` says why.

    Args:
        path: a submission, or ``sb3:PATH.zip``.
        answer_s: time it has for a step, s.
        limits: of its process.
        options: of the policy.

    Raises:
        PolicyError: it cannot be loaded; the message says why.
    """

    def __init__(self, path: str, answer_s: float = ANSWER_S, limits: Limits = LIMITS, **options: Any) -> None:
        _check_exists(path)
        self._path, self._answer_s = path, answer_s
        self._process = EntryProcess(path, limits)
        self._lost = ""
        self._made = made_for(path)
        self.held: dict[str, str] = {}
        """Boats without a usable answer of the policy's own in this step, and why."""
        self._ids: list[str] = []
        self.name = plain_text(self._first("load", _absolute(path), options).get("name"), 80)
        self._reporter = Reporter(self.name)

    def reset(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Begin a game.

        Raises:
            PolicyError: a game that nobody reads, unusable agent ids, a game that the shield in it is not for, or the
                code cannot begin.
        """
        game = seen_game(env)
        if self._made is not None:
            check_game(self._made, game, self._path)
        game.check_team(agent_ids)
        self._ids = list(agent_ids)
        self._reader = ActionReader(game)
        self._reporter.begin(game.decision_s)
        if not self._lost:
            self._first("begin", game_facts(env), self._ids, seed)

    def act(self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]) -> dict[str, Action]:
        """The entry's own actions, unchanged; ``HOLD`` where there is no usable one.

        Raises:
            PolicyError: `reset` was not called, or observations or infos lack what the code is entitled to.
        """
        if not self._ids:
            raise PolicyError(f"policy {self.name!r} has no game; call reset(env, agent_ids, seed) first")
        check_observed(observations, self._ids)
        self.held = {}
        seen = self._seen(observations, infos)
        answers = {} if self._lost else self._ask(*seen)
        actions = {agent_id: self._checked(agent_id, answers.get(agent_id)) for agent_id in self._ids}
        self._reporter.next_step()
        return actions

    def report(self) -> PolicyReport:
        """Failures and times over all games so far."""
        return self._reporter.report()

    def close(self) -> None:
        """End its process, with all it started; may be called again."""
        self._process.over()

    def _first(self, order: str, *arguments: Any) -> dict[str, Any]:
        """The answer to an order without which there is no game.

        Raises:
            PolicyError: the entry raised, or its process was lost.
        """
        try:
            content = self._process.ask(order, *arguments)
        except Lost as lost:
            raise PolicyError(f"policy {plain_text(self._path)} cannot {order}: {lost}") from None
        if "failed" in content:
            self._process.end()
            raise PolicyError(plain_text(content["failed"], 600))
        return content

    def _seen(self, observations: Mapping[str, Any], infos: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """What the entry is shown, as plain dicts: pickled by us, read by its process, never the other way round.

        Raises:
            PolicyError: infos lack what it is entitled to.
        """
        rows = {agent_id: np.asarray(row) for agent_id, row in observations.items()}
        if self._path.startswith(SB3_PREFIX):
            return rows, {}
        try:
            state = dict(next(iter(infos.values()))["global_state"])
            raw = {agent_id: dict(infos[agent_id]["unnorm_obs"]) for agent_id in rows}
        except (KeyError, StopIteration, TypeError) as error:
            raise PolicyError(f"infos lack {error} for a submission; pass those of MctfEnv.reset or step") from error
        return rows, {agent_id: {"unnorm_obs": one, "global_state": state} for agent_id, one in raw.items()}

    def _ask(self, observations: Mapping[str, Any], infos: Mapping[str, Any]) -> Mapping[str, Any]:
        try:
            content = self._process.ask("step", observations, infos, timeout_s=self._answer_s)
        except Lost as lost:
            self._lost = str(lost)
            return {}
        if "failed" in content:
            return {agent_id: {"raised": "Error", "text": content["failed"]} for agent_id in self._ids}
        answers = content.get("answers")
        return answers if isinstance(answers, dict) else {}

    def _checked(self, agent_id: str, answer: Any) -> Action:
        answer = answer if isinstance(answer, dict) else {}
        action, unusable = self._read(agent_id, answer)
        found = unusable or _within(answer)
        if found is not None:
            self.held[agent_id] = f"{found[0]}: {found[1]}"
            self._reporter.failed(agent_id, *found)
        return action if unusable is None else HOLD

    def _read(self, agent_id: str, answer: Mapping[str, Any]) -> tuple[Action, Fault | None]:
        """An action, and what is wrong with it as (kind, explanation)."""
        if self._lost:
            return None, ("process ended", f"{self._lost}; its boats hold for the rest of the game")
        spent_ns = answer.get("ns")
        if isinstance(spent_ns, int) and 0 <= spent_ns < MOST_NS:
            self._reporter.timed(agent_id, spent_ns)
        if "raised" in answer:
            return None, (f"raised {plain_text(answer['raised'], 60)}", plain_text(answer.get("text"), 500))
        action = from_plain(answer.get("action"))
        found = self._reader.problem(agent_id, action)
        return action, found and (found[0], plain_text(found[1], 500))


def _within(answer: Mapping[str, Any]) -> Fault | None:
    """What a shielded zip says of the entry in it."""
    told = answer.get("within")
    if not isinstance(told, list) or len(told) != 2:
        return None
    return plain_text(told[0], 80), plain_text(told[1], 500)


def _absolute(path: str) -> str:
    """The same entry wherever its process was started."""
    prefix = SB3_PREFIX if path.startswith(SB3_PREFIX) else ""
    return f"{prefix}{Path(path.removeprefix(SB3_PREFIX)).expanduser().absolute()}"


def _check_exists(path: str) -> None:
    """Look before a process is started, in the words of whoever would load it.

    Raises:
        PolicyError: there is nothing.
    """
    if path.startswith(SB3_PREFIX):
        policies.check(path)
    elif not Path(path).expanduser().exists():
        raise PolicyError(f"there is no submission at {path}; give a folder or a zip with {ENTRY_FILE}")


def is_entry(name: str) -> bool:
    """Whether a policy's name is that of foreign code: a path, or ``sb3:`` and one.

    Exported weights are numbers, and so is what is read of models of ``steerclear train``.
    """
    if name.startswith(WEIGHTS_PREFIX):
        return False
    if name.startswith(SB3_PREFIX) and trained_here(name.removeprefix(SB3_PREFIX)):
        return False
    return name not in policies.names() and (name.startswith(SB3_PREFIX) or looks_like_path(name))


def make_team(name: str, game: int | None = None, trust: bool = False, answer_s: float = ANSWER_S) -> TeamPolicy:
    """A team policy by name, in a process of its own if it is foreign code.

    Args:
        name: as `steerclear.policies.make` takes it.
        game: number of the game in its series.
        trust: also load models that lie among entries, see `steerclear.policies.load_sb3`.
        answer_s: time foreign code has for a step, s.

    Raises:
        PolicyError: there is no such policy, or it cannot be loaded.
    """
    if not is_entry(name):
        return policies.make(name, game=game)
    options: dict[str, Any] = {"allow_code": trust or None} if name.startswith(SB3_PREFIX) else {}
    lacking = unlimited()
    if lacking:
        _say_once(lacking)
        if "this one" in lacking:
            return policies.make(name, **options)
    return EntryTeam(name, answer_s, **options)


@cache
def _say_once(words: str) -> None:
    logger.warning("%s", words)
