"""What the post-hoc analysis says about a separation violation, and who is responsible for it.

Responsible is who had the last clear chance: each boat is judged with the other's actual track held fixed, and the boat
whose last preventable step is the later one let the last chance pass, by the command of that step. When both had their
last chance within one step of each other, both are responsible. Where commands take effect late, it is the moments at
which they had to be given that are compared. When the game itself drove that boat in that step (a tagged boat on its
way home), the game is. When neither could have avoided it, neither is; a pair that was inside when the record began is
a matter of the start.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class OracleError(ValueError):
    """A record, boat or setting that cannot be judged; the text names the remedy."""


class Outcome(str, Enum):
    """Whether a boat could have kept the radius.

    AVOIDABLE is proved: there are commands, replayed with the full model. UNAVOIDABLE means that the search was
    exhausted without finding any, at the stated resolution. STARTED_INSIDE: the pair was inside when the record began
    and never apart before the breach, so that nobody had a chance.
    """

    __str__ = str.__str__

    AVOIDABLE = "avoidable"
    UNAVOIDABLE = "unavoidable"
    STARTED_INSIDE = "started_inside"


class Responsible(str, Enum):
    """Whose command let the last chance pass."""

    __str__ = str.__str__

    FIRST = "first"
    SECOND = "second"
    BOTH = "both"
    GAME = "game"
    NEITHER = "neither"
    START = "start"


@dataclass(frozen=True)
class Plan:
    """Own commands that keep the radius, proved by replaying them with the full boat model.

    Attributes:
        begin_step: index of the state from which the commands act.
        speed_mps: (S,) commanded speed of each step.
        heading_error_deg: (S,) commanded heading relative to the boat's at that step, in [-180, 180].
        heading_deg: (S,) the same command as an absolute heading, clockwise from north, in [-180, 180].
        path_m: (S+1, 2) where the boat would have gone.
        closest_m: smallest distance to any other boat on the way, m; above the radius.
    """

    begin_step: int
    speed_mps: Array
    heading_error_deg: Array
    heading_deg: Array
    path_m: Array
    closest_m: float


@dataclass(frozen=True)
class Verdict:
    """One boat's side of a breach.

    Attributes:
        own: index of the boat that is judged.
        other: index of the boat it came too close to.
        step: index of the first state inside the radius.
        radius_m: separation radius, m.
        outcome: see `Outcome`.
        last_step: the latest state at which a command could still prevent the breach; None where there is none.
        last_preventable_s: how long before the breach that was, s; None where there is none.
        looked_back_s: how far back commands could begin to differ, s: T, or less where the record is shorter.
        end_step: index of the last state up to which the radius had to be kept.
        plan: commands given from ``last_step`` on, which act from there on or so much later as the boat's commands
            come late; None unless avoidable.
        exhausted: whether the search that found nothing (one step after ``last_step``, or at all) kept every state it
            reached at its resolution; False when it had to drop some for lack of width.
        searches: how many searches this took.
    """

    own: int
    other: int
    step: int
    radius_m: float
    outcome: Outcome
    last_step: int | None
    last_preventable_s: float | None
    looked_back_s: float
    end_step: int
    plan: Plan | None = field(repr=False)
    exhausted: bool
    searches: int


@dataclass(frozen=True)
class BreachVerdict:
    """A breach judged from both sides.

    Attributes:
        step: index of the first state inside the radius.
        first: verdict on the first boat of the pair.
        second: verdict on the second.
        responsible: see `Responsible`.
    """

    step: int
    first: Verdict
    second: Verdict
    responsible: Responsible

    def of(self, boat: int) -> Verdict:
        """Return the verdict on one of the two boats.

        Raises:
            KeyError: the boat is not in the pair.
        """
        for verdict in (self.first, self.second):
            if verdict.own == boat:
                return verdict
        raise KeyError(f"boat {boat} is not in the pair ({self.first.own}, {self.second.own})")

    def responsible_boats(self) -> tuple[int, ...]:
        """Return the boats that are responsible: none, one or two."""
        chosen = {
            Responsible.FIRST: (self.first.own,),
            Responsible.SECOND: (self.second.own,),
            Responsible.BOTH: (self.first.own, self.second.own),
        }
        return chosen.get(self.responsible, ())


def responsible_of(first: Verdict, second: Verdict, driven: NDArray[np.bool_]) -> Responsible:
    """Who let the later of both boats' last chances pass; ``driven`` (T, n): boats that the game drove in each step."""
    if first.outcome is Outcome.STARTED_INSIDE or second.outcome is Outcome.STARTED_INSIDE:
        return Responsible.START
    if first.last_step is None and second.last_step is None:
        return Responsible.NEITHER
    lasts = [-2 if verdict.last_step is None else verdict.last_step for verdict in (first, second)]
    late = [verdict for verdict, last in zip((first, second), lasts, strict=True) if last >= max(lasts) - 1]
    free = [v for v in late if v.last_step is not None and not driven[v.last_step, v.own]]
    if not free:
        return Responsible.GAME
    if len(free) == 2:
        return Responsible.BOTH
    return Responsible.FIRST if free[0] is first else Responsible.SECOND
