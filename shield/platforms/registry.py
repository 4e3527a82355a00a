"""The boats the package knows, by name."""

from __future__ import annotations

from ..exceptions import PlatformError
from .platform import Gains, Platform
from .proving import reference_models

with reference_models():  # proved by the tests: importing them compiles nothing
    HERON = Platform(
        name="heron",
        kind="usv",
        max_speed_mps=2.0,
        thrust_map=((0.0, 0.0), (40.0, 1.0), (100.0, 2.0)),
        turn_loss=0.85,
        turn_gain=60.0,
        max_dec=0.5,
        speed_pid=Gains(kp=1.0, integral_limit=0.07),
        heading_pid=Gains(kp=0.9, kd=0.6, integral_limit=0.3),
    )

    SURVEYOR = Platform(
        name="surveyor",
        kind="usv",
        max_speed_mps=3.0,
        thrust_map=((-100.0, -2.0), (0.0, 0.0), (20.0, 1.0), (40.0, 1.5), (60.0, 2.0), (70.0, 2.25), (100.0, 3.0)),
        turn_loss=0.85,
        turn_gain=10.0,
        max_acc=0.15,
        max_dec=0.25,
        speed_pid=Gains(kp=0.5),
        heading_pid=Gains(kp=1.2, kd=3.0),
    )

    LARGE_USV = Platform(
        name="large_usv",
        kind="usv",
        max_speed_mps=12.0,
        thrust_map=((-100.0, -3.0), (0.0, 0.0), (20.0, 3.0), (40.0, 6.0), (60.0, 9.0), (80.0, 12.0), (100.0, 12.0)),
        speed_factor=20.0 / 3.0,
        max_thrust=70.0,
        turn_loss=0.85,
        turn_gain=50.0,
        max_acc=0.5,
        max_dec=0.5,
        speed_pid=Gains(kp=1.0, integral_limit=0.07),
        heading_pid=Gains(kp=0.35, kd=0.07, integral_limit=0.07),
    )

    # The 2024 simulator's own boat. No recorded trace covers it; its controller gains are the ones the 2023-2024
    # river experiments used for heading (kp 0.35, kd 0.07) with a proportional speed controller.
    MCTF2024_SIM = Platform(
        name="mctf2024_sim",
        kind="usv",
        max_speed_mps=1.5,
        thrust_map=((-100.0, -2.0), (0.0, 0.0), (20.0, 1.0), (40.0, 2.0), (60.0, 3.0), (80.0, 5.0), (100.0, 5.0)),
        max_thrust=70.0,
        turn_loss=0.85,
        turn_gain=70.0,
        max_acc=1.0,
        max_dec=1.0,
        speed_gain=20.0,
        speed_pid=Gains(kp=1.0, integral_limit=0.07),
        heading_pid=Gains(kp=0.35, kd=0.07, integral_limit=0.07),
    )

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
    platform.name: platform
    for platform in (HERON, SURVEYOR, LARGE_USV, MCTF2024_SIM, SINGLE_INTEGRATOR, DOUBLE_INTEGRATOR)
}


def get_platform(name: str | Platform) -> Platform:
    """The platform of that name; a `Platform` passes through.

    Raises:
        PlatformError: no platform has that name; the message lists those that exist.
    """
    if isinstance(name, Platform):
        return name
    if not isinstance(name, str) or name not in PLATFORMS:
        raise PlatformError(f"unknown platform {name!r}; known platforms: {', '.join(sorted(PLATFORMS))}")
    return PLATFORMS[name]
