"""Speaking to the user: results on stdout, progress and errors on stderr, exit codes that mean something."""

from __future__ import annotations

import functools
import inspect
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import IntEnum
from typing import Any, NoReturn, TypeVar

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from steerclear.shield.exceptions import SteerclearError

from ..faults import fault_words, machine_words
from ..runner import Interrupted
from ..terminal import SafeConsole
from ..workers import JobFault, interrupted_by_sigterm
from .files import check_files
from .plain_progress import PlainProgress

__all__ = ["ExitCode", "Interrupted", "command", "err", "finish", "leave_failed", "out", "progress", "unbroken"]
Command = TypeVar("Command", bound=Callable[..., Any])
MAX_WIDTH = 100
"""Tables do not stretch over wider terminals."""


class ExitCode(IntEnum):
    """What the command's exit status means."""

    OK = 0
    GOAL_MISSED = 1
    BAD_INPUT = 2
    NOT_PROVED = 3
    FAULT = 70
    INTERRUPTED = 130


def out(least: int = 0) -> Console:
    """Return the console for results; lines of up to ``least`` characters run on rather than lose their ends."""
    width = SafeConsole().width
    return SafeConsole(width=max(min(width, MAX_WIDTH), least))


def err() -> Console:
    """Return the console for everything else."""
    return SafeConsole(stderr=True)


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
        except JobFault as error:
            _leave(f"error: {error}", ExitCode.FAULT)
        except Interrupted as error:
            _leave(str(error), ExitCode.INTERRUPTED)
        except KeyboardInterrupt:
            _leave("interrupted", ExitCode.INTERRUPTED)
        except (typer.Exit, typer.Abort, typer.BadParameter, BrokenPipeError):
            raise  # ends in order, and a reader of a pipe that has enough
        except Exception as error:
            leave_failed(error)

    guarded.__doc__ = unbroken(function.__doc__ or "")
    return guarded  # type: ignore[return-value]


def unbroken(text: str) -> str:
    """Paragraphs on one line each: help is broken where the terminal ends, not where the source does."""
    paragraphs = (" ".join(part.split()) for part in inspect.cleandoc(text).split("\n\n"))
    return "\n\n".join(part.replace("``", "") for part in paragraphs)


def _leave(text: str, code: ExitCode) -> NoReturn:
    err().print(text, markup=False, soft_wrap=True)
    raise typer.Exit(int(code))


def leave_failed(error: Exception) -> NoReturn:
    """End with one line for what no one foresaw: the machine's doing, or a fault of steerclear kept in a file."""
    words = machine_words(error)
    if words:
        _leave(f"error: {words}", ExitCode.BAD_INPUT)
    _leave(f"error: {fault_words(error)}", ExitCode.FAULT)


def finish(passed: bool) -> None:
    """End a command that judged something: exit status 1 when it did not pass."""
    if not passed:
        raise typer.Exit(int(ExitCode.GOAL_MISSED))


@contextmanager
def progress(words: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show progress on stderr; call what it yields with the number of finished jobs.

    On a terminal that is a bar, elsewhere a plain line now and then.
    """
    console = err()
    if not console.is_terminal:
        yield PlainProgress(words, total, console)
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(20), MofNCompleteColumn(), TimeElapsedColumn())
    columns += (TextColumn("left"), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(words, total=total)
        yield lambda done: bar.update(task, completed=done, refresh=True)
