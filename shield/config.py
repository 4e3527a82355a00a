"""`ShieldConfig`: every setting of the shield, with its unit, validated at construction."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import Field, dataclass, field, fields
from difflib import get_close_matches
from numbers import Real
from typing import Any, NamedTuple

from .exceptions import ConfigError
from .renamed import PROFILES as OLD_PROFILES
from .renamed import SETTING_PROPERTIES, SETTINGS, accepts_old_names, warn

COORDINATION = ("team", "per_boat")
PROFILES = {"competitive": (12.0, 7.0), "ramming": (math.inf, math.inf), "constant_velocity": (0.0, 0.0)}
"""`ShieldConfig.adversary_horizon_s` and `intruder_horizon_s` of each profile, s."""


class DefaultDistance(float):
    """A distance that nobody chose: a game's own replaces it if larger. It stays one in copies of settings."""


class Range(NamedTuple):
    """Numbers that a setting accepts; ``low`` itself unless it must be ``above`` it."""

    low: float
    high: float
    above: bool


def _number(default: float | None, high: float = math.inf, low: float = 0.0, above: bool = False) -> Any:
    """Return a setting that is a number within a range; those annotated so may be None as well."""
    return field(default=default, metadata={"range": Range(low, high, above)})


@accepts_old_names(SETTINGS, SETTING_PROPERTIES)
@dataclass(frozen=True)
class ShieldConfig:
    """Settings of the shield, each with its unit in its name; the page of settings says more of each and what it costs.

    The range of a number is in its field's metadata: values for which a decision can be made at all. Longer times cost
    memory and work, and what is farther off is a guess. A larger cap of margins would outweigh the field's edge.
    Lengths and speeds beyond their range are in other units, such as mm for m. Settings without an upper end may be
    inf.

    If nobody gives ``separation_m`` or ``obstacle_clearance_m``, a wrapper or `games_shield` uses the distance at
    which its game counts a collision, or the radius of its boats, if that is larger.

    Raises:
        ConfigError: a value is of the wrong type, not finite or out of range.
    """

    separation_m: float = _number(DefaultDistance(2.5), 1000.0, above=True)  # required distance between boat centres
    buffer_m: float = _number(0.05, 50.0)  # added to the separation for rounding and sampling
    dt_s: float = _number(0.1, 2.0, 0.01)  # step of the decision loop,
    move_s: float | None = _number(None, 1.0, 0.01)  # and of the boat model, if a command is held for several
    opponent_model: str = "auto"  # how opponents are predicted, see `backup.family.OPPONENT_MODELS`
    coordination: str = "team"  # one decision for all own boats; "per_boat": one each, for boats that cannot talk
    solver: str = "active_set"  # of the QP: this one (a historical name) is compiled, others are of qpsolvers
    adversary_horizon_s: float | None = _number(None)  # how long an opponent is adversarial; None: the profile's
    intruder_horizon_s: float | None = _number(None)  # the same for one on our side, which can tag nobody there
    profile: str = "competitive"  # kind of opponents, see `PROFILES`
    cbf_rate_per_s: float = _number(1.0, above=True)  # class-K rate alpha; inf lets a margin fall to 0
    table_cbf_rate_per_s: float = _number(0.3, above=True)  # where opponents are looked up in value tables
    static_cbf_rate_per_s: float = _number(2.0, above=True)  # from the edge, obstacles and circles
    deadlock_timeout_s: float = _number(3.0, above=True)  # how long a teammate may keep a boat from turning
    table_margin_m: float = _number(0.45, 50.0)  # added to the separation where a value table is looked up
    margin_cap_m: float = _number(2.0, 50.0)  # margins above this shrink freely,
    teammate_margin_cap_m: float = _number(0.2, 50.0)  # and from teammates whose motion is known
    straight_horizon_s: float = _number(5.0, 60.0)  # how long courses continue straight beyond the horizon
    horizon_s: float | None = _number(None, 120.0, above=True)  # of backups; None: a half turn's time and 4 s
    work_budget: float = _number(200_000.0, low=1e3)  # clearances after which a decision searches no further
    min_backup_hold_s: float = _number(0.4, 10.0)  # least time on a backup, of boats that turn at once
    speed_weight: float = _number(0.1, 1e6, above=True)  # cost of changing the speed by top speed; full rudder: 1
    position_error_m: float = _number(0.0, 100.0)  # bound on the error of every reported position
    current_mps: float = _number(0.0, 10.0)  # bound on the speed of a current of unknown direction
    track_error_mps: float = _number(0.5, 50.0)  # growth of a neighbour's position error with the age of its track
    max_track_age_s: float = _number(2.0)  # tracks older than this are refused
    delay_s: float = _number(0.0, 10.0)  # time from decision to effect, rounded up to whole steps
    edge_m: float | None = _number(0.2, 200.0)  # clearance from the field edge; None: the edge is ignored
    beyond_m: float | None = _number(None, 1000.0)  # how far outside the edge the hard line lies; None: there is none
    beyond_then: str = "flee"  # or "stop": a boat beyond the hard line, and before obstacles, see `filter.last_line`
    obstacle_clearance_m: float = _number(DefaultDistance(1.0), 200.0)  # clearance from walls of obstacles
    barriers: tuple[str, ...] = ()  # names of registered barriers in force; in one text joined by "+"

    def __post_init__(self) -> None:
        from .backup.family import OPPONENT_MODELS
        from .filter.program import check_solver

        object.__setattr__(self, "barriers", _barriers(self.barriers))
        for entry in fields(self):
            value = getattr(self, entry.name)
            if "range" in entry.metadata:
                object.__setattr__(self, entry.name, _checked(entry, value))
            elif entry.name != "barriers" and not isinstance(value, str):
                raise ConfigError(f"{entry.name} is {value!r}; give a name")
        if self.profile in OLD_PROFILES:
            warn(self.profile, OLD_PROFILES[self.profile])
            object.__setattr__(self, "profile", OLD_PROFILES[self.profile])
        choices: dict[str, Iterable[str]] = {"profile": PROFILES, "opponent_model": OPPONENT_MODELS}
        for name, known in (choices | {"coordination": COORDINATION, "beyond_then": ("flee", "stop")}).items():
            if getattr(self, name) not in known:
                raise ConfigError(f"unknown {name} {getattr(self, name)!r}; choose one of {', '.join(known)}")
        check_solver(self.solver)
        if self.move_s is not None and abs(self.moves - self.dt_s / self.move_s) > 1e-6:
            raise ConfigError(f"dt_s is {self.dt_s:g}, no whole number of moves of {self.move_s:g} s (move_s)")

    @property
    def model_s(self) -> float:
        """Step of the boat model, s."""
        return self.dt_s if self.move_s is None else self.move_s

    @property
    def moves(self) -> int:
        """Steps of the boat model in a step of the decision loop."""
        return max(1, round(self.dt_s / self.model_s))

    @property
    def effective_adversary_horizon_s(self) -> float:
        """How long an opponent is adversarial, s: `adversary_horizon_s`, or the profile's."""
        return PROFILES[self.profile][0] if self.adversary_horizon_s is None else self.adversary_horizon_s

    @property
    def effective_intruder_horizon_s(self) -> float:
        """The same for opponents on our side of the field, s."""
        if self.intruder_horizon_s is not None:
            return self.intruder_horizon_s
        return PROFILES[self.profile][1] if self.adversary_horizon_s is None else self.adversary_horizon_s

    def is_chosen(self, name: str) -> bool:
        """Return whether somebody chose this setting; False is known only of distances that a game may choose."""
        return not isinstance(getattr(self, name), DefaultDistance)

    @classmethod
    def of(cls, **settings: Any) -> ShieldConfig:
        """Build from keyword settings; for an unknown key the error names the nearest known one.

        Raises:
            ConfigError: unknown key, or a bad value.
        """
        known = [entry.name for entry in fields(cls)]
        for key in settings:
            if key not in known:
                near = get_close_matches(key, known, 1)
                hint = f"did you mean {near[0]!r}?" if near else f"known settings: {', '.join(known)}"
                raise ConfigError(f"unknown shield setting {key!r}; {hint}")
        return cls(**settings)


