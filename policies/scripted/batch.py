"""`ScriptedBatch`: a scripted team in every game of a `BatchedMctf`, in one compiled call."""

from __future__ import annotations

import numpy as np
from steerclear.env.core import BatchedMctf
from steerclear.env.field import CORNER_INSET_M
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.jit import Array, BoolArray, IntArray, lean_kernel

from . import layout as S
from .boats import easy_defend, ram, random_walk, waypoints
from .layout import MEDIUM_REACH, Behaviour, Game, seed_streams
from .plan import Plan
from .roles import HARD_REACH_M, easy_attack, field_attack, hard, hard_defend, medium_defend

_SEED_MASK = (1 << 64) - 1
# plain integers: numba caches kernels only with constants of such types
RANDOM, RAMMER, WAYPOINTS = int(Behaviour.RANDOM), int(Behaviour.RAMMER), int(Behaviour.WAYPOINTS)
EASY_ATTACK, EASY_DEFEND = int(Behaviour.EASY_ATTACK), int(Behaviour.EASY_DEFEND)
MEDIUM_ATTACK, MEDIUM_DEFEND = int(Behaviour.MEDIUM_ATTACK), int(Behaviour.MEDIUM_DEFEND)
HARD, HARD_ATTACK = int(Behaviour.HARD), int(Behaviour.HARD_ATTACK)
HARD_DEFEND = int(Behaviour.HARD_DEFEND)


class ScriptedBatch:
    """A `BatchPolicy` for any scripted team. It reads the games' live arrays without copying.

    Args:
        name: name for records and reports.
        plan: behaviours of the boats.
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
            seed: game b draws from seed + b; it also selects the hidden opponent's composition.
            boats: numbers of the boats to play; None for the whole team.
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
        """Begin the chosen games (B,) anew, game b with seed + b; the others go on."""
        if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)):
            raise PolicyError(f"seed is {seed!r}; give a whole number")
        self._memory[chosen] = 0.0
        for game in np.flatnonzero(chosen):
            cast = self.plan.cast(self._team_size, int(seed) + int(game))
            self._codes[game] = [int(cast[slot]) for slot in self._slots]
        seeds = np.array([(int(seed) + game) & _SEED_MASK for game in range(chosen.size)], dtype=np.uint64)
        seed_streams(seeds, self._boats, chosen, self._streams)

    def act(self, core: BatchedMctf, team: int) -> Array:
        """Return commands (B, n_team, 2), speed m/s and relative heading deg; the next call reuses the array."""
        if team != self._team or core.n_games != self._out.shape[0]:
            raise PolicyError(f"policy {self.name!r} was not reset for team {team} of these games; call reset first")
        games = Game(
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
    def behaviours(self) -> list[list[Behaviour]]:
        """Behaviour of each boat, by game."""
        return [[Behaviour(code) for code in row] for row in self._codes]

    @property
    def waypoints_reached(self) -> IntArray:
        """Waypoints reached so far, (B, n_team); zero for boats without waypoints."""
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
    """Return waypoints (n_boats, k, 2); each boat starts a shared list one point later, so that they spread out."""
    if plan.points is None:
        return np.zeros((n_boats, 0, 2))
    if plan.points.ndim == 3:
        if (given := plan.points.shape[0]) != n_boats:
            raise PolicyError(f"points are for {given} boats but the team has {n_boats}; give (k, 2) or one list each")
        return plan.points
    return np.stack([np.roll(plan.points, -slot, axis=0) for slot in range(n_boats)])


@lean_kernel
def command_boat(
    game: Game, boat: int, behaviour: int, memory: Array, given: Array, streams: np.ndarray, slot: int
) -> tuple[float, float]:
    """Return speed m/s and relative heading deg of one boat under its behaviour; advance its memory and stream."""
    if behaviour == MEDIUM_ATTACK:
        return field_attack(game, boat, game.field[MEDIUM_REACH], False)
    if behaviour == MEDIUM_DEFEND:
        return medium_defend(game, boat)
    if behaviour == EASY_ATTACK:
        return easy_attack(game, boat, memory)
    if behaviour == EASY_DEFEND:
        return easy_defend(game, boat, memory)
    if behaviour == HARD:
        return hard(game, boat)
    if behaviour == HARD_ATTACK:
        return field_attack(game, boat, HARD_REACH_M, True)
    if behaviour == HARD_DEFEND:
        return hard_defend(game, boat)
    if behaviour == RAMMER:
        return ram(game, boat)
    if behaviour == WAYPOINTS:
        return waypoints(game, boat, memory, given, streams, slot)
    if behaviour == RANDOM:
        return random_walk(game, boat, memory, streams, slot)
    return 0.0, 0.0


@lean_kernel
def command_team(
    codes: IntArray, boats: IntArray, memory: Array, given: Array, streams: np.ndarray, game: Game, out: Array
) -> None:
    """Write commands of one team's boats in one game into ``out`` (n_team, 2): speed m/s, relative heading deg."""
    for slot in range(boats.size):
        speed, heading = command_boat(game, boats[slot], codes[slot], memory[slot], given[slot], streams, slot)
        out[slot, 0] = speed
        out[slot, 1] = heading


@lean_kernel
def command_batch(
    codes: IntArray, boats: IntArray, memory: Array, given: Array, streams: np.ndarray, games: Game, out: Array
) -> None:
    """Run `command_team` for every game: the same arguments with a leading axis of games.

    ``boats``, ``given`` and the games' ``limits``, ``team``, ``flag_home`` and ``field`` are the same in all games and
    have no such axis.
    """
    for g in range(games.state.shape[0]):
        game = Game(
            games.state[g],
            games.limits,
            games.team,
            games.is_tagged[g],
            games.has_flag[g],
            games.on_side[g],
            games.flag_home,
            games.flag_position[g],
            games.field,
        )
        command_team(codes[g], boats, memory[g], given, streams[g], game, out[g])
