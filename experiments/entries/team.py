"""`EntryTeam`: an entry in its own process as a team policy; `make_team`: any policy, isolated if it is an entry.

Processes are used again for the next game: what ran there is gone by then, and the supervisor forks anew.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib.util
import json
import logging
import pickle
import time
from collections.abc import Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from steerclear import policies
from steerclear.policies.actions import HOLD, Fault, SeenGame
from steerclear.policies.foreign import ForeignTeam, game_facts
from steerclear.policies.protocol import TeamPolicy
from steerclear.policies.registry import SB3_PREFIX, WEIGHTS_PREFIX, looks_like_path
from steerclear.policies.sb3 import trained_here
from steerclear.policies.submissions.made_for import check_game, made_for
from steerclear.policies.submissions.stage import no_submission
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.foreign import plain_text

from ..deploy.worker import Broken, Worker
from ..play.spec import ANSWER_S
from .child import from_plain
from .imports import imports_of
from .sandbox import Limits, unlimited

MOST_NS = 10**15
LIMITS = Limits()
logger = logging.getLogger(__name__)
PART = "steerclear.experiments.entries.child"
LOAD_S = 120.0
"""Time an entry has to load and to begin a game, s."""
OVER_S = 3.0
"""Time for a game's process to be gone, s."""
MOST_IDLE = 2
"""Processes kept for later games."""
HEAVY = ("torch", "stable_baselines3")
"""Modules that take long to import: done once for all games of an entry that imports them."""
_IDLE: list[Worker] = []


class Lost(Exception):
    """The entry's process is of no use any more; the text says what it did."""


class EntryProcess:
    """One entry in a process of its own, for one game.

    Args:
        policy: path, as `steerclear.policies.make` takes it.
        limits: of the process.
    """

    def __init__(self, policy: str, limits: Limits) -> None:
        self._worker: Worker | None = _worker(limits, heavy_modules(policy))

    def ask(self, *order: Any, timeout_s: float = LOAD_S) -> dict[str, Any]:
        """Give an order and wait for the answer."""
        worker = self._worker
        if worker is None:
            raise Lost("its process is no longer running")
        try:
            worker.send(pickle.dumps(order, pickle.HIGHEST_PROTOCOL))
            return _content(self._answer(worker, timeout_s))
        except Broken as error:
            said = worker.epitaph(str(error))
            self.end()
            raise Lost(said) from None

    def over(self) -> None:
        """The game is over: end what ran there, and keep the process for the next game if all went well."""
        worker, self._worker = self._worker, None
        if worker is None:
            return
        with contextlib.suppress(Broken):
            worker.send(pickle.dumps(("over",)))
            if worker.is_fresh(OVER_S) and len(_IDLE) < MOST_IDLE:
                _IDLE.append(worker)
                return
        worker.end()

    def end(self) -> None:
        """End the process at once, with all it started."""
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.end()

    def _answer(self, worker: Worker, timeout_s: float) -> bytes:
        end_s = time.monotonic() + timeout_s
        while True:
            left_s = end_s - time.monotonic()
            worker.await_turn(min(max(left_s, 0.0), 0.5))
            worker.flush()
            messages = worker.messages()
            if len(messages) > 1:
                raise Broken("it answers what it was not asked")
            if messages:
                return messages[0]
            if worker.prints_too_much:
                raise Broken(f"it printed more than {worker.limits.output_bytes} bytes; its process was ended")
            if left_s <= 0.0:
                raise Broken(f"it did not answer within {timeout_s:g} s; its process was ended")


@lru_cache(maxsize=64)
def heavy_modules(policy: str) -> tuple[str, ...]:
    """Those of `HEAVY` that an entry imports by name, and that are installed."""
    if policy.startswith(SB3_PREFIX):
        wanted = set(HEAVY)
    else:
        try:
            wanted = set(imports_of(policy).needed)
        except PolicyError:
            wanted = set()  # whoever loads it will say so
    return tuple(name for name in HEAVY if name in wanted and importlib.util.find_spec(name) is not None)


def _worker(limits: Limits, preload: tuple[str, ...]) -> Worker:
    for worker in list(_IDLE):
        if worker.is_gone:
            _IDLE.remove(worker)
            worker.end()
        elif (worker.limits, worker.preload) == (limits, preload):
            _IDLE.remove(worker)
            return worker
    while len(_IDLE) >= MOST_IDLE:
        _IDLE.pop(0).end()
    return Worker(b"", PART, limits, preload)


