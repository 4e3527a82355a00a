"""``steerclear train``: learn a team from a config."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from shutil import copyfile
from typing import Annotated, Any

import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.extras import install_command

from ..result_files import lock_folder
from ..training.config_file import read_config
from .console import Interrupted, command, err, out
from .plain_progress import PlainProgress

Config = Annotated[Path, typer.Argument(metavar="CONFIG.yaml", help="What to train; see docs/train.md.")]
Folder = Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder of the training.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on from the last checkpoint in --out.")]
CONFIG = "config.yaml"
WRITTEN = ("curve.json", "best.npz", "final.npz", "model.zip")
"""What a training writes into its folder beside checkpoints and its config."""
EXTRA = f"training needs torch and stable-baselines3; {install_command('train')}"


@command
def train(config: Config, out_folder: Folder = None, resume: Resume = False) -> None:
    """Learn a team; checkpoints, curve, best and last weights go into a folder.

    Exit status: 0 done, 2 bad input or a loss that is not finite, 130 interrupted (all is kept, --resume goes on).
    """
    settings = read_config(config)
    folder = out_folder or Path("trainings") / config.stem
    if settings.algorithm != "cloning":
        check_extra()
    kept = folder / CONFIG
    if not resume and (folder / "checkpoints").exists():
        raise ConfigError(f"{folder} holds a training already; add --resume to go on with it, or name another --out")
    for name in () if resume else (CONFIG, *WRITTEN):
        if (folder / name).exists() and not (name == CONFIG and kept.samefile(config)):
            raise ConfigError(f"{folder / name} would be written over; name another --out, or move it")
    _make(folder)
    lock = lock_folder(folder)  # held while this function runs: no other may write here
    training = _training_of(settings, folder, resume)
    if not (kept.exists() and kept.samefile(config)):
        copyfile(config, kept)
    _run(training, folder)
    del lock
    for name in WRITTEN:
        if (folder / name).exists():
            out().print(f"{folder / name}", soft_wrap=True)


def check_extra() -> None:
    """Refuse what learns where the extra is not installed.

    Raises:
        ConfigError: it is not.
    """
    if find_spec("torch") is None or find_spec("stable_baselines3") is None:
        raise ConfigError(EXTRA)


def _training_of(settings: Any, folder: Path, resume: bool) -> Any:
    from ..training.training import training_of

    return training_of(settings, folder, resume)


def _run(training: Any, folder: Path) -> None:
    total = training.total
    if training.decisions >= total:
        err().print(
            f"nothing was left to do: all {total:,} decisions were made before; more decisions in the config go on "
            "from here",
            soft_wrap=True,
        )
    columns = (TextColumn("{task.description}", markup=False), BarColumn(20), TimeElapsedColumn(), TextColumn("left"))
    try:
        if not err().is_terminal:
            plain = PlainProgress("decisions", total, err(), at_once=True)
            plain(training.decisions)
            training.run(plain)
            return
        with Progress(*columns, TimeRemainingColumn(), console=err(), transient=True) as bar:
            task = bar.add_task("training", total=total, completed=training.decisions)
            training.run(lambda done, words: bar.update(task, completed=done, description=words, refresh=True))
    except KeyboardInterrupt:
        raise Interrupted(
            f"interrupted after {training.decisions:,} decisions: all up to the last rollout is kept in {folder}; "
            f"the same command with --out {folder} --resume goes on from there"
        ) from None


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"cannot write to {folder} ({error.strerror}); choose another --out") from error
