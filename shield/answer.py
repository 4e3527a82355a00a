"""What one decision has to say, copied out of working memory, and the commands that come of it."""

from __future__ import annotations

import numpy as np

from .certificates.manoeuvre import told_margin
from .certificates.rating import FIXED_THING
from .commands import Commands
from .fleet import Fleet
from .jit import Array, BoolArray, IntArray
from .plan import HELD, NOT_COVERED, PASSED, Plan
from .platforms import layout as L
from .scene import Work


class Answer:
    """Arrays of an answer, copied out of working memory."""

    def __init__(self, plan: Plan, work: Work, state: Array) -> None:
        n = len(state)
        self.commands = plan.commands.copy()
        self.reason = plan.reason.copy()
        self.slack = plan.slack_m.copy()
        self.margin = np.where(self.reason == NOT_COVERED, np.inf, work.clear[:n, 0])
        for i in np.flatnonzero(work.breach.any(axis=1) & (self.reason != NOT_COVERED)):
            self.margin[i] = told_margin(int(i), state, work)
        self.bound = work.bound[:n].copy()

    @classmethod
    def empty(cls, n: int) -> Answer:
        """An answer that covers nobody."""
        answer = cls.__new__(cls)
        answer.commands, answer.slack = np.zeros((n, 2)), np.zeros(n)
        answer.reason, answer.bound = np.full(n, NOT_COVERED), np.full(n, -1)
        answer.margin = np.full(n, np.inf)
        return answer

    def take(self, i: int, plan: Plan, work: Work, state: Array) -> None:
        """Take boat i's row of another decider's answer."""
        self.commands[i], self.reason[i], self.slack[i] = plan.commands[i], plan.reason[i], plan.slack_m[i]
        self.margin[i], self.bound[i] = told_margin(i, state, work), work.bound[i]


def to_send(
    fleet: Fleet, wanted: Commands, asked: Array, turned: Array, answer: Answer
) -> tuple[Commands, BoolArray, IntArray]:
    """Commands to send, which of them are changed, and what binds each boat."""
    changed = (answer.reason != NOT_COVERED) & (answer.reason != PASSED)
    changed &= (answer.commands != asked).any(axis=1)
    if not changed.any():
        return wanted, changed, answer.bound
    sent = wanted.replaced(changed, less_turn(answer.commands, -turned), fleet.state[:, L.HEADING])
    alone = changed & (answer.bound < 0) & (answer.reason != HELD)
    return sent, changed, np.where(alone, FIXED_THING, answer.bound)  # nothing else changes commands


def less_turn(commands: Array, turned_deg: Array) -> Array:
    """Commands (speed, relative heading deg) as seen after a turn; those of boats that do not turn bit for bit."""
    if not turned_deg.any():
        return commands
    return np.stack([commands[:, 0], commands[:, 1] - turned_deg], axis=1)
