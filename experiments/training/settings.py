"""What a training is to be: frozen settings, checked when they are built; a config file's keys are their names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from steerclear.env.config import GameConfig
from steerclear.shield.exceptions import ConfigError

from ..play.kept_distance import check_shield
from ..play.spec import near
from .checks import choice, count, number, span, texts

SHIELDS = ("none", "deployment", "training", "training+intervention")
ALGORITHMS = ("ppo", "qmix", "qmix+ppo", "cloning", "raids")
DEVICES = ("auto", "cpu", "cuda")
SELF = "self"
"""Among opponents: snapshots of the learner."""
INTERVENTION_WEIGHT = 0.02
"""Cost of a game step in which the shield changed a boat's command, where the shield mode asks for one."""

Span = float | tuple[float, float]
"""A number, or two that each game draws its own between."""


@dataclass(frozen=True)
class Stage:
    """One stage of a curriculum, against a pool of opponents, which ends by its promotion rule.

    Promotion: once ``games`` games that began in the stage have ended with a mean of at least ``net`` captures for less
    against over the last ``games`` of them, or after ``most`` decisions of all boats together (0: never for that). The
    last stage goes on until the training ends.

    Attributes:
        opponents: names as `steerclear.policies.make_batch` takes them, single-game policies (entrants, submissions;
            slower), or "self": the league's snapshots of the learner.
        net: captures for less against, a game.
        games: games that the mean is over.
        most: decisions.
        tag_probability: chance that a tag of either team succeeds in this stage, so that boats learn to bring flags
            home before they learn to keep away from tags; None: as in the rules. Evaluations are always by the rules.
        cooldown_s: time in which an opponent that has tagged cannot tag again in this stage, at least the rules'; with
            more, a team learns to draw a tag first and to use the time after it. Two numbers: each game draws its own
            between them. None: as in the rules.
        rewards: weights of reward terms that replace the training's in this stage; what is not named stays.
        shielded: with a shield in training, whether it stands in the games of this stage.
        rules: settings of the game that replace the training's in this stage, such as slower boats for opponents; what
            boats see must keep its size and bounds. Evaluations are always by the training's rules.
    """

    opponents: tuple[str, ...] = ("medium",)
    net: float = 2.0
    games: int = 30
    most: int = 0
    tag_probability: float | None = None
    cooldown_s: Span | None = None
    rewards: Mapping[str, float] = field(default_factory=dict)
    shielded: bool = True
    rules: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "opponents", texts("opponents", self.opponents))
        number("net", self.net, -100.0, 100.0)
        count("games", self.games, 1, 100_000)
        count("most", self.most, 0, 10**12)
        if self.tag_probability is not None:
            number("tag_probability", self.tag_probability, 0.0, 1.0)
        if self.cooldown_s is not None:
            object.__setattr__(self, "cooldown_s", span("cooldown_s", self.cooldown_s, 0.0, 1e6))
        if not isinstance(self.rewards, Mapping):
            raise ConfigError(f"rewards is {self.rewards!r}; give names and weights, such as {{collision: 0.1}}")
        for name, weight in self.rewards.items():
            number(f"rewards.{name}", weight, -1000.0, 1000.0)
        if not isinstance(self.shielded, bool):
            raise ConfigError(f"shielded is {self.shielded!r}; give true or false")
        if not isinstance(self.rules, Mapping):
            raise ConfigError(f"rules is {self.rules!r}; give settings of the game, such as {{max_time_s: 120}}")


@dataclass(frozen=True)
class Ppo:
    """Settings of PPO, ours by default: large batches and few epochs keep the network's share of the time small.

    Attributes are as in Stable-Baselines3; ``batch`` is the size of its minibatches, and a rollout is ``steps``
    decisions of every boat in every game. ``critic_first``: so many rollouts teach the critic alone. Weights to start
    with are an actor's; a critic that knows nothing yet would lead it astray.
    """

    steps: int = 128
    batch: int = 8192
    epochs: int = 4
    learning_rate: float = 1e-3
    discount: float = 0.99
    gae_lambda: float = 0.95
    clip: float = 0.2
    entropy: float = 0.01
    value: float = 0.5
    max_grad_norm: float = 0.5
    critic_first: int = 0

    def __post_init__(self) -> None:
        count("critic_first", self.critic_first, 0, 10**6)
        for name, least, most in (("steps", 1, 100_000), ("batch", 2, 10**7), ("epochs", 1, 1000)):
            count(name, getattr(self, name), least, most)
        for name in ("learning_rate", "clip", "max_grad_norm"):
            number(name, getattr(self, name), 1e-9, 1e3)
        for name in ("discount", "gae_lambda"):
            number(name, getattr(self, name), 0.0, 1.0)
        for name in ("entropy", "value"):
            number(name, getattr(self, name), 0.0, 100.0)


