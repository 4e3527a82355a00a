"""Raids as in `undertow`, with numbers from a network.

The network's input is where all boats are and the state of the raid; its output is the raid's `Shape`. This is a
parameterised option (Masson, Ranchod and Konidaris 2016), held until the raid changes phase, ends, or some seconds have
passed. All input is mirrored so that the bait is at large y.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.jit import Array, BoolArray
from steerclear.shield.platforms import layout as L

from ..observation import is_turned, look
from ..plane import SLOWEST, SLOWING_M
from ..play import BatchFront
from ..undertow.raid import Chart, Phase, Raid
from ..undertow.shape import SCRIPTED
from ..undertow.team import aim_of
from .network import Network

Numbers = NDArray[np.int64]
IDLE_S, RAID_S = 10.0, 3.0
"""Longest times that a shape is held outside and during a raid, s."""
NEAR_M, KEPT_S = 10.0, 30.0
"""Scales of the input: of near distances, m, and of the time since a side was chosen, s."""
BOATS, SEEN = 3, 67
"""Boats of a team; numbers in the network's input."""


class RaidsBatch:
    """A `BatchPolicy` that raids with numbers from a network.

    Args:
        network: of the kind "raids": from `seen` to the units by which a `Shape` is moved.
        name: for records and reports.
        sample: refused, since there are no probabilities to draw with.

    Attributes:
        raids: of each game.

    Raises:
        PolicyError: sampling is requested, or the network has another input.
    """

    def __init__(self, network: Network, name: str = "weights", sample: bool = False) -> None:
        if sample:
            raise PolicyError(f"policy {name!r} has no probabilities to draw actions with; leave out sample")
        if network.n_obs != SEEN:
            found = f"{network.n_obs} observations, this version has {SEEN}"
            raise PolicyError(f"policy {name!r} expects {found}; train it anew")
        self.network, self.name = network, name
        self._team = -1

    def reset(self, core: Any, team: int, seed: int) -> None:
        """Begin all games."""
        own = np.flatnonzero(core.team == team)
        if own.size != BOATS or core.n_boats != 2 * BOATS:
            raise PolicyError(f"policy {self.name!r} plays {BOATS} boats against {BOATS}; play it with team_size 3")
        games, shape = core.n_games, (core.n_games, BOATS)
        self._core, self._team, self._own = core, team, own
        self._order = np.concatenate([own, np.flatnonzero(core.team != team)])
        self._turn_deg = 180.0 if is_turned(core, team) else 0.0
        self._left, self._stood, self._held_s = np.zeros(games, np.int64), np.zeros(games, np.int64), np.zeros(games)
        self._points, self._near_m, self._stays = np.zeros((*shape, 2)), np.zeros(shape), np.ones(shape, np.bool_)
        self._out = np.zeros((*shape, 2))
        self.raids = [Raid(look(core, team, game)) for game in range(games)]
        self.restart(np.ones(games, np.bool_), seed)

    def restart(self, chosen: BoolArray, seed: int) -> None:
        """Begin the chosen games (B,) anew; the seed has no effect."""
        self._left[chosen], self._stays[chosen], self._stood[chosen] = 0, True, -1
        for game in np.flatnonzero(chosen):
            self.raids[game] = Raid(look(self._core, self._team, int(game)))

    def act(self, core: Any, team: int) -> Array:
        """Return commands (B, 3, 2), speed m/s and relative heading deg; the next call reuses the array."""
        if team != self._team or core.n_games != self._left.size:
            raise PolicyError(f"policy {self.name!r} was not reset for team {team} of these games; call reset first")
        due = np.flatnonzero(self._left == 0)
        asked = self.advance(due)
        if asked.size:
            self.shape(asked, self.network.outputs(self.seen(asked), np.zeros(asked.size, np.int64)))
        self.aim(due, self.network.interval)
        self._left -= 1
        return self.steered()

    def advance(self, games: Numbers) -> Numbers:
        """Advance the raids of some games; return the games in which a new shape is due."""
        return np.array([game for game in games if self._asks(int(game))], np.int64)

    def _asks(self, game: int) -> bool:
        """Return whether a raid changed phase, took the flag, or has held its shape long enough."""
        raid, before = self.raids[game], self._stood[game]
        raid.advance(look(self._core, self._team, game))
        self._stood[game] = raid.phase + len(Phase) * raid.held
        longest_s = IDLE_S if raid.phase == Phase.GATHER else RAID_S
        late = bool(self._core.time_s[game] - self._held_s[game] > longest_s - 1e-6)
        return late or before != self._stood[game]

    def shape(self, games: Numbers, units: NDArray[np.floating[Any]]) -> None:
        """Give the raids of some games (G,) their numbers, in units (G, n) of `shape.LIMITS`."""
        for game, by in zip(games, units.tolist(), strict=True):
            self.raids[game].shape = SCRIPTED.moved(by)
        self._held_s[games] = self._core.time_s[games]

    def aim(self, games: Numbers, steps: int) -> None:
        """Set the points that the boats of some games steer for, for ``steps`` game steps."""
        for game in games:
            obs, raid = look(self._core, self._team, int(game)), self.raids[game]
            chart = Chart(obs, raid.upper, raid.shape)
            for number, boat in enumerate(obs.own):
                self._stays[game, number] = boat.tagged
                if boat.tagged:  # the game controls it
                    continue
                aim = aim_of(raid, obs, chart, number)
                self._points[game, number] = aim.point
                self._near_m[game, number] = math.nan if aim.near_m is None else aim.near_m
        self._left[games] = steps

    def steered(self) -> Array:
        """Return commands (B, 3, 2) towards the boats' points, as `Aim.order`."""
        state = self._core.state[:, self._own]
        at, size = state[..., [L.X, L.Y]], np.array(self._core.config.env_bounds_m)
        way = self._points - (size - at if self._turn_deg else at)
        way_m, heading_deg = np.hypot(way[..., 0], way[..., 1]), state[..., L.HEADING] + self._turn_deg
        share = np.where(np.isnan(self._near_m), 1.0, np.clip(way_m / SLOWING_M, SLOWEST, 1.0))
        there = self._stays | (way_m <= self._near_m)
        turn_deg = (np.degrees(np.arctan2(way[..., 0], way[..., 1])) - heading_deg + 180.0) % 360.0 - 180.0
        self._out[..., 0] = np.where(there, 0.0, share * self._core.max_speed_mps[self._own])
        self._out[..., 1] = np.where(there, 0.0, turn_deg)
        return self._out

    def seen(self, games: Numbers) -> NDArray[np.float32]:
        """Return the network's input for some games (G, n)."""
        core, raids, some = self._core, [self.raids[game] for game in games], np.ix_(games, self._order)
        size, sign = np.array(core.config.env_bounds_m), -1.0 if self._turn_deg else 1.0
        mirror = np.where([raid.upper for raid in raids], 1.0, -1.0)[:, None]
        at = (core.state[some][..., [L.X, L.Y]] - 0.5 * size) * sign
        at[..., 1] *= mirror
        heading = np.radians(core.state[some][..., L.HEADING])
        speed = core.state[some][..., L.SPEED] / core.max_speed_mps[self._order] * sign
        apart = np.linalg.norm(at[:, :BOATS, None] - at[:, None, BOATS:], axis=-1).reshape(len(raids), -1)
        parts = (
            at[..., 0] / size[0] * 2.0,
            at[..., 1] / size[1] * 2.0,
            speed * np.sin(heading),
            speed * np.cos(heading) * mirror,
            core.is_tagged[some],
            core.has_flag[some],
            core.on_side[some],
            core.tagging_cooldown_s[some] / max(core.config.tagging_cooldown_s, 1e-9),
            np.exp(-apart / NEAR_M),
            core.flag_taken[games][:, [self._team, 1 - self._team]],
            np.eye(len(Phase))[[raid.phase for raid in raids]],
            [[raid.bait_taken, raid.held, raid.unguarded] for raid in raids],
            np.clip((core.time_s[games] - [raid.kept_s for raid in raids]) / KEPT_S, 0.0, 2.0)[:, None],
        )
        return np.concatenate(parts, axis=1).astype(np.float32)


class RaidsTeam(BatchFront):
    """The same in one game: a thin layer over `RaidsBatch` with the same arguments."""

    def __init__(self, network: Network, name: str = "weights", sample: bool = False) -> None:
        super().__init__()
        self.name = name
        self._batch = RaidsBatch(network, name, sample)
