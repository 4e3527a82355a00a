"""`Fleet`: all boats seen at one moment."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
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
            `barriers.foreseen`, unless they may be free before a backup ends, or are controlled.
        adversary_s: (n,) how long from now each may do its worst as an opponent before it holds its course, s; NaN, or
            None for all: as the settings say, see `ShieldConfig.adversary_s`; where that is 0 nobody is feared at all.
        visiting: (n,) boats on the other team's side of a field, where they can tag nobody: they are feared for
            `ShieldConfig.visitor_s`. None: of none it is known.
    """

    state: Array
    team: IntArray
    platforms: tuple[str | Platform, ...]
    controlled: BoolArray
    names: tuple[str, ...]
    age_s: Array | None = None
    position_error_m: Array | None = field(default=None)
    driven: Array | None = None
    adversary_s: Array | None = None
    visiting: BoolArray | None = None

    def __post_init__(self) -> None:
        """Bring arrays to the type and layout of compiled code; what cannot be is refused by `check`."""
        for name, brought in _FORMS.items():
            value = getattr(self, name)
            if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
                raise FleetError(f"{name} holds masked values; fill them in, or leave those boats out")
            if isinstance(value, (list, tuple)):
                brought = _FROM_LISTS.get(name, brought)
            if isinstance(value, (np.ndarray, list, tuple)):
                with suppress(NoNumbersError):
                    object.__setattr__(self, name, brought(value))
        for name in ("platforms", "names"):
            if isinstance(getattr(self, name), (list, np.ndarray)):
                object.__setattr__(self, name, tuple(getattr(self, name)))

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
        adversary_s: ArrayLike | None = None,
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
            adversary_s: (n,) how long each may do its worst as an opponent, s, 0 to inf; NaN: as the settings say.
            visiting: (n,) bool, boats on the other team's side, where they can tag nobody.

        Raises:
            FleetError: shapes do not fit together, a value cannot be used or is out of its range, two boats have the
                same name, or one is called "field".
            PlatformError: a platform is unknown.
        """
        position = _shaped("position_m", position_m, (None, 2))
        n = len(position)
        state = np.zeros((n, L.N_STATE))
        state[:, L.X : L.Y + 1] = position
        state[:, L.HEADING] = _headings_deg(heading_rad, heading_deg, n)
        state[:, L.SPEED] = _shaped("speed_mps", speed_mps, (n,))
        state[:, L.THRUST] = np.nan if thrust is None else _shaped("thrust", thrust, (n,))
        state[:, L.SPEED_ERROR] = np.nan
        state[:, L.HEADING_ERROR] = np.nan
        if heading_error_rad is not None:
            error_rad = _shaped("heading_error_rad", heading_error_rad, (n,))
            hint_at_headings("Fleet.of: heading_error_rad", error_rad, "give radians")
            state[:, L.HEADING_ERROR] = np.degrees(error_rad)
        with np.errstate(invalid="ignore"):  # infinite ones become NaN, which the check below names
            state[:, L.HEADING] = (state[:, L.HEADING] + 180.0) % 360.0 - 180.0
        hint_at_positions(position)
        teams = _whole("team", team, n)
        fleet = cls(
            state=state,
            team=teams,
            platforms=_kinds(platforms, n),
            controlled=teams == 0 if controlled is None else _yes_or_no("controlled", controlled, n),
            names=tuple(f"boat_{i}" for i in range(n)) if names is None else _names(names),
            age_s=_copied("age_s", age_s, n),
            position_error_m=_copied("position_error_m", position_error_m, n),
            adversary_s=_copied("adversary_s", adversary_s, n),
            visiting=None if visiting is None else _yes_or_no("visiting", visiting, n),
        )
        fleet.check()
        _check_given(fleet)
        if FIELD in fleet.names:
            raise FleetError(f"names holds {FIELD!r}, by which decisions name walls and edges; give that boat another")
        twins = sorted({name for name in fleet.names if fleet.names.count(name) > 1})
        if twins:
            raise FleetError(f"names holds {twins[0]!r} more than once; give every boat a name of its own")
        return fleet

    def __len__(self) -> int:
        return len(self.state)

    def check(self) -> None:
        """Check shapes and values.

        Raises:
            FleetError: shapes do not fit together, a position, heading or speed is not finite or absurd, or an error
                bound is not a length.
        """
        if not isinstance(self.state, np.ndarray):
            raise FleetError(f"state is of {type(self.state).__name__}; give an array, or build the fleet by Fleet.of")
        n = len(self.state) if self.state.ndim else 0
        if self.state.ndim != 2 or self.state.shape[1] != L.N_STATE or self.state.dtype != np.float64:
            raise FleetError(
                f"state has shape {self.state.shape} of {self.state.dtype}; give (n, {L.N_STATE}) of float64, see "
                "platforms.layout"
            )
        self._check_length("platforms", n)
        self._check_length("names", n)
        for name, kind, row in _ARRAYS:
            value = getattr(self, name)
            if value is None and name in _OPTIONAL:
                continue
            if not isinstance(value, np.ndarray) or value.dtype != kind or value.shape != (n, *row):
                self._refuse(name, kind, n)
        if not sound(self.state):
            self._name_fault()
        error = self.position_error_m
        if error is not None and not ((error >= 0.0) & (error <= LARGEST)).all():
            i = int(np.argmin((error >= 0.0) & (error <= LARGEST)))
            raise FleetError(
                f"position_error_m holds {error[i]} for boat {self.names[i]!r}: negative, not finite or beyond "
                f"{LARGEST:g}; give a bound in m per boat"
            )
        fear = self.adversary_s
        if fear is not None and (fear < 0.0).any():
            i = int(np.argmax(fear < 0.0))
            raise FleetError(
                f"adversary_s holds a negative time for boat {self.names[i]!r} ({fear[i]:g}); give s per boat, 0 to "
                "inf, or NaN where the settings say it"
            )

    def _check_length(self, name: str, n: int) -> None:
        value = getattr(self, name)
        flat = value.ndim == 1 if isinstance(value, np.ndarray) else hasattr(value, "__len__")
        if not flat or isinstance(value, (str, bytes)):
            raise FleetError(f"{name} is {value!r}; give one per boat, or build the fleet by Fleet.of")
        if len(value) != n:
            raise FleetError(f"{name} has {len(value)} entries for {n} boats; give one per boat")

    def _refuse(self, name: str, kind: np.dtype[Any], n: int) -> None:
        """Raise for an array that is not what compiled code takes."""
        value = getattr(self, name)
        if name == "controlled":
            self._check_length(name, n)
            found = getattr(value, "dtype", type(value).__name__)
            raise FleetError(f"controlled is of {found}; give an array of True or False per boat")
        if name != "driven":
            self._check_length(name, n)
        if not isinstance(value, np.ndarray):
            raise FleetError(f"{name} is of {type(value).__name__}; give an array, or build the fleet by Fleet.of")
        if name == "driven" and value.shape != (n, 4):
            raise FleetError(f"driven has shape {value.shape}; give ({n}, 4): speed m/s, x m, y m, time s")
        raise FleetError(f"{name} is of {value.dtype}; give {kind}, or build the fleet by Fleet.of")

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


def _laid_out(value: np.ndarray) -> np.ndarray:
    """The array in the layout of compiled code; its type stays what it is."""
    return np.require(np.asarray(value), None, ["C", "A", "W"])


_OPTIONAL = ("age_s", "position_error_m", "driven", "adversary_s", "visiting")

_ARRAYS: tuple[tuple[str, np.dtype[Any], tuple[int, ...]], ...] = (
    ("team", np.dtype(np.int64), ()),
    ("controlled", np.dtype(np.bool_), ()),
    ("age_s", np.dtype(np.float64), ()),
    ("position_error_m", np.dtype(np.float64), ()),
    ("driven", np.dtype(np.float64), (4,)),
    ("adversary_s", np.dtype(np.float64), ()),
    ("visiting", np.dtype(np.bool_), ()),
)
"""Type of each array but the state, and shape of a boat's row in it."""

