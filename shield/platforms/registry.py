"""Known boats by name: the files of ``shipped``, the simulator's two integrators, and registered boats."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from ..exceptions import PlatformError
from ..foreign import load_others
from .files import is_path, load_platform
from .platform import Platform
from .proving import reference_models

GROUP = "steerclear.platforms"
"""Entry-point group of other packages: each entry names a `Platform`, a function that builds one, or a module that
registers some.
"""
Boat = TypeVar("Boat", bound="Platform | str | Path | Callable[[], Platform]")
SHIPPED = Path(__file__).parent / "shipped"

with reference_models():  # the tests check them, so importing compiles nothing
    _FILES = {path.stem: load_platform(path).platform for path in sorted(SHIPPED.glob("*.yaml"))}

    SINGLE_INTEGRATOR = Platform(name="si", kind="single_integrator", max_speed_mps=10.0, max_turn_rate_dps=90.0)

    DOUBLE_INTEGRATOR = Platform(
        name="di",
        kind="double_integrator",
        max_speed_mps=10.0,
        max_acc=1.0,
        max_turn_rate_dps=90.0,
        max_angular_acc_dps2=180.0,
    )

PLATFORMS: dict[str, Platform] = {
    platform.name: platform for platform in (*_FILES.values(), SINGLE_INTEGRATOR, DOUBLE_INTEGRATOR)
}

HERON = PLATFORMS["heron"]


def register_platform(boat: Boat) -> Boat:
    """Register a boat by its name, in this process. Also a decorator of a function that builds one.

    Args:
        boat: the platform, its file (``.yaml``), or a function that builds it.

    Returns:
        The argument.

    Raises:
        PlatformError: another boat has that name, the name looks like a file's, or it is no boat.
    """
    found = boat() if callable(boat) else load_platform(boat).platform if isinstance(boat, str | Path) else boat
    if not isinstance(found, Platform):
        raise PlatformError(f"{found!r} is no platform; give a Platform, its file, or a function that builds one")
    if is_path(found.name) or PLATFORMS.get(found.name, found) != found:
        why = "ends like a file" if is_path(found.name) else "is another boat's"
        raise PlatformError(f"a platform cannot be named {found.name!r}, which {why}; choose another name")
    PLATFORMS.setdefault(found.name, found)
    return boat


def known_platforms() -> dict[str, Platform]:
    """Return all boats by name: ours, those registered here, and those of other packages' entry points."""
    load_others(GROUP, register_platform)
    return dict(PLATFORMS)


def get_platform(name: str | Platform) -> Platform:
    """Return the platform of that name, or of that file (``.yaml``); a `Platform` passes through.

    Raises:
        PlatformError: no platform has that name (the message lists those that exist), or its file is no boat.
    """
    if isinstance(name, Platform):
        return name
    if isinstance(name, str) and is_path(name):
        return load_platform(name).platform
    if isinstance(name, str) and name in PLATFORMS:
        return PLATFORMS[name]
    boats = known_platforms()
    if not isinstance(name, str) or name not in boats:
        near = difflib.get_close_matches(str(name), boats, n=3)
        hint = f"did you mean {', '.join(near)}? " if near else ""
        known = ", ".join(sorted(boats))
        raise PlatformError(f"unknown platform {name!r}; {hint}known platforms: {known}; or give a file, NAME.yaml")
    return boats[name]
