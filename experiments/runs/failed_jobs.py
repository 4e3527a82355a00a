"""Jobs that gave no answer: bad input and the machine's doing end a command otherwise than a fault of steerclear."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

from steerclear.shield.exceptions import ConfigError


class JobFault(Exception):
    """A job ended in what no one foresaw; the text says so, and where its traceback is."""


def end_failed(failed: Sequence[Mapping[str, Any]], what: str, remedy: str) -> NoReturn:
    """End a run of which jobs gave no answer.

    Args:
        failed: of each, among others, `pool.Outcome.why`.
        what: of the jobs, with their number, such as "3 games could not be played".
        remedy: where nothing is wrong with steerclear.

    Raises:
        JobFault: one of them is a fault of steerclear.
        ConfigError: none is.
    """
    faults = [entry["error"] for entry in failed if entry["fault"]]
    if faults:
        raise JobFault(f"{what}: {faults[0]}")
    raise ConfigError(f"{what}{remedy}")
