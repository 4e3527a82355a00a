"""``steerclear warm-up``: everything compiled now, so that nothing waits for it later."""

from __future__ import annotations

import time

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from steerclear.shield.compiled.compiling import COMPILING, told_to
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import kept_in

from ..runs.warming import parts_of_all
from .console import command, err, out


@command
def warm_up() -> None:
    """Compile everything for this machine, with a bar, and say where it is kept: one to three minutes, once.

    Without it the first decision, game or command on a machine does so. Run it again after an update.

    Exit status: 0 done, 2 nothing can be kept (the message says how it can), 130 interrupted.
    """
    place, started = kept_in(), time.perf_counter()
    if not place:
        raise ConfigError("compiled code can be kept nowhere; set NUMBA_CACHE_DIR to a folder that can be written to")
    columns = (TextColumn("{task.description}"), BarColumn(20), MofNCompleteColumn(), TimeElapsedColumn())
    console = err()
    if not console.is_terminal:
        console.print("compiling everything: one to three minutes of an idle machine", soft_wrap=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        shown = _Shown(bar)
        with told_to(shown):
            for name, compile_it in parts_of_all():
                shown.begin(name)
                compile_it()
    seconds = time.perf_counter() - started
    done = COMPILING.compiled
    words = f"{done} functions were compiled ({seconds:.0f} s)" if done else "everything had been compiled before"
    out().print(f"{words}; kept in {place}", soft_wrap=True)


class _Shown:
    """The bar: which part, and how many functions have machine code."""

    def __init__(self, bar: Progress) -> None:
        self._bar = bar
        self._task = bar.add_task("", total=None)

    def begin(self, name: str) -> None:
        """A part comes next."""
        self._bar.update(self._task, description=f"compiling {name}", refresh=True)

    def goes_on(self, done: int, of: int) -> None:
        """See `steerclear.shield.compiled.compiling.Listener`."""
        self._bar.update(self._task, completed=done, total=of, refresh=True)

    def ends(self) -> None:
        """See `steerclear.shield.compiled.compiling.Listener`."""