_FORMS: dict[str, Callable[[Any], Any]] = {
    "state": _laid_out,
    "team": whole_numbers,
    "controlled": _laid_out,
    "age_s": numbers,
    "position_error_m": numbers,
    "driven": numbers,
    "adversary_s": numbers,
    "visiting": _laid_out,
}
_FROM_LISTS: dict[str, Callable[[Any], Any]] = {"state": numbers, "controlled": truths, "visiting": truths}


def _shaped(name: str, value: ArrayLike, shape: tuple[int | None, ...], bools: bool = False) -> Array:
    """Value as a float array of that shape (None matches any length); nothing at all fits any."""
    try:
        array = numbers(value, bools)
    except NoNumbersError as error:
        raise FleetError(f"{name} is not an array of numbers ({error})") from None
    if array.shape == (0,) and shape[0] in (None, 0):
        array = array.reshape(0, *(entry or 0 for entry in shape[1:]))
    fits = array.ndim == len(shape) and all(w is None or w == g for w, g in zip(shape, array.shape, strict=True))
    if not fits:
        wanted = tuple("n" if entry is None else entry for entry in shape)
        raise FleetError(f"{name} has shape {array.shape}; expected {wanted}")
    return array


def _check_given(fleet: Fleet) -> None:
    """Check what a person gave: numbers that compiled code would take, but that say nothing, or are of other units.

    Of fleets that programs build these are not refused: a boat at sea is better kept clear of as well as may be.

    Raises:
        FleetError: one is out of its range.
    """
    errors_m, ages_s, thrusts = fleet.position_error_m, fleet.age_s, fleet.state[:, L.THRUST]
    if errors_m is not None:
        within = "give a bound in m from 0 to {:g}, not in mm; leave out boats whose place is not known"
        _check_range(fleet, "position_error_m", errors_m, 0.0, np.full(len(fleet), LARGEST_ERROR_M), within)
        hint_at_errors(errors_m)
    if ages_s is not None:
        within = "give seconds since its fix from 0 to {:g}, not the time of day, nor ms; leave out boats long gone"
        _check_range(fleet, "age_s", ages_s, 0.0, np.full(len(fleet), LARGEST_AGE_S), within)
    most = np.array([get_platform(kind).max_thrust for kind in fleet.platforms])
    within = "give percent up to {:g} either way, not the pulse in us, or NaN where it is unknown"
    rounded = most + 1e-6 * most  # of logs and float32
    _check_range(fleet, "thrust", np.where(np.isnan(thrusts), 0.0, thrusts), -rounded, rounded, within)


