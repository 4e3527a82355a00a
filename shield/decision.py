"""The shield's results: one frozen `Decision` per boat, stored as arrays until somebody reads it."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, fields
from difflib import get_close_matches
from enum import IntEnum
from typing import Any

import numpy as np

from . import workspace
from .barriers.static import STATIC
from .commands import Commands
from .exceptions import FleetError
from .fleet import FIELD, Fleet
from .jit import Array, BoolArray, IntArray
from .renamed import DECISION, DECISIONS, accepts_old_names


class Reason(IntEnum):
    """Why a command is what it is."""

    PASSED = workspace.PASSED
    """The nominal command leaves every boat its backup; it is sent bit for bit."""
    LEAST_CHANGE = workspace.LEAST_CHANGE
    """A command nearer to the nominal one that satisfies what the backups satisfy. `Decision.solver` names what
    found it; the full boat model has verified it."""
    QP = workspace.LEAST_CHANGE
    """Another name of `LEAST_CHANGE`, for stored data."""
    QP_RELAXED = workspace.QP_RELAXED
    """Only in old logs: the QP's answer with slack."""
    BACKUP = workspace.BACKUP
    """The boat's backup manoeuvre, which clears all boats."""
    ESCAPE = workspace.BACKUP
    """Another name of `BACKUP`, for stored data."""
    BEST_EFFORT = workspace.BEST_EFFORT
    """No manoeuvre satisfies the required margin; this is the best one found."""
    HELD = workspace.HELD
    """The nominal command was not finite or absurdly large, or a registered barrier is unknown where the boat is. The
    boat is commanded to stop on its course."""
    NOT_COVERED = workspace.NOT_COVERED
    """The shield does not decide for this boat."""
    RIGHT_OF_WAY = workspace.RIGHT_OF_WAY
    """Two teammates kept each other from turning: one turns away (gives way), one holds its course (stands on)."""
    LIMITED = workspace.LIMITED
    """The nominal speed is beyond the platform's range; cut to that, the command leaves every boat its backup. In a
    game the command stays as it is, and the game cuts it."""
    STOPPED = workspace.STOPPED
    """With "stop" in the settings (`ShieldConfig.beyond_then`): the boat is beyond the hard line, or would otherwise
    touch an obstacle. It is commanded to stop on its course, and its link is asked for its own stop."""


SOLVERS = (None, "qp", "line_search")
"""What finds a least change, by its number in `Decisions.solver`: the QP on linearised constraints, among teammates; a
line search between nominal command and backup, where constraints are curved."""

FALLBACKS = {
    Reason.BACKUP: "backup manoeuvre",
    Reason.BEST_EFFORT: "best effort",
    Reason.HELD: "hold",
    Reason.STOPPED: "stop",
}


@accepts_old_names(DECISION)
@dataclass(frozen=True, eq=False)
class Decision:
    """One boat's decision.

    Two decisions are equal if they say the same of the same boat, with NaN (no command was given) equal to NaN,
    however long each took.

    Attributes:
        boat: name of the boat.
        nominal_heading_rad, nominal_speed_mps: nominal command, heading absolute, clockwise from north.
        filtered_heading_rad, filtered_speed_mps: command to send.
        intervened: whether the two differ in any bit.
        reason: why.
        active_constraints: names of the boats, or registered barriers, or "field", that the command was chosen for.
        safety_margin_m: verified margin beyond the required distance, m; inf when nobody is near.
        slack_m: margin given up, m.
        fallback: name of the fallback used, or None.
        solve_time_s: time of the whole decision, s.
        no_table: names of the opponents without an applicable value table. They are simulated as pursuers instead,
            which is less reliable for slow boats; the log says why, once. None: not known, as for decisions read from a
            black box.
        cut_short: whether `ShieldConfig.work_budget` ended the search for this boat's command; the command is then the
            best one verified so far.
        adversary_horizon_s: how long from now this boat, an opponent, was assumed to do its worst before it holds its
            course, s (0: it holds it from now on, or its way is known). None: it is no opponent, or not known.
        outside_m: how far outside the field's edge the boat is, m; 0 inside, or without a field.
        solver: what found a `LEAST_CHANGE`, "qp" or "line_search"; None: another reason, or not known.
    """

    boat: str
    nominal_heading_rad: float
    nominal_speed_mps: float
    filtered_heading_rad: float
    filtered_speed_mps: float
    intervened: bool
    reason: Reason
    active_constraints: tuple[str, ...]
    safety_margin_m: float
    slack_m: float
    fallback: str | None
    solve_time_s: float = field(compare=False)
    no_table: tuple[str, ...] | None = None
    cut_short: bool = False
    adversary_horizon_s: float | None = None
    outside_m: float = 0.0
    solver: str | None = None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Decision) and self._compared() == other._compared()

    def __hash__(self) -> int:
        return hash(self._compared())

    def _compared(self) -> tuple[Any, ...]:
        """Return all that counts for equality; NaN, which equals nothing, as None."""
        values = (getattr(self, entry.name) for entry in fields(self) if entry.compare)
        return tuple(None if value != value else value for value in values)

    def _cells(self) -> tuple[str, ...]:
        nominal = f"{math.degrees(self.nominal_heading_rad) % 360.0:.1f}", f"{self.nominal_speed_mps:.2f}"
        filtered = f"{math.degrees(self.filtered_heading_rad) % 360.0:.1f}", f"{self.filtered_speed_mps:.2f}"
        margin = "-" if math.isinf(self.safety_margin_m) else f"{self.safety_margin_m:.2f}"
        return (self.boat, *nominal, *filtered, self.reason.name, ", ".join(self.active_constraints) or "-", margin)


