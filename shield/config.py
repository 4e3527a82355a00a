"""`ShieldConfig`: every setting of the shield, with its unit, validated when built."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from difflib import get_close_matches
from numbers import Integral, Real
from typing import Any

from .exceptions import ConfigError
from .renamed import PROFILES as OLD_PROFILES
from .renamed import SETTING_PROPERTIES, SETTINGS, accepts_old_names, warn

COORDINATION = ("team", "per_boat")
BEYOND_THEN = ("flee", "stop")


PROFILES = {"competitive": (12.0, 7.0), "ramming": (math.inf, math.inf), "constant_velocity": (0.0, 0.0)}
"""`ShieldConfig.adversary_horizon_s` and `intruder_horizon_s` of each profile, s."""


class Unsaid(float):
    """A distance that nobody chose: a game's own, if larger, takes its place. It stays one in copies of settings."""


@accepts_old_names(SETTINGS, SETTING_PROPERTIES)
@dataclass(frozen=True)
class ShieldConfig:
    """Settings of the shield.

    Numbers are finite and at least 0 where nothing else is said; what stands in `RANGES` is refused beyond it.

    Attributes:
        separation_m: distance to keep between boat centres, m. Where nobody gives it, a wrapper or `games_shield` takes
            the distance at which its game counts a collision, if that is larger.
        buffer_m: added to the separation for rounding and sampling, m.
        dt_s: step of the decision loop, s, and of the boat model where ``move_s`` is None.
        move_s: step of the boat model, s, where a command is held for several: ``dt_s`` is a whole number of them, in
            each of which the same relative heading is applied anew; None: a command is for one.
        opponent_model: how opponents are predicted, see `backup.family.CERTIFICATES`.
        coordination: "team" solves one program for all boats of ours, "per_boat" one for each boat, which assumes
            that teammates hold course and take their share of the answer (for boats that cannot talk).
        solver: what solves the program: "active_set" (a historical name), Hildreth's projection, compiled, or a backend
            by its name in qpsolvers.
        adversary_horizon_s: how long from now an opponent may do its worst, before it holds its course, s; 0: it holds
            its course from now on; inf: for ever. None takes the profile's. The longer, the more is promised, and of
            slow boats the more commands are changed. Against a boat that is slow it counts from when that is under
            way, see `barriers.value_function`.
        profile: what the opponents are taken for, see `PROFILES`: "competitive" teams, boats that are "ramming", or
            traffic of "constant_velocity".
        intruder_horizon_s: the same of an opponent on our side of the field, which can tag nobody there
            (`Fleet.visiting`), s; None takes ``adversary_horizon_s``, or the profile's where that is None as well.
        cbf_rate_per_s: class-K rate alpha: a margin may shrink by exp(-alpha dt) per step; inf lets it fall to 0.
        table_cbf_rate_per_s: the same for boats whose opponents are looked up in value tables.
        static_cbf_rate_per_s: the same of margins from the edge, obstacles and circles.
        deadlock_timeout_s: time a teammate alongside may keep one from turning where it wants before one of the two
            gives way, s; inf never.
        table_margin_m: added to the separation where a value table is looked into, for its own error, m.
        margin_cap_m: margins above this shrink freely and are told as this much, or as infinite where nobody can come
            near, m, at most 50.
        teammate_margin_cap_m: the same of margins from teammates whose backups are known: one program decides for all
            (coordination "team"), positions are exact, commands act at once and no current is feared; and opponents
            are feared (as pursuers or by tables), whose own margins are kept beside. Else `margin_cap_m` holds for
            them.
        straight_horizon_s: how long courses are run on straight beyond the horizon, s.
        horizon_s: length of backup manoeuvres, s; None takes the time of a half turn plus 4 s per platform.
        work_budget: what a decision may cost before it searches no further, in clearances of one path from one boat,
            0.2 to 1 microsecond each; it then sends the best that it has verified and says so
            (`Decision.cut_short`). Counted in work, so that the same inputs give the same bits on any machine; at least
            1000, which lets six boats look at every manoeuvre; inf: no limit.
        min_backup_hold_s: least time for which boats of kind "rate", which turn at once, carry on with a backup from
            opponents that keep them short of `margin_cap_m`; 0: none. Other boats' autopilots smooth what they are
            told.
        speed_weight: cost of changing the commanded speed by top speed; centring a full rudder costs 1.
        position_error_m: bound on the error of every reported position, m; widens the separation twice, and once
            what is kept from the edge, obstacles and circles.
        current_mps: bound on the speed of a current or of drift by wind, m/s, whose direction is not known; widens what
            is kept from the edge, obstacles and circles, the more the later. Boats near each other drift alike.
        track_error_mps: growth of a neighbour's position error with the age of its track, m/s.
        max_track_age_s: tracks older than this are refused, s.
        delay_s: time from decision to effect, s, rounded up to whole steps: boats are run on by it before deciding.
        edge_m: distance to keep from the field edge, m; None: the edge is not kept.
        beyond_m: how far outside the field's edge its hard line lies, m; None: there is none.
        beyond_then: what becomes of a boat beyond the hard line: "flee" lets it go on to keep clear of others, "stop"
            stops it there, and before obstacles, whatever else is in its way, see `filter.last_line`.
        obstacle_clearance_m: distance to keep from walls of obstacles, m. Where nobody gives it, a wrapper or
            `games_shield` takes the radius of its game's boats, if that is larger and there are obstacles.
        barriers: names of registered barriers that are kept as obstacles are, see `barriers.registry.register_barrier`;
            in one text joined by "+".

    Raises:
        ConfigError: a value is of the wrong type, not finite or out of range.
    """

    separation_m: float = Unsaid(2.5)
    buffer_m: float = 0.05
    dt_s: float = 0.1
    move_s: float | None = None
    opponent_model: str = "auto"
    coordination: str = "team"
    solver: str = "active_set"
    adversary_horizon_s: float | None = None
    intruder_horizon_s: float | None = None
    profile: str = "competitive"
    cbf_rate_per_s: float = 1.0
    table_cbf_rate_per_s: float = 0.3
    static_cbf_rate_per_s: float = 2.0
    deadlock_timeout_s: float = 3.0
    table_margin_m: float = 0.45
    margin_cap_m: float = 2.0
    teammate_margin_cap_m: float = 0.2
    straight_horizon_s: float = 5.0
    horizon_s: float | None = None
    work_budget: float = 200_000.0
    min_backup_hold_s: float = 0.4
    speed_weight: float = 0.1
    position_error_m: float = 0.0
    current_mps: float = 0.0
    track_error_mps: float = 0.5
    max_track_age_s: float = 2.0
    delay_s: float = 0.0
    edge_m: float | None = 0.2
    beyond_m: float | None = None
    beyond_then: str = "flee"
    obstacle_clearance_m: float = Unsaid(1.0)
    barriers: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        from .backup.family import CERTIFICATES
        from .filter.program import check_solver

        object.__setattr__(self, "barriers", _names(self.barriers))
        for entry in fields(self):
            value = getattr(self, entry.name)
            _check_number(entry.name, value)
            if isinstance(value, Real) and not isinstance(value, Unsaid):  # compiled code knows numbers by their kind
                object.__setattr__(self, entry.name, float(value))
        if self.profile in OLD_PROFILES:
            warn(self.profile, OLD_PROFILES[self.profile])
            object.__setattr__(self, "profile", OLD_PROFILES[self.profile])
        if self.profile not in PROFILES:
            raise ConfigError(f"unknown profile {self.profile!r}; choose one of {', '.join(PROFILES)}")
        if self.opponent_model not in CERTIFICATES:
            raise ConfigError(
                f"unknown opponent_model {self.opponent_model!r}; choose one of {', '.join(CERTIFICATES)}"
            )
        if self.coordination not in COORDINATION:
            raise ConfigError(f"unknown coordination {self.coordination!r}; choose one of {', '.join(COORDINATION)}")
        if self.beyond_then not in BEYOND_THEN:
            raise ConfigError(f"unknown beyond_then {self.beyond_then!r}; choose one of {', '.join(BEYOND_THEN)}")
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
        """How long an opponent may do its worst, s: `adversary_horizon_s`, or the profile's."""
        return PROFILES[self.profile][0] if self.adversary_horizon_s is None else self.adversary_horizon_s

    @property
    def effective_intruder_horizon_s(self) -> float:
        """The same of opponents on our side of the field, s."""
        if self.intruder_horizon_s is not None:
            return self.intruder_horizon_s
        return PROFILES[self.profile][1] if self.adversary_horizon_s is None else self.adversary_horizon_s

    def said(self, name: str) -> bool:
        """Whether somebody chose this setting; only of distances that a game may choose it is known that nobody did."""
        return not isinstance(getattr(self, name), Unsaid)

    @classmethod
    def of(cls, **settings: Any) -> ShieldConfig:
        """Build from keyword settings; an unknown key is an error that names the nearest known one.

        Raises:
            ConfigError: unknown key, or a bad value.
        """
        known = [entry.name for entry in fields(cls)]
        for key in settings:
            if key not in known:
                near = get_close_matches(key, known, 1)
                hint = f"; did you mean {near[0]!r}?" if near else f"; known settings: {', '.join(known)}"
                raise ConfigError(f"unknown shield setting {key!r}{hint}")
        return cls(**settings)


