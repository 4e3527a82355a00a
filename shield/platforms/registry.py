"""The boats the package knows, by name: the files of ``shipped``, and the simulator's two integrators."""

from __future__ import annotations

from pathlib import Path

from ..exceptions import PlatformError
from .files import is_path, load_platform
from .platform import Platform
from .proving import reference_models

SHIPPED = Path(__file__).parent / "shipped"

with reference_models():  # proved by the tests: importing them compiles nothing
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


def get_platform(name: str | Platform) -> Platform:
    """The platform of that name, or of that file (``.yaml``); a `Platform` passes through.

    Raises:
        PlatformError: no platform has that name, with the list of those that exist, or its file is no boat.
    """
    if isinstance(name, Platform):
        return name
    if isinstance(name, str) and is_path(name):
        return load_platform(name).platform
    if not isinstance(name, str) or name not in PLATFORMS:
        known = ", ".join(sorted(PLATFORMS))
        raise PlatformError(f"unknown platform {name!r}; known platforms: {known}; or give a file, NAME.yaml")
    return PLATFORMS[name]
