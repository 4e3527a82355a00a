"""Earlier public names: each still works for one release and warns with its new name."""

from __future__ import annotations

import functools
import logging
import warnings
from collections.abc import Callable, Mapping
from typing import Any, TypeVar, cast

from .calls import explain

SETTINGS = {
    "adversary_s": "adversary_horizon_s",
    "visitor_s": "intruder_horizon_s",
    "certificate": "opponent_model",
    "response_per_s": "cbf_rate_per_s",
    "table_response_per_s": "table_cbf_rate_per_s",
    "fixed_response_per_s": "static_cbf_rate_per_s",
    "give_way_after_s": "deadlock_timeout_s",
    "search_limit": "work_budget",
    "dwell_s": "min_backup_hold_s",
    "tail_s": "straight_horizon_s",
    "hull_m": "obstacle_clearance_m",
    "mate_cap_m": "teammate_margin_cap_m",
}
"""Settings of `ShieldConfig`, old name to new."""
SETTING_PROPERTIES = {
    "said": "is_chosen",
    "feared_s": "effective_adversary_horizon_s",
    "visitor_feared_s": "effective_intruder_horizon_s",
}
PROFILES = {"players": "competitive", "rammers": "ramming", "hold-course": "constant_velocity"}
FLEET = {"adversary_s": "adversary_horizon_s"}
DECISION = {
    "wanted_heading_rad": "nominal_heading_rad",
    "wanted_speed_mps": "nominal_speed_mps",
    "sent_heading_rad": "filtered_heading_rad",
    "sent_speed_mps": "filtered_speed_mps",
    "binding": "active_constraints",
    "certificate_m": "safety_margin_m",
    "feared_s": "adversary_horizon_s",
}
DECISIONS = {
    "bound": "active_constraint",
    "wanted": "nominal",
    "sent": "filtered",
    "certificate_m": "safety_margin_m",
    "feared_s": "adversary_horizon_s",
}
"""Fields of `Fleet`, `Decision` and `Decisions`."""
KEYS = {"wanted": "nominal", "sent": "filtered", "guard": "filter", "guards": "filters"}
KEY_PARTS = {"breaches": "violations", "breached": "violated", "start_certificate_m": "start_safety_margin_m"}
"""Keys of records and result files; parts of keys."""

_OLD_KEYS = {new: old for old, new in KEYS.items() if old.startswith("guard")}
T = TypeVar("T", bound=type)
F = TypeVar("F", bound=Callable[..., Any])
LOG = logging.getLogger(__name__)


def current_settings(settings: Mapping[str, Any], warned: bool = False) -> dict[str, Any]:
    """Return settings of an earlier version under their present names; others stay as they are.

    Args:
        settings: by name.
        warned: whether to log a warning for each old name.
    """
    renamed = {}
    for name, value in settings.items():
        new = SETTINGS.get(name, name)
        renamed[new] = PROFILES.get(value, value) if new == "profile" and isinstance(value, str) else value
        for old, now in ((name, new), (value, renamed[new])):
            if warned and now is not old and now != old:
                LOG.warning("%s is now %s; the old name goes with the next release", old, now)
    return renamed


def warn(old: str, new: str, stacklevel: int = 3) -> None:
    """Warn that a name is deprecated, with its new name."""
    text = f"{old!r} is now {new!r}; the old name goes with the next release"
    warnings.warn(text, DeprecationWarning, stacklevel=stacklevel + 1)


def current_key(key: str) -> str:
    """Return the present name of a key of a record or result file of an earlier version."""
    for old, new in KEY_PARTS.items():
        key = key.replace(old, new)
    return KEYS.get(key, key)


def current_keys(content: Any) -> Any:
    """Return nested data of a result file of an earlier version under present keys."""
    if isinstance(content, Mapping):
        return {current_key(key): current_keys(value) for key, value in content.items()}
    return [current_keys(value) for value in content] if isinstance(content, list) else content


def earlier_keys(content: Any) -> Any:
    """Return the part of nested results whose keys were renamed, under the earlier keys; empty: there is none."""
    if isinstance(content, list | tuple):
        parts = [earlier_keys(value) for value in content]
        return parts if any(parts) else []
    if not isinstance(content, Mapping):
        return {}
    found = {}
    for key, value in content.items():
        old = _OLD_KEYS.get(key, str(key))
        for part, now in KEY_PARTS.items():
            old = old.replace(now, part)
        inside = value if old != key else earlier_keys(value)
        if old != key or inside:
            found[old] = inside
    return found


def old_names(module: Mapping[str, Any], names: Mapping[str, str]) -> Callable[[str], Any]:
    """Return a module's ``__getattr__`` that answers to old names, with a warning.

    Args:
        module: the module's ``globals()``.
        names: old name to new.
    """

    def read(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {module['__name__']!r} has no attribute {name!r}")
        warn(name, names[name], stacklevel=2)
        return module[names[name]]

    return read


class Renamed(dict[str, Any]):
    """A dict that also answers to keys of an earlier version, with a warning."""

    def __missing__(self, key: str) -> Any:
        new = current_key(key)
        if new == key:
            raise KeyError(key)
        warn(key, new, stacklevel=2)
        return self[new]

    def __contains__(self, key: object) -> bool:
        return super().__contains__(key) or (isinstance(key, str) and super().__contains__(current_key(key)))

    def get(self, key: str, default: Any = None) -> Any:
        """As of any dict, and for earlier keys."""
        if super().__contains__(key) or key not in self:
            return super().get(key, default)
        warn(key, current_key(key), stacklevel=2)
        return self[current_key(key)]


def takes_old_keywords(keywords: Mapping[str, str]) -> Callable[[F], F]:
    """Let a function be called with the old names of some keywords, old name to new; each use warns.

    Wrong arguments end in a `CallError`, as of `checked_calls`.
    """

    def renaming(function: F) -> F:
        @functools.wraps(function)
        def called(*args: Any, **given: Any) -> Any:
            if not keywords.keys().isdisjoint(given):  # rare, and decisions are made by the thousand
                for old in [name for name in given if name in keywords]:
                    warn(old, keywords[old])
                    given[keywords[old]] = given.pop(old)
            try:
                return function(*args, **given)
            except TypeError as error:
                explain(error, function, args, given)
                raise

        return cast(F, called)

    return renaming


def accepts_old_names(keywords: Mapping[str, str], attributes: Mapping[str, str] | None = None) -> Callable[[T], T]:
    """Let a class be built with, and read by, its old names as well; each use warns.

    Args:
        keywords: keywords of its constructor, and of its classmethod ``of`` if it has one, old name to new.
        attributes: other attributes with an old name.
    """
    readable, renaming = {**keywords, **(attributes or {})}, takes_old_keywords(keywords)

    def read(self: Any, name: str) -> Any:
        if name not in readable:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        warn(name, readable[name])
        return getattr(self, readable[name])

    def decorate(cls: Any) -> Any:
        cls.__init__, cls.__getattr__ = renaming(cls.__init__), read
        if "of" in vars(cls):
            cls.of = classmethod(renaming(vars(cls)["of"].__func__))
        return cls

    return decorate
