"""`Fleet`: all boats seen at one moment."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .arrays import hint_at_degrees, numbers, say_once, shaped, truths, whole_numbers
from .exceptions import FleetError
from .jit import Array, BoolArray, IntArray, kernel
from .platforms import Platform, get_platform
from .platforms import layout as L
from .platforms.files import is_path
from .renamed import FLEET, accepts_old_names

FIELD = "field"
"""Name of an active constraint that is no boat: walls, circles, edges. No boat may have this name."""

LARGEST = 1e9
"""Values beyond this (m, m/s, deg, percent) are faults of the source: their squares lose the metres."""

LARGEST_SPEED_MPS = 50.0
"""Speeds beyond this are faults of the source, m/s: such a boat would jump over the radius within a step."""

LARGEST_ERROR_M = 1000.0
"""Given bounds on position errors beyond this, m, say nothing about where a boat is."""

LARGEST_AGE_S = 3600.0
"""Given track ages beyond this, s, are times of day, or of a boat long gone."""

SMALLEST_FLEET_M = 0.05
"""Boats that are all this close, but not at one point, are probably not given in metres."""


@kernel
def sound(state: Array) -> bool:
    """Return whether every boat's observed values are finite and of a sensible size, and its memory that or NaN."""
    for i in range(state.shape[0]):
        for column in range(state.shape[1]):
            if column <= L.SPEED and not abs(state[i, column]) <= LARGEST:
                return False
            if abs(state[i, column]) > LARGEST:
                return False
        if abs(state[i, L.SPEED]) > LARGEST_SPEED_MPS:
            return False
    return True


