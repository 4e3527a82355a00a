"""What a training is to be: the keys of a config file are the names of these models, checked when they are built."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from steerclear.env.config import GameConfig
from steerclear.shield.exceptions import ConfigError

from ..play.spec import check_shield

SELF = "self"
"""Among opponents: snapshots of the learner."""
SHIELDS = ("none", "deployment", "training", "training+intervention")
INTERVENTION_WEIGHT = 0.02
"""Cost of a game step in which the shield changed a boat's command, where the shield mode asks for one."""


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _in_order(value: Any) -> Any:
    if isinstance(value, tuple) and value[0] > value[1]:
        raise ValueError("give the least first")
    return value


Count = Annotated[int, Field(ge=1, le=10**12)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Rate = Annotated[float, Field(ge=1e-9, le=1e3)]
Held = Annotated[int, Field(ge=1, le=1000)]
"""Game steps."""
Weights = Mapping[str, Annotated[float, Field(ge=-1000.0, le=1000.0)]]
Settings = Mapping[str, Any]
Names = Annotated[tuple[Annotated[str, Field(min_length=1)], ...], Field(min_length=1), BeforeValidator(_as_tuple)]
Seconds = Annotated[float, Field(ge=0.0, le=1e6)]
Span = Annotated[Seconds | tuple[Seconds, Seconds], BeforeValidator(_as_tuple), AfterValidator(_in_order)]
"""A number, or two that each game draws its own between, the least first."""


class Part(BaseModel):
    """Part of a config: unknown keys are errors, and nothing is taken for something else."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class Opponents(Part):
    """Whom games are played against.

    ``opponents``: names as `steerclear.policies.make_batch` takes them, single-game policies (entrants, submissions;
    slower), or "self": the league's snapshots of the learner.
    """

    opponents: Names = ("medium",)


class Stage(Opponents):
    """How games of a stage are played; evaluations are always by the training's rules, settings and shield.

    Attributes:
        tag_probability: chance that a tag of either team succeeds, so that boats learn to bring flags home before they
            learn to keep away from tags; None: as in the rules.
        cooldown_s: time in which an opponent that has tagged cannot tag again, at least the rules'; with more, a team
            learns to draw a tag first and to use the time after it. Two numbers: each game draws its own between them.
        rewards: weights of reward terms that replace the training's; what is not named stays.
        shielded: with a shield in training, whether it stands in the games of this stage.
        shield_settings: of its `ShieldConfig`, that replace the training's, such as a separation that grows.
        rules: settings of the game that replace the training's, such as slower boats for opponents; what boats see
            must keep its size and bounds.
    """

    tag_probability: Share | None = None
    cooldown_s: Span | None = None
    rewards: Weights = Field(default_factory=dict)
    shielded: bool = True
    shield_settings: Settings = Field(default_factory=dict)
    rules: Settings = Field(default_factory=dict)


class CurriculumStage(Stage):
    """A stage of several, which ends by its promotion rule; the last goes on until the training ends.

    Promotion: once ``games`` games that began in the stage have ended with a mean of at least ``net`` captures for less
    against over the last ``games`` of them, or after ``most`` decisions of all boats together (0: never for that).
    """

    net: Annotated[float, Field(ge=-100.0, le=100.0)] = 2.0
    games: Annotated[int, Field(ge=1, le=100_000)] = 30
    most: Annotated[int, Field(ge=0, le=10**12)] = 0


class Discount(Part):
    """What QMIX takes of PPO's settings."""

    discount: Share = 0.99


class RaidsPpo(Discount):
    """Settings of PPO, ours by default: large batches and few epochs keep the network's share of the time small.

    Attributes are as in Stable-Baselines3; ``batch`` is the size of its minibatches, and a rollout is ``steps``
    decisions of every boat in every game. ``critic_first``: so many rollouts teach the critic alone. Weights to start
    with are an actor's; a critic that knows nothing yet would lead it astray.
    """

    steps: Annotated[int, Field(ge=1, le=100_000)] = 128
    batch: Annotated[int, Field(ge=2, le=10**7)] = 8192
    epochs: Held = 4
    learning_rate: Rate = 1e-3
    gae_lambda: Share = 0.95
    clip: Rate = 0.2
    entropy: Annotated[float, Field(ge=0.0, le=100.0)] = 0.01
    max_grad_norm: Rate = 0.5
    critic_first: Annotated[int, Field(ge=0, le=10**6)] = 0


class Ppo(RaidsPpo):
    """The same, and the weight of the critic's loss, where one optimiser learns both."""

    value: Annotated[float, Field(ge=0.0, le=100.0)] = 0.5


class Layers(Part):
    """The network: widths of its hidden layers, and the activation between them."""

    hidden: Annotated[
        tuple[Annotated[int, Field(ge=1, le=4096)], ...],
        Field(min_length=1, max_length=8),
        BeforeValidator(_as_tuple),
    ] = (128, 128)
    activation: Literal["tanh", "relu"] = "tanh"


class Net(Layers):
    """A network that is given features of its observations, or the observations as they are."""

    features: bool = True


class BoatsNet(Net):
    """A network of the boats of a team.

    ``roles``: "shared": one for all boats; "placed": one for all, told a boat's place in the team, which the rules can
    hang on (of boats in reach of a tag, the first in order is tagged); "each": one per place.
    """

    roles: Literal["shared", "placed", "each"] = "shared"


class Evaluation(Part):
    """Games against held-out opponents: so many each."""

    opponents: Names = ("medium",)
    games: Annotated[int, Field(ge=1, le=10_000)] = 16
    seed: Annotated[int, Field(ge=0, le=2**40)] = 900_000

    @model_validator(mode="after")
    def _check(self) -> Evaluation:
        if SELF in self.opponents:
            raise ValueError(f"opponents names {SELF!r}, which is no policy; name held-out opponents")
        return self


class Evaluations(Evaluation):
    """Evaluations during a training, every so many rollouts."""

    every: Count = 20


class Draws(Part):
    """The league's matching rule.

    Each game that begins draws its opponent from the stage's pool with weight (1 - s)^power + floor, where s is the
    learner's mean score (1 won, 0.5 drawn, 0 lost by captures) in its last 50 games against it; so those who beat it
    come more often, and none is forgotten.
    """

    power: Annotated[float, Field(ge=0.0, le=10.0)] = 2.0
    floor: Annotated[float, Field(ge=1e-6, le=10.0)] = 0.1


class League(Draws):
    """Snapshots of the learner as opponents, ``every`` so many rollouts while "self" is in the pool; so many kept."""

    every: Count = 20
    keep: Annotated[int, Field(ge=1, le=100)] = 4


class PpoOptions(Part):
    """``first``: a file of weights that play until the flag is held."""

    first: str = ""


class QmixOptions(Part):
    """Moments kept and moments an update, updates a decision of all games, random actions, rate of Adam.

    ``explore_end`` is the last share of random actions, ``explore_share`` the share of the training until then.
    """

    replay: Annotated[int, Field(ge=1, le=10**8)] = 50_000
    batch: Annotated[int, Field(ge=1, le=10**7)] = 256
    updates: Held = 4
    explore_end: Share = 0.05
    explore_share: Annotated[float, Field(ge=1e-6, le=1.0)] = 0.5
    rate: Rate = 5e-4


class TwoPartOptions(QmixOptions):
    """QMIX's, and its share of the decisions; the rest is PPO's."""

    play_share: Share = 0.5


class CloningOptions(Part):
    """A file of ``steerclear demonstrate`` (empty: games of the scripted demonstrator), and how it is learned from."""

    demonstrations: str = ""
    epochs: Annotated[int, Field(ge=1, le=10**6)] = 200
    rate: Rate = 3e-3
    hidden: Annotated[int, Field(ge=1, le=4096)] = 64
    batch: Annotated[int, Field(ge=1, le=10**7)] = 256


Numbers = Annotated[tuple[Annotated[float, Field(ge=0.0, le=10.0)], ...], BeforeValidator(_as_tuple)]


class RaidsOptions(Part):
    """Where raids begin, and how far their numbers are drawn about what is learned.

    Attributes:
        recorded: deviations of the numbers in games that starts are recorded from, for each as many games as are
            played at once.
        shares: how often games begin at each of `raid_starts.KINDS`.
        spread: deviation of what is drawn at first.
        furthest: mean Kullback-Leibler divergence at which a rollout's learning of the actor ends.
    """

    recorded: Annotated[Numbers, Field(min_length=1)] = (0.0, 0.4)
    shares: Annotated[Numbers, Field(min_length=6, max_length=6)] = (0.15, 0.35, 0.3, 0.2, 0.0, 0.0)
    spread: Annotated[float, Field(ge=1e-3, le=10.0)] = 0.5
    furthest: Annotated[float, Field(ge=1e-6, le=10.0)] = 0.05

    @model_validator(mode="after")
    def _check(self) -> RaidsOptions:
        if not any(self.shares):
            raise ValueError("shares are all 0; give one above 0")
        return self


class Games(Part):
    """The games of a training.

    Attributes:
        preset: rules of the game.
        platform: of all boats; empty: the preset's.
        rules: settings of the game that replace the preset's.
        games: games at once.
        seed: of everything.
    """

    preset: str = "aamas2024"
    platform: str = ""
    rules: Settings = Field(default_factory=dict)
    games: Annotated[int, Field(ge=1, le=100_000)] = 64
    seed: Annotated[int, Field(ge=0, le=2**40)] = 0

    def game(self, stage: Stage | None = None) -> GameConfig:
        """The rules of its games, in a stage or in evaluations.

        Raises:
            ConfigError: they cannot be.
        """
        rules: dict[str, Any] = {"default_start": False, **self.rules, **(stage.rules if stage else {})}
        if self.platform:
            rules["platforms"] = self.platform
        return GameConfig.preset(self.preset, **rules)


class Learning(Games):
    """A training by rewards.

    Attributes:
        decisions: decisions of all boats together after which the training ends.
        interval: game steps for which a decision is held.
        stages: the curriculum.
        rewards: weights of reward terms by name, see `rewards.TERMS`.
        shield: one of `SHIELDS`.
        shield_settings: of its `ShieldConfig`.
        entrants_every: game steps between two questions to opponents that play one game after another, in the games
            learned in; with more than 1 they hold their courses in between and cost less. Evaluations ask each step.
        threads: of the network on a CPU. One is fastest for networks this small: more wait for one another, the more so
            where other programs run.
        device: where the network learns; "auto" takes a GPU where there is one.
    """

    decisions: Count = 3_000_000
    interval: Held = 10
    stages: Annotated[tuple[Stage, ...], Field(min_length=1, max_length=1), BeforeValidator(_as_tuple)] = (Stage(),)
    rewards: Weights = Field(default_factory=lambda: {"sparse": 1.0, "progress": 1.0})
    shield: Literal["none", "deployment", "training", "training+intervention"] = "none"
    shield_settings: Settings = Field(default_factory=dict)
    entrants_every: Held = 1
    threads: Annotated[int, Field(ge=1, le=1024)] = 1
    device: Literal["auto", "cpu", "cuda"] = "auto"
    evaluation: Evaluation = Evaluation()
    league: Draws = Draws()

    @model_validator(mode="after")
    def _check(self) -> Learning:
        """Whatever the shield mode: shields of these settings must fit the games before they are trained for."""
        if not isinstance(self, PpoConfig) and SELF in self.stages[0].opponents:
            raise ValueError(f"stages[0].opponents names {SELF!r}, and there are no snapshots at first; leave it out")
        for stage in (None, *(one for one in self.stages if one.rules or one.shield_settings)):
            try:
                check_shield(self.shield_of(stage), self.game(stage))
            except ConfigError as error:
                raise ConfigError(f"shield_settings: {error}") from None
        return self

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


class OftenAsked(Learning):
    """``shield_every``: game steps between two questions to the shield in the games learned in.

    With more than 1 it guarantees nothing there. Evaluations ask it in every game step.
    """

    shield_every: Held = 1


class PpoConfig(OftenAsked):
    """PPO of one network for the boats of a team.

    ``checkpoint_every``: rollouts between checkpoints; ``start``: exported weights to begin with.
    """

    algorithm: Literal["ppo"] = "ppo"
    actions: Literal["discrete", "normalised"] = "discrete"
    stages: Annotated[tuple[CurriculumStage, ...], Field(min_length=1), BeforeValidator(_as_tuple)] = (
        CurriculumStage(),
    )
    ppo: Ppo = Ppo()
    net: BoatsNet = BoatsNet()
    evaluation: Evaluations = Evaluations()
    league: League = League()
    options: PpoOptions = PpoOptions()
    checkpoint_every: Count = 10
    start: str = ""

    @model_validator(mode="after")
    def _rollout(self) -> PpoConfig:
        if self.ppo.steps * self.games * self.game().team_size < 2:
            raise ValueError("a rollout of one decision teaches nothing; give more of ppo.steps or of games")
        return self


class TwoPartConfig(PpoConfig):
    """QMIX until the flag is held and PPO from there, two networks."""

    algorithm: Literal["qmix+ppo"]  # type: ignore[assignment]
    actions: Literal["discrete"] = "discrete"
    options: TwoPartOptions = TwoPartOptions()  # type: ignore[assignment]

    @model_validator(mode="after")
    def _first_part(self) -> TwoPartConfig:
        if SELF in self.stages[0].opponents:
            raise ValueError(f"stages[0].opponents names {SELF!r}, and there are no snapshots at first; leave it out")
        return self


class QmixConfig(OftenAsked):
    """QMIX (own); it begins anew instead of resuming, and learns on the CPU."""

    algorithm: Literal["qmix"]
    device: Literal["auto", "cpu"] = "auto"
    ppo: Discount = Discount()
    net: Net = Net()
    options: QmixOptions = QmixOptions()


class RaidsConfig(Learning):
    """PPO over the numbers of `undertow`'s raids, one decision for the team; begins anew instead of resuming."""

    algorithm: Literal["raids"]
    ppo: RaidsPpo = RaidsPpo()
    net: Layers = Layers()
    evaluation: Evaluations = Evaluations()
    options: RaidsOptions = RaidsOptions()
    start: str = ""


class CloningConfig(Games):
    """Cloning of options; it takes seconds, on the CPU."""

    algorithm: Literal["cloning"]
    device: Literal["auto", "cpu"] = "auto"
    stages: Annotated[tuple[Opponents, ...], Field(min_length=1, max_length=1), BeforeValidator(_as_tuple)] = (
        Opponents(),
    )
    options: CloningOptions = CloningOptions()
