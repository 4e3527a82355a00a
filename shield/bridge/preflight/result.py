"""What one check before the start found, and running many of them so that none can stop or hide another."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ...exceptions import ConfigError

LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class CheckResult:
    """What one check found.

    Attributes:
        name: short and stable, such as "rates:blue_1": what ``--accept NAME`` names.
        passed: whether boats may start as far as this check goes.
        text: one line: what was found and, when not passed, what the operator must do.
        figures: what was measured, by name with its unit, such as ``{"position_rate_hz": 19.8}``.
    """

    name: str
    passed: bool
    text: str
    figures: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Check:
    """A check yet to be run.

    Attributes:
        name: as in its result; known beforehand, so that a check that fails to answer is still named.
        run: does it; takes its time, moves boats only if its description says so.
    """

    name: str
    run: Callable[[], CheckResult]


def run_check(check: Check) -> CheckResult:
    """Run one check; whatever goes wrong inside it is a check not passed.

    Args:
        check: to run.

    Returns:
        Its result, under the name it was registered with.
    """
    try:
        result = check.run()
    except Exception as error:  # a check that broke has shown nothing: the answer is no, and the others still run
        LOG.warning("check %s broke", check.name, exc_info=True)
        return CheckResult(
            check.name, False, f"the check itself failed ({type(error).__name__}: {error}); put that right, run again"
        )
    # a numpy bool is fine; None, NaN or a string that crept in must not count as passed
    passed = isinstance(result.passed, (bool, np.bool_)) and bool(result.passed)
    return CheckResult(check.name, passed, result.text, dict(result.figures))


def validate_accepted(accepted: Iterable[str], checks: Iterable[Check]) -> None:
    """Refuse to accept what is not checked: a misspelt name would otherwise look as if it did something.

    Args:
        accepted: names given by the operator.
        checks: that will be run.

    Raises:
        ConfigError: a name is neither that of a check nor its part before ":".
    """
    names = [check.name for check in checks]
    known = sorted({*names, *(name.split(":")[0] for name in names)})
    for name in accepted:
        if name not in known:
            raise ConfigError(f"--accept {name}: there is no such check; the checks are {', '.join(known)}")


def run_checks(checks: Iterable[Check], seen: Callable[[CheckResult], None] | None = None) -> list[CheckResult]:
    """Run checks one after another, all of them, whatever any of them finds.

    Args:
        checks: in the order to run.
        seen: called with each result as it comes, for a display.

    Returns:
        One result per check, in order.
    """
    results = []
    for check in checks:
        results.append(run_check(check))
        if seen is not None:
            seen(results[-1])
    return results


def not_passed(results: Iterable[CheckResult], accepted: Iterable[str] = ()) -> list[CheckResult]:
    """The results that forbid the start.

    Args:
        results: of `run_checks`.
        accepted: names the operator accepted; the part before ":" accepts it for every boat.

    Returns:
        Those that did not pass and were not accepted, in order. Empty results forbid nothing: the caller decides what
        must be checked.
    """
    allowed = set(accepted)
    return [r for r in results if not r.passed and r.name not in allowed and r.name.split(":")[0] not in allowed]