@accepts_old_names(FLEET)
@dataclass(frozen=True)
class Fleet:
    """State of n boats, own and others.

    Build it with `Fleet.of` from plain arrays, or pass simulator state rows directly. Arrays of the right type and
    layout are stored without a copy (others are converted), and decisions read them later: pass a copy of arrays that
    a simulator goes on changing.

    Attributes:
        state: (n, N_STATE) rows as in `platforms.layout`; autopilot memory may be NaN where it is unknown.
        team: (n,) team of each boat.
        platforms: names (or `Platform` objects) of the n boats.
        controlled: (n,) boats the shield decides for.
        names: names for messages and reports.
        age_s: (n,) age of each track, s; None: all fresh.
        position_error_m: (n,) bound on each position's error, m; None: as in the settings.
        driven: (n, 4) motion of boats that something predictable drives (a game, for tagged or disabled ones): speed
            m/s, the point x, y m that it steers at (NaN: none, the rudder is left alone) and the time, s, for which
            that is sure to last; a row of NaN where nothing is known. None: of no boat. Such boats are predicted
            accordingly, see `barriers.neighbours`, unless they may be free before a backup ends, or are controlled.
        adversary_horizon_s: (n,) how long from now each may do its worst as an opponent before it holds its course, s;
            NaN, or None for all: as in the settings. If `ShieldConfig.adversary_horizon_s` is 0, nobody is adversarial.
        visiting: (n,) boats on the other team's side of a field, where they can tag nobody: adversarial for
            `ShieldConfig.intruder_horizon_s`. None: not known of any.

    Raises:
        FleetError: shapes do not fit together, or an entry is of another kind. `check` checks the values.
    """

    state: Array
    team: IntArray
    platforms: tuple[str | Platform, ...]
    controlled: BoolArray
    names: tuple[str, ...]
    age_s: Array | None = None
    position_error_m: Array | None = None
    driven: Array | None = None
    adversary_horizon_s: Array | None = None
    visiting: BoolArray | None = None

    def __post_init__(self) -> None:
        n = len(self.state) if hasattr(self.state, "__len__") else 0
        for name, (brought, *row) in _COLUMNS.items():
            value = getattr(self, name)
            if value is not None or name in ("state", "team", "controlled"):
                object.__setattr__(self, name, shaped(name, value, (n, *row), brought))
        for name in ("platforms", "names"):
            each = _each(name, getattr(self, name))
            if len(each) != n:
                raise FleetError(f"{name} has {len(each)} entries for {n} boats; give one per boat")
            object.__setattr__(self, name, each)

    @classmethod
    def of(
        cls,
        *,
        position_m: ArrayLike,
        heading_rad: ArrayLike | None = None,
        heading_deg: ArrayLike | None = None,
        speed_mps: ArrayLike,
        team: ArrayLike,
        platforms: str | Platform | Sequence[str | Platform],
        controlled: ArrayLike | None = None,
        names: Sequence[str] | None = None,
        thrust: ArrayLike | None = None,
        age_s: ArrayLike | None = None,
        position_error_m: ArrayLike | None = None,
        adversary_horizon_s: ArrayLike | None = None,
        visiting: ArrayLike | None = None,
    ) -> Fleet:
        """Build a fleet from plain arrays, one entry per boat, which are copied.

        Args:
            position_m: (n, 2) east and north, m, within 1e9 of the origin.
            heading_rad: clockwise from north, rad; any number of turns; or
            heading_deg: the same in deg.
            speed_mps: m/s, negative astern, at most 50 either way.
            team: whole numbers.
            platforms: one platform for all, or n of them.
            controlled: True and False; None: the boats of team 0.
            names: n names; None: boat_0, boat_1, ...
            thrust: percent where known, at most the platform's ``max_thrust`` either way, else NaN. Unknown thrust of
                own boats is then estimated from the commands sent; at first, and for others, from the speed.
            age_s: age of each track, s, 0 to 3600; more than `ShieldConfig.max_track_age_s` is refused later.
            position_error_m: bound on the position error, m, 0 to 1000.
            adversary_horizon_s: as in `Fleet`, s, 0 to inf.
            visiting: as in `Fleet`.

        Raises:
            FleetError: shapes do not fit together, a value cannot be used or is out of its range, two boats have the
                same name, or one is called "field".
            PlatformError: a platform is unknown.
        """
        position = shaped("position_m", position_m, (None, 2))
        n = len(position)
        state = np.zeros((n, L.N_STATE))
        state[:, L.X : L.Y + 1] = position
        state[:, L.SPEED] = shaped("speed_mps", speed_mps, (n,))
        state[:, L.THRUST] = np.nan if thrust is None else shaped("thrust", thrust, (n,))
        state[:, [L.SPEED_ERROR, L.HEADING_ERROR]] = np.nan
        if (heading_rad is None) == (heading_deg is None):
            raise FleetError("give either heading_rad or heading_deg, clockwise from north")
        with np.errstate(invalid="ignore"):  # infinite ones become NaN, which the check below names
            if heading_deg is None:
                angles = shaped("heading_rad", heading_rad, (n,))
                hint_at_degrees("Fleet.of: heading_rad", angles, "give heading_deg")
            heading = np.degrees(angles) if heading_deg is None else shaped("heading_deg", heading_deg, (n,))
            state[:, L.HEADING] = (heading + 180.0) % 360.0 - 180.0
            spread_m = np.ptp(position, axis=0).max() if n > 1 else 0.0
        if 0.0 < spread_m < SMALLEST_FLEET_M and (np.abs(position) <= 180.0).all():
            say_once("position_m", f"all {n} boats are within {spread_m:.2g} m of each other; {_IF_DEGREES}")
        teams = _own("team", team, n)
        one = isinstance(platforms, (str, Platform))
        fleet = cls(
            state=state,
            team=teams,
            platforms=_known((platforms,) * n if one else platforms),
            controlled=teams == 0 if controlled is None else _own("controlled", controlled, n),
            names=_each("names", [f"boat_{i}" for i in range(n)] if names is None else names),
            age_s=_own("age_s", age_s, n),
            position_error_m=_own("position_error_m", position_error_m, n),
            adversary_horizon_s=_own("adversary_horizon_s", adversary_horizon_s, n),
            visiting=_own("visiting", visiting, n),
        )
        fleet.check()
        _check_given(fleet)
        if controlled is None and n and not fleet.controlled.any():
            say_once(
                "controlled",
                f"no boat is controlled: by default those of team 0 are, and teams here are {np.unique(teams).tolist()}"
                "; give team 0 to the own boats, or controlled=",
            )
        return fleet

    def __len__(self) -> int:
        return len(self.state)

    def check(self) -> None:
        """Check values, which may have changed since the fleet was built.

        Raises:
            FleetError: a position, heading or speed is not finite or absurd, or an age or an error bound is invalid.
        """
        if not sound(self.state):
            for column, values in enumerate(self.state.T):
                what, most, remedy = _SEEN.get(column, _MEMORY)
                known = np.where(np.isnan(values) & (what == "memory"), 0.0, values)
                self._check(what, known, -most, most, remedy)
        self._check("age_s", self.age_s, 0.0, LARGEST, "give seconds since its track's fix")
        self._check("position_error_m", self.position_error_m, 0.0, LARGEST, "give a bound in m, 0 to {:g}")
        if self.adversary_horizon_s is not None:
            times_s = np.where(np.isnan(self.adversary_horizon_s), 0.0, self.adversary_horizon_s)
            remedy = "give s per boat, 0 to {:g}, or NaN where the settings say it"
            self._check("adversary_horizon_s", times_s, 0.0, np.inf, remedy)

    def _check(self, name: str, values: Array | None, low: Any, high: Any, remedy: str) -> None:
        """Raise for the first boat whose value is out of its range; {} in the remedy is the highest value."""
        if values is None:
            return
        bad = ~((values >= low) & (values <= high))
        if bad.any():
            i = int(np.argmax(bad))
            most = float(np.broadcast_to(high, bad.shape)[i])
            raise FleetError(f"{name} of boat {self.names[i]!r} is {values[i]:g}; {remedy.format(most)}")

    @property
    def position_m(self) -> Array:
        """Positions east and north, m, (n, 2)."""
        return self.state[:, L.X : L.Y + 1]

    @property
    def heading_rad(self) -> Array:
        """Headings clockwise from north, rad, (n,)."""
        return np.radians(self.state[:, L.HEADING])

    @property
    def speed_mps(self) -> Array:
        """Speeds, m/s, (n,)."""
        return self.state[:, L.SPEED]


