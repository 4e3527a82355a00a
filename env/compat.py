"""What policies written for Pyquaticus look up on the environment object, answered from the live game."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import Enum
from typing import Any, Generic, TypeVar

import numpy as np
from steerclear.shield.exceptions import GameError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L

from .core import BatchedMctf

V = TypeVar("V")


class Team(Enum):
    """The two teams; ``int(team)`` indexes arrays."""

    BLUE_TEAM = 0
    RED_TEAM = 1

    def __int__(self) -> int:
        return int(self.value)


class TeamMap(Mapping[Any, V], Generic[V]):
    """A pair of values, one per team, indexed by anything whose ``int`` is 0 or 1: ours, or another package's Team."""

    def __init__(self, blue: V, red: V) -> None:
        self._values = (blue, red)

    def __getitem__(self, team: Any) -> V:
        try:
            number = int(team)
        except (TypeError, ValueError):
            number = -1
        if number not in (0, 1):
            raise KeyError(team)
        return self._values[number]

    def __iter__(self) -> Iterator[Team]:
        return iter(Team)

    def __len__(self) -> int:
        return 2


class Player:
    """One boat of a running game; every property is read from the game when asked for.

    Attributes:
        id: agent id.
        idx: number of the boat.
        team: its `Team`.
    """

    def __init__(self, core: BatchedMctf, idx: int) -> None:
        self._core = core
        self.id = core.config.agent_ids[idx]
        self.idx = idx
        self.team = Team(int(core.team[idx]))

    @property
    def pos(self) -> Array:
        """Position (2,), m."""
        return np.array(self._core.state[0, self.idx, [L.X, L.Y]])

    @property
    def prev_pos(self) -> Array:
        """Position before the last move (2,), m."""
        return np.array(self._core.previous_position[0, self.idx])

    @property
    def heading(self) -> float:
        """Heading, deg clockwise from north."""
        return float(self._core.state[0, self.idx, L.HEADING])

    @property
    def speed(self) -> float:
        """Speed, m/s."""
        return float(self._core.state[0, self.idx, L.SPEED])

    @property
    def has_flag(self) -> bool:
        """Whether it carries the opponents' flag."""
        return bool(self._core.has_flag[0, self.idx])

    @property
    def is_tagged(self) -> bool:
        """Whether it is tagged."""
        return bool(self._core.is_tagged[0, self.idx])

    @property
    def is_disabled(self) -> bool:
        """Whether a power play has it stopped."""
        return bool(self._core.is_disabled[0, self.idx])

    @property
    def oob(self) -> bool:
        """Whether it is out of bounds."""
        return bool(self._core.oob[0, self.idx])

    @property
    def on_own_side(self) -> bool:
        """Whether it was on its own side when the last step began."""
        return bool(self._core.on_side[0, self.idx])

    @property
    def tagging_cooldown(self) -> float:
        """Time since its last tag, s, up to the cool-down."""
        return float(self._core.tagging_cooldown_s[0, self.idx])

    def get_max_speed(self) -> float:
        """Top speed, m/s."""
        return float(self._core.max_speed_mps[self.idx])


class Flag:
    """One team's flag in a running game."""

    def __init__(self, core: BatchedMctf, team: Team) -> None:
        self._core = core
        self.team = team

    @property
    def home(self) -> Array:
        """Its home (2,), m."""
        return np.array(self._core.flag_home[int(self.team)])

    @property
    def pos(self) -> Array:
        """Where it is (2,), m."""
        return np.array(self._core.flag_position[0, int(self.team)])

    @property
    def taken(self) -> bool:
        """Whether an opponent carries it."""
        return bool(self._core.flag_taken[0, int(self.team)])


class CircleObstacle:
    """A circle in the water."""

    def __init__(self, radius: float, center_point: tuple[float, float]) -> None:
        self.radius = radius
        self.center_point = center_point


class PolygonObstacle:
    """A polygon in the water."""

    def __init__(self, anchor_points: list[tuple[float, float]]) -> None:
        self.anchor_points = anchor_points


class PyquaticusAttributes:
    """Attributes under Pyquaticus' names, for policies that are built with the environment object.

    Constant ones are set by `_set_pyquaticus_attributes`; the rest are properties.
    """

    core: BatchedMctf

    def _set_pyquaticus_attributes(self, points: dict[str, Array]) -> None:
        core, config, field = self.core, self.core.config, self.core.field
        ids, size = config.agent_ids, config.team_size
        players = [Player(core, i) for i in range(config.n_boats)]
        self.players = {player.id: player for player in players}
        self.agents_of_team = TeamMap(players[:size], players[size:])
        self.agent_ids_of_team = TeamMap(list(ids[:size]), list(ids[size:]))
        self.agent_inds_of_team = TeamMap(np.arange(size), np.arange(size, 2 * size))
        self.flags = [Flag(core, team) for team in Team]
        self.flag_homes = TeamMap(field.flag_home[0].copy(), field.flag_home[1].copy())
        self._walls = {team: [[wall[0], wall[1]] for wall in field.walls[team]] for team in (0, 1)}
        self.aquaticus_field_points = points
        self.obstacles = [CircleObstacle(r, centre) for r, centre in config.obstacles["circle"]]
        self.obstacles += [PolygonObstacle(list(corners)) for corners in config.obstacles["polygon"]]
        self.scrimmage_coords = field.scrimmage.copy()
        self.env_size = field.size.copy()
        self.env_bounds = np.array([[0.0, 0.0], field.size])
        self.env_diag = field.diagonal
        self.max_speeds = core.max_speed_mps.tolist()
        self._set_pyquaticus_numbers()

    def _set_pyquaticus_numbers(self) -> None:
        config = self.core.config
        self.gps_env = False
        self.team_size = config.team_size
        self.dt = config.dt_s
        self.sim_speedup_factor = config.decision_steps
        self.tag_speed_frac = config.tag_speed_frac
        self.tag_probability = config.tag_probability
        self.untag_radius = config.corner_radius_m
        self.power_play_percentage = config.power_play_share
        self.blue_untag_coords, self.red_untag_coords = self.core.rules.corner_marks.tolist()
        self.agent_radius = np.array(config.agent_radius_m)
        self.catch_radius = config.catch_radius_m
        self.flag_radius = config.flag_radius_m
        self.flag_keepout_radius = config.flag_keepout_m
        self.tagging_cooldown = config.tagging_cooldown_s
        self.max_score = config.max_score
        self.max_time = config.max_time_s
        self.oob_speed_frac = config.oob_speed_frac
        self.tag_on_oob = config.tag_on_oob
        self.tag_on_collision = config.tag_on_collision

    @property
    def current_time(self) -> float:
        """Time since the start of the game, s."""
        return float(self.core.time_s[0])

    @property
    def game_events(self) -> TeamMap[dict[str, int]]:
        """Scores, grabs, tags and collisions so far, by team."""
        if self.core.n_games != 1:
            raise GameError("game_events belongs to a single game; read the arrays of BatchedMctf instead")
        return TeamMap(self._events_of(0), self._events_of(1))

    def _events_of(self, team: int) -> dict[str, int]:
        core = self.core
        return {
            "scores": int(core.captures[0, team]),
            "grabs": int(core.grabs[0, team]),
            "tags": int(core.tags[0, team]),
            "collisions": int(core.collisions[0, core.team == team].sum()),
        }
