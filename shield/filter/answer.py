"""What one decision has to say, copied out of working memory, and the commands that come of it."""

from __future__ import annotations

import numpy as np

from ..barriers.boats import reported_margin
from ..barriers.static import STATIC
from ..commands import Commands
from ..fleet import Fleet
from ..jit import Array, BoolArray, IntArray, lean_kernel
from ..plan import HELD, NOT_COVERED, PASSED, Plan
from ..platforms import layout as L
from ..work import Work


@lean_kernel
def read_margins(state: Array, work: Work, reason: IntArray, reported_m: Array, cut_short: BoolArray) -> None:
    """Write the margin reported of each boat, m, infinite for those not decided for, and whose search was ended."""
    for i in range(state.shape[0]):
        covered = reason[i] != NOT_COVERED
        reported_m[i] = reported_margin(i, state, work) if covered else np.inf
        cut_short[i] = covered and work.cut_short[0]


@lean_kernel
def mark_changed(commands: Array, asked: Array, reason: IntArray, changed: BoolArray) -> bool:
    """Mark the boats whose command is not the one asked for, bit for bit; returns whether there are any."""
    some = False
    for i in range(asked.shape[0]):
        changed[i] = False
        if reason[i] != NOT_COVERED and reason[i] != PASSED:
            changed[i] = commands[i, 0] != asked[i, 0] or commands[i, 1] != asked[i, 1]
            some = some or changed[i]
    return some


class Answer:
    """Arrays of an answer, copied out of working memory."""

    def __init__(self, plan: Plan, work: Work, state: Array) -> None:
        n = len(state)
        self.commands = plan.commands.copy()
        self.reason = plan.reason.copy()
        self.slack = plan.slack_m.copy()
        self.bound = work.bound[:n].copy()
        self.margin, self.cut_short = np.empty(n), np.empty(n, np.bool_)
        read_margins(state, work, self.reason, self.margin, self.cut_short)

    @classmethod
    def empty(cls, n: int) -> Answer:
        """An answer that covers nobody."""
        answer = cls.__new__(cls)
        answer.commands, answer.slack = np.zeros((n, 2)), np.zeros(n)
        answer.reason, answer.bound = np.full(n, NOT_COVERED), np.full(n, -1)
        answer.margin = np.full(n, np.inf)
        answer.cut_short = np.zeros(n, np.bool_)
        return answer

    def take(self, i: int, plan: Plan, work: Work, state: Array) -> None:
        """Take boat i's row of another decider's answer."""
        self.commands[i], self.reason[i], self.slack[i] = plan.commands[i], plan.reason[i], plan.slack_m[i]
        self.margin[i], self.bound[i] = reported_margin(i, state, work), work.bound[i]
        self.cut_short[i] = work.cut_short[0]


def to_send(
    fleet: Fleet, wanted: Commands, asked: Array, turned: Array, answer: Answer
) -> tuple[Commands, BoolArray, IntArray]:
    """Commands to send, which of them are changed, and what binds each boat."""
    changed: BoolArray = np.empty(len(asked), np.bool_)
    if not mark_changed(answer.commands, asked, answer.reason, changed):
        return wanted, changed, answer.bound
    sent = wanted.replaced(changed, less_turn(answer.commands, -turned), fleet.state[:, L.HEADING])
    alone = changed & (answer.bound == -1) & (answer.reason != HELD)
    return sent, changed, np.where(alone, STATIC, answer.bound)  # nothing else changes commands


def less_turn(commands: Array, turned_deg: Array) -> Array:
    """Commands (speed, relative heading deg) as seen after a turn; those of boats that do not turn bit for bit."""
    if not turned_deg.any():
        return commands
    return np.stack([commands[:, 0], commands[:, 1] - turned_deg], axis=1)