def _names(barriers: object) -> tuple[str, ...]:
    """Names of registered barriers, each once."""
    from .barriers.registry import get_barrier

    names = [name for name in barriers.split("+") if name] if isinstance(barriers, str) else barriers
    if not isinstance(names, (list, tuple)) or not all(isinstance(name, str) for name in names):
        raise ConfigError(f"barriers is {barriers!r}; give names of registered barriers, as ('ferry',)")
    for name in names:
        get_barrier(name)
    return tuple(dict.fromkeys(names))


_TEXTS = {"beyond_then", "opponent_model", "coordination", "profile", "solver"}
_RATES = {"cbf_rate_per_s", "table_cbf_rate_per_s", "static_cbf_rate_per_s"}
_POSITIVE = _RATES | {
    "work_budget",
    "deadlock_timeout_s",
    "separation_m",
    "dt_s",
    "move_s",
    "speed_weight",
    "horizon_s",
}
RANGES = {
    "separation_m": (0.0, 1000.0),
    "buffer_m": (0.0, 50.0),
    "obstacle_clearance_m": (0.0, 200.0),
    "edge_m": (0.0, 200.0),
    "beyond_m": (0.0, 1000.0),
    "position_error_m": (0.0, 100.0),
    "table_margin_m": (0.0, 50.0),
    "current_mps": (0.0, 10.0),
    "track_error_mps": (0.0, 50.0),
    "speed_weight": (0.0, 1e6),
    "margin_cap_m": (0.0, 50.0),
    "teammate_margin_cap_m": (0.0, 50.0),
    "dt_s": (0.01, 2.0),
    "move_s": (0.01, 1.0),
    "horizon_s": (0.0, 120.0),
    "straight_horizon_s": (0.0, 60.0),
    "min_backup_hold_s": (0.0, 10.0),
    "delay_s": (0.0, 10.0),
    "work_budget": (1e3, math.inf),
}
"""What a decision can be made for at all: with times memory and work grow, and what is farther off is a guess; a larger
cap of margins would weigh more than the field's edge. Lengths and speeds beyond theirs are of other units, as mm for m:
the water would be closed."""
_UNITS = {"m": ("mm", "m"), "s": ("ms", "s"), "mps": ("mm/s", "m/s"), "weight": ("", ""), "budget": ("", "clearances")}
"""By the end of a setting's name: the unit a thousand times smaller in which it may have been given, and its own."""
_MAY_BE_NONE = {"adversary_horizon_s", "intruder_horizon_s", "move_s", "horizon_s", "edge_m", "beyond_m"}
_MAY_BE_INFINITE = _RATES | {
    "adversary_horizon_s",
    "intruder_horizon_s",
    "max_track_age_s",
    "deadlock_timeout_s",
    "work_budget",
}


