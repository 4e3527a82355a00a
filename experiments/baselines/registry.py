"""Safety filters by name, as ``--guard`` takes them: ``none``, ``shield``, ``reach``, by rollouts, textbook filters."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from functools import cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from steerclear.shield.batch import BatchedShield
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.surroundings import OPEN_WATER, Surroundings

if TYPE_CHECKING:
    from ..encounters.scene import Conditions, Scenes

NONE, SHIELD, REACH = "none", "shield", "reach"
GIVEN = {
    "separation_m": "--radius",
    "position_error_m": "--noise",
    "delay_s": "--delay",
    "current_mps": "--current",
    "dt_s": "no option",
}
"""Settings that the conditions of a run decide."""


class Guard(Protocol):
    """What filters the commands of a batch of games; the batched shield is one."""

    @property
    def reason(self) -> IntArray:
        """(B, n) values of `Reason`, of the last decision."""
        ...

    @property
    def safety_margin_m(self) -> Array:
        """(B, n) margin left, m, of the last decision; inf where nobody is near."""
        ...

    def decide(self, state: Array, wanted: Array, ours: BoolArray) -> Array:
        """Commands (B, n, 2), speed m/s and relative heading deg, for the boats of ``ours`` (B, n)."""
        ...


GuardMaker = Callable[[ShieldConfig, int, tuple[str, ...], tuple[int, ...], Surroundings], Guard]
"""From settings, games, platforms, teams and static constraints to a guard."""


class NoGuard:
    """Passes every command."""

    def __init__(self, games: int, boats: int) -> None:
        self.reason = np.zeros((games, boats), np.int64)
        self.safety_margin_m = np.full((games, boats), np.inf)

    def decide(self, state: Array, wanted: Array, ours: BoolArray) -> Array:
        """The nominal commands themselves."""
        return wanted


class Entry(NamedTuple):
    """A filter that has a name.

    Attributes:
        make: from what a `GuardMaker` takes, and the settings given with the name, to the filter.
        check: refuses settings; None: it takes none.
        of_config: whether its settings are those of `ShieldConfig`.
    """

    make: Callable[..., Guard]
    check: Callable[[dict[str, Any]], object] | None = None
    of_config: bool = False


@cache
def filters() -> dict[str, Entry]:
    """Every filter, by name: an entry here makes one an option of ``--guard``."""
    from . import gatekeeper, plcbf, reach, rollouts, textbook

    by_rollouts = {
        rollouts.GATEKEEPER: gatekeeper.Gatekeeper,
        rollouts.GATEKEEPER_WORST: gatekeeper.Gatekeeper,
        rollouts.PL_CBF: plcbf.PolicyLibrary,
    }
    return {
        NONE: Entry(lambda config, games, platforms, team, around, settings: NoGuard(games, len(team))),
        SHIELD: Entry(lambda *fleet: BatchedShield(*fleet[:5]), lambda given: ShieldConfig.of(**given), True),
        REACH: Entry(lambda *fleet: reach.ReachGuard(*fleet[:4]), reach.check_settings, True),
        **{
            name: Entry(
                lambda *fleet, name=name, kind=kind: kind(name, *fleet[:4], fleet[5]),
                partial(rollouts.read_settings, name, kind.kind),
            )
            for name, kind in by_rollouts.items()
        },
        **{name: Entry(lambda *fleet, name=name: textbook.TextbookGuard(name, *fleet[:4])) for name in textbook.NAMES},
    }


def parse_guards(text: str) -> list[str]:
    """Split names of guards at commas; ``shield:a=1,b=2,none`` is two: a piece ``b=2`` belongs to what is before.

    Raises:
        ConfigError: no name, one that is not known, or settings that it refuses.
    """
    names: list[str] = []
    for piece in filter(None, (part.strip() for part in text.split(","))):
        if names and re.fullmatch(r"\w+=.*", piece):
            names[-1] += f",{piece}"
        else:
            names.append(piece)
    if not names:
        raise ConfigError("--guard names no guard; give none, shield, or one of the filters of the literature")
    for name in names:
        check_guard(name)
    return names


def check_guard(name: str) -> None:
    """Check a guard's name and settings.

    Raises:
        ConfigError: see `parse_guards`.
    """
    base, settings = split_name(name)
    known = filters()
    if base not in known:
        raise ConfigError(f"unknown guard {base!r}; choose from {', '.join(known)}")
    check = known[base].check
    if check is not None:
        check(settings)
    elif settings:
        names = ", ".join(one for one, entry in known.items() if entry.check)
        raise ConfigError(f"{base!r} takes no settings; only {names} do, as in shield:KEY=VALUE,...")


def is_shield(guard: str) -> bool:
    """Whether a guard is the shield, with whatever settings."""
    return guard.partition(":")[0] == SHIELD


def split_name(name: str) -> tuple[str, dict[str, Any]]:
    """Split ``shield:KEY=VALUE,...`` into the name and the settings; values are JSON or words.

    Raises:
        ConfigError: a setting without a value, or one that the conditions decide.
    """
    base, _, rest = name.partition(":")
    settings: dict[str, Any] = {}
    for piece in filter(None, rest.split(",")):
        key, equals, value = piece.partition("=")
        if not equals:
            raise ConfigError(f"{piece!r} in guard {name!r} has no value; write {base}:KEY=VALUE,...")
        if key in GIVEN:
            raise ConfigError(f"{key} of guard {name!r} follows from the run; set it with {GIVEN[key]}")
        try:
            settings[key] = json.loads(value)
        except json.JSONDecodeError:
            settings[key] = float(value) if value in ("inf", "-inf", "nan") else value
    return base, settings


def build_guard(guard: str | GuardMaker, scenes: Scenes, conditions: Conditions) -> Guard:
    """Make the guard for a batch of scenes.

    Args:
        guard: a name, or what makes one.
        scenes: games, fleet and field.
        conditions: become settings: radius, position error, delay, speed of the current.

    Raises:
        ConfigError: an unknown name, or a guard that cannot honour the conditions.
    """
    base, settings = split_name(guard) if isinstance(guard, str) else ("", {})
    if isinstance(guard, str):
        check_guard(guard)
    of_config = not base or filters()[base].of_config
    config = ShieldConfig.of(
        separation_m=conditions.radius_m,
        position_error_m=conditions.noise_m,
        delay_s=conditions.delay_s,
        current_mps=conditions.current_mps,
        dt_s=scenes.dt_s,
        **(settings if of_config else {}),
    )
    around = OPEN_WATER if scenes.field is None else Surroundings(field=scenes.field)
    fleet = (config, scenes.games, scenes.platforms, tuple(scenes.team.tolist()), around)
    return guard(*fleet) if callable(guard) else filters()[base].make(*fleet, settings)
