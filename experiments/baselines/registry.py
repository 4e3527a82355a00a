"""Safety filters by name, as ``--filter`` takes them: the shield, and filters of the literature."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from steerclear.shield.batch import BatchedShield
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.surroundings import OPEN_WATER, Surroundings

from .barriers import BARRIERS
from .own_filters import check_maker, made_filter
from .plcbf import PolicyLibrary
from .reach import ReachFilter
from .rollouts import Gatekeeper
from .textbook import TextbookFilter

if TYPE_CHECKING:
    from ..encounters.scene import Conditions, Scenes

NONE, SHIELD, REACH = "none", "shield", "reach"
GIVEN = {
    "separation_m": "--separation",
    "position_error_m": "--noise",
    "delay_s": "--delay",
    "current_mps": "--current",
    "dt_s": "no option",
}
"""Settings that follow from the conditions of a run."""


class SafetyFilter(Protocol):
    """Protocol of a filter of the commands of a batch of games; the batched shield is one."""

    @property
    def reason(self) -> IntArray:
        """(B, n) values of `Reason`, of the last decision."""
        ...

    @property
    def safety_margin_m(self) -> Array:
        """(B, n) margin left, m, of the last decision; inf where no boat is near."""
        ...

    def decide(self, state: Array, nominal: Array, ours: BoolArray) -> Array:
        """Return commands (B, n, 2), speed m/s and relative heading deg, for the boats of ``ours`` (B, n)."""
        ...


FilterMaker = Callable[[ShieldConfig, int, tuple[str, ...], tuple[int, ...], Surroundings], SafetyFilter]
"""Makes a safety filter from settings, number of games, platforms, teams and static constraints."""


class NoFilter:
    """Filter that passes every command."""

    def __init__(self, games: int, boats: int) -> None:
        self.reason = np.zeros((games, boats), np.int64)
        self.safety_margin_m = np.full((games, boats), np.inf)

    def decide(self, state: Array, nominal: Array, ours: BoolArray) -> Array:
        """Return the nominal commands themselves."""
        return nominal


class Entry(NamedTuple):
    """A named filter, made from the arguments of a `FilterMaker` and the settings given with the name.

    ``check`` rejects bad settings (None: the filter takes none); ``of_config``: they are settings of `ShieldConfig`.
    """

    make: Callable[..., SafetyFilter]
    check: Callable[[dict[str, Any]], object] | None = None
    of_config: bool = False


def _rollouts(kind: Any, name: str) -> Entry:
    return Entry(lambda *fleet: kind(name, *fleet[:4], fleet[5]), partial(kind.read_settings, name))


FILTERS: dict[str, Entry] = {
    NONE: Entry(lambda config, games, platforms, team, around, settings: NoFilter(games, len(team))),
    SHIELD: Entry(lambda *fleet: BatchedShield(*fleet[:5]), lambda given: ShieldConfig.of(**given), True),
    REACH: Entry(lambda *fleet: ReachFilter(*fleet[:4]), ReachFilter.check_settings, True),
    **{name: _rollouts(Gatekeeper, name) for name in ("gatekeeper", "gatekeeper-worst")},
    "pl-cbf": _rollouts(PolicyLibrary, "pl-cbf"),
    **{name: Entry(lambda *fleet, name=name: TextbookFilter(name, *fleet[:4])) for name in BARRIERS},
}
"""Every filter by name; each entry is a value of ``--filter``."""


def parse_filters(text: str) -> list[str]:
    """Split names of filters at commas; ``shield:a=1,b=2,none`` is two: a piece ``b=2`` belongs to the name before it.

    Raises:
        ConfigError: no name, an unknown one, or settings that the filter rejects.
    """
    names = [piece for piece in re.split(r",(?!\w+=)", "".join(text.split())) if piece]
    if not names:
        raise ConfigError("--filter names no safety filter; give none, shield, or one of those of the literature")
    for name in names:
        check_filter(name)
    return names


def check_filter(name: str) -> None:
    """Check a filter's name and settings.

    Raises:
        ConfigError: see `parse_filters`.
    """
    base, settings = split_name(name)
    if base not in FILTERS:
        raise ConfigError(f"unknown safety filter {base!r}; choose from {', '.join(FILTERS)}")
    check = FILTERS[base].check
    if check is not None:
        check(settings)
    elif settings:
        names = ", ".join(one for one, entry in FILTERS.items() if entry.check)
        raise ConfigError(f"{base!r} takes no settings; only {names} do, as in shield:KEY=VALUE,...")


def is_shield(name: str) -> bool:
    """Return whether a filter is the shield, with any settings."""
    return name.partition(":")[0] == SHIELD


def split_name(name: str) -> tuple[str, dict[str, Any]]:
    """Split ``shield:KEY=VALUE,...`` into the name and the settings; values are JSON or words.

    Raises:
        ConfigError: a setting without a value, or one that follows from the conditions.
    """
    base, _, rest = name.partition(":")
    settings: dict[str, Any] = {}
    for piece in filter(None, rest.split(",")):
        key, equals, value = piece.partition("=")
        if not equals:
            raise ConfigError(f"{piece!r} in filter {name!r} has no value; write {base}:KEY=VALUE,...")
        if key in GIVEN:
            raise ConfigError(f"{key} of filter {name!r} follows from the run; set it with {GIVEN[key]}")
        try:
            settings[key] = json.loads(value)
        except json.JSONDecodeError:
            settings[key] = float(value) if value in ("inf", "-inf", "nan") else value
    return base, settings


def build_filter(safety_filter: str | FilterMaker, scenes: Scenes, conditions: Conditions) -> SafetyFilter:
    """Build the filter with a name, or call a maker, for a batch of scenes; conditions become settings.

    Raises:
        ConfigError: an unknown name, what makes no filter, or a filter that cannot honour the conditions.
    """
    check_maker(safety_filter)
    base, settings = split_name(safety_filter) if isinstance(safety_filter, str) else ("", {})
    if isinstance(safety_filter, str):
        check_filter(safety_filter)
    config = ShieldConfig.of(
        separation_m=conditions.radius_m,
        position_error_m=conditions.noise_m,
        delay_s=conditions.delay_s,
        current_mps=conditions.current_mps,
        dt_s=scenes.dt_s,
        **(settings if not base or FILTERS[base].of_config else {}),
    )
    around = OPEN_WATER if scenes.field is None else Surroundings(field=scenes.field)
    fleet = (config, scenes.games, scenes.platforms, tuple(scenes.team.tolist()), around)
    return made_filter(safety_filter, fleet) if callable(safety_filter) else FILTERS[base].make(*fleet, settings)
