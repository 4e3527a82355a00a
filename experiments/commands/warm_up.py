"""``steerclear warm-up``: everything compiled now, so that nothing waits for it later."""

from __future__ import annotations

import time

from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import kept_in

from ..warming import PARTS
from .console import command, err, out


@command
def warm_up() -> None:
    """Compile everything for this machine and say where it is kept: about a minute, once.

    Without it the first decision, game or command on a machine does so. Run it again after an update.

    Exit status: 0 done, 2 nothing can be kept (the message says how it can), 130 interrupted.
    """
    place, started = kept_in(), time.perf_counter()
    if not place:
        raise ConfigError("compiled code can be kept nowhere; set NUMBA_CACHE_DIR to a folder that can be written to")
    for name, compile_it in PARTS.items():
        err().print(f"compiling {name}", soft_wrap=True)
        compile_it()
    out().print(f"done ({time.perf_counter() - started:.0f} s); kept in {place}", soft_wrap=True)
