"""What `steerclear preflight` found, kept beside the logs: `steerclear deploy` wants the drill of these very boats."""

from __future__ import annotations

import hashlib
import logging
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError
from steerclear.shield.bridge.drill import counted_words
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.preflight_checks import CheckResult
from steerclear.shield.exceptions import BridgeError

LOG = logging.getLogger(__name__)

VALID_S = 12.0 * 3600.0
"""A drill counts for a day on the water, s."""
DRILLED = ("course", "response", "model")
"""Checks that only a drill can make."""


class Kept(BaseModel):
    """A preflight.

    Attributes:
        fleet: fingerprint of the fleet file's text: a changed file wants a new drill.
        unix_s: when it ended, s since 1970.
        refused: names of checks neither passed nor accepted.
        checks: all results.
    """

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    fleet: str
    unix_s: float
    refused: list[str]
    checks: list[CheckResult]


def keep(fleet: FleetFile, text: str, boat: str | None, results: Sequence[CheckResult], refused: Sequence[str]) -> Path:
    """Write what all checks found, for the process of a boat, or of the team, and the text of its file.

    Raises:
        BridgeError: it cannot be written.
    """
    checks = [
        replace(one, figures={name: float(value) for name, value in one.figures.items() if math.isfinite(value)})
        for one in results
    ]
    kept = Kept(fleet=_fingerprint(text), unix_s=time.time(), refused=list(refused), checks=checks)
    path = path_of(fleet, boat)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(kept.model_dump_json(indent=1), encoding="utf-8")
    except OSError as error:
        raise BridgeError(f"cannot write {path} ({error.strerror}); free space, or change log_dir") from None
    return path


def path_of(fleet: FleetFile, boat: str | None) -> Path:
    """Where it is kept."""
    return fleet.log_dir / f"preflight_{boat or fleet.team}.json"


def check_drill(
    fleet: FleetFile, text: str, boat: str | None, commanded: Sequence[str], accept: Sequence[str] = ()
) -> CheckResult:
    """These boats were drilled lately, with this very file, and did as their platforms foretell."""
    found = _read(path_of(fleet, boat))
    why = "no preflight of these boats" if found is None else _outdated(found, text, commanded)
    if found is None or why:
        return CheckResult("drill", False, f"{why}; run steerclear preflight first")
    texts = {check.name: check.text for check in found.checks}
    for name in found.refused:
        kind = name.split(":")[0]
        if name in texts and kind in DRILLED and not {name, kind} & set(accept):
            return CheckResult("drill", False, f"{name}: {texts[name]}")
    delay = measured_delay_s(fleet, boat)
    counted = counted_words(fleet.shield_config.delay_s, fleet.dt_s)
    minutes = (time.time() - found.unix_s) / 60.0
    figures = {} if delay is None else {"delay_s": delay}
    return CheckResult("drill", True, f"boats drilled {minutes:.0f} min ago{counted}", figures)


def measured_delay_s(fleet: FleetFile, boat: str | None) -> float | None:
    """Longest delay from command to effect that the drill measured, s; None: none was."""
    found = _read(path_of(fleet, boat))
    checks = () if found is None else found.checks
    delays = [check.figures.get("delay_s") for check in checks if check.name.startswith("response:")]
    return max((delay for delay in delays if delay is not None), default=None)


def _fingerprint(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _outdated(found: Kept, text: str, commanded: Sequence[str]) -> str:
    """Why a preflight does not count for these boats now; empty: it does."""
    if found.fleet != _fingerprint(text):
        return "the fleet file has changed since its preflight"
    age_s = time.time() - found.unix_s
    if not 0.0 <= age_s <= VALID_S:
        return f"the last preflight is {age_s / 3600.0:.0f} h old"
    names = {check.name for check in found.checks}
    missing = [f"{kind}:{name}" for name in commanded for kind in DRILLED if f"{kind}:{name}" not in names]
    return f"the last preflight lacks {', '.join(missing)}, which its drill makes" if missing else ""


def _read(path: Path) -> Kept | None:
    try:
        return Kept.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        return None
    except (OSError, ValidationError) as error:
        why = error.errors()[0]["msg"] if isinstance(error, ValidationError) else error
        LOG.warning("%s cannot be read (%s); it counts as missing", path, why)
    return None