def _check_range(fleet: Fleet, name: str, values: Array, low: Array | float, high: Array, remedy: str) -> None:
    """Raise for the first boat whose value is not within its range.

    Raises:
        FleetError: names the boat, the value and the ``remedy``, in which {} is its highest value.
    """
    for i in np.flatnonzero(~((values >= low) & (values <= high)))[:1]:
        raise FleetError(f"{name} of boat {fleet.names[i]!r} is {values[i]:g}; {remedy.format(high[i])}")


def _copied(name: str, value: ArrayLike | None, n: int) -> Array | None:
    """Values of n boats that the fleet keeps, if there are any."""
    return None if value is None else _shaped(name, value, (n,)).copy()


def _headings_deg(heading_rad: ArrayLike | None, heading_deg: ArrayLike | None, n: int) -> Array:
    """Headings in deg, from whichever was given."""
    if heading_deg is not None and heading_rad is None:
        return _shaped("heading_deg", heading_deg, (n,))
    if heading_rad is None or heading_deg is not None:
        raise FleetError("give either heading_rad or heading_deg, clockwise from north")
    found = _shaped("heading_rad", heading_rad, (n,))
    hint_at_headings("Fleet.of: heading_rad", found, "give heading_deg")
    return np.degrees(found)


def _names(names: Sequence[str]) -> tuple[str, ...]:
    """Names, each a text with something in it."""
    if isinstance(names, (str, bytes)):
        raise FleetError(f"names is the text {names!r}; give a list of names, one for each boat")
    if not isinstance(names, Iterable):
        raise FleetError(f"names is {names!r}; give a list of names, one for each boat")
    found = tuple(names)
    for name in found:
        if not isinstance(name, str) or not name:
            raise FleetError(f"names holds {name!r}; give a name, not empty, for each boat")
    return tuple(str(name) for name in found)


def _kinds(platforms: str | Platform | Sequence[str | Platform], n: int) -> tuple[str | Platform, ...]:
    """Platforms of n boats, each a known one."""
    if platforms is None:
        raise FleetError("platforms is None; give a platform's name, or one for each boat")
    if not isinstance(platforms, (str, Platform, Iterable)):
        raise FleetError(f"platforms is {platforms!r}; give a platform's name, or one for each boat")
    kinds = (platforms,) * n if isinstance(platforms, (str, Platform)) else tuple(platforms)
    for kind in kinds:
        if not isinstance(kind, (str, Platform)):
            raise FleetError(f"platforms holds {kind!r}; give names of platforms, or Platform objects")
        get_platform(kind)
    return tuple(get_platform(kind) if isinstance(kind, str) and is_path(kind) else kind for kind in kinds)


def _yes_or_no(name: str, value: ArrayLike, n: int) -> BoolArray:
    """Values as booleans; what is neither true nor false, as NaN, is refused."""
    _shaped(name, value, (n,), bools=True)
    try:
        return truths(value).reshape(n).copy()
    except NoNumbersError as error:
        raise FleetError(f"{name} holds {error}") from None


def _whole(name: str, values: ArrayLike, n: int) -> IntArray:
    """Values of n boats as integers; fractions, NaN and what 64 bits do not hold are refused."""
    _shaped(name, values, (n,), bools=True)
    try:
        return whole_numbers(values).reshape(n).copy()
    except NoNumbersError as error:
        raise FleetError(f"{name} holds {error}") from None