@accepts_old_names(DECISIONS)
@dataclass(frozen=True)
class Decisions:
    """Decisions for all boats of a fleet, in its order; indexing, by place or name, builds the `Decision` of one boat.

    ``decisions[0]`` is that of the fleet's first boat, ``decisions["boat_0"]`` that of the boat of this name, and
    ``"boat_0" in decisions`` tells whether there is one. `filtered` and the other arrays have all boats at once.

    Raises:
        FleetError: indexed by an unknown name, or by something that is neither place nor name.
        IndexError: the place is out of range.
    """

    fleet: Fleet
    nominal: Commands
    filtered: Commands  # in the same frame
    intervened: BoolArray  # (n,), as all that follow
    reason: IntArray  # values of `Reason`
    safety_margin_m: Array
    slack_m: Array
    active_constraint: IntArray  # index of a boat, -1 none, -2 static constraints, -3 and below ``barriers``
    solve_time_s: float = field(compare=False)  # of the whole decision
    no_table: BoolArray | None = None  # (n, n) own boats and opponents without a value table; None: not known
    cut_short: BoolArray | None = None  # None: not known, taken as False
    adversary_horizon_s: Array | None = None  # NaN for boats that are no opponents; None: not known
    solver: IntArray | None = None  # places in `SOLVERS`; None: not known
    barriers: tuple[str, ...] = ()  # names of the registered barriers in force
    area: tuple[float, float, float, float] | None = None  # xmin, ymin, xmax, ymax of the field, m; None: there is none

    @classmethod
    def made(cls, **fields: Any) -> Decisions:
        """Build from all fields without checks: a decision is made at every step."""
        made = object.__new__(cls)
        made.__dict__.update(fields)
        return made

    def __len__(self) -> int:
        return len(self.reason)

    def __iter__(self) -> Iterator[Decision]:
        return (self[i] for i in range(len(self)))

    def __contains__(self, item: object) -> bool:
        return item in self.fleet.names if isinstance(item, str) else any(item == one for one in self)

    def __getitem__(self, index: int | str) -> Decision:
        i = self._place(index)
        if not -len(self) <= i < len(self):
            raise IndexError(f"no boat {i} in a fleet of {len(self)}")
        i, names = i % len(self), self.fleet.names
        heading, active, reason = self.fleet.heading_rad[i], int(self.active_constraint[i]), Reason(int(self.reason[i]))
        nominal_speed, nominal_heading = self.nominal.absolute(i, heading)
        filtered_speed, filtered_heading = self.filtered.absolute(i, heading)
        adversarial_s = math.nan if self.adversary_horizon_s is None else float(self.adversary_horizon_s[i])
        covered = reason != Reason.NOT_COVERED
        no_table = None if self.no_table is None else np.flatnonzero(self.no_table[i] & covered)
        return Decision(
            boat=names[i],
            nominal_heading_rad=nominal_heading,
            nominal_speed_mps=nominal_speed,
            filtered_heading_rad=filtered_heading,
            filtered_speed_mps=filtered_speed,
            intervened=bool(self.intervened[i]),
            reason=reason,
            active_constraints=self._names_of(active),
            safety_margin_m=float(self.safety_margin_m[i]),
            slack_m=float(self.slack_m[i]),
            fallback=FALLBACKS.get(reason),
            solve_time_s=self.solve_time_s,
            no_table=None if no_table is None else tuple(names[j] for j in no_table),
            cut_short=self.cut_short is not None and bool(self.cut_short[i]),
            adversary_horizon_s=None if math.isnan(adversarial_s) else adversarial_s,
            outside_m=float(self.outside_m[i]),
            solver=None if self.solver is None else SOLVERS[int(self.solver[i])],
        )

    def _names_of(self, active: int) -> tuple[str, ...]:
        """Return the names of an active constraint: of a boat, a registered barrier or the field, or none."""
        if active < STATIC:
            return (self.barriers[STATIC - 1 - active],)
        return (self.fleet.names[active],) if active >= 0 else (FIELD,) if active == STATIC else ()

    def _place(self, index: Any) -> int:
        """Return the place of a boat in the fleet, by its name or place: no fraction, mask, True or False."""
        names = self.fleet.names
        if isinstance(index, str):
            if index in names:
                return names.index(index)
            near = get_close_matches(index, names, 1)
            hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(names) or 'none'}"
            raise FleetError(f"no boat {index!r} in the fleet decided on; {hint}")
        if not isinstance(index, (bool, np.bool_)):
            with suppress(TypeError):
                return operator.index(index)
        raise FleetError(
            f"decisions are indexed by a boat's name or place in the fleet, not by {index!r}; of several boats at once "
            "see their arrays: filtered.values, intervened, reason"
        )

    def __str__(self) -> str:
        """Return one line a boat: the nominal command, the filtered one, and why."""
        heads = ("boat", "nominal deg", "m/s", "filtered deg", "m/s", "reason", "active constraint", "margin m")
        rows = [heads, *(one._cells() for one in self)]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        alignments = "<>>>><<>"  # text is aligned left, numbers right
        lines = ["  ".join(map("{:{}{}}".format, row, alignments, widths)) for row in rows]
        return "\n".join(line.rstrip() for line in lines)

    @property
    def outside_m(self) -> Array:
        """(n,) how far outside the field's edge each boat was seen, m; 0 inside, or without a field."""
        if self.area is None:
            return np.zeros(len(self))
        low, high = np.reshape(self.area, (2, 2))
        position_m = self.fleet.position_m
        return np.maximum(low - position_m, position_m - high).max(axis=1, initial=0.0)

    @property
    def count_intervened(self) -> int:
        """Number of boats whose command was changed."""
        return int(np.count_nonzero(self.intervened))
