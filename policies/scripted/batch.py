"""`ScriptedBatch`: a scripted team in every game of a `BatchedMctf`, decided by one compiled call."""

from __future__ import annotations

import numpy as np
from steerclear.env.core import BatchedMctf
from steerclear.env.field import CORNER_INSET_M
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.jit import Array, BoolArray, IntArray

from . import layout as S
from .dispatch import command_batch
from .geometry import seed_streams
from .plan import Plan

_SEED_MASK = (1 << 64) - 1


class ScriptedBatch:
    """A `BatchPolicy` for any scripted team. Reads the games' live arrays; nothing is copied.

    Args:
        name: name for records and reports.
        plan: who does what.
    """

    def __init__(self, name: str, plan: Plan) -> None:
        self.name = name
        self.plan = plan
        self._team = -1

    def reset(self, core: BatchedMctf, team: int, seed: int, boats: IntArray | None = None) -> None:
        """Begin all games.

        Args:
            core: the games.
            team: 0 blue, 1 red.
            seed: game b draws from seed + b; also chooses the hidden opponent's composition.
            boats: numbers of the boats to play; None for the whole team.

        Raises:
            PolicyError: no such team, an unusable seed, or the plan does not fit the team's size.
        """
        if team not in (0, 1):
            raise PolicyError(f"team is {team!r}; give 0 (blue) or 1 (red)")
        own = np.flatnonzero(core.team == team)
        self._team = team
        self._boats = own if boats is None else np.asarray(boats, dtype=np.int64)
        shape = (core.n_games, self._boats.size)
        self._codes = np.zeros(shape, dtype=np.int64)
        self._memory = np.zeros((*shape, S.N_MEMORY))
        self._streams = np.zeros(shape, dtype=np.uint64)
        self._out = np.zeros((*shape, 2))
        self._field = _field_row(core, self.plan)
        self._limits = np.column_stack([core.max_speed_mps, core.agent_radius_m])
        self._given = _given_points(self.plan, self._boats.size)
        self._slots = np.searchsorted(own, self._boats)
        self._team_size = own.size
        self.restart(np.ones(core.n_games, dtype=np.bool_), seed)

    def restart(self, chosen: BoolArray, seed: int) -> None:
        """Begin the chosen games (B,) anew, game b with seed + b; the others go on.

        Raises:
            PolicyError: an unusable seed, or the plan does not fit the team's size.
        """
        if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)):
            raise PolicyError(f"seed is {seed!r}; give a whole number")
        self._memory[chosen] = 0.0
        for game in np.flatnonzero(chosen):
            cast = self.plan.cast(self._team_size, int(seed) + int(game))
            self._codes[game] = [int(cast[slot]) for slot in self._slots]
        seeds = np.array([(int(seed) + game) & _SEED_MASK for game in range(chosen.size)], dtype=np.uint64)
        seed_streams(seeds, self._boats, chosen, self._streams)

    def act(self, core: BatchedMctf, team: int) -> Array:
        """Commands (B, n_team, 2), speed m/s and relative heading deg; the array is reused by the next call.

        Raises:
            PolicyError: `reset` was not called for this team and number of games.
        """
        if team != self._team or core.n_games != self._out.shape[0]:
            raise PolicyError(f"policy {self.name!r} was not reset for team {team} of these games; call reset first")
        games = S.Game(
            core.state,
            self._limits,
            core.team,
            core.is_tagged,
            core.has_flag,
            core.on_side,
            core.flag_home,
            core.flag_position,
            self._field,
        )
        command_batch(self._codes, self._boats, self._memory, self._given, self._streams, games, self._out)
        return self._out

    @property
    def behaviours(self) -> list[list[S.Behaviour]]:
        """What each boat does, by game."""
        return [[S.Behaviour(code) for code in row] for row in self._codes]

    @property
    def waypoints_reached(self) -> IntArray:
        """Waypoints reached so far, (B, n_team); zero for boats that drive none."""
        return self._memory[:, :, S.REACHED].astype(np.int64)


def _field_row(core: BatchedMctf, plan: Plan) -> Array:
    row = np.zeros(S.N_FIELD)
    row[S.WIDTH], row[S.HEIGHT] = core.config.env_bounds_m
    row[S.KEEPOUT] = core.config.flag_keepout_m
    row[S.STEP] = core.config.decision_s
    row[S.CORNER_INSET] = CORNER_INSET_M if core.config.capture_at == "own_corners" else 0.0
    row[S.SPEED_FRACTION] = plan.speed_fraction
    row[S.HIT_TEAM_MATES] = float(plan.target_team_mates)
    row[S.MEDIUM_REACH] = plan.reach_m
    return row


def _given_points(plan: Plan, n_boats: int) -> Array:
    """(n_boats, k, 2) waypoints; a shared list is begun by each boat one point further on, so that they spread out."""
    if plan.points is None:
        return np.zeros((n_boats, 0, 2))
    if plan.points.ndim == 3:
        if (given := plan.points.shape[0]) != n_boats:
            raise PolicyError(f"points are for {given} boats but the team has {n_boats}; give (k, 2) or one list each")
        return plan.points
    return np.stack([np.roll(plan.points, -slot, axis=0) for slot in range(n_boats)])
