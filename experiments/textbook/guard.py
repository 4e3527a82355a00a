"""`make_guard`: a filter of the literature, in the place where the shield stands in a batch of games."""

from __future__ import annotations

import numpy as np
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError, FleetError
from steerclear.shield.fleet import LARGEST
from steerclear.shield.jit import Array, BoolArray
from steerclear.shield.platforms import Platform, get_platform
from steerclear.shield.platforms import layout as L

from .barriers import PARABOLIC
from .filters import decide_games
from .inputs import input_limits
from .parameters import INFLATION, KINDS, NAMES, Gains, gains_of
from .rows import Setup


class TextbookGuard:
    """Commands of B games of the same fleet, filtered as the literature does.

    Reasons: 0 passed bit for bit, 1 changed, 2 the program had no answer and was relaxed (the command may then be
    the wanted one, where no input helps), 3 not even the relaxed program was solved: the boat is told to stop.

    Args:
        name: one of `NAMES`.
        config: settings; separation, buffer, position error and step are used.
        games: number of games B.
        platforms: platforms of the n boats.
        team: team of the n boats.
        gains: gains for all boats; None takes those of each platform.

    Raises:
        ConfigError: unknown name, a fleet that does not fit, or a delay, which these filters know nothing of.
    """

    def __init__(
        self,
        name: str,
        config: ShieldConfig,
        games: int,
        platforms: tuple[str | Platform, ...],
        team: tuple[int, ...],
        gains: Gains | None = None,
    ) -> None:
        if name not in KINDS:
            raise ConfigError(f"unknown filter {name!r}; choose one of {', '.join(NAMES)}")
        if config.delay_s > 0:
            raise ConfigError(f"delay_s is {config.delay_s}; the filters of the literature know no delay, set 0")
        if isinstance(games, bool) or not isinstance(games, (int, np.integer)) or games < 1:
            raise ConfigError(f"games is {games!r}; give a whole number >= 1")
        if len(platforms) != len(team) or not platforms:
            raise ConfigError(f"{len(platforms)} platforms and {len(team)} team entries; give one of each per boat")
        self.name, self.config = name, config
        self._setup = _setup(name, config, [get_platform(kind) for kind in platforms], gains)
        shape = (int(games), len(platforms))
        self.reason = np.zeros(shape, np.int64)
        self.certificate_m = np.full(shape, np.inf)
        self.sent = np.zeros((*shape, 2))

    def reset(self, mask: BoolArray | None = None) -> None:
        """Nothing is remembered from step to step; kept for the interface."""
        which = slice(None) if mask is None else mask
        self.reason[which] = 0
        self.certificate_m[which] = np.inf

    def decide(self, state: Array, wanted: Array, ours: BoolArray) -> Array:
        """Filtered commands.

        Args:
            state: (B, n, N_STATE) boat states.
            wanted: (B, n, 2) speed m/s and relative heading deg.
            ours: (B, n) boats to decide for.

        Returns:
            (B, n, 2) commands, reused by the next call. ``reason`` (B, n) tells why; ``certificate_m`` (B, n) is
            the distance to the nearest boat less the radius kept, m.

        Raises:
            FleetError: an array has the wrong shape, a state is not finite, or a wanted command of ours is not.
        """
        state, wanted, ours = np.asarray(state), np.asarray(wanted), np.asarray(ours)
        for what, array, shape in (
            ("state", state, (*self.reason.shape, L.N_STATE)),
            ("wanted", wanted, self.sent.shape),
            ("ours", ours, self.reason.shape),
        ):
            if array.shape != shape:
                raise FleetError(f"{what} has shape {array.shape}; expected {shape}")
        if not (np.abs(state[:, :, : L.SPEED_ERROR]) <= LARGEST).all() or (np.abs(state) > LARGEST).any():
            raise FleetError(f"a boat's position, heading, speed, thrust or rudder is not finite or beyond {LARGEST:g}")
        if not (np.abs(wanted[ours.astype(bool)]) <= LARGEST).all():
            raise FleetError(f"a wanted command is not finite or beyond {LARGEST:g}; give a speed and a heading")
        decide_games(
            self._setup,
            np.ascontiguousarray(state, dtype=np.float64),
            np.ascontiguousarray(wanted, dtype=np.float64),
            np.ascontiguousarray(ours, dtype=np.bool_),
            self.sent,
            self.reason,
            self.certificate_m,
        )
        return self.sent


def _setup(name: str, config: ShieldConfig, platforms: list[Platform], gains: Gains | None) -> Setup:
    radius_m = config.separation_m + config.buffer_m + 2.0 * config.position_error_m
    if KINDS[name] == PARABOLIC:
        radius_m *= INFLATION
    return Setup(
        kind=KINDS[name],
        gains=np.array([(gains or gains_of(name, kind.name)).pack(radius_m) for kind in platforms]),
        radius_m=radius_m,
        dt_s=config.dt_s,
        params=np.array([kind.pack() for kind in platforms]),
        limits=np.array([input_limits(kind, config.dt_s).pack() for kind in platforms]),
    )


def make_guard(
    name: str, config: ShieldConfig, games: int, platforms: tuple[str | Platform, ...], team: tuple[int, ...]
) -> TextbookGuard:
    """The filter of that name; see `TextbookGuard`."""
    return TextbookGuard(name, config, games, tuple(platforms), tuple(team))
