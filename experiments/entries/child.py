"""What runs in an entry's process: loads its policy, begins a game and answers its steps. See `team` for the orders.

Orders are pickled tuples of ours; answers are JSON, so that nothing is unpickled that foreign code may have made.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import sys
import time
from collections.abc import Mapping, Sequence
from multiprocessing.connection import Connection
from typing import Any, cast

import numpy as np
from steerclear import policies
from steerclear.policies.foreign import ForeignCode, GameFacts, GuardedTeam
from steerclear.shield.exceptions import SteerclearError
from steerclear.shield.foreign import describe_error, plain_text

from .sandbox import AGAIN

MOST = 64
"""Numbers of an action, and characters of a text, that are looked at: no action has as many."""
DEEPEST = 4
"""Lists within lists that are looked at."""
_NUMBERS = ("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "float32", "float64")


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
        with contextlib.suppress(Exception):  # the entry's own, by now
            sys.stdout.flush()
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
            name = "" if self._team is None else self._team.name
            text = describe_error(error) if self._team is None else self._team.code.told(describe_error(error))
            return {"failed": f"policy {name!r} cannot {order}: {text}"}

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


def _ask(code: ForeignCode, answer: Any, agent_id: str) -> dict[str, Any]:
    """One boat's action, or what was raised instead, and how long that took."""
    started_ns = time.perf_counter_ns()
    try:
        action = answer(agent_id)
        spent_ns = time.perf_counter_ns() - started_ns
        return {"action": to_plain(action), "ns": spent_ns, "within": code.failed_within(agent_id)}
    except BaseException as error:
        spent_ns = time.perf_counter_ns() - started_ns
        return {"raised": type(error).__name__, "text": code.told(describe_error(error)), "ns": spent_ns}


class Unreadable:
    """Stands for an answer that is no action, and looks like it."""

    def __init__(self, text: str) -> None:
        self._text = text

    def __repr__(self) -> str:
        return self._text


def to_plain(action: Any, depth: int = 0) -> Any:
    """An answer as JSON content, from which `from_plain` makes the same action."""
    if hasattr(action, "detach"):  # a tensor
        action = action.detach().cpu().numpy()
    if isinstance(action, (np.ndarray, np.generic)) and action.size <= MOST and action.dtype.name in _NUMBERS:
        return {"array": action.tolist(), "dtype": action.dtype.name, "scalar": isinstance(action, np.generic)}
    if isinstance(action, list | tuple) and len(action) <= MOST and depth < DEEPEST:
        return {"tuple" if isinstance(action, tuple) else "list": [to_plain(item, depth + 1) for item in action]}
    short = (type(action) is int and abs(action) < 2**63) or (type(action) is str and len(action) <= MOST)
    if short or action is None or type(action) in (bool, float):
        return action
    try:
        text = repr(action)
    except Exception:
        text = type(action).__name__
    return {"unreadable": plain_text(text, 80)}


def from_plain(content: Any, depth: int = 0) -> Any:
    """The action that `to_plain` took; whatever else it is given, some action or something unreadable."""
    if not isinstance(content, Mapping):
        return Unreadable("a list") if isinstance(content, list) else content
    array, dtype = content.get("array"), content.get("dtype")
    if dtype in _NUMBERS and array is not None:
        try:
            made = np.array(array, dtype=dtype)
        except (TypeError, ValueError, OverflowError):
            return Unreadable("an array")
        return made[()] if content.get("scalar") is True and made.ndim == 0 else made
    for name, kind in (("tuple", tuple), ("list", list)):
        items = content.get(name)
        if isinstance(items, list) and depth < DEEPEST:
            return kind(from_plain(item, depth + 1) for item in items)
    return Unreadable(plain_text(content.get("unreadable", "nothing"), 80))
