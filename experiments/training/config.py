"""What a training is to be: the keys of a config file are the names of these models, checked when they are built."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator
from steerclear.env.config import GameConfig
from steerclear.shield.bridge.fleet_yaml import read_settings
from steerclear.shield.exceptions import ConfigError, FleetFileError

from ..play.spec import check_shield, near

SELF = "self"
"""Among opponents: snapshots of the learner."""
SHIELDS = ("none", "deployment", "training", "training+intervention")
INTERVENTION_WEIGHT = 0.02
"""Cost of a game step in which the shield changed a boat's command, where the shield mode asks for one."""
MOST_BYTES = 2**20
REMEDY = "give a config file (docs/train.md)"


def _in_order(value: Any) -> Any:
    if isinstance(value, tuple) and value[0] > value[1]:
        raise ValueError("give the least first")
    return value


AsTuple = BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value)
Count = Annotated[int, Field(ge=1, le=10**12)]
Size = Annotated[int, Field(ge=1, le=10**7)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Rate = Annotated[float, Field(ge=1e-9, le=1e3)]
Held = Annotated[int, Field(ge=1, le=1000)]
"""Game steps."""
Seed = Annotated[int, Field(ge=0, le=2**40)]
Width = Annotated[int, Field(ge=1, le=4096)]
Weights = Mapping[str, Annotated[float, Field(ge=-1000.0, le=1000.0)]]
Settings = Mapping[str, Any]
Names = Annotated[tuple[Annotated[str, Field(min_length=1)], ...], Field(min_length=1), AsTuple]
Seconds = Annotated[float, Field(ge=0.0, le=1e6)]
Span = Annotated[Seconds | tuple[Seconds, Seconds], AsTuple, AfterValidator(_in_order)]
"""A number, or two that each game draws its own between, the least first."""
Numbers = Annotated[tuple[Annotated[float, Field(ge=0.0, le=10.0)], ...], AsTuple]


class Part(BaseModel):
    """Part of a config: unknown keys are errors, and nothing is taken for something else."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class Stage(Part):
    """How games of a stage are played; evaluations are always by the training's rules, settings and shield.

    A stage of several ends once ``games`` games that began in it have ended with a mean of at least ``net`` captures
    for less against over the last ``games`` of them, or after ``most`` decisions of all boats together (0: never for
    that); the last goes on until the training ends. Rules of a stage must leave what boats see its size and bounds.
    """

    opponents: Names = ("medium",)
    tag_probability: Share | None = None
    cooldown_s: Span | None = None
    rewards: Weights = Field(default_factory=dict)
    shielded: bool = True
    shield_settings: Settings = Field(default_factory=dict)
    rules: Settings = Field(default_factory=dict)
    net: Annotated[float, Field(ge=-100.0, le=100.0)] = 2.0
    games: Annotated[int, Field(ge=1, le=100_000)] = 30
    most: Annotated[int, Field(ge=0, le=10**12)] = 0


class Ppo(Part):
    """Settings of PPO as in Stable-Baselines3; large batches and few epochs keep the network's share of the time small.

    Weights to start with are an actor's; a critic that knows nothing yet would lead it astray (``critic_first``).
    """

    discount: Share = 0.99
    steps: Annotated[int, Field(ge=1, le=100_000)] = 128
    batch: Annotated[int, Field(ge=2, le=10**7)] = 8192
    epochs: Held = 4
    learning_rate: Rate = 1e-3
    gae_lambda: Share = 0.95
    clip: Rate = 0.2
    entropy: Annotated[float, Field(ge=0.0, le=100.0)] = 0.01
    max_grad_norm: Rate = 0.5
    critic_first: Annotated[int, Field(ge=0, le=10**6)] = 0
    value: Annotated[float, Field(ge=0.0, le=100.0)] = 0.5


class Net(Part):
    """The network: one for all boats, one that is told a boat's place (rules can hang on it), or one per place."""

    hidden: Annotated[tuple[Width, ...], Field(min_length=1, max_length=8), AsTuple] = (128, 128)
    activation: Literal["tanh", "relu"] = "tanh"
    features: bool = True
    roles: Literal["shared", "placed", "each"] = "shared"


class Evaluation(Part):
    """Games against held-out opponents, so many each, every so many rollouts."""

    opponents: Names = ("medium",)
    games: Annotated[int, Field(ge=1, le=10_000)] = 16
    seed: Seed = 900_000
    every: Count = 20

    @model_validator(mode="after")
    def _check(self) -> Evaluation:
        if SELF in self.opponents:
            raise ValueError(f"opponents names {SELF!r}, which is no policy; name held-out opponents")
        return self


class League(Part):
    """The matching rule, and snapshots of the learner as opponents while "self" is in the pool.

    Each game that begins draws its opponent from the stage's pool with weight (1 - s)^power + floor, where s is the
    learner's mean score (1 won, 0.5 drawn, 0 lost by captures) in its last 50 games against it; so those who beat it
    come more often, and none is forgotten. A snapshot is taken ``every`` so many rollouts, and so many are kept.
    """

    power: Annotated[float, Field(ge=0.0, le=10.0)] = 2.0
    floor: Annotated[float, Field(ge=1e-6, le=10.0)] = 0.1
    every: Count = 20
    keep: Annotated[int, Field(ge=1, le=100)] = 4


class QmixOptions(Part):
    """Moments kept and moments an update, updates a decision of all games, random actions, rate of Adam."""

    replay: Annotated[int, Field(ge=1, le=10**8)] = 50_000
    batch: Size = 256
    updates: Held = 4
    explore_end: Share = 0.05
    explore_share: Annotated[float, Field(ge=1e-6, le=1.0)] = 0.5
    rate: Rate = 5e-4


class TwoPartOptions(QmixOptions):
    """QMIX's, and its share of the decisions; the rest is PPO's."""

    play_share: Share = 0.5


class CloningOptions(Part):
    """How the scripted demonstrator's games are learned from."""

    epochs: Annotated[int, Field(ge=1, le=10**6)] = 200
    rate: Rate = 3e-3
    hidden: Width = 64
    batch: Size = 256


class RaidsOptions(Part):
    """Where raids begin (``shares`` of each of `raids.KINDS`), and how far numbers are drawn about what is learned."""

    recorded: Annotated[Numbers, Field(min_length=1)] = (0.0, 0.4)
    shares: Annotated[Numbers, Field(min_length=6, max_length=6)] = (0.15, 0.35, 0.3, 0.2, 0.0, 0.0)
    spread: Annotated[float, Field(ge=1e-3, le=10.0)] = 0.5
    furthest: Annotated[float, Field(ge=1e-6, le=10.0)] = 0.05

    @model_validator(mode="after")
    def _check(self) -> RaidsOptions:
        if not any(self.shares):
            raise ValueError("shares are all 0; give one above 0")
        return self


class Config(Part):
    """A training; docs/train.md says what each key is, `NO_USE` which ones an algorithm does not know."""

    algorithm: Literal["ppo", "qmix", "qmix+ppo", "raids", "cloning"] = "ppo"
    preset: str = "aamas2024"
    platform: str = ""
    rules: Settings = Field(default_factory=dict)
    games: Annotated[int, Field(ge=1, le=100_000)] = 64
    seed: Seed = 0
    decisions: Count = 3_000_000
    interval: Held = 10
    actions: Literal["discrete", "normalised"] = "discrete"
    stages: Annotated[tuple[Stage, ...], Field(min_length=1), AsTuple] = (Stage(),)
    rewards: Weights = Field(default_factory=lambda: {"sparse": 1.0, "progress": 1.0})
    shield: Literal["none", "deployment", "training", "training+intervention"] = "none"
    shield_settings: Settings = Field(default_factory=dict)
    shield_every: Held = 1
    shield_threads: Annotated[int, Field(ge=1, le=1024)] = 1
    entrants_every: Held = 1
    threads: Annotated[int, Field(ge=1, le=1024)] = 1
    device: Literal["auto", "cpu", "cuda"] = "auto"
    ppo: Ppo = Ppo()
    net: Net = Net()
    evaluation: Evaluation = Evaluation()
    league: League = League()
    options: Any = Part()
    checkpoint_every: Count = 10
    start: str = ""

    @model_validator(mode="after")
    def _check(self) -> Config:
        """Whatever the shield mode: shields of these settings must fit the games before they are trained for."""
        kind = self.algorithm
        if kind != "ppo" and SELF in self.stages[0].opponents:
            raise ValueError(f"stages[0].opponents names {SELF!r}, and there are no snapshots at first; leave it out")
        if not kind.endswith("ppo") and len(self.stages) > 1:
            raise ValueError(f"stages is of {len(self.stages)}; algorithm {kind} learns in one")
        if kind in ("qmix", "cloning") and self.device == "cuda":
            raise ValueError("device is 'cuda'; it should be 'auto' or 'cpu'")
        if kind == "qmix+ppo" and self.actions != "discrete":
            raise ValueError(f"actions is {self.actions!r}; it should be 'discrete'")
        if kind == "cloning":
            return self
        for stage in (None, *(one for one in self.stages if one.rules or one.shield_settings)):
            try:
                check_shield(self.shield_of(stage), self.game(stage))
            except ConfigError as error:
                raise ConfigError(f"shield_settings: {error}") from None
        if kind.endswith("ppo") and self.ppo.steps * self.games * self.game().team_size < 2:
            raise ValueError("a rollout of one decision teaches nothing; give more of ppo.steps or of games")
        return self

    def game(self, stage: Stage | None = None) -> GameConfig:
        """The rules of its games, in a stage or in evaluations."""
        rules: dict[str, Any] = {"default_start": False, **self.rules, **(stage.rules if stage else {})}
        if self.platform:
            rules["platforms"] = self.platform
        return GameConfig.preset(self.preset, **rules)

    def shield_of(self, stage: Stage | None = None) -> dict[str, Any]:
        """Settings of the shield in a stage or in evaluations."""
        return {**self.shield_settings, **(stage.shield_settings if stage else {})}

    def reward_weights(self, stage: Stage) -> dict[str, float]:
        """Weights of the reward terms in a stage, the shield mode's own among them."""
        weights = {**self.rewards, **stage.rewards}
        if self.shield == "training+intervention":
            weights.setdefault("intervention", INTERVENTION_WEIGHT)
        return weights

    @property
    def shielded_training(self) -> bool:
        """Whether the shield stands in the games learned in."""
        return self.shield.startswith("training")

    def told(self) -> dict[str, Any]:
        """Keys and values that make it again, fit for JSON: those that its algorithm has a use for."""
        found = self.model_dump(mode="json")
        for path in NO_USE[self.algorithm]:
            head, _, name = path.partition(".")
            for part in _parts_of(found, head) if name else (found,):
                part.pop(name or head, None)
        return found


OPTIONS: dict[str, type[Part]] = {
    "ppo": Part,
    "qmix": QmixOptions,
    "qmix+ppo": TwoPartOptions,
    "raids": RaidsOptions,
    "cloning": CloningOptions,
}
"""Options by algorithm."""
_CURRICULUM = ("stages.net", "stages.games", "stages.most", "league.every", "league.keep")
_OF_CLONING = ("algorithm", "preset", "platform", "rules", "games", "seed", "device", "stages", "options")
NO_USE: dict[str, tuple[str, ...]] = {
    "ppo": ("options",),
    "qmix": (
        *("actions", "checkpoint_every", "start", "evaluation.every", "net.roles", *_CURRICULUM),
        *(f"ppo.{name}" for name in Ppo.model_fields if name != "discount"),
    ),
    "qmix+ppo": (),
    "raids": ("actions", "checkpoint_every", "shield_every", "ppo.value", "net.features", "net.roles", *_CURRICULUM),
    "cloning": (
        *(name for name in Config.model_fields if name not in _OF_CLONING),
        *(f"stages.{name}" for name in Stage.model_fields if name != "opponents"),
    ),
}
"""Keys that an algorithm has no use for."""


def read_config(path: Path) -> Config:
    """The config in a file."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise ConfigError(f"{path} is larger than {MOST_BYTES} bytes; {REMEDY}")
        return config_of(read_settings(path.read_text(encoding="utf-8")), str(path))
    except OSError as error:
        raise ConfigError(f"cannot read {path} ({error.strerror}); {REMEDY}") from error
    except FleetFileError as error:
        raise ConfigError(f"{path}: {error}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path} is no text in UTF-8 ({error.reason}); {REMEDY}") from error


def config_of(content: Any, where: str = "the config") -> Config:
    """The config that keys and values make."""
    if not isinstance(content, Mapping):
        raise ConfigError(f"{where} is {type(content).__name__}; give keys and values (docs/train.md)")
    algorithm = content.get("algorithm", "ppo")
    if algorithm not in OPTIONS:
        raise ConfigError(f"algorithm in {where} is {algorithm!r}; {near(str(algorithm), OPTIONS)}")
    for path in NO_USE[algorithm]:
        head, _, name = path.partition(".")
        if any(name in part for part in _parts_of(content, head)) if name else head in content:
            raise ConfigError(f"{where}: algorithm {algorithm} has no use for {path}; leave it out")
    before: tuple[str, ...] = ("options",)
    try:
        options = OPTIONS[algorithm].model_validate(content.get("options", {}))
        before = ()
        return Config.model_validate({**content, "options": options})
    except ValidationError as error:
        raise ConfigError(f"{where}: {_words(error, algorithm, before)}") from None


def _parts_of(content: Mapping[str, Any], head: str) -> Iterator[Any]:
    """The mappings under a key: one, or those of a list."""
    found = content.get(head)
    yield from (one for one in (found if isinstance(found, list) else [found]) if isinstance(one, Mapping))


def _words(error: ValidationError, algorithm: str, before: tuple[str, ...]) -> str:
    """The first thing that is wrong, in one line: where, what was found, what to give."""
    first = error.errors()[0]
    steps = [*before, *(str(step) for step in first["loc"] if not isinstance(step, int))]
    path, text = ".".join(steps), first["msg"].removeprefix("Value error, ")
    if first["type"] == "extra_forbidden":
        if before and any(steps[-1] in kind.model_fields for kind in OPTIONS.values()):
            return f"algorithm {algorithm} has no use for {path}; leave it out"
        return f"unknown key {path!r}; {near(steps[-1], _fields(OPTIONS[algorithm] if before else Config, steps))}"
    if not path:
        return text
    return f"{path} is {str(first['input'])[:80]!r}; {text.replace('Input should', 'it should')}"


def _fields(kind: Any, steps: list[str]) -> list[str]:
    """Names of the keys beside an unknown one."""
    for step in steps[:-1] if kind is Config else ():
        annotation = kind.model_fields[step].annotation
        parts = (annotation, *get_args(annotation))
        kind = next(one for one in parts if isinstance(one, type) and issubclass(one, Part))
    return list(kind.model_fields)