@atexit.register
def _end_idle() -> None:
    while _IDLE:
        _IDLE.pop().end()


def _content(message: bytes) -> dict[str, Any]:
    try:
        content: Any = json.loads(message)
    except (ValueError, RecursionError):
        raise Broken("its answer is not JSON") from None
    if not isinstance(content, Mapping):
        raise Broken("its answer is no object")
    return dict(content)


class EntryTeam(ForeignTeam):
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
        prefix = SB3_PREFIX if path.startswith(SB3_PREFIX) else ""
        file = Path(path.removeprefix(SB3_PREFIX)).expanduser()
        if prefix:  # looked at before a process is started, in the words of whoever would load it
            policies.check(path)
        elif not file.exists():
            raise PolicyError(no_submission(path))
        self._path, self._answer_s, self._lost = path, answer_s, ""
        self._process, self._made = EntryProcess(path, limits), made_for(path)
        super().__init__(plain_text(self._first("load", f"{prefix}{file.absolute()}", options).get("name"), 80))

    def close(self) -> None:
        """End its process, with all it started; may be called again."""
        self._process.over()

    def _begin(self, env: Any, game: SeenGame, seed: int) -> None:
        if self._made is not None:
            check_game(self._made, game, self._path)
        if not self._lost:
            self._first("begin", game_facts(env), self._ids, seed)

    def _first(self, order: str, *arguments: Any) -> dict[str, Any]:
        """The answer to an order without which there is no game."""
        try:
            content = self._process.ask(order, *arguments)
        except Lost as lost:
            raise PolicyError(f"policy {plain_text(self._path)} cannot {order}: {lost}") from None
        if "failed" in content:
            self._process.end()
            raise PolicyError(plain_text(content["failed"], 600))
        return content

    def _answers(
        self, observations: Mapping[str, Any], infos: Mapping[str, Any]
    ) -> dict[str, tuple[Any, Fault | None]]:
        seen = self._seen(observations, infos)
        content: dict[str, Any] = {}
        if not self._lost:
            try:
                content = self._process.ask("step", *seen, timeout_s=self._answer_s)
            except Lost as lost:
                self._lost = str(lost)
        if self._lost:
            ended = HOLD, ("process ended", f"{self._lost}; its boats hold for the rest of the game")
            return dict.fromkeys(self._ids, ended)
        if "failed" in content:
            return dict.fromkeys(self._ids, (HOLD, ("raised Error", plain_text(content["failed"], 500))))
        answers = content.get("answers")
        found = answers if isinstance(answers, dict) else {}
        return {agent_id: self._read(agent_id, found.get(agent_id)) for agent_id in self._ids}

    def _seen(self, observations: Mapping[str, Any], infos: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """What the entry is shown, as plain dicts: pickled by us, read by its process, never the other way round."""
        rows = {agent_id: np.asarray(row) for agent_id, row in observations.items()}
        if self._path.startswith(SB3_PREFIX):
            return rows, {}
        try:
            state = dict(next(iter(infos.values()))["global_state"])
            raw = {agent_id: dict(infos[agent_id]["unnorm_obs"]) for agent_id in rows}
        except (KeyError, StopIteration, TypeError) as error:
            raise PolicyError(f"infos lack {error} for a submission; pass those of MctfEnv.reset or step") from error
        return rows, {agent_id: {"unnorm_obs": one, "global_state": state} for agent_id, one in raw.items()}

    def _read(self, agent_id: str, answer: Any) -> tuple[Any, Fault | None]:
        """A boat's answer as `child` packs it; whatever else it is, one that cannot be used."""
        answer = answer if isinstance(answer, dict) else {}
        spent_ns = answer.get("ns")
        if isinstance(spent_ns, int) and 0 <= spent_ns < MOST_NS:
            self._reporter.timed(agent_id, spent_ns)
        if "raised" in answer:
            return HOLD, (f"raised {plain_text(answer['raised'], 60)}", plain_text(answer.get("text"), 500))
        within = answer.get("within")  # what a shielded zip says of the entry in it
        told = isinstance(within, list) and len(within) == 2
        fault = (plain_text(within[0], 80), plain_text(within[1], 500)) if told else None
        return from_plain(answer.get("action")), fault


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
