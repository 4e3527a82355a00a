"""`PolicyProcess`: a policy in a process of its own, so that it cannot delay the loop.

Only `PolicyProcess.start` waits. Other calls read what has come, send what can be sent and check the process.
"""

from __future__ import annotations

import json
import logging
import math
import pickle
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.policies.registry import looks_like_path
from steerclear.shield.bridge.clock import Clock, MonotonicClock
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import Answer, Closing, Snapshot
from steerclear.shield.commands import Commands
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.jit import Array

from .player import Orders, cast_of
from .worker import Broken, Worker

logger = logging.getLogger(__name__)

START_WITHIN_S = 120.0  # time a policy has to load and to give its first answer, s
SLOW_S = 0.3  # an answer that takes longer than this is reported as a fault, s
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.25, 10.0
"""First and longest pause before a dead policy is restarted, s; the pause doubles each time."""
HEALTHY_S = 30.0  # after answering for this long, a policy's next restart uses the first pause again, s


class PolicyProcess(Closing):
    """A `NominalSource`: sends snapshots to a policy's process and returns its latest answer. A context manager.

    At most one snapshot is in flight; of later ones only the latest waits. A policy that dies or does not answer within
    ``deadline_s`` is ended with all processes it started, and restarted after a pause.

    Args:
        fleet: the file.
        policy: name or path, as `steerclear.policies.make` takes it.
        deadline_s: time for an answer, wall-clock s; None: the file's limits.policy.give_up_after_s.
        clock: clock of the snapshots; None: the machine's.
        boats: names of the boats it plays; None: all that a process commands for the team.
        options: of the policy.
        seed: of the policy's random draws.
        start_within_s: time to load, wall-clock s.

    Attributes:
        policy: its short name, for messages.
        restarts: number of restarts.
        refused: why the last start could not load it; empty if it could.

    Raises:
        FleetFileError: the policy needs a game and the file has none, or one of the boats does not play.
    """

    def __init__(
        self,
        fleet: FleetFile,
        policy: str,
        deadline_s: float | None = None,
        *,
        clock: Clock | None = None,
        boats: Sequence[str] | None = None,
        options: Mapping[str, Any] | None = None,
        seed: int = 0,
        start_within_s: float = START_WITHIN_S,
    ) -> None:
        self.policy = Path(policy).name if looks_like_path(policy) else policy
        self._orders = pickle.dumps(Orders(cast_of(fleet, boats, policy), policy, dict(options or {}), seed))
        self._shape = (len(fleet.names), 2)
        self._deadline_s = fleet.limits.policy.give_up_after_s if deadline_s is None else deadline_s
        self._start_within_s = start_within_s
        self._clock: Clock = MonotonicClock() if clock is None else clock
        self._worker: Worker | None = None
        self._ended: list[Worker] = []
        self._ready = self._answered = self._closed = False
        self._pending: Snapshot | None = None
        self._asked: Snapshot | None = None
        self._since_s = self._again_s = self._taken_s = -math.inf
        self._healthy_s, self._pause_s = math.inf, FIRST_PAUSE_S
        self._commands: Commands | None = None
        self._fault = self.refused = ""
        self.restarts = 0

    def start(self) -> None:
        """Start the policy and wait until it is loaded. Without this call, `offer` starts it.

        Raises:
            PolicyError: it cannot be loaded, or not in time.
        """
        end_s = time.monotonic() + self._start_within_s
        self._launch()
        while not self._ready:
            time.sleep(0.01)
            self._turn()
            late = time.monotonic() > end_s
            if self._worker is None or late:
                said = f"not within {self._start_within_s:g} s" if late else self._fault
                self.close()
                raise PolicyError(self.refused or f"policy {self.policy!r} does not start: {said}")

    def offer(self, snapshot: Snapshot) -> None:
        """Queue the latest snapshot; it replaces one that was not sent yet."""
        self._pending = snapshot
        self._turn()

    def latest(self) -> Answer:
        """Return the latest answer."""
        self._turn()
        return Answer(self._commands, self._clock.now_s() - self._taken_s, self._present_fault())

    def close(self) -> None:
        """End the policy's process; may be called again."""
        self._closed = True
        self._end()
        for worker in self._ended:
            worker.wait(2.0)
        self._ended.clear()

    def _turn(self) -> None:
        now_s, worker = time.monotonic(), self._worker
        self._ended = [ended for ended in self._ended if not ended.is_gone]
        if self._closed or (worker is None and now_s < self._again_s):
            return
        if worker is None:
            self._launch()
            return
        try:
            for message in worker.messages():
                self._take(message, now_s)
            worker.flush()
            if self._ready and self._asked is None and self._pending is not None:
                worker.send(pickle.dumps(self._pending))
                self._asked, self._pending, self._since_s = self._pending, None, now_s
        except Broken as error:
            self._lose(worker.epitaph(str(error)), now_s)
            return
        waited_s = now_s - self._since_s
        if not self._ready and waited_s > self._start_within_s:
            self._lose(f"did not load within {self._start_within_s:g} s", now_s)
        elif self._asked is not None and waited_s > (
            within_s := self._deadline_s if self._answered else self._start_within_s
        ):
            self._lose(f"did not answer within {within_s:g} s", now_s)
        elif now_s - self._healthy_s > HEALTHY_S:
            self._pause_s = FIRST_PAUSE_S

    def _launch(self) -> None:
        now_s = time.monotonic()
        try:
            self._worker = Worker(self._orders)
        except (OSError, Broken) as error:
            self._lose(f"cannot be started ({error})", now_s)
            return
        self._ready, self._answered, self._asked = False, False, None
        self._since_s, self._healthy_s = now_s, math.inf

    def _take(self, message: bytes, now_s: float) -> None:
        try:
            content = json.loads(message)
        except (ValueError, RecursionError):
            raise Broken("its answer is not JSON") from None
        if not isinstance(content, dict):
            raise Broken("its answer is no object")
        if "failed" in content:
            self.refused = str(content["failed"])[:500]
            raise Broken(self.refused)
        if content.get("ready") is True and not self._ready:
            self._ready, self.refused = True, ""
            return
        asked = self._asked
        if asked is None or content.get("number") != asked.number:
            raise Broken("it answers what it was not asked")
        self._asked, self._answered = None, True
        self._healthy_s = min(self._healthy_s, now_s)
        problems, rows = content.get("problems"), content.get("commands")
        self._fault = "; ".join(map(str, problems))[:300] if isinstance(problems, list) else ""
        if rows is not None:
            self._commands, self._taken_s = Commands.absolute_rad(_commands(rows, self._shape)), asked.taken_s

    def _lose(self, what: str, now_s: float) -> None:
        """End the process and schedule a restart."""
        self._end()
        self._ready = False
        self._fault = f"policy {self.policy} {what}; starting it again after {self._pause_s:g} s"
        self._again_s = now_s + self._pause_s
        self._pause_s = min(2.0 * self._pause_s, LONGEST_PAUSE_S)
        self.restarts += 1
        logger.warning("%s", self._fault)

    def _end(self) -> None:
        """End the current process; `_ended` holds it until the system has removed it."""
        if self._worker is not None:
            self._worker.end()
            self._ended.append(self._worker)
            self._worker = None

    def _present_fault(self) -> str:
        waited_s = time.monotonic() - self._since_s
        if self._worker is None:
            return self._fault or f"policy {self.policy} is not running"
        if not self._ready:
            before = f"; before: {self._fault}" if self._fault else ""
            return f"policy {self.policy} is loading ({waited_s:.1f} s){before}"
        if self._asked is not None and waited_s > SLOW_S:
            return f"policy {self.policy} has not answered for {waited_s:.1f} s"
        return self._fault


def _commands(rows: Any, shape: tuple[int, int]) -> Array:
    """Return the commands (n, 2) of an answer, NaN where it has none."""
    try:
        values = np.array([[math.nan, math.nan] if row is None else row for row in rows], dtype=np.float64)
    except (TypeError, ValueError):
        raise Broken("its answer holds no commands") from None
    if values.shape != shape:
        raise Broken(f"its answer has commands of shape {values.shape}, not {shape}")
    return values