def _check_number(name: str, value: object) -> None:
    """Numbers are finite (where not said otherwise) and >= 0, or > 0 where zero makes no sense."""
    if name == "barriers":
        return
    if name in _TEXTS:
        if not isinstance(value, str):
            raise ConfigError(f"{name} is {value!r}; give a name")
        return
    if value is None and name in _MAY_BE_NONE:
        return
    if isinstance(value, bool) or not isinstance(value, Real) or value != value:
        raise ConfigError(f"{name} is {value!r}; give a number")
    if isinstance(value, Integral) and abs(int(value)) > 1e300:  # no float holds it
        raise ConfigError(f"{name} is too large; give a finite number")
    number = float(value)
    if math.isinf(number) and name not in _MAY_BE_INFINITE:
        raise ConfigError(f"{name} is {value}; give a finite number")
    if number < 0 or (number == 0 and name in _POSITIVE):
        bound = "> 0" if name in _POSITIVE else ">= 0"
        raise ConfigError(f"{name} is {value}; it must be {bound}")
    low, high = RANGES.get(name, (0.0, math.inf))
    if not low <= number <= high:
        first = "more than 0 and at most" if name in _POSITIVE and low == 0.0 else f"{low:g} to"
        unit = name.rsplit("_")[-1]
        small, unit = _UNITS.get(unit, ("", unit))
        words = f" (if that is {small}, give {number / 1000.0:g})" if small and number >= 2.0 * high else ""
        raise ConfigError(f"{name} is {value}{words}; give {first} {high:g} {unit}".rstrip())
