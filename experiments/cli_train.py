"""Commands about learning: train, train-study, export."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from shutil import copyfile
from typing import Annotated, Any

import typer
from steerclear.policies.entrants.learned.network import Network, read_weights, write_weights
from steerclear.policies.entrants.learned.sb3_file import read_sb3
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.extras import install_command

from . import cli_options as o
from .cli_files import check_ending
from .console import Interrupted, bars, command, progress, say, warn
from .entries.wrap import write_submission
from .result_files import NEW, lock_folder
from .runner import RESULTS_FILE
from .training.config import read_config
from .workers import processes_of

Config = Annotated[Path, typer.Argument(metavar="CONFIG.yaml", help="What to train; see docs/train.md.")]
CONFIG = "config.yaml"
WRITTEN = ("curve.json", "best.npz", "final.npz", "model.zip")
"""What a training writes into its folder beside checkpoints and its config."""


@command()
def train(
    config: Config,
    folder: Annotated[Path | None, o.option("DIR", "Folder of the training.", "--out")] = None,
    resume: Annotated[bool, o.flag("Go on from the last checkpoint in --out.", "--resume")] = False,
) -> None:
    """Learn a team; checkpoints, curve, best and last weights go into a folder.

    Exit status: 0 done, 2 bad input or a loss that is not finite, 130 interrupted (all is kept, --resume goes on).
    """
    settings = read_config(config)
    folder = folder or Path("trainings") / config.stem
    if settings.algorithm != "cloning":
        _check_extra()
    kept = folder / CONFIG
    if not resume and (folder / "checkpoints").exists():
        raise ConfigError(f"{folder} holds a training already; add --resume to go on with it, or name another --out")
    for name in () if resume else (CONFIG, *WRITTEN):
        if (folder / name).exists() and not (name == CONFIG and kept.samefile(config)):
            raise ConfigError(f"{folder / name} would be written over; name another --out, or move it")
    lock = lock_folder(folder)
    from .training.training import training_of

    training = training_of(settings, folder, resume)
    if not (kept.exists() and kept.samefile(config)):
        copyfile(config, kept)
    _run(training, folder)
    del lock
    say(*(folder / name for name in WRITTEN if (folder / name).exists()))


def _check_extra() -> None:
    """Refuse what learns where the extra is not installed."""
    if find_spec("torch") is None or find_spec("stable_baselines3") is None:
        raise ConfigError(f"training needs torch and stable-baselines3; {install_command('train')}")


def _run(training: Any, folder: Path) -> None:
    total = training.total
    if training.decisions >= total:
        warn(
            f"nothing was left to do: all {total:,} decisions were made before; more decisions in the config go on "
            "from here"
        )
    try:
        with bars() as begin:
            notice = begin("decisions", total, at_once=True)
            notice(training.decisions)
            training.run(notice)
    except KeyboardInterrupt:
        raise Interrupted(
            f"interrupted after {training.decisions:,} decisions: all up to the last rollout is kept in {folder}; "
            f"the same command with --out {folder} --resume goes on from there"
        ) from None


@command()
def train_study(
    config: Config,
    folder: Annotated[Path, o.option("DIR", "Folder; what is there is taken.", "--out")],
    seeds: Annotated[int, typer.Option(metavar="N", min=1, max=100, help="Trainings per cell.")] = 3,
    games: Annotated[
        int, typer.Option(metavar="N", min=1, max=10_000, help="Games per cell and held-out opponent.")
    ] = 50,
    jobs: o.Jobs = None,
) -> None:
    """Train and play {no shield, deployment, training, training + intervention} x {collision term or not} x seeds.

    ``steerclear docs DIR`` makes its page. Exit status: 0 done, 2 bad input, 130 interrupted (the same goes on).
    """
    settings, processes = read_config(config), processes_of(jobs)
    _check_extra()
    from .training.study import run_study, trainings_of

    with progress("trainings", len(trainings_of(settings, folder, seeds, games))) as notice:
        run_study(settings, folder, seeds, games, notice, processes)
    say(folder / RESULTS_FILE)


@command()
def export(
    model: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL",
            help="A model.zip of PPO or A2C, a training's checkpoint (.zip) or exported weights (.npz).",
        ),
    ],
    file: Annotated[Path | None, o.option("FILE.npz", "Where the weights go; a new file.", "--out"), NEW] = None,
    submission: Annotated[
        Path | None, o.option("FILE.zip", "Where a competition entry goes; a new file.", "--submission"), NEW
    ] = None,
    interval: Annotated[
        int | None, o.option("N", "Game steps a decision is held for.", default="as it learned")
    ] = None,
) -> None:
    """Write a model's actor as numbers that play without torch. Only tensors are read: none of its pickles runs.

    Exit status: 0 done, 2 bad input.
    """
    if file is None and submission is None:
        raise ConfigError("nothing to write; give --out weights.npz, --submission solution.zip or both")
    check_ending(file, "--out", ".npz")
    check_ending(submission, "--submission", ".zip")
    if interval is not None and not 1 <= interval <= 1000:
        raise ConfigError(f"--interval is {interval}; give 1 to 1000")
    numbers = model.suffix.lower() == ".npz"
    network = _held(read_weights(model), interval) if numbers else read_sb3(model, interval)
    game = f"for games of preset {network.preset}" if network.preset else "for games of the preset it learned in"
    if file is not None:
        say(f"{write_weights(network, file)}: {game}; play it as weights:{file}")
    if submission is not None:
        say(f"{write_submission(network, submission)}: {game}")


def _held(network: Network, interval: int | None) -> Network:
    if interval is None:
        return network
    second = None if network.carrying is None else _held(network.carrying, interval)
    return replace(network, interval=interval, carrying=second)
