"""Settings that an algorithm has no use for are refused: what is not honoured is not taken."""

from __future__ import annotations

from dataclasses import fields
from operator import attrgetter

from steerclear.shield.exceptions import ConfigError

from .settings import SELF, Evaluation, League, Net, Ppo, Stage, TrainingSettings


def _all(part: str, kind: type, but: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Every setting of a part of the config, but some."""
    return tuple(f"{part}.{entry.name}" for entry in fields(kind) if entry.name not in but)


_SNAPSHOTS = ("league.every", "league.keep")
_NO_CHECKPOINTS = ("checkpoint_every",)
NO_USE: dict[str, tuple[str, ...]] = {
    "ppo": (),
    "qmix+ppo": ("actions",),
    "qmix": (
        *_all("ppo", Ppo, but=("discount",)),
        *_SNAPSHOTS,
        *_NO_CHECKPOINTS,
        "actions",
        "net.roles",
        "evaluation.every",
        "start",
    ),
    "cloning": (
        *_all("ppo", Ppo),
        *_all("net", Net),
        *_all("evaluation", Evaluation),
        *_all("league", League),
        *_NO_CHECKPOINTS,
        "interval",
        "actions",
        "rewards",
        "shield",
        "shield_settings",
        "shield_every",
        "entrants_every",
        "decisions",
        "threads",
        "start",
    ),
    "raids": (
        *_all("league", League),
        *_NO_CHECKPOINTS,
        "actions",
        "ppo.value",
        "net.features",
        "net.roles",
        "shield_every",
    ),
}
"""By algorithm, dotted names."""
ON_CPU = ("qmix", "cloning")
_PROMOTION = ("net", "games", "most")
NO_USE_IN_STAGE: dict[str, tuple[str, ...]] = {
    "qmix": _PROMOTION,
    "cloning": tuple(entry.name for entry in fields(Stage) if entry.name != "opponents"),
    "raids": _PROMOTION,
}
"""The same of the stage of algorithms that learn in one."""


def check_used(settings: TrainingSettings) -> None:
    """Refuse settings that differ from their defaults and change nothing.

    Raises:
        ConfigError: one does, or there are stages or opponents that no game would have.
    """
    algorithm, first = settings.algorithm, settings.stages[0]
    if algorithm in ON_CPU and settings.device == "cuda":
        raise ConfigError(f"algorithm {algorithm} learns on the CPU; leave device out")
    _refuse(algorithm, settings, TrainingSettings(), NO_USE[algorithm], "")
    if algorithm in NO_USE_IN_STAGE:
        if len(settings.stages) > 1:
            raise ConfigError(f"algorithm {algorithm} learns in one stage; give one")
        _refuse(algorithm, first, Stage(), NO_USE_IN_STAGE[algorithm], " in its stage")
    if algorithm != "ppo" and SELF in first.opponents:
        raise ConfigError(f"algorithm {algorithm} begins without snapshots; leave {SELF!r} out of the first opponents")


def _refuse(algorithm: str, given: object, usual: object, names: tuple[str, ...], where: str) -> None:
    for name in names:
        if attrgetter(name)(given) != attrgetter(name)(usual):
            raise ConfigError(f"algorithm {algorithm} has no use for {name}{where}; leave it out")
