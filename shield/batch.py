"""`BatchedShield`: the decisions of `Shield` for thousands of games, compiled, without Python in the loop."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from . import workspace as W
from .arrays import NoNumbersError, shaped, truths, whole_numbers
from .calls import checked_calls
from .config import ShieldConfig
from .decide import Deciders
from .exceptions import ConfigError, FleetError
from .filter.program import solver_of
from .fleet import LARGEST, LARGEST_SPEED_MPS
from .jit import Array, BoolArray
from .masks import passing
from .model import boats_of
from .platforms import Platform
from .platforms import layout as L
from .renamed import takes_old_keywords
from .shield import NOMINAL, barriers_of
from .surroundings import OPEN_WATER, Surroundings


class BatchedShield:
    """`Shield` for B games of the same fleet.

    Decisions are those of `Shield`, bit for bit: it is a batch of one. Tracks are taken as fresh, and exact up to
    ``position_error_m``. It serves one thread at a time, as `Shield` does.

    Args:
        config: settings; coordination must be "team".
        games: number of games B.
        platforms: platforms of the n boats.
        team: team of the n boats.
        surroundings: static constraints, the same for all games.
        flag_of: team around whose flag the circle in the surroundings' ``stops`` is; None: no particular team.
        threads: threads that share the games; decisions are the same, bit for bit. More threads than cores do not help.

    Attributes:
        sent: (B, n, 2) commands of the last decisions; every call overwrites this and the other arrays.
        reason: (B, n) reason of each, values of `decision.Reason`.
        serves: the team that games have used it for since `reset`; None: none yet.

    Raises:
        ConfigError: a setting that a batch does not support, or that is invalid.
    """

    @checked_calls()
    def __init__(
        self,
        config: ShieldConfig,
        games: int,
        platforms: tuple[str | Platform, ...],
        team: tuple[int, ...],
        surroundings: Surroundings = OPEN_WATER,
        flag_of: int | None = None,
        threads: int = 1,
    ) -> None:
        if not isinstance(config, ShieldConfig) or not isinstance(surroundings, Surroundings):
            found = f"{type(config).__name__} and {type(surroundings).__name__}"
            raise ConfigError(f"config and surroundings are {found}; give ShieldConfig.of(...) and Surroundings(...)")
        if config.coordination != "team":
            raise ConfigError("a batch decides for whole teams at once: set coordination='team'")
        for name, number in (("games", games), ("threads", threads)):
            if isinstance(number, bool) or not isinstance(number, (int, np.integer)) or number < 1:
                raise ConfigError(f"{name} is {number!r}; give a whole number >= 1")
        if isinstance(platforms, (str, Platform)) or not isinstance(platforms, Iterable):
            raise ConfigError(f"platforms is {platforms!r}; give a list of them, one for each boat")
        self.config, self.flag_of, self.surroundings = config, flag_of, surroundings
        self.platforms, self.team = tuple(platforms), _teams(team)
        if len(self.platforms) != len(self.team) or not self.platforms:
            raise ConfigError(
                f"{len(self.platforms)} platforms and {len(self.team)} team entries; give one of each per boat"
            )
        boats = boats_of(config, self.platforms, self.team)
        self._barriers = barriers_of(config)
        self._static = surroundings.pack(config, self._barriers.arrays)
        self._deciders = Deciders(config, games, boats, self._static, solver_of(config.solver), threads)
        scene = self._deciders.scene
        scene.given[:, :, W.HORIZON_S] = np.nan
        self.sent, self.reason = scene.sent, scene.reasons
        self.serves: int | None = None

    @property
    def safety_margin_m(self) -> Array:
        """(B, n) margins of the last decisions, m."""
        return self._deciders.scene.reported[:, :, W.MARGIN_M]

    @property
    def cut_short(self) -> BoolArray:
        """(B,) which of the last decisions were ended by `ShieldConfig.work_budget`."""
        return np.asarray((self._deciders.scene.reported[:, :, W.CUT_SHORT] != 0.0).any(axis=1))

    @property
    def remembered(self) -> dict[str, Array]:
        """Memory from decision to decision, by name: live arrays, (B, ...). Copies written back continue from there."""
        return self._deciders.remembered

    def reset(self, mask: BoolArray | None = None) -> None:
        """Forget the backups of the games in ``mask`` (B,) of True and False, or of all.

        Raises:
            FleetError: the mask is no such array.
        """
        which: slice | BoolArray = slice(None)
        if mask is None:
            self.serves = None
        else:
            which, games = np.asarray(mask), len(self.reason)
            if which.dtype != np.bool_ or which.shape != (games,):
                raise FleetError(f"mask is {which.dtype} of shape {which.shape}; give bool of shape ({games},)")
        self._deciders.forget(which)

    @takes_old_keywords({"wanted": "nominal"})
    def decide(
        self,
        state: Array,
        nominal: Array,
        ours: BoolArray,
        visiting: BoolArray | None = None,
        driven: Array | None = None,
    ) -> Array:
        """Return filtered commands.

        Args:
            state: (B, n, N_STATE) boat states; autopilot memory that is NaN is filled from the speed, not estimated as
                `Shield` does.
            nominal: (B, n, 2) nominal speed m/s and relative heading deg, as `Commands.game_deg`: games limit speeds
                themselves.
            ours: (B, n) boats to decide for.
            visiting: (B, n) boats on the other team's side, see `Fleet.visiting`; None: not known of any.
            driven: (B, n, 4) motion of boats that the games drive, see `Fleet.driven`; rows of NaN, or None, where
                nothing is known. Those not decided for are predicted accordingly.

        Returns:
            (B, n, 2) commands; rows of boats not decided for, and of those that pass, are ``nominal`` bit for bit. The
            next call overwrites the array. ``reason`` and ``safety_margin_m`` (B, n) say why; ``cut_short`` (B,) which
            decisions `ShieldConfig.work_budget` ended.

        Raises:
            FleetError: an array has the wrong shape or holds no numbers, or a state is not finite.
        """
        nominal = shaped("nominal", nominal, (*self.reason.shape, 2))
        self._give(state, ours, visiting, driven)
        self._deciders.scene.given[:, :, NOMINAL] = nominal
        self._barriers.renew()
        self._deciders.decide(self._static)
        self._barriers.tell()
        return self.sent

    def safe_actions(
        self,
        state: Array,
        actions: Array,
        ours: BoolArray,
        visiting: BoolArray | None = None,
        driven: Array | None = None,
    ) -> BoolArray:
        """Return which of k candidate commands would pass unchanged in this step, (B, n, k); see `masks`.

        Args:
            state: as all others but the actions, as in `decide`.
            actions: (B, n, k, 2) speed m/s and relative heading deg; all pass for boats not decided for.
            ours: as in `decide`.
            visiting: as in `decide`.
            driven: as in `decide`.

        Raises:
            FleetError: no candidates, or as in `decide`.
        """
        self._give(state, ours, visiting, driven)
        candidates = shaped("actions", actions, (*self.reason.shape, None, 2))
        if candidates.shape[2] < 1:
            raise FleetError("actions hold no candidate; give one at least for each boat")
        self._barriers.renew()
        passes = passing(self._deciders, self._static, candidates)
        self._barriers.tell()
        return passes

    def _give(self, state: Array, ours: BoolArray, visiting: BoolArray | None, driven: Array | None) -> None:
        """Write all inputs but the commands into the scene."""
        games = self.reason.shape
        state, ours = shaped("state", state, (*games, L.N_STATE)), shaped("ours", ours, games, truths)
        visiting = None if visiting is None else shaped("visiting", visiting, games, truths)
        driven = None if driven is None else shaped("driven", driven, (*games, 4))
        if not (np.abs(state[:, :, : L.SPEED_ERROR]) <= LARGEST).all() or (np.abs(state) > LARGEST).any():
            raise FleetError(f"a boat's position, heading, speed, thrust or rudder is not finite or beyond {LARGEST:g}")
        if (np.abs(state[:, :, L.SPEED]) > LARGEST_SPEED_MPS).any():
            raise FleetError(f"a boat's speed is beyond {LARGEST_SPEED_MPS:g} m/s; no boat of a game goes so fast")
        given = self._deciders.scene.given
        given[:, :, : L.N_STATE], given[:, :, W.OURS] = state, ours
        given[:, :, W.VISITING] = 0.0 if visiting is None else visiting
        given[:, :, W.DRIVEN :] = np.nan if driven is None else driven

    def filter_for(self, team: int, shield_autopilot: bool = True) -> Any:
        """Return a command filter for a batched game: ``step(actions, command_filter=shield.filter_for(0))``.

        Args:
            team: the team to shield.
            shield_autopilot: also decide for boats the game drives (tagged, out of bounds; never disabled ones).

        Raises:
            ConfigError: no boat is of that team, or the shield was built for the other team's flag. When the filter is
                called: the shield was built for other games.
        """
        if isinstance(team, str) or team not in self.team:
            raise ConfigError(f"no boat is of team {team!r}; give one of {sorted(set(self.team))}")
        if self.flag_of not in (None, team):
            raise ConfigError(f"this shield keeps off the flag of team {self.flag_of}; build another for team {team}")
        from .wrappers.games_shield import GamesFilter

        return GamesFilter(self, team, shield_autopilot)


def _teams(team: Any) -> tuple[int, ...]:
    try:
        found = whole_numbers(team)
    except NoNumbersError as error:
        raise ConfigError(f"team holds {error}; give a whole number for each boat") from None
    if found.ndim != 1:
        raise ConfigError(f"team has shape {found.shape}; give a whole number for each boat")
    return tuple(found.tolist())
