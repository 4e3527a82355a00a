"""``steerclear train-study``: trainings with the shield nowhere, at deployment and in training, beside one another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from steerclear.shield.exceptions import ConfigError

from ..result_files import lock_folder
from ..training.config_file import read_config
from ..workers import processes_of
from . import options as o
from .console import Interrupted, command, out, progress
from .train import Config, check_extra

Seeds = Annotated[int, typer.Option(metavar="N", min=1, max=100, help="Trainings per cell.")]
Games = Annotated[int, typer.Option(metavar="N", min=1, max=10_000, help="Games per cell and held-out opponent.")]


@command
def train_study(
    config: Config,
    folder: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder; what is there is taken.")],
    seeds: Seeds = 3,
    games: Games = 50,
    jobs: o.Jobs = None,
) -> None:
    """Train and play {no shield, deployment, training, training + intervention} x {collision term or not} x seeds.

    ``steerclear docs DIR`` makes its page. Exit status: 0 done, 2 bad input, 130 interrupted (the same goes on).
    """
    settings, processes = read_config(config), processes_of(jobs)
    check_extra()
    from ..training.study import RESULTS, cells, run_study

    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = lock_folder(folder)
    except OSError as error:
        raise ConfigError(f"cannot write to {folder} ({error.strerror}); choose another --out") from error
    try:
        with progress("trainings and games", len(list(cells(seeds)))) as notice:
            run_study(settings, folder, seeds, games, lambda done, words: notice(done), processes)
    except KeyboardInterrupt:
        raise Interrupted(
            f"interrupted: what is done is kept in {folder}; the same command goes on from there"
        ) from None
    del lock
    out().print(f"{folder / RESULTS}", soft_wrap=True)
