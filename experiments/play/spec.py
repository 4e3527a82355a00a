"""What a game is to be, complete enough to be played again to the bit: a `MatchSpec`, and where boats start."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from steerclear.env.config import GameConfig
from steerclear.env.field import field_geometry
from steerclear.shield import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array

from ..game_metrics import DEFAULT_PENALTY
from ..metrics import RADII_M
from ..runner import job_id
from ..verdicts import check_judge
from .conditions import CALM, Conditions

SIDES = ("blue", "red")
LARGEST_SEED = 2**62
"""Seeds of games count up from that of a run: all of them are whole numbers of 64 bits, as tables hold."""
ANSWER_S, MOST_ANSWER_S = 10.0, 86_400.0
"""Time a policy from a file has for the actions of a step, and the longest that can be given, s."""
GAP_M = 8.0
"""Boats start at least this far apart, from each other and from flags."""
SPREAD_DEG = 45.0
"""Boats head for the opponents' flag, this much to either side."""
TRIES = 2000


@dataclass(frozen=True)
class MatchSpec:
    """One game between two policies, described by plain values that travel to other processes and into JSON.

    Attributes:
        preset: rules of the game.
        own: policy of the team whose results are counted: a registered name or a submission's path.
        opponent: policy of the other team.
        game: number of the game within its pairing; the same number is played with and without the shield.
        seed: of the start places and of both policies.
        side: colour of the own team.
        shield: settings of the own team's shield (`ShieldConfig`), None for no shield.
        opponent_shield: likewise for the other team.
        shield_autopilot: the shield also covers boats that the game itself drives (tagged, out of bounds).
        rules: settings of the game that replace the preset's.
        fixed_start: start on the preset's fixed places instead of random ones.
        penalty: weight of a collision in the primary score.
        radii_m: radii at which separation violations are counted.
        judge: whose separation violations are judged, see `verdicts.JUDGE`.
        conditions: delay, position noise and current, the same with a shield and without.
        files: digests of both policies' files (`policies.fingerprint`), own and opponent; empty where there are none.
        trust: also load models that lie among entries of others, see `policies.load_sb3`.
        answer_s: time a policy from a file has for the actions of a step, s.
    """

    preset: str
    own: str
    opponent: str
    game: int = 0
    seed: int = 0
    side: str = "blue"
    shield: Mapping[str, Any] | None = None
    opponent_shield: Mapping[str, Any] | None = None
    shield_autopilot: bool = True
    rules: Mapping[str, Any] = field(default_factory=dict)
    fixed_start: bool = False
    penalty: float = DEFAULT_PENALTY
    radii_m: tuple[float, ...] = RADII_M
    judge: str = "shielded"
    conditions: Conditions = CALM
    files: tuple[str, str] = ("", "")
    trust: bool = False
    answer_s: float = ANSWER_S

    def __post_init__(self) -> None:
        check_seed(self.seed)
        if self.side not in SIDES:
            raise ConfigError(f"unknown side {self.side!r}; {near(self.side, SIDES)}")
        check_judge(self.judge)
        if not 0.0 < self.answer_s <= MOST_ANSWER_S:
            raise ConfigError(f"--answer-time must be above 0 and at most {MOST_ANSWER_S:g} s; got {self.answer_s:g}")

    @property
    def pairing(self) -> str:
        """Name of the pairing."""
        return f"{self.own} vs {self.opponent}"

    @property
    def covered(self) -> bool:
        """Whether the own shield also decides for boats that the game drives."""
        return self.shield is not None and self.shield_autopilot

    @property
    def own_team(self) -> int:
        """0 when the own team is blue, 1 when it is red."""
        return SIDES.index(self.side)

    @property
    def shields(self) -> tuple[Mapping[str, Any] | None, Mapping[str, Any] | None]:
        """Settings of the shields of blue and red."""
        both = (self.shield, self.opponent_shield)
        return both if self.own_team == 0 else both[::-1]

    @property
    def judged(self) -> bool:
        """Whether this game's separation violations are judged."""
        shielded = self.shield is not None or self.opponent_shield is not None
        return self.judge == "all" or (self.judge == "shielded" and shielded)

    @property
    def key(self) -> str:
        """Short name that two specs share exactly when they describe the same game."""
        return job_id(self.as_job())

    def as_job(self) -> dict[str, Any]:
        """Plain values, as `runner.Experiment` takes them."""
        return asdict(self)

    @classmethod
    def of_job(cls, job: Mapping[str, Any]) -> MatchSpec:
        """The game that plain values describe; entries that are none of a game's are left out."""
        known = {name: job[name] for name in cls.__dataclass_fields__ if name in job}
        radii_m, files = tuple(job["radii_m"]), tuple(job["files"])
        return cls(**{**known, "conditions": Conditions(**job["conditions"]), "radii_m": radii_m, "files": files})

    def config(self) -> GameConfig:
        """The game's settings; ConfigError where the preset or a setting is unknown or out of range."""
        return GameConfig.preset(self.preset, **self.rules)


