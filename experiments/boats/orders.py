"""What an autopilot wants of its hull, in the field's frame, and what a commander asked of the autopilot."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Steer:
    """Hold a heading (rad clockwise from the field's y axis) at a speed over ground, m/s, negative astern."""

    heading_rad: float
    speed_mps: float


@dataclass(frozen=True)
class Bear:
    """Turn by an angle (deg, clockwise) from the present heading at a speed, m/s, as the game's own boats are told."""

    error_deg: float
    speed_mps: float


@dataclass(frozen=True)
class Turn:
    """Turn at a rate (rad/s, clockwise) at a speed over ground, m/s, negative astern."""

    rate_rads: float
    speed_mps: float


@dataclass(frozen=True)
class Reach:
    """Go to a place of the field, m, at a speed, m/s, and stay."""

    x_m: float
    y_m: float
    speed_mps: float


@dataclass(frozen=True)
class Keep:
    """Stop and stay.

    Attributes:
        back_up_m: run astern once stopped.
    """

    back_up_m: float = 0.0


@dataclass(frozen=True)
class Actuate:
    """Rudder and thrust themselves, percent; only thrust ahead."""

    rudder: float
    thrust: float


@dataclass(frozen=True)
class Coast:
    """Motors off."""


Order = Steer | Bear | Turn | Reach | Keep | Actuate | Coast
