"""``steerclear train-study``: trainings with the shield nowhere, at deployment and in training, beside one another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..runner import RESULTS_FILE
from ..training.config_file import read_config
from ..workers import processes_of
from . import options as o
from .console import command, out, progress
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
    from ..training.study import run_study, trainings_of

    with progress("trainings", len(trainings_of(settings, folder, seeds, games))) as notice:
        run_study(settings, folder, seeds, games, lambda done, of: notice(done), processes)
    out().print(f"{folder / RESULTS_FILE}", soft_wrap=True)
