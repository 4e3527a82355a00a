"""Settings and verdicts of the post-hoc analysis, and the rule for responsibility.

The boat with the last clear chance is responsible. Each boat is judged with the other's actual track held fixed; the
boat with the later last preventable step let the last chance pass. If both last chances are within one step of each
other, both are responsible. With command delays, the analysis compares the moments at which commands had to be given.
If the game controlled that boat in that step (a tagged boat on its way home), the game is responsible. If neither
could have avoided the violation, neither is. If the pair was inside when the record began, the start is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class OracleError(ValueError):
    """A record, boat or setting that cannot be judged; the text names the remedy."""


class Level(NamedTuple):
    """Resolution of a search.

    ``width``: most states kept per layer. ``cells``: sizes of x and y, m, heading, deg, speed, m/s, and thrust,
    percent; states of one layer in the same cell are merged. ``rudders``: choices as shares of full rudder, ascending.
    ``schedules``: each is a separate search and lists the lengths of the first choices, s; the last length repeats.
    """

    width: int
    cells: tuple[float, ...]
    rudders: tuple[float, ...]
    schedules: tuple[tuple[float, ...], ...]


QUICK = Level(150, (0.5, 0.5, 10.0, 0.25, 15.0), (-1.0, 0.0, 1.0), ((0.5, 0.5, 0.5, 1.0),))
SCHEDULES = ((0.5,), (0.1, 0.1, 0.1, 0.2, 0.2, 0.3), (*(0.1,) * 15, *(0.2,) * 5, 0.3))
"""Short choices find the last moment, but on a slow boat they differ by less than a cell; longer choices do not."""
FULL = Level(2000, (0.05, 0.05, 2.0, 0.03, 3.0), (-1.0, -0.5, 0.0, 0.5, 1.0), SCHEDULES)


@dataclass(frozen=True)
class Settings:
    """Settings of a judgement.

    Attributes:
        look_back_s: T, how long before the violation own commands may begin to differ, s.
        settle_s: how long after the violation the radius must still be kept, s. A plan that is clear when the real pair
            came apart, but heads into the next contact, has avoided nothing. Beyond a few seconds, the others' recorded
            tracks respond to a boat that is no longer there. 5 s lets a heron turn through 180 deg.
        longest_s: a violation counts as over after this time, s, because boats may be parked side by side for minutes.
        quick: level searched first; a plan found there is proof.
        full: level that must fail before a violation is called unavoidable.
    """

    look_back_s: float = 30.0
    settle_s: float = 5.0
    longest_s: float = 30.0
    quick: Level = QUICK
    full: Level = FULL

    def __post_init__(self) -> None:
        for name, low in (("look_back_s", 0.1), ("settle_s", 0.0), ("longest_s", 0.0)):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= low):
                raise OracleError(f"{name} must be a number of seconds, at least {low:g}; got {value}")
        for level in (self.quick, self.full):
            lengths_s = [length_s for first_s in level.schedules for length_s in first_s]
            sound = min((level.width, *level.cells, *lengths_s)) > 0 and level.schedules and all(level.schedules)
            if not (sound and level.rudders and all(-1 <= value <= 1 for value in level.rudders)):
                raise OracleError(f"a search level needs positive sizes and rudders within [-1, 1]; got {level}")


@dataclass(frozen=True)
class Motion:
    """Physics of a record beyond its boats.

    Attributes:
        current_mps: (east, north) speed at which the water carried every boat, m/s.
        delay_steps: steps from a command to its effect, per boat; empty: no delay.

    Raises:
        OracleError: a current that is not finite, or a delay that is not a number of steps.
    """

    current_mps: tuple[float, float] = (0.0, 0.0)
    delay_steps: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if len(self.current_mps) != 2 or not all(math.isfinite(speed) for speed in self.current_mps):
            raise OracleError(f"current_mps is {self.current_mps}; give two finite speeds, east and north")
        if not all(isinstance(steps, int | np.integer) and steps >= 0 for steps in self.delay_steps):
            raise OracleError(f"delay_steps is {self.delay_steps}; give a whole number of steps, 0 or more, per boat")


AT_ONCE = Motion()
"""Still water and no command delay."""


class Outcome(str, Enum):
    """Whether a boat could have kept the radius.

    AVOIDABLE is proved: a replay with the full model verifies the commands. UNAVOIDABLE: the search found none at the
    stated resolution. STARTED_INSIDE: the pair was inside when the record began and never apart before the violation,
    so neither boat had a chance.
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

    @classmethod
    def of(cls, first: Verdict, second: Verdict, driven: NDArray[np.bool_]) -> Responsible:
        """Return who let the later last chance pass; ``driven`` (T, n): boats the game controlled in each step."""
        if Outcome.STARTED_INSIDE in (first.outcome, second.outcome):
            return cls.START
        lasts = [(verdict, verdict.last_step) for verdict in (first, second) if verdict.last_step is not None]
        latest = max((last for _, last in lasts), default=-1)
        late = [(verdict, last) for verdict, last in lasts if last >= latest - 1]
        free = [verdict for verdict, last in late if not driven[last, verdict.own]]
        if not late:
            return cls.NEITHER
        if not free:
            return cls.GAME
        return cls.BOTH if len(free) == 2 else cls.FIRST if free[0] is first else cls.SECOND


@dataclass(frozen=True)
class Plan:
    """Own commands that keep the radius, proved by replay with the full boat model.

    Attributes:
        begin_step: index of the state from which the commands act.
        speed_mps: (S,) commanded speed of each step.
        heading_error_deg: (S,) commanded heading relative to the boat's heading at that step, in [-180, 180].
        heading_deg: (S,) the same command as an absolute heading, clockwise from north, in [-180, 180].
        path_m: (S+1, 2) positions the boat would have had.
        closest_m: smallest distance to any other boat on the path, m; above the radius.
    """

    begin_step: int
    speed_mps: Array
    heading_error_deg: Array
    heading_deg: Array
    path_m: Array
    closest_m: float


@dataclass(frozen=True)
class Verdict:
    """One boat's side of a separation violation.

    Attributes:
        own: index of the judged boat.
        other: index of the boat it came too close to.
        step: index of the first state inside the radius.
        radius_m: separation, m.
        outcome: see `Outcome`.
        last_step: the latest state at which a command could still prevent the violation; None if there is none.
        last_preventable_s: time from that state to the violation, s; None if there is none.
        looked_back_s: how far back commands could begin to differ, s: T, or less in a shorter record.
        end_step: index of the last state up to which the radius had to be kept.
        plan: commands given from ``last_step`` on, which act after the boat's command delay; None unless avoidable.
        exhausted: whether the failed search (one step after ``last_step``, or all of them) kept every state it reached
            at its resolution; False if it dropped some for lack of width.
        searches: number of searches made.
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
class ViolationVerdict:
    """A separation violation judged from both sides; ``step`` is the index of the first state inside the radius."""

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
        first, second, both = Responsible.FIRST, Responsible.SECOND, Responsible.BOTH
        sides = ((self.first, (first, both)), (self.second, (second, both)))
        return tuple(verdict.own for verdict, named in sides if self.responsible in named)
