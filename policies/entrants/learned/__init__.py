"""Learned teams: networks of numpy weights, played without torch."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from .kinds import batch_of as batch_of
from .kinds import team_of as team_of
from .network import preset_in
from .play import LearnedBatch, LearnedTeam
from .raids import RaidsBatch, RaidsTeam
from .weights_file import read_weights

WEIGHTS, SB3 = "weights:", "sb3:"
TEAMS = Path(__file__).parent / "teams"
"""Where the weights of our learned entrants lie, with config and curve beside them."""


class Builder(NamedTuple):
    """What builds a batch policy, and its first arguments."""

    build: Callable[..., Any]
    first: tuple[Any, ...]


def load_weights(path: str | Path, sample: bool = False) -> LearnedTeam | RaidsTeam:
    """An exported network as a team policy.

    Args:
        path: the ``.npz`` that ``steerclear export`` wrote.
        sample: draw actions with the network's probabilities instead of taking the likeliest.

    Raises:
        PolicyError: no such file, or none of ours.
    """
    return team_of(read_weights(path), Path(path).stem, sample)


def load_weights_batch(path: str | Path, sample: bool = False) -> LearnedBatch | RaidsBatch:
    """The same for a batch of games."""
    return batch_of(read_weights(path), Path(path).stem, sample)


def load_trained(path: str | Path, sample: bool = False, interval: int | None = None) -> LearnedTeam:
    """A model of ``steerclear train`` as a team policy: what was trained, read as numbers; see `load_sb3_batch`."""
    from .sb3_file import read_sb3

    return LearnedTeam(read_sb3(path, interval), Path(path).stem, sample)


def load_sb3_batch(path: str | Path, sample: bool = False, interval: int | None = None) -> LearnedBatch:
    """A saved Stable-Baselines3 model for a batch of games. Its tensors alone are read: none of its pickles runs.

    Args:
        path: the zip ``model.save`` wrote.
        sample: draw actions with the network's probabilities.
        interval: game steps for which a decision is held; None: as it learned, 1 where the file does not say.

    Raises:
        PolicyError: torch is missing, or the file is no model this can play.
    """
    from .sb3_file import read_sb3

    return LearnedBatch(read_sb3(path, interval), Path(path).stem, sample)


def batch_builder(name: str) -> Builder | None:
    """What builds the batch policy of that name; None where it is no learned one."""
    from .entered import FILES

    if name.startswith(WEIGHTS):
        return Builder(load_weights_batch, (name.removeprefix(WEIGHTS),))
    if name.startswith(SB3):
        return Builder(load_sb3_batch, (name.removeprefix(SB3),))
    if name in FILES:
        return Builder(load_weights_batch, (FILES[name],))
    return None


def learned_in(name: str) -> str:
    """Preset that the policy of that name learned in; empty where it is no learned one, or does not say.

    Raises:
        PolicyError: its file cannot be read.
    """
    from ...sb3 import read_card
    from .entered import FILES

    if name.startswith(SB3):
        return preset_in(read_card(Path(name.removeprefix(SB3)).expanduser()))
    path = name.removeprefix(WEIGHTS) if name.startswith(WEIGHTS) else FILES.get(name)
    return "" if path is None else read_weights(path).preset
