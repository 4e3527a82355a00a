"""Settings of simulated boats: identity, autopilot, water and radio; `ConfigError` for a number out of range."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import Platform

FREE = ""  # address of a boat that picks a free port itself
_MOST = 1e9


def check_bounds(settings: object, **bounds: tuple[float, float]) -> None:
    """Raise `ConfigError` unless these attributes are numbers within their bounds."""
    for name, (low, high) in bounds.items():
        value = getattr(settings, name)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
            raise ConfigError(f"{name} is {value!r}; give a number, {low:g} to {high:g}")


@dataclass(frozen=True)
class SimBoat:
    """One simulated boat."""

    name: str  # its name
    platform: str | Platform = "heron"  # dynamics, a name or a `Platform`
    team: int = 0  # 0 blue, 1 red
    system_id: int = 0  # MAVLink system id; 0: position in the list + 1
    # its link, as the runner opens it: ``udpin:HOST:PORT`` (the boat sends there), ``udpout:HOST:PORT`` (the boat
    # listens there), ``tcp:HOST:PORT`` (the boat is the server), ``tcpin:HOST:PORT`` (the boat connects); `FREE`:
    # ``udpout`` with a free port; None: no link
    address: str | None = FREE
    # scripted policy that steers the boat while nobody commands it by its link; empty: without commands it stays where
    # it is
    policy: str = ""
    start: tuple[float, float, float] | None = None  # x m, y m, heading deg in the field; None: the game's start
    gate: str = "helm"  # of a boat that runs MOOS: where its commander sits, "helm" or "pid", as in FLEET.yaml


@dataclass(frozen=True)
class AutopilotSettings:
    """Behaviour of an autopilot; defaults are measured values."""

    # from power on until it arms with all checks. It has a position after 9/42 of this; ATTITUDE is invalid for the
    # first 1/42
    boot_s: float = 42.0
    timeout_s: float = 3.0  # commands older than this are dropped
    # deceleration of the autopilot's own stops (time-out, LOITER); None: as the platform stops
    brake_mps2: float | None = 1.2
    back_up_m: float = 2.0  # distance run astern after a time-out stop
    top_rate_hz: float = 40.0  # highest rate of one message
    # autopilot parameters that differ from the defaults, by name
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        positive = ("timeout_s", "top_rate_hz", *(() if self.brake_mps2 is None else ("brake_mps2",)))
        check_bounds(self, boot_s=(0.0, _MOST), back_up_m=(0.0, _MOST), **dict.fromkeys(positive, (0.01, _MOST)))


@dataclass(frozen=True)
class Water:
    """Wind and current, in true degrees: where the wind comes from, where the current goes to."""

    wind_mps: float = 0.0  # mean wind
    wind_from_deg: float = 0.0  # mean wind
    gust_share: float = 0.3  # standard deviation of gusts as a share of the mean wind
    leeway_share: float = 0.03  # drift speed of a boat as a share of the wind speed
    current_mps: float = 0.0  # the current
    current_to_deg: float = 0.0  # the current

    def __post_init__(self) -> None:
        check_bounds(self, wind_mps=(0.0, 60.0), wind_from_deg=(-360.0, 360.0), gust_share=(0.0, 1.0))
        check_bounds(self, leeway_share=(0.0, 1.0), current_mps=(0.0, 60.0), current_to_deg=(-360.0, 360.0))

    @property
    def is_still(self) -> bool:
        """Whether there is neither wind nor current."""
        return self.wind_mps == 0.0 and self.current_mps == 0.0


@dataclass(frozen=True)
class RadioSettings:
    """Effect of the radio on every packet, in either direction."""

    loss: float = 0.0  # share of packets lost
    delay_s: float = 0.0  # one way
    jitter_s: float = 0.0  # extra delay, drawn per packet between 0 and this; packets may overtake each other

    def __post_init__(self) -> None:
        check_bounds(self, loss=(0.0, 1.0), delay_s=(0.0, 60.0), jitter_s=(0.0, 60.0))
