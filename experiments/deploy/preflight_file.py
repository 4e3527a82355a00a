"""What `steerclear preflight` found, kept beside the logs: `steerclear deploy` wants the drill of these very boats."""

from __future__ import annotations

import hashlib
import json
import logging
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from steerclear.shield.bridge.drill import counted_words
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.preflight_checks import CheckResult
from steerclear.shield.exceptions import BridgeError

LOG = logging.getLogger(__name__)

VALID_S = 12.0 * 3600.0
"""A drill counts for a day on the water, s."""

DRILLED = ("course", "response", "model")
"""Checks that only a drill can make."""


def fingerprint(text: str) -> str:
    """Of a fleet file's text: a changed file wants a new drill."""
    return hashlib.sha256(text.encode()).hexdigest()


def keep(fleet: FleetFile, text: str, boat: str | None, results: Sequence[CheckResult], refused: Sequence[str]) -> Path:
    """Write what was found.

    Args:
        fleet: the file.
        text: its text.
        boat: whose process it was; None: the team's.
        results: of all checks.
        refused: names of those neither passed nor accepted.

    Raises:
        BridgeError: it cannot be written.
    """
    content = {
        "fleet": fingerprint(text),
        "unix_s": time.time(),
        "refused": list(refused),
        "checks": [{"name": r.name, "passed": r.passed, "text": r.text, "figures": _plain(r.figures)} for r in results],
    }
    path = path_of(fleet, boat)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(content, indent=1, allow_nan=False), encoding="utf-8")
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
    remedy = "run steerclear preflight first"
    found = _read(path_of(fleet, boat))
    if found is None:
        return CheckResult("drill", False, f"no preflight of these boats; {remedy}")
    if found.get("fleet") != fingerprint(text):
        return CheckResult("drill", False, f"the fleet file has changed since its preflight; {remedy}")
    age = time.time() - float(found.get("unix_s", -math.inf))
    if not 0.0 <= age <= VALID_S:
        return CheckResult("drill", False, f"the last preflight is {age / 3600.0:.0f} h old; {remedy}")
    checks = {entry["name"]: entry for entry in found["checks"]}
    missing = [f"{kind}:{name}" for name in commanded for kind in DRILLED if f"{kind}:{name}" not in checks]
    if missing:
        return CheckResult("drill", False, f"the last preflight lacks {', '.join(missing)}; {remedy}, with its drill")
    bad = [name for name in found["refused"] if name in checks and name.split(":")[0] in DRILLED]
    bad = [name for name in bad if name not in accept and name.split(":")[0] not in accept]
    if bad:
        return CheckResult("drill", False, f"{bad[0]}: {checks[bad[0]]['text']}")
    delay = measured_delay_s(fleet, boat)
    counted = counted_words(fleet.shield_config.delay_s, fleet.dt_s)
    figures = {} if delay is None else {"delay_s": delay}
    return CheckResult("drill", True, f"boats drilled {age / 60.0:.0f} min ago{counted}", figures)


def measured_delay_s(fleet: FleetFile, boat: str | None) -> float | None:
    """Longest delay from command to effect that the drill measured, s; None: none was."""
    found = _read(path_of(fleet, boat))
    delays = [
        entry["figures"]["delay_s"]
        for entry in ([] if found is None else found["checks"])
        if entry["name"].startswith("response:") and "delay_s" in entry["figures"]
    ]
    return max(delays, default=None)


def _read(path: Path) -> dict[str, Any] | None:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if _is_sound(found):
            return dict(found)
        raise ValueError("it is of another form")
    except FileNotFoundError:
        return None
    except (OSError, ValueError, RecursionError) as error:
        LOG.warning("%s cannot be read (%s); it counts as missing", path, error)
    return None


def _is_sound(found: Any) -> bool:
    """Whether a file's content is what `keep` writes, as far as it is read."""
    if not isinstance(found, dict) or not isinstance(found.get("unix_s"), int | float):
        return False
    lists = found.get("checks"), found.get("refused")
    if not all(isinstance(entries, list) for entries in lists):
        return False
    return all(isinstance(name, str) for name in lists[1]) and all(
        isinstance(check, dict)
        and isinstance(check.get("name"), str)
        and isinstance(check.get("text"), str)
        and isinstance(check.get("figures"), dict)
        and all(isinstance(value, int | float) for value in check["figures"].values())
        for check in lists[0]
    )


def _plain(figures: Any) -> dict[str, float]:
    return {name: float(value) for name, value in figures.items() if math.isfinite(value)}