def check_seed(seed: int) -> None:
    """Refuse (ConfigError) seeds that nothing can be drawn from, or whose games' seeds no record or table can hold."""
    if seed < 0:
        raise ConfigError(f"--seed must be 0 or more; got {seed}")
    if seed > LARGEST_SEED:
        raise ConfigError(f"--seed must be at most {LARGEST_SEED}; got {seed}")


def check_count(option: str, number: int, low: int, high: int) -> None:
    """Refuse (ConfigError) a number of things that are none, or too many to be listed."""
    if not low <= number <= high:
        raise ConfigError(f"{option} must be at least {low} and at most {high:,}; got {number:,}")


def near(name: str, known: Iterable[str]) -> str:
    """Say which known names are like ``name``, or all of them when none is."""
    names = list(known)
    matches = difflib.get_close_matches(name, names, n=3, cutoff=0.6)
    return f"did you mean {', '.join(matches)}?" if matches else f"choose one of {', '.join(names)}"


def counted_m(game: GameConfig) -> float:
    """Distance at which a game counts collisions, m: the largest of any two boats."""
    radii_m = game.agent_radius_m
    return 2.0 * max(radii_m) if isinstance(radii_m, tuple) else 2.0 * radii_m


def check_shield(settings: Mapping[str, Any], game: GameConfig) -> ShieldConfig:
    """The settings of a shield that fit a game, checked before it is played.

    Raises:
        ConfigError: a setting is unknown or out of range, or a distance that the field has no room for.
    """
    config = ShieldConfig.of(**settings)
    shorter_m = min(game.env_bounds_m)
    if config.separation_m > shorter_m:
        raise ConfigError(
            f"separation_m is {config.separation_m:g} m, more than the shorter side of the field, {shorter_m:g} m: "
            f"no boats there can keep it; give {shorter_m:g} m at most"
        )
    return config


def words_of_less(kept_m: float, game: GameConfig) -> str:
    """What to say of a shield that keeps less than the distance at which its game counts collisions; else nothing."""
    if kept_m >= counted_m(game) - 1e-9:
        return ""
    return (
        f"the shield keeps {kept_m:g} m (separation_m), but this game counts collisions at {counted_m(game):g} m: "
        "such hits it does not prevent"
    )


def opening(config: GameConfig, seed: int) -> dict[str, Any]:
    """Draw start places and headings, the same of the same seed.

    Most policies are deterministic, so games differ by their start places alone; the preset's own random starts give
    boats speeds and places from which a violation cannot be avoided, which would say nothing about a shield.

    Every boat lies at rest on its own side, `GAP_M` or more from every other boat, flag home and field edge
    (less where the field is small), heading for the opponents' flag give or take `SPREAD_DEG`.

    Returns:
        ``init_dict`` for ``env.reset(options={"init_dict": ...})``.

    Raises:
        ConfigError: obstacles or the number of boats leave no room.
    """
    field, rng = field_geometry(config), np.random.default_rng([seed, 0x5EA])
    homes, gap_m = field.flag_home, min(GAP_M, float(field.size.min()) / (2.0 * config.team_size))
    places, headings = list[Array](), list[float]()
    for boat in range(config.n_boats):
        team = boat // config.team_size
        for _ in range(TRIES):
            place = rng.uniform(gap_m, field.size - gap_m)
            own, other = np.linalg.norm(homes - place, axis=1)[[team, 1 - team]]
            # a boat's width clear of the dividing line, so that it starts on its own side
            clear = min(np.linalg.norm(place - thing) for thing in (*places, *homes)) >= gap_m and other - own > gap_m
            if clear and not _on_obstacle(config, place, gap_m):
                break
        else:
            raise ConfigError("no start places found; use fewer boats or obstacles, a larger field, or --fixed-start")
        east, north = homes[1 - team] - place
        places.append(np.asarray(place))
        headings.append(float(np.degrees(np.arctan2(east, north)) + rng.uniform(-SPREAD_DEG, SPREAD_DEG)))
    return {
        "agent_position": [place.tolist() for place in places],
        "agent_heading": [(heading + 180.0) % 360.0 - 180.0 for heading in headings],
        "agent_speed": [0.0] * config.n_boats,
    }


def _on_obstacle(config: GameConfig, place: Array, gap_m: float) -> bool:
    obstacles = config.obstacles or {"circle": (), "polygon": ()}
    if any(np.linalg.norm(place - centre) < radius + gap_m for radius, centre in obstacles["circle"]):
        return True
    boxes = (np.array(corners) for corners in obstacles["polygon"])  # a polygon's bounding box will do
    return any(bool(((place > b.min(axis=0) - gap_m) & (place < b.max(axis=0) + gap_m)).all()) for b in boxes)
