"""What a game is to be, complete enough to be played again to the bit: a `MatchSpec`; what its settings must be."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from steerclear.env.config import GameConfig
from steerclear.shield import ShieldConfig
from steerclear.shield.exceptions import ConfigError

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