@dataclass(frozen=True)
class Net:
    """The network: widths of its hidden layers, activation, who has it, features or raw observations.

    ``roles``: "shared": one for all boats; "placed": one for all, told a boat's place in the team, which the rules can
    hang on (of boats in reach of a tag, the first in order is tagged); "each": one per place.
    """

    hidden: tuple[int, ...] = (128, 128)
    activation: str = "tanh"
    roles: str = "shared"
    features: bool = True

    def __post_init__(self) -> None:
        if not isinstance(self.hidden, (list, tuple)) or not 1 <= len(self.hidden) <= 8:
            raise ConfigError(f"hidden is {self.hidden!r}; give a list of widths, such as [128, 128]")
        object.__setattr__(self, "hidden", tuple(count("hidden", width, 1, 4096) for width in self.hidden))
        choice("activation", self.activation, ("tanh", "relu"))
        choice("roles", self.roles, ("shared", "placed", "each"))
        if not isinstance(self.features, bool):
            raise ConfigError(f"features is {self.features!r}; give true or false")


@dataclass(frozen=True)
class Evaluation:
    """Games against held-out opponents during a training: every so many rollouts, games each, length in s."""

    every: int = 20
    opponents: tuple[str, ...] = ("medium",)
    games: int = 16
    seed: int = 900_000

    def __post_init__(self) -> None:
        object.__setattr__(self, "opponents", texts("opponents", self.opponents))
        if SELF in self.opponents:
            raise ConfigError(f"evaluation.opponents names {SELF!r}, which is no policy; name held-out opponents")
        count("every", self.every, 1, 10**6)
        count("games", self.games, 1, 10_000)
        count("seed", self.seed, 0, 2**40)


@dataclass(frozen=True)
class League:
    """Snapshots of the learner as opponents.

    Matching rule: each game that begins draws its opponent from the stage's pool with weight (1 - s)^power + floor,
    where s is the learner's mean score (1 won, 0.5 drawn, 0 lost by captures) in its last 50 games against it; so those
    who beat it come more often, and none is forgotten.

    Attributes:
        every: rollouts between snapshots, while "self" is in the pool.
        keep: snapshots at most; the oldest goes.
        power: how much more those that beat it come.
        floor: least weight.
    """

    every: int = 20
    keep: int = 4
    power: float = 2.0
    floor: float = 0.1

    def __post_init__(self) -> None:
        count("every", self.every, 1, 10**6)
        count("keep", self.keep, 1, 100)
        number("power", self.power, 0.0, 10.0)
        number("floor", self.floor, 1e-6, 10.0)


