"""Attributes that Pyquaticus policies read from the environment object, answered from the live game."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
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
    """A pair of values, one per team, indexed by anything whose ``int`` is 0 or 1, such as another package's Team."""

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


def _live(name: str, kind: Callable[[Any], Any], doc: str) -> Any:
    """Make a property that reads an array of game 0, for the boat or team ``idx``."""
    return property(lambda self: kind(getattr(self._core, name)[0, self.idx]), doc=doc)


def _moving(column: int, doc: str) -> Any:
    """Make a property that reads a column of a boat's state."""
    return property(lambda self: float(self._core.state[0, self.idx, column]), doc=doc)


class Player:
    """One boat of a running game: agent ``id``, number ``idx`` and `Team`. Properties read the live game."""

    def __init__(self, core: BatchedMctf, idx: int) -> None:
        self._core = core
        self.id = core.config.agent_ids[idx]
        self.idx = idx
        self.team = Team(int(core.team[idx]))

    pos = _live("state", lambda row: np.array(row[[L.X, L.Y]]), "Position (2,), m.")
    prev_pos = _live("previous_position", np.array, "Position before the last move (2,), m.")
    heading = _moving(L.HEADING, "Heading, deg clockwise from north.")
    speed = _moving(L.SPEED, "Speed, m/s.")
    has_flag = _live("has_flag", bool, "Whether it carries the opponents' flag.")
    is_tagged = _live("is_tagged", bool, "Whether it is tagged.")
    is_disabled = _live("is_disabled", bool, "Whether a power play has it stopped.")
    oob = _live("oob", bool, "Whether it is out of bounds.")
    on_own_side = _live("on_side", bool, "Whether it was on its own side when the last step began.")
    tagging_cooldown = _live("tagging_cooldown_s", float, "Time since its last tag, s, up to the cool-down.")

    def get_max_speed(self) -> float:
        """Return the top speed, m/s."""
        return float(self._core.max_speed_mps[self.idx])


class Flag:
    """One team's flag in a running game."""

    def __init__(self, core: BatchedMctf, team: Team) -> None:
        self._core, self.team, self.idx = core, team, int(team)

    home = property(lambda self: np.array(self._core.flag_home[self.idx]), doc="Its home (2,), m.")
    pos = _live("flag_position", np.array, "Where it is (2,), m.")
    taken = _live("flag_taken", bool, "Whether an opponent carries it.")


@dataclass
class CircleObstacle:
    """A circular obstacle, m."""

    radius: float
    center_point: tuple[float, float]


@dataclass
class PolygonObstacle:
    """A polygonal obstacle, m."""

    anchor_points: list[tuple[float, float]]


_SETTINGS = {
    "team_size": "team_size",
    "dt": "dt_s",
    "sim_speedup_factor": "decision_steps",
    "tag_speed_frac": "tag_speed_frac",
    "tag_probability": "tag_probability",
    "untag_radius": "corner_radius_m",
    "power_play_percentage": "power_play_share",
    "catch_radius": "catch_radius_m",
    "flag_radius": "flag_radius_m",
    "flag_keepout_radius": "flag_keepout_m",
    "tagging_cooldown": "tagging_cooldown_s",
    "max_score": "max_score",
    "max_time": "max_time_s",
    "oob_speed_frac": "oob_speed_frac",
    "tag_on_oob": "tag_on_oob",
    "tag_on_collision": "tag_on_collision",
}
"""Pyquaticus' attribute -> our setting, where both mean the same."""


class PyquaticusAttributes:
    """Attributes under Pyquaticus' names, for policies that are built with the environment object.

    `_set_pyquaticus_attributes` sets the constant ones; the others are properties.
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
        self.gps_env = False
        self.agent_radius = np.array(config.agent_radius_m)
        self.blue_untag_coords, self.red_untag_coords = core.rules.corner_marks.tolist()
        for theirs, ours in _SETTINGS.items():
            setattr(self, theirs, getattr(config, ours))

    @property
    def current_time(self) -> float:
        """Time since the start of the game, s."""
        return float(self.core.time_s[0])

    @property
    def game_events(self) -> TeamMap[dict[str, int]]:
        """Scores, grabs, tags and collisions so far, by team."""
        if self.core.n_games != 1:
            raise GameError("game_events belongs to a single game; read the arrays of BatchedMctf instead")
        core = self.core
        blue, red = (
            {
                "scores": int(core.captures[0, team]),
                "grabs": int(core.grabs[0, team]),
                "tags": int(core.tags[0, team]),
                "collisions": int(core.collisions[0, core.team == team].sum()),
            }
            for team in (0, 1)
        )
        return TeamMap(blue, red)
