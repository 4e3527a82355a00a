"""Settings of simulated boats: who they are, how their autopilots behave, the water and the radio."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields

from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import Platform

FREE = ""
"""Address of a boat that chooses a free port itself."""


def check_numbers(settings: object, names: tuple[str, ...], low: float = 0.0, high: float = math.inf) -> None:
    """Raise unless these attributes are finite numbers within [low, high].

    Raises:
        ConfigError: one of them is not.
    """
    for name in names:
        value = getattr(settings, name)
        fine = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
        if not (fine and low <= value <= high):
            raise ConfigError(f"{name} is {value!r}; give a number within {low:g} and {high:g}")


@dataclass(frozen=True)
class SimBoat:
    """One simulated boat.

    Attributes:
        name: its name.
        platform: its dynamics, a name or a `Platform`.
        team: 0 blue, 1 red.
        system_id: MAVLink system id; 0: its place in the list + 1.
        address: where its link is, as the runner's side has it: ``udpin:HOST:PORT`` (the boat sends there),
            ``udpout:HOST:PORT`` (the boat listens there), ``tcp:HOST:PORT`` (the boat is the server),
            ``tcpin:HOST:PORT`` (the boat dials); `FREE`: ``udpout`` with a free port; None: no link.
        policy: scripted policy that drives the boat while nobody commands it by its link; empty: without commands it
            stays where it is.
        start: x m, y m, heading deg in the field; None: the game's start place.
        gate: of a boat that runs MOOS: where its commander sits, "helm" or "pid", as in FLEET.yaml.
    """

    name: str
    platform: str | Platform = "heron"
    team: int = 0
    system_id: int = 0
    address: str | None = FREE
    policy: str = ""
    start: tuple[float, float, float] | None = None
    gate: str = "helm"


@dataclass(frozen=True)
class Firmware:
    """What differs between autopilot versions.

    Attributes:
        version: major, minor, patch.
        yaw_trap: velocity with yaw takes the speed's sign from the velocity's x component.
        yaw_speed_command: obeys MAV_CMD_NAV_SET_YAW_SPEED.
        timeout_parameter: has GUID_TIMEOUT.
    """

    version: tuple[int, int, int] = (4, 6, 0)
    yaw_trap: bool = True
    yaw_speed_command: bool = True
    timeout_parameter: bool = False


MEASURED_FIRMWARE = Firmware()
"""The one that was measured."""

LATER_FIRMWARE = Firmware((4, 8, 0), yaw_trap=False, yaw_speed_command=False, timeout_parameter=True)
"""One from mid-2026 on."""


@dataclass(frozen=True)
class AutopilotSettings:
    """How an autopilot behaves; the defaults are what was measured.

    Attributes:
        boot_s: from power on until it arms with all checks; its position is there after 9/42 of this, and ATTITUDE is
            not to be believed for 1/42 of it.
        timeout_s: commands older than this are dropped.
        brake_mps2: deceleration of a stop of the autopilot's own (time-out, LOITER); None: the platform's own way.
        back_up_m: run astern after the stop of a time-out.
        top_rate_hz: highest rate of one message.
        firmware: see `Firmware`.
        parameters: values of parameters that differ from the defaults, by name.

    Raises:
        ConfigError: a number out of range.
    """

    boot_s: float = 42.0
    timeout_s: float = 3.0
    brake_mps2: float | None = 1.2
    back_up_m: float = 2.0
    top_rate_hz: float = 40.0
    firmware: Firmware = MEASURED_FIRMWARE
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_numbers(self, ("boot_s", "back_up_m"))
        check_numbers(self, ("timeout_s", "top_rate_hz"), low=0.01)
        if self.brake_mps2 is not None:
            check_numbers(self, ("brake_mps2",), low=0.01)


@dataclass(frozen=True)
class Water:
    """Wind and current; directions are where the wind comes from and where the current goes to, true deg.

    Attributes:
        wind_mps, wind_from_deg: mean wind.
        gust_share: standard deviation of gusts as a share of the mean wind.
        leeway_share: speed a boat is pushed with as a share of the wind's.
        current_mps, current_to_deg: the current.

    Raises:
        ConfigError: a number out of range.
    """

    wind_mps: float = 0.0
    wind_from_deg: float = 0.0
    gust_share: float = 0.3
    leeway_share: float = 0.03
    current_mps: float = 0.0
    current_to_deg: float = 0.0

    def __post_init__(self) -> None:
        check_numbers(self, ("wind_mps", "current_mps"), high=60.0)
        check_numbers(self, ("gust_share", "leeway_share"), high=1.0)
        check_numbers(self, ("wind_from_deg", "current_to_deg"), low=-360.0, high=360.0)

    @property
    def is_still(self) -> bool:
        """Neither wind nor current."""
        return self.wind_mps == 0.0 and self.current_mps == 0.0


@dataclass(frozen=True)
class RadioSettings:
    """What the radio does to every packet, in either direction.

    Attributes:
        loss: share of packets lost.
        delay_s: one way.
        jitter_s: further delay, drawn for each packet from 0 to this; packets may overtake each other.

    Raises:
        ConfigError: a number out of range.
    """

    loss: float = 0.0
    delay_s: float = 0.0
    jitter_s: float = 0.0

    def __post_init__(self) -> None:
        check_numbers(self, ("loss",), high=1.0)
        check_numbers(self, tuple(entry.name for entry in fields(self))[1:], high=60.0)
