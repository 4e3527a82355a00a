"""`Fleet`: all boats seen at one moment."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .arrays import NoNumbersError, numbers, truths, whole_numbers
from .exceptions import FleetError
from .hints import hint_at_errors, hint_at_headings, hint_at_positions
from .jit import Array, BoolArray, IntArray, kernel
from .platforms import Platform, get_platform
from .platforms import layout as L
from .platforms.files import is_path
from .renamed import FLEET, accepts_old_names

_SEEN = (L.X, L.Y, L.HEADING, L.SPEED)

FIELD = "field"
"""What decisions name as binding where no boat is: walls, circles, edges. No boat may be called so."""

LARGEST = 1e9
"""Values beyond this (m, m/s, deg, percent) are faults of the source: squares of them lose the metres."""

LARGEST_SPEED_MPS = 50.0
"""Speeds beyond this are faults of the source, m/s: such a boat would jump over the radius within a step."""

LARGEST_ERROR_M = 1000.0
"""Bounds on a position's error that are given beyond this say nothing of where a boat is, m."""

LARGEST_AGE_S = 3600.0
"""Ages of tracks that are given beyond this are times of day, or of a boat long gone, s."""


@kernel
def sound(state: Array) -> bool:
    """Whether what is seen of every boat is finite and of a sensible size, and its memory is that or NaN."""
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

    Build it with `Fleet.of` from plain arrays, or hand over simulator state rows directly. Arrays of the right type and
    layout are kept, not copied (others are copied into it), and decisions are read off them: hand over a copy of what a
    simulator goes on changing.

    Attributes:
        state: (n, N_STATE) rows as in `platforms.layout`; autopilot memory may be NaN where it is not known.
        team: (n,) team of each boat.
        platforms: names (or `Platform` objects) of the n boats.
        controlled: (n,) boats the shield decides for.
        names: names for messages and reports.
        age_s: (n,) age of each track, s; None: all fresh.
        position_error_m: (n,) bound on each position's error, m; None: as in the settings.
        driven: (n, 4) of boats that something drives whose doing is known (a game, of tagged or disabled ones): speed
            m/s, the place x, y m it steers at (NaN: none, the rudder is left alone) and the time, s, for which that is
            sure to last; a row of NaN where nothing is known. None: of no boat. They are foreseen as such, see
            `barriers.neighbours`, unless they may be free before a backup ends, or are controlled.
        adversary_horizon_s: (n,) how long from now each may do its worst as an opponent before it holds its course, s;
            NaN, or
            None for all: as the settings say, see `ShieldConfig.adversary_horizon_s`; where that is 0 nobody is feared
            at all.
        visiting: (n,) boats on the other team's side of a field, where they can tag nobody: they are feared for
            `ShieldConfig.intruder_horizon_s`. None: of none it is known.
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
        for name, (brought, row) in _ARRAYS.items():
            value = getattr(self, name)
            if value is not None or name not in _OPTIONAL:
                object.__setattr__(self, name, _rows(name, value, (n, *row), brought))
        for name in ("platforms", "names"):
            value = getattr(self, name)
            if isinstance(value, (str, bytes)) or not isinstance(value, (tuple, list, np.ndarray)):
                raise FleetError(f"{name} is {value!r}; give one per boat, or build the fleet by Fleet.of")
            if len(value) != n:
                raise FleetError(f"{name} has {len(value)} entries for {n} boats; give one per boat")
            object.__setattr__(self, name, tuple(value))

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
        heading_error_rad: ArrayLike | None = None,
        age_s: ArrayLike | None = None,
        position_error_m: ArrayLike | None = None,
        adversary_horizon_s: ArrayLike | None = None,
        visiting: ArrayLike | None = None,
    ) -> Fleet:
        """Fleet from plain arrays.

        Args:
            position_m: (n, 2) east and north, m, within 1e9 of the origin.
            heading_rad: (n,) clockwise from north, rad; any number of turns; or
            heading_deg: (n,) the same in deg.
            speed_mps: (n,) m/s, negative astern, at most 50 either way.
            team: (n,) integers.
            platforms: one platform for all, or n of them.
            controlled: (n,) bool; None: the boats of team 0.
            names: n names; None: boat_0, boat_1, ...
            thrust: (n,) thrust in percent where known, at most the platform's ``max_thrust`` either way, else NaN: of
                own boats it is then followed from what was sent; at first, and of others, it is taken from the speed.
            heading_error_rad: (n,) last error the heading controller saw where known, else NaN.
            age_s: (n,) age of each track, s, 0 to 3600; more than `ShieldConfig.max_track_age_s` is refused later.
            position_error_m: (n,) bound on the position error, m, 0 to 1000.
            adversary_horizon_s: (n,) how long each may do its worst as an opponent, s, 0 to inf; NaN: as the settings
            say.
            visiting: (n,) bool, boats on the other team's side, where they can tag nobody.

        Raises:
            FleetError: shapes do not fit together, a value cannot be used or is out of its range, two boats have the
                same name, or one is called "field".
            PlatformError: a platform is unknown.
        """
        position = _rows("position_m", position_m, (None, 2))
        n = len(position)
        state = np.zeros((n, L.N_STATE))
        state[:, L.X : L.Y + 1] = position
        state[:, L.SPEED] = _rows("speed_mps", speed_mps, (n,))
        state[:, L.THRUST] = np.nan if thrust is None else _rows("thrust", thrust, (n,))
        state[:, [L.SPEED_ERROR, L.HEADING_ERROR]] = np.nan
        if heading_error_rad is not None:
            error_rad = _rows("heading_error_rad", heading_error_rad, (n,))
            hint_at_headings("Fleet.of: heading_error_rad", error_rad, "give radians")
            state[:, L.HEADING_ERROR] = np.degrees(error_rad)
        with np.errstate(invalid="ignore"):  # infinite ones become NaN, which the check below names
            state[:, L.HEADING] = (_headings_deg(heading_rad, heading_deg, n) + 180.0) % 360.0 - 180.0
        hint_at_positions(position)
        teams = _rows("team", team, (n,), whole_numbers).copy()
        given = {
            "age_s": age_s,
            "position_error_m": position_error_m,
            "adversary_horizon_s": adversary_horizon_s,
            "visiting": visiting,
        }
        fleet = cls(
            state=state,
            team=teams,
            platforms=_kinds(platforms, n),
            controlled=teams == 0 if controlled is None else _rows("controlled", controlled, (n,), truths).copy(),
            names=tuple(f"boat_{i}" for i in range(n)) if names is None else _names(names),
            **{
                name: _rows(name, value, (n,), _ARRAYS[name][0]).copy()
                for name, value in given.items()
                if value is not None
            },
        )
        fleet.check()
        _check_given(fleet)
        return fleet

    def __len__(self) -> int:
        return len(self.state)

    def check(self) -> None:
        """Check values, which may have changed since the fleet was built.

        Raises:
            FleetError: a position, heading or speed is not finite or absurd, or an error bound is not a length.
        """
        if not sound(self.state):
            self._name_fault()
        if self.position_error_m is not None:
            remedy = "give a bound in m per boat, 0 to {:g}"
            _check_range(self, "position_error_m", self.position_error_m, 0.0, LARGEST, remedy)
        if self.adversary_horizon_s is not None:
            times_s = np.where(np.isnan(self.adversary_horizon_s), 0.0, self.adversary_horizon_s)
            remedy = "give s per boat, 0 to {:g}, or NaN where the settings say it"
            _check_range(self, "adversary_horizon_s", times_s, 0.0, np.inf, remedy)

    def _name_fault(self) -> None:
        """Raise for the first boat whose values cannot be used."""
        size = np.abs(self.state)
        bad = size > LARGEST
        bad[:, _SEEN] |= ~np.isfinite(size[:, _SEEN])
        bad[:, L.SPEED] |= size[:, L.SPEED] > LARGEST_SPEED_MPS
        i, column = np.argwhere(bad)[0]
        what = {L.X: "position", L.Y: "position", L.HEADING: "heading", L.SPEED: "speed"}.get(column, "memory")
        remedy = "give the last fix with its age_s; leave out boats that never had one"
        if what == "memory":
            remedy = "give NaN where it is unknown"
        elif np.isfinite(size[i, column]):
            remedy = {"speed": "give m/s, not mm/s or cm/s", "position": "give m from a place nearby"}.get(
                what, "give deg"
            )
        most = f"{LARGEST_SPEED_MPS:g} m/s" if what == "speed" else f"{LARGEST:g}"
        raise FleetError(
            f"{what} of boat {self.names[i]!r} is not finite or beyond {most} ({self.state[i, column]}); {remedy}"
        )

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


