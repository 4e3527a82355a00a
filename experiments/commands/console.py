"""Speaking to the user: results on stdout, progress and errors on stderr, exit codes that mean something."""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import IntEnum
from typing import Any, NoReturn, TypeVar

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from steerclear.shield.exceptions import SteerclearError

from ..pool import interrupted_by_sigterm
from .files import check_files

Command = TypeVar("Command", bound=Callable[..., Any])
MAX_WIDTH = 100
"""Tables do not stretch over wider terminals."""


class ExitCode(IntEnum):
    """What the command's exit status means."""

    OK = 0
    BAR_FAILED = 1
    BAD_INPUT = 2
    NOT_PROVED = 3
    INTERRUPTED = 130


class Interrupted(Exception):
    """The user pressed Ctrl-C, or SIGTERM came; the text says what is kept and how to go on."""


def out() -> Console:
    """Return the console for results."""
    console = Console(highlight=False, soft_wrap=False)
    return console if console.width <= MAX_WIDTH else Console(highlight=False, width=MAX_WIDTH)


def err() -> Console:
    """Return the console for everything else."""
    return Console(stderr=True, highlight=False)


def command(function: Command) -> Command:
    """Give a command the exit codes of `ExitCode`: one line instead of a traceback for bad input; SIGTERM is Ctrl-C."""

    @functools.wraps(function)
    def guarded(*args: Any, **kwargs: Any) -> Any:
        logging.captureWarnings(True)
        try:
            check_files(function, kwargs)
            with interrupted_by_sigterm():
                return function(*args, **kwargs)
        except SteerclearError as error:
            _leave(f"error: {error}", ExitCode.BAD_INPUT)
        except Interrupted as error:
            _leave(str(error), ExitCode.INTERRUPTED)
        except KeyboardInterrupt:
            _leave("interrupted", ExitCode.INTERRUPTED)

    return guarded  # type: ignore[return-value]


def _leave(text: str, code: ExitCode) -> NoReturn:
    err().print(text, markup=False, soft_wrap=True)
    raise typer.Exit(int(code))


def finish(passed: bool) -> None:
    """End a command that judged something: exit status 1 when it did not pass."""
    if not passed:
        raise typer.Exit(int(ExitCode.BAR_FAILED))


@contextmanager
def progress(words: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show a progress bar on stderr; call what it yields with the number of finished jobs."""
    columns = (TextColumn("{task.description}"), BarColumn(20), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TextColumn("left"), TimeRemainingColumn(), console=err(), transient=True) as bar:
        task = bar.add_task(words, total=total)
        yield lambda done: bar.update(task, completed=done, refresh=True)
