"""`GameConfig`: every setting of a game, with units, checked when it is built."""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import Platform, get_platform

from .validation import (
    check_choice,
    check_count,
    check_obstacles,
    check_point,
    check_real,
    check_segment,
    per_boat,
)

Point = tuple[float, float]

CAPTURE_AT = ("own_side", "own_base", "own_corners")
UNTAG_AT = ("own_flag", "own_corners")

MOST_STEPS, MOST_BOATS = 1000, 1000
"""Most steps of a decision, and most boats of a team. A larger number is taken for a typing error."""

LONGEST_S = 1e7
"""Longest game, s: four months. A longer one is taken for a typing error."""

_YES_OR_NO = ("tag_on_oob", "tag_on_collision", "default_start", "on_side_start", "shows_disabled")
_COUNTS = {"team_size": MOST_BOATS, "max_score": None, "decision_steps": MOST_STEPS}
_CHOICES: dict[str, tuple[Any, ...]] = {
    **dict.fromkeys(_YES_OR_NO, (True, False)),
    "capture_at": CAPTURE_AT,
    "untag_at": UNTAG_AT,
}
_POSITIVE = {"dt_s": None, "catch_radius_m": None, "corner_radius_m": None, "max_time_s": LONGEST_S}
_NOT_NEGATIVE = {
    "flag_keepout_m": None,
    "flag_radius_m": None,
    "tagging_cooldown_s": None,
    "oob_speed_frac": None,
    "tag_speed_frac": None,
    "tag_probability": 1.0,
    "power_play_share": 0.5,  # two power plays of more than half a game each would overlap
}
"""Settings that are numbers >= 0, and their upper limits."""


@dataclass(frozen=True)
class RewardWeights:
    """Weights of the default, sparse reward of one boat in one step.

    Each of the first four counts events of the own team minus the same events of the opponents, so the two teams'
    rewards from them add up to zero. ``oob`` (boats that have just left the field) and ``collision`` (new collisions of
    this boat) are costs and enter with a minus sign.

    Raises:
        ConfigError: a weight is not a finite number.
    """

    capture: float = 1.0
    grab: float = 0.25
    tag: float = 0.25
    oob: float = 0.25
    collision: float = 0.0

    def __post_init__(self) -> None:
        for entry in dataclasses.fields(self):
            check_real(f"reward.{entry.name}", getattr(self, entry.name), low=-math.inf)


