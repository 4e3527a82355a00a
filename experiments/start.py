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
        cause: BaseException | None = error  # Python turns what is raised while a class is made into another
        while cause is not None and not isinstance(cause, KeyboardInterrupt):
            cause = cause.__cause__ or cause.__context__
        if cause is None:
            raise
        sys.stderr.write("interrupted\n")
        sys.exit(130)