_ARRAYS: dict[str, tuple[Callable[[Any], Any], tuple[int, ...]]] = {
    "state": (numbers, (L.N_STATE,)),
    "team": (whole_numbers, ()),
    "controlled": (truths, ()),
    "age_s": (numbers, ()),
    "position_error_m": (numbers, ()),
    "driven": (numbers, (4,)),
    "adversary_horizon_s": (numbers, ()),
    "visiting": (truths, ()),
}
"""What brings each array to the type of compiled code, and the shape of a boat's row in it."""
_OPTIONAL = ("age_s", "position_error_m", "driven", "adversary_horizon_s", "visiting")


def _rows(name: str, value: Any, shape: tuple[int | None, ...], brought: Callable[[Any], Any] = numbers) -> Any:
    """Value as an array of that shape (None matches any length) that compiled code takes; nothing at all fits any.

    Raises:
        FleetError: it is none.
    """
    try:
        array = brought(value)
    except NoNumbersError as error:
        of = "True or False" if brought is truths else "whole numbers" if brought is whole_numbers else "numbers"
        raise FleetError(f"{name} is not an array of {of} ({error}); give one, see Fleet.of") from None
    if array.shape == (0,) and shape[0] in (None, 0):
        array = array.reshape(0, *(entry or 0 for entry in shape[1:]))
    if array.ndim != len(shape) or any(w not in (None, g) for w, g in zip(shape, array.shape, strict=True)):
        expected = tuple("n" if entry is None else entry for entry in shape)
        raise FleetError(f"{name} has shape {array.shape}; expected {expected}")
    return array


