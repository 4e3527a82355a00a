"""What runs in an entry's process: loads its policy, begins a game and answers its steps. See `process` for the orders.

Orders are pickled tuples of ours; answers are JSON.
"""

from __future__ import annotations

import json
import os
import pickle
import sys
import time
from collections.abc import Mapping, Sequence
from multiprocessing.connection import Connection
from typing import Any, cast

from steerclear import policies
from steerclear.policies.guard import ForeignCode, GameFacts, GuardedTeam
from steerclear.shield.exceptions import SteerclearError
from steerclear.shield.foreign import describe_error

from .answers import to_plain
from .sandbox import AGAIN


def serve(read_fd: int, write_fd: int, folder: str) -> int:
    """Answer orders until the game is over or the runner is gone."""
    own, player = os.getpid(), Player()
    orders, answers = Connection(read_fd, writable=False), Connection(write_fd, readable=False)
    while True:
        try:
            message = orders.recv_bytes()
        except EOFError:
            return 0
        order, *arguments = pickle.loads(message)
        if order == "over":
            os._exit(AGAIN)  # whatever threads the entry has left
        answer = player.obey(order, arguments)
        if os.getpid() != own:
            os._exit(0)  # the entry forked: its child has no part in the game
        _flush()
        answers.send_bytes(json.dumps(answer).encode())


class Player:
    """An entry's policy and the game it is in."""

    def __init__(self) -> None:
        self._team: GuardedTeam | None = None
        self._ids: Sequence[str] = ()

    def obey(self, order: str, arguments: Sequence[Any]) -> dict[str, Any]:
        """Do what an order says; whatever the entry raises is in the answer."""
        try:
            orders: dict[str, Any] = {"load": self._load, "begin": self._begin, "step": self._step}
            return dict(orders[order](*arguments))
        except SteerclearError as error:
            return {"failed": str(error)}
        except BaseException as error:  # foreign code may raise anything
            return {"failed": f"policy {self._name()!r} cannot {order}: {describe_error(error)}"}

    def _load(self, path: str, options: Mapping[str, Any]) -> dict[str, Any]:
        self._team = team = cast(GuardedTeam, policies.make(path, **options))  # as it makes of paths
        return {"name": team.name}

    def _begin(self, facts: GameFacts, agent_ids: Sequence[str], seed: int) -> dict[str, Any]:
        self._ids = agent_ids
        self._code().begin(facts, agent_ids, seed)
        return {}

    def _step(self, observations: Mapping[str, Any], infos: Mapping[str, Any]) -> dict[str, Any]:
        code = self._code()
        answer = code.prepare(observations, infos)
        with code.around():
            return {"answers": {agent_id: _ask(code, answer, agent_id) for agent_id in self._ids}}

    def _code(self) -> ForeignCode:
        if self._team is None:
            raise SteerclearError("no policy was loaded")
        return self._team.code

    def _name(self) -> str:
        return "" if self._team is None else self._team.name


def _ask(code: ForeignCode, answer: Any, agent_id: str) -> dict[str, Any]:
    """One boat's action, or what was raised instead, and how long that took."""
    started_ns = time.perf_counter_ns()
    try:
        action = answer(agent_id)
        spent_ns = time.perf_counter_ns() - started_ns
        return {"action": to_plain(action), "ns": spent_ns, "within": code.failed_within(agent_id)}
    except BaseException as error:
        spent_ns = time.perf_counter_ns() - started_ns
        return {"raised": type(error).__name__, "text": describe_error(error), "ns": spent_ns}


def _flush() -> None:
    try:
        sys.stdout.flush()
    except Exception:  # the entry's own, by now
        return