@dataclass(frozen=True)
class GameConfig:
    """Settings of a game. Build one with `GameConfig.preset`, or name what differs from the defaults.

    Attributes:
        team_size: boats per team; blue are agent_0.., red follow.
        env_bounds_m: width (x, east) and height (y, north) of the field, m.
        dt_s: length of a step, in which boats move, s.
        decision_steps: steps under one command, whose relative heading is held; the rules are applied once, after the
            last.
        max_time_s: length of a game, s, at most 10^7.
        max_score: captures that end the game.
        platforms: one platform (name or `Platform`) for all boats or one per boat.
        agent_radius_m: radius of a boat, m, one for all or one per boat; two boats collide when closer than the sum.
        catch_radius_m: radius for tags, grabs and untagging at the own flag's home, m.
        corner_radius_m: radius around the two corners of the own side, for captures and untagging there, m.
        flag_keepout_m: own boats stay this far plus their radius from their flag while it is home, m; 0 = no keep-out.
        flag_radius_m: radius of a drawn flag, m.
        tagging_cooldown_s: time after a tag before the same boat can tag again, s.
        oob_speed_frac: share of top speed at which the game steers an out-of-bounds boat.
        tag_speed_frac: share of top speed at which the game steers a tagged boat.
        tag_probability: chance that a tag succeeds; a failed one costs the cool-down too.
        tag_on_oob: leaving the field tags the boat.
        tag_on_collision: hitting an obstacle tags the boat.
        capture_at: "own_side" (on crossing to it), "own_base" (within the catch radius of the own flag's home) or
            "own_corners" (within ``corner_radius_m`` of a corner of the own side).
        untag_at: "own_flag" or "own_corners", where the game steers tagged boats and frees them; corners do not free
            boats that are out of bounds.
        power_play_share: share of the game for which each team, once, has a random boat disabled, 0 to 0.5; 0: never.
        shows_disabled: observations and the global state contain which boats are disabled.
        blue_flag_home_m, red_flag_home_m: flag homes (x, y), m; None = 1/8 and 7/8 of the width, half the height.
        scrimmage_m: two points of the dividing line, m; None = perpendicular bisector of the flag homes.
        default_start: boats start at rest on a fixed line before the own flag; otherwise at random positions, speeds
            and headings.
        on_side_start: random starts only on the own side.
        obstacles: {"circle": [(radius, (x, y)), ...], "polygon": [((x, y), ...), ...]}, m.
        reward: weights of the default reward.
        preset_name: origin of the settings, for records and reports.

    Raises:
        ConfigError: a value is of the wrong kind or out of range.
        PlatformError: a platform is unknown.
    """

    team_size: int = 3
    env_bounds_m: Point = (160.0, 80.0)
    dt_s: float = 0.1
    decision_steps: int = 1
    max_time_s: float = 600.0
    max_score: int = 20
    platforms: str | Platform | tuple[str | Platform, ...] = "surveyor"
    agent_radius_m: float | tuple[float, ...] = 2.0
    catch_radius_m: float = 10.0
    corner_radius_m: float = 20.0
    flag_keepout_m: float = 3.0
    flag_radius_m: float = 2.0
    tagging_cooldown_s: float = 60.0
    oob_speed_frac: float = 0.5
    tag_speed_frac: float = 1.0
    tag_probability: float = 1.0
    tag_on_oob: bool = True
    tag_on_collision: bool = False
    capture_at: str = "own_side"
    untag_at: str = "own_flag"
    power_play_share: float = 0.0
    shows_disabled: bool = False
    blue_flag_home_m: Point | None = None
    red_flag_home_m: Point | None = None
    scrimmage_m: tuple[Point, Point] | None = None
    default_start: bool = True
    on_side_start: bool = True
    obstacles: Mapping[str, Any] | None = field(default=None, hash=False)
    reward: RewardWeights = field(default_factory=RewardWeights)
    preset_name: str = "custom"

    def __post_init__(self) -> None:
        for name, most in _COUNTS.items():
            check_count(name, getattr(self, name), 1, most)
        for name, high in _POSITIVE.items():
            self._set(name, check_real(name, getattr(self, name), above=0.0, high=high))
        for name, high in _NOT_NEGATIVE.items():
            self._set(name, check_real(name, getattr(self, name), low=0.0, high=high))
        for name, choices in _CHOICES.items():
            check_choice(name, getattr(self, name), choices)
        if not isinstance(self.preset_name, str):
            raise ConfigError(f"preset_name is {self.preset_name!r}; give a text")
        if not isinstance(self.reward, RewardWeights):
            raise ConfigError(f"reward is {self.reward!r}; give a RewardWeights(...)")
        width, height = check_point("env_bounds_m", self.env_bounds_m)
        check_real("env_bounds_m width", width, above=0.0)
        check_real("env_bounds_m height", height, above=0.0)
        self._set("env_bounds_m", (width, height))
        for name in ("blue_flag_home_m", "red_flag_home_m"):
            if getattr(self, name) is not None:
                self._set(name, check_point(name, getattr(self, name)))
        if (self.blue_flag_home_m is None) != (self.red_flag_home_m is None):
            raise ConfigError("give both blue_flag_home_m and red_flag_home_m, or neither")
        if self.scrimmage_m is not None:
            self._set("scrimmage_m", check_segment("scrimmage_m", self.scrimmage_m))
        self._set("obstacles", check_obstacles(self.obstacles))
        platforms = per_boat("platforms", self.platforms, self.n_boats, (str, Platform))
        self._set("platforms", tuple(get_platform(p) for p in platforms))
        radii = per_boat("agent_radius_m", self.agent_radius_m, self.n_boats, (int, float))
        self._set("agent_radius_m", tuple(check_real("agent_radius_m", r, above=0.0) for r in radii))

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    @property
    def decision_s(self) -> float:
        """Time from one decision to the next, s."""
        return self.decision_steps * self.dt_s

    @property
    def n_boats(self) -> int:
        """Number of boats in a game, both teams."""
        return 2 * self.team_size

    @property
    def n_obstacles(self) -> int:
        """Number of obstacles in the field."""
        return 0 if self.obstacles is None else len(self.obstacles["circle"]) + len(self.obstacles["polygon"])

    @property
    def agent_ids(self) -> tuple[str, ...]:
        """Names of the boats, blue first."""
        return tuple(f"agent_{i}" for i in range(self.n_boats))

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return the names of all settings."""
        return tuple(entry.name for entry in dataclasses.fields(cls))

    @classmethod
    def build(cls, **settings: Any) -> GameConfig:
        """Build a config from keyword settings; unlike the constructor, explain a misspelt name.

        Raises:
            ConfigError: a setting is unknown; the message names near matches.
        """
        for name in settings:
            if name not in cls.names():
                near = difflib.get_close_matches(name, cls.names(), n=3, cutoff=0.5)
                hint = f"did you mean {', '.join(near)}?" if near else f"known settings: {', '.join(cls.names())}"
                raise ConfigError(f"unknown game setting {name!r}; {hint}")
        return cls(**settings)

    @classmethod
    def preset(cls, name: str, **overrides: Any) -> GameConfig:
        """Return a named set of rules, with overrides.

        Args:
            name: "aamas2024" (the 2024 competition's paper), "mctf2025" or "mctf2026" (the configurations of the 2025
                and 2026 competitions).
            **overrides: any setting of `GameConfig`.

        Raises:
            ConfigError: the preset or a setting is unknown.
        """
        if name not in PRESETS:
            raise ConfigError(f"unknown preset {name!r}; known presets: {', '.join(sorted(PRESETS))}")
        return cls.build(**{**PRESETS[name], "preset_name": name, **overrides})

    def replace(self, **overrides: Any) -> GameConfig:
        """Return a copy with settings replaced.

        Raises:
            ConfigError: a setting is unknown.
        """
        current = {name: getattr(self, name) for name in self.names()}
        return self.build(**{**current, **overrides})


def of_the_config(name: str) -> str:
    """Return what to do with a setting of the game that was given to the game itself; empty: it is none."""
    words = f"it is a setting of the game: give GameConfig.preset(name, {name}=...)"
    return words if name in GameConfig.names() else ""


def as_config(config: GameConfig | str | None) -> GameConfig:
    """Return a `GameConfig` from itself, a preset's name, or None (the ``mctf2025`` preset).

    Raises:
        ConfigError: the preset is unknown or the argument is of another kind.
    """
    if config is None:
        return GameConfig.preset("mctf2025")
    if isinstance(config, str):
        return GameConfig.preset(config)
    if isinstance(config, GameConfig):
        return config
    raise ConfigError(f"config is {type(config).__name__}; give a GameConfig or a preset name ({', '.join(PRESETS)})")


PRESETS: dict[str, dict[str, Any]] = {
    # Rules of the 2024 competition as in its paper, with Heron boats.
    "aamas2024": {
        "env_bounds_m": (80.0, 40.0),
        "platforms": "heron",
        "agent_radius_m": 1.25,
        "tagging_cooldown_s": 10.0,
    },
    # The 2025 competition's configuration.
    "mctf2025": {
        "env_bounds_m": (160.0, 80.0),
        "platforms": "surveyor",
        "agent_radius_m": 2.0,
        "tagging_cooldown_s": 60.0,
    },
    # The 2026 competition's configuration: one decision a second, corners instead of the flag, power plays.
    "mctf2026": {
        "env_bounds_m": (160.0, 80.0),
        "platforms": "surveyor",
        "agent_radius_m": 2.0,
        "tagging_cooldown_s": 60.0,
        "decision_steps": 10,
        "flag_keepout_m": 0.0,
        "flag_radius_m": 1.5,
        "tag_speed_frac": 0.5,
        "capture_at": "own_corners",
        "untag_at": "own_corners",
        "power_play_share": 0.2,
        "shows_disabled": True,
    },
}