def _check_given(fleet: Fleet) -> None:
    """Check what a person gave: numbers that compiled code would take, but that say nothing, or are of other units.

    Of fleets that programs build these are not refused: a boat at sea is better kept clear of as well as may be.

    Raises:
        FleetError: one is out of its range.
    """
    if fleet.position_error_m is not None:
        remedy = "give a bound in m from 0 to {:g}, not in mm; leave out boats whose place is not known"
        _check_range(fleet, "position_error_m", fleet.position_error_m, 0.0, LARGEST_ERROR_M, remedy)
        hint_at_errors(fleet.position_error_m)
    if fleet.age_s is not None:
        remedy = "give seconds since its fix from 0 to {:g}, not the time of day, nor ms; leave out boats long gone"
        _check_range(fleet, "age_s", fleet.age_s, 0.0, LARGEST_AGE_S, remedy)
    thrusts = np.where(np.isnan(fleet.state[:, L.THRUST]), 0.0, fleet.state[:, L.THRUST])
    most = np.array([get_platform(kind).max_thrust for kind in fleet.platforms]) * (1.0 + 1e-6)  # of logs and float32
    remedy = "give percent up to {:g} either way, not the pulse in us, or NaN where it is unknown"
    _check_range(fleet, "thrust", thrusts, -most, most, remedy)
    if FIELD in fleet.names:
        raise FleetError(f"names holds {FIELD!r}, by which decisions name walls and edges; give that boat another")
    twins = sorted({name for name in fleet.names if fleet.names.count(name) > 1})
    if twins:
        raise FleetError(f"names holds {twins[0]!r} more than once; give every boat a name of its own")


def _check_range(fleet: Fleet, name: str, values: Array, low: Array | float, high: Array | float, remedy: str) -> None:
    """Raise for the first boat whose value is not within its range.

    Raises:
        FleetError: names the boat, the value and the ``remedy``, in which {} is its highest value.
    """
    bad = ~((values >= low) & (values <= high))
    if bad.any():
        i = int(np.argmax(bad))
        most = float(np.broadcast_to(high, bad.shape)[i])
        raise FleetError(f"{name} of boat {fleet.names[i]!r} is {values[i]:g}; {remedy.format(most)}")


def _headings_deg(heading_rad: ArrayLike | None, heading_deg: ArrayLike | None, n: int) -> Array:
    """Headings in deg, from whichever was given."""
    if heading_deg is not None and heading_rad is None:
        return _rows("heading_deg", heading_deg, (n,))
    if heading_rad is None or heading_deg is not None:
        raise FleetError("give either heading_rad or heading_deg, clockwise from north")
    found = _rows("heading_rad", heading_rad, (n,))
    hint_at_headings("Fleet.of: heading_rad", found, "give heading_deg")
    return np.degrees(found)


def _names(names: Sequence[str]) -> tuple[str, ...]:
    """Names, each a text with something in it."""
    if isinstance(names, (str, bytes)) or not isinstance(names, Iterable):
        raise FleetError(f"names is {names!r}; give a list of names, one for each boat")
    found = tuple(names)
    for name in found:
        if not isinstance(name, str) or not name:
            raise FleetError(f"names holds {name!r}; give a name, not empty, for each boat")
    return tuple(str(name) for name in found)


def _kinds(platforms: str | Platform | Sequence[str | Platform], n: int) -> tuple[str | Platform, ...]:
    """Platforms of n boats, each a known one."""
    if not isinstance(platforms, (str, Platform, Iterable)):
        raise FleetError(f"platforms is {platforms!r}; give a platform's name, or one for each boat")
    kinds = (platforms,) * n if isinstance(platforms, (str, Platform)) else tuple(platforms)
    for kind in kinds:
        if not isinstance(kind, (str, Platform)):
            raise FleetError(f"platforms holds {kind!r}; give names of platforms, or Platform objects")
        get_platform(kind)
    return tuple(get_platform(kind) if isinstance(kind, str) and is_path(kind) else kind for kind in kinds)