@dataclass(frozen=True)
class TrainingSettings:
    """All of a training.

    Attributes:
        algorithm: one of `ALGORITHMS`.
        preset: rules of the game.
        platform: of all boats; empty: the preset's.
        rules: settings of the game that replace the preset's.
        games: games at once.
        decisions: decisions of all boats together after which the training ends.
        interval: game steps for which a decision is held.
        actions: "discrete" or "normalised".
        stages: the curriculum.
        rewards: weights of reward terms by name, see `rewards.TERMS`.
        shield: one of `SHIELDS`.
        shield_settings: of its `ShieldConfig`.
        shield_every: game steps between two questions to the shield in the games learned in; with more than 1 it
            guarantees nothing there. Evaluations ask it in every game step.
        entrants_every: game steps between two questions to opponents that play one game after another, in the games
            learned in; with more than 1 they hold their courses in between and cost less. Evaluations ask each step.
        seed: of everything.
        device: where the network learns; "auto" takes a GPU where there is one.
        threads: of the network on a CPU. One is fastest for networks this small: more wait for one another, the more so
            where other programs run.
        checkpoint_every: rollouts between checkpoints.
        start: exported weights to begin with; empty: none.
    """

    algorithm: str = "ppo"
    preset: str = "aamas2024"
    platform: str = ""
    rules: Mapping[str, Any] = field(default_factory=dict)
    games: int = 64
    decisions: int = 3_000_000
    interval: int = 10
    actions: str = "discrete"
    stages: tuple[Stage, ...] = (Stage(),)
    rewards: Mapping[str, float] = field(default_factory=lambda: {"sparse": 1.0, "progress": 1.0})
    shield: str = "none"
    shield_settings: Mapping[str, Any] = field(default_factory=dict)
    shield_every: int = 1
    entrants_every: int = 1
    ppo: Ppo = field(default_factory=Ppo)
    net: Net = field(default_factory=Net)
    evaluation: Evaluation = field(default_factory=Evaluation)
    league: League = field(default_factory=League)
    options: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0
    device: str = "auto"
    threads: int = 1
    checkpoint_every: int = 10
    start: str = ""

    def __post_init__(self) -> None:
        for name, known in (("algorithm", ALGORITHMS), ("shield", SHIELDS), ("device", DEVICES)):
            choice(name, getattr(self, name), known)
        choice("actions", self.actions, ("discrete", "normalised"))
        count("games", self.games, 1, 100_000)
        count("decisions", self.decisions, 1, 10**12)
        count("interval", self.interval, 1, 1000)
        count("seed", self.seed, 0, 2**40)
        count("shield_every", self.shield_every, 1, 1000)
        count("entrants_every", self.entrants_every, 1, 1000)
        count("threads", self.threads, 1, 1024)
        count("checkpoint_every", self.checkpoint_every, 1, 10**6)
        learners = self.games * self.game().team_size
        if self.algorithm in ("ppo", "qmix+ppo") and self.ppo.steps * learners < 2:
            raise ConfigError(
                f"ppo.steps is {self.ppo.steps} and games {self.games}, so that a rollout holds one decision; "
                "PPO needs 2, give more of either"
            )
        if not self.stages:
            raise ConfigError("stages is empty; give one stage at least, such as [{opponents: [medium]}]")
        for name, weight in self.rewards.items():
            number(f"rewards.{name}", weight, -1000.0, 1000.0)
        for stage in (None, *(stage for stage in self.stages if stage.rules)):
            self._check_shield(self.game(stage))

    def game(self, stage: Stage | None = None) -> GameConfig:
        """The rules of its games, in a stage or in evaluations.

        Raises:
            ConfigError: they cannot be.
        """
        rules: dict[str, Any] = {"default_start": False, **self.rules, **(stage.rules if stage else {})}
        if self.platform:
            rules["platforms"] = self.platform
        return GameConfig.preset(self.preset, **rules)

    def _check_shield(self, game: GameConfig) -> None:
        """Whatever the shield mode: a shield of these settings must fit the game before it is trained for."""
        try:
            check_shield(self.shield_settings, game)
        except ConfigError as error:
            raise ConfigError(f"shield_settings: {error}") from None

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


_PARTS: dict[str, Any] = {"ppo": Ppo, "net": Net, "evaluation": Evaluation, "league": League}


def settings_of(content: Any, where: str = "the config") -> TrainingSettings:
    """Settings from a config's content.

    Raises:
        ConfigError: an unknown key (the message names near ones), or a value that cannot be.
    """
    given = dict(_mapping(content, where))
    _known(given, TrainingSettings, where)
    for name, kind in _PARTS.items():
        if name in given:
            given[name] = _built(kind, given[name], f"{name} in {where}")
    if "stages" in given:
        if not isinstance(given["stages"], list):
            raise ConfigError(f"stages in {where} is no list; give one stage a line: - opponents: [medium]")
        given["stages"] = tuple(_built(Stage, one, f"a stage in {where}") for one in given["stages"])
    for name in ("rules", "rewards", "shield_settings", "options"):
        if name in given:
            given[name] = dict(_mapping(given[name], f"{name} in {where}"))
    return _built(TrainingSettings, given, where)


def _built(kind: Any, given: Any, where: str) -> Any:
    values = dict(_mapping(given, where))
    _known(values, kind, where)
    try:
        return kind(**values)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from None


def _known(given: Mapping[str, Any], kind: Any, where: str) -> None:
    names = [entry.name for entry in fields(kind)]
    for name in given:
        if name not in names:
            raise ConfigError(f"unknown key {name!r} in {where}; {near(str(name), names)}")


def _mapping(content: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(content, Mapping):
        raise ConfigError(f"{where} is {type(content).__name__}; give keys and values (docs/train.md)")
    return content
