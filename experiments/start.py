"""Where ``steerclear`` starts: Ctrl-C ends it in words from the first moment on, also while its modules are loaded."""

from __future__ import annotations

import sys


def main() -> None:
    """Load the command line and run it."""
    try:
        from .cli import main as run  # takes seconds on a busy machine, in which people change their minds

        run()
    except SystemExit:
        raise
    except BaseException as error:
        if not _interrupted(error):
            raise
        sys.stderr.write("interrupted\n")
        sys.exit(130)


def _interrupted(error: BaseException | None) -> bool:
    """Whether an error is Ctrl-C, or was made of it: Python turns what is raised while a class is made into another."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None