def _barriers(barriers: object) -> tuple[str, ...]:
    """Return names of registered barriers, each once."""
    from .barriers.registry import get_barrier

    names = [name for name in barriers.split("+") if name] if isinstance(barriers, str) else barriers
    if not isinstance(names, (list, tuple)) or not all(isinstance(name, str) for name in names):
        raise ConfigError(f"barriers is {barriers!r}; give names of registered barriers, as ('ferry',)")
    for name in names:
        get_barrier(name)
    return tuple(dict.fromkeys(names))


_UNITS = {"per_s": "1/s", "mps": "m/s", "m": "m", "s": "s", "budget": "clearances"}
"""Unit of a setting by the end of its name."""


def _checked(entry: Field[Any], value: Any) -> float | None:
    """Return a number within its range as a float, the type that compiled code takes."""
    name, (low, high, above) = entry.name, entry.metadata["range"]
    if value is None and entry.type == "float | None":
        return None
    if isinstance(value, bool) or not isinstance(value, Real) or value != value:
        raise ConfigError(f"{name} is {value!r}; give a number")
    try:
        number = value if isinstance(value, DefaultDistance) else float(value)
    except OverflowError:
        raise ConfigError(f"{name} is too large; give a finite number") from None
    if not low <= number <= high or (above and number == low):
        unit = next((unit for end, unit in _UNITS.items() if name.endswith(f"_{end}")), "")
        small = unit in ("m", "s") and 2.0 * high <= number < math.inf
        hint = f" (if that is m{unit}, give {number / 1000.0:g})" if small else ""
        first = f"more than {low:g} and at most" if above else f"{low:g} to"
        raise ConfigError(f"{name} is {value}{hint}; give {first} {high:g} {unit}".rstrip())
    return number