_COLUMNS: dict[str, Any] = {
    "state": (numbers, L.N_STATE),
    "team": (whole_numbers,),
    "controlled": (truths,),
    "age_s": (numbers,),
    "position_error_m": (numbers,),
    "driven": (numbers, 4),
    "adversary_horizon_s": (numbers,),
    "visiting": (truths,),
}
"""Function that converts each array to the type of compiled code, and the shape of a boat's row."""

_LAST = "of a boat that drops out the last fix with its age_s, and leave out boats that never had one"
_PLACE = ("position", LARGEST, f"give m from a place nearby; {_LAST}")
_SEEN = {
    L.X: _PLACE,
    L.Y: _PLACE,
    L.HEADING: ("heading", LARGEST, f"give deg; {_LAST}"),
    L.SPEED: ("speed", LARGEST_SPEED_MPS, f"give m/s up to {{:g}} either way, not mm/s or cm/s; {_LAST}"),
}
_MEMORY = ("memory", LARGEST, "give NaN where it is unknown")
"""Name of a column of the state, its largest value, and the remedy."""

_IF_DEGREES = (
    "if these are degrees, give metres east and north of a place nearby: steerclear.shield.bridge.frame.FieldFrame("
    "latitude_deg, longitude_deg).to_field_m(latitude_deg, longitude_deg)"
)


def _each(name: str, value: Any) -> tuple[Any, ...]:
    if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
        raise FleetError(f"{name} is {value!r}; give a list of them, one for each boat")
    return tuple(value)


def _known(platforms: Any) -> tuple[str | Platform, ...]:
    """Return platforms, each a known one; those named by a file are read."""
    kinds = _each("platforms", platforms)
    for kind in kinds:
        if not isinstance(kind, (str, Platform)):
            raise FleetError(f"platforms holds {kind!r}; give names of platforms, or Platform objects")
        get_platform(kind)
    return tuple(get_platform(kind) if isinstance(kind, str) and is_path(kind) else kind for kind in kinds)


def _own(name: str, value: Any, n: int) -> Any:
    """Return a copy of an array with an entry per boat, of its type; None for None."""
    return None if value is None else shaped(name, value, (n,), _COLUMNS[name][0]).copy()


def _check_given(fleet: Fleet) -> None:
    """Check what a person gave: reject numbers that compiled code takes, but that mean nothing or are in other units.

    Fleets that programs build are not checked so: the shield should avoid a boat at sea as well as it can.
    """
    remedy = "give a bound in m from 0 to {:g}, not in mm; leave out boats whose place is not known"
    fleet._check("position_error_m", fleet.position_error_m, 0.0, LARGEST_ERROR_M, remedy)
    remedy = "give seconds since its fix from 0 to {:g}, not the time of day, nor ms; leave out boats long gone"
    fleet._check("age_s", fleet.age_s, 0.0, LARGEST_AGE_S, remedy)
    most = np.array([get_platform(kind).max_thrust for kind in fleet.platforms]) * (1.0 + 1e-6)  # of logs and float32
    remedy = "give percent up to {:g} either way, not the pulse in us, or NaN where it is unknown"
    fleet._check("thrust", np.nan_to_num(fleet.state[:, L.THRUST]), -most, most, remedy)
    for name in fleet.names:
        if not isinstance(name, str) or not name or name == FIELD or fleet.names.count(name) > 1:
            raise FleetError(
                f"names holds {name!r}, not a name of its own; give each boat one, not empty, and not {FIELD!r}, by "
                "which decisions name walls and edges"
            )
