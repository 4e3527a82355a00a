"""``steerclear export``: a trained model as numpy weights, or as a competition entry."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from steerclear.policies.entrants.learned import read_weights
from steerclear.policies.entrants.learned.network import Network
from steerclear.policies.entrants.learned.sb3_file import read_sb3
from steerclear.policies.entrants.learned.weights_file import write_weights
from steerclear.shield.exceptions import ConfigError

from ..result_files import NEW
from ..training.export import write_submission
from .console import command, out
from .files import check_ending

Model = Annotated[
    Path,
    typer.Argument(
        metavar="MODEL", help="A model.zip of PPO or A2C, a training's checkpoint (.zip) or exported weights (.npz)."
    ),
]
Weights = Annotated[
    Path | None, typer.Option("--out", metavar="FILE.npz", help="Where the weights go; a new file."), NEW
]
Submission = Annotated[
    Path | None,
    typer.Option("--submission", metavar="FILE.zip", help="Where a competition entry goes; a new file."),
    NEW,
]
Interval = Annotated[
    int | None, typer.Option(metavar="N", help="Game steps a decision is held for.", show_default="as it learned")
]


@command
def export(model: Model, file: Weights = None, submission: Submission = None, interval: Interval = None) -> None:
    """Write a model's actor as numbers that play without torch. Only tensors are read: none of its pickles runs.

    Exit status: 0 done, 2 bad input.
    """
    if file is None and submission is None:
        raise ConfigError("nothing to write; give --out weights.npz, --submission solution.zip or both")
    check_ending(file, "--out", (".npz",))
    check_ending(submission, "--submission", (".zip",))
    if interval is not None and not 1 <= interval <= 1000:
        raise ConfigError(f"--interval is {interval}; give 1 to 1000")
    network = _read(model, interval)
    game = f"for games of preset {network.preset}" if network.preset else "for games of the preset it learned in"
    if file is not None:
        out().print(f"{write_weights(network, file)}: {game}; play it as weights:{file}", soft_wrap=True)
    if submission is not None:
        out().print(f"{write_submission(network, submission)}: {game}", soft_wrap=True)


def _read(model: Path, interval: int | None) -> Network:
    if model.suffix.lower() == ".npz":
        network = read_weights(model)
        return network if interval is None else _held(network, interval)
    return read_sb3(model, interval)


def _held(network: Network, interval: int) -> Network:
    second = None if network.carrying is None else _held(network.carrying, interval)
    return replace(network, interval=interval, carrying=second)
