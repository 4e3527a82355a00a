"""Platform files: a boat behind its autopilot as YAML with units, and with what a fit measured."""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import lru_cache
from pathlib import Path
from typing import Any, NoReturn

from ..exceptions import FleetFileError, PlatformError
from .platform import KINDS, Gains, Platform
from .schema import ENTRIES, GAINS, MEASURED, UNITS_TAKEN_FOR_OTHERS

SUFFIXES = (".yaml", ".yml")
LARGEST_BYTES = 64 << 10
FASTEST_MPS = 40.0
"""Fastest boat; a larger number is in another unit."""


@dataclass(frozen=True)
class PlatformFile:
    """A platform and its measurements.

    Attributes:
        platform: the boat.
        measured: entries of `schema.MEASURED` in the file; empty if no fit was made.
    """

    platform: Platform
    measured: Mapping[str, float] = field(default_factory=dict)

    @property
    def delay_s(self) -> float | None:
        """Time from command to effect, s; None if not measured."""
        return self.measured.get("delay_s")

    def error_m(self, ahead_s: float) -> float:
        """Return a bound on 99 % of the position errors of predictions so far ahead, m; 0 if not measured."""
        growth = self.measured.get("error_growth_mps", 0.0)
        return self.measured.get("position_error_m", 0.0) + growth * max(0.0, ahead_s - 1.0)


def is_path(name: str) -> bool:
    """Return whether a platform's name is that of a file."""
    return name.endswith(SUFFIXES)


def load_platform(path: str | Path) -> PlatformFile:
    """Read a platform file.

    Raises:
        PlatformError: it cannot be read or is no boat; one line that names the file, the entry and the remedy.
    """
    name = os.fspath(path)
    try:
        found = os.stat(name)
        if found.st_size > LARGEST_BYTES:
            raise PlatformError(f"platform file {name} is larger than {LARGEST_BYTES >> 10} KiB; give a platform file")
        return _load(name, found.st_mtime_ns, found.st_size)
    except FileNotFoundError:
        raise PlatformError(f"there is no platform file {name}; make one with: steerclear platform new NAME") from None
    except OSError as error:
        raise PlatformError(f"platform file {name} cannot be read: {error.strerror or error}") from None


@lru_cache(maxsize=64)
def _load(name: str, _mtime_ns: int, _size: int) -> PlatformFile:
    path = Path(name)
    if not path.is_file():
        raise PlatformError(f"platform file {name} is no plain file; give a platform file")
    try:
        return parse_platform(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        raise PlatformError(f"platform file {name} is no text; give a platform file") from None
    except PlatformError as error:
        raise PlatformError(f"platform file {name}: {error}") from None


def parse_platform(text: str) -> PlatformFile:
    """Return the platform of a file's text.

    Raises:
        PlatformError: it is no boat; one line.
    """
    from ..bridge.fleet_yaml import read_settings  # the strict reader; importing it here keeps the package light

    try:
        given = read_settings(text)
    except FleetFileError as error:
        raise PlatformError(str(error)) from None
    if not isinstance(given, Mapping):
        raise PlatformError("it holds no settings; make one with: steerclear platform new NAME")
    if "boats" in given:
        boats = "of a fleet, with its boats; give a boat's own platform file, or check the fleet with"
        raise PlatformError(f"it is a FLEET.yaml {boats}: steerclear preflight")
    return platform_file_of(dict(given))


def platform_file_of(given: dict[str, Any]) -> PlatformFile:
    """Return the platform of a file's settings.

    Raises:
        PlatformError: an entry is unknown, missing, of another unit or not a number, or the boat cannot be steered.
    """
    name, kind = given.pop("name", None), given.pop("kind", "usv")
    if not isinstance(name, str) or not name:
        raise PlatformError(f"name is {name!r}; give the boat's name, a text")
    if not isinstance(kind, str) or kind not in KINDS:
        raise PlatformError(f"kind is {kind!r}; choose one of {', '.join(sorted(KINDS))}")
    measured = _measured(given.pop("measured", {}))
    settings = {key: _setting(key, value, kind) for key, value in given.items()}
    if "max_speed_mps" not in settings:
        raise PlatformError("max_speed_mps is missing; give the boat's top speed, m/s")
    if settings["max_speed_mps"] > FASTEST_MPS:
        raise PlatformError(f"max_speed_mps is {settings['max_speed_mps']:g}; give m/s, at most {FASTEST_MPS:g}")
    return PlatformFile(Platform(name=name, kind=kind, **settings), measured)


def _setting(key: str, value: Any, kind: str) -> Any:
    if key not in ENTRIES:
        _refuse_key(key, ENTRIES)
    entry = ENTRIES[key]
    if kind not in entry.kinds:
        raise PlatformError(f"{key} is for boats of kind {' or '.join(entry.kinds)}, this is a {kind}; leave it out")
    if key.endswith("_pid"):
        return _gains(key, value)
    if key == "thrust_map":
        if not isinstance(value, list) or not all(isinstance(point, list) for point in value):
            raise PlatformError(f"{key} is {value!r}; give points [thrust percent, speed m/s]")
        return tuple(tuple(_number(key, part, entry.unit) for part in point) for point in value)
    return _number(key, value, entry.unit)


def _number(key: str, value: Any, unit: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise PlatformError(f"{key} is {value!r}; give a plain number in {unit or 'its unit'}")
    return float(value)


def _gains(key: str, value: Any) -> Gains:
    if not isinstance(value, Mapping):
        raise PlatformError(f"{key} is {value!r}; give {{kp: ..., ki: ..., kd: ..., integral_limit: ...}}")
    for name in value:
        if name not in GAINS:
            _refuse_key(f"{key}.{name}", {f"{key}.{known}": None for known in GAINS})
    return Gains(**{name: _number(f"{key}.{name}", gain, "") for name, gain in value.items()})


def _measured(given: Any) -> dict[str, float]:
    if not isinstance(given, Mapping):
        raise PlatformError(f"measured is {given!r}; give the entries that steerclear fit writes, or leave it out")
    for key, value in given.items():
        if key not in MEASURED:
            _refuse_key(f"measured.{key}", {f"measured.{known}": None for known in MEASURED})
        if not 0.0 <= _number(f"measured.{key}", value, MEASURED[key].unit) < 1e6:
            raise PlatformError(f"measured.{key} is {value!r}; give a number from 0 to 1e6")
    return {key: float(value) for key, value in given.items()}


def _refuse_key(key: str, known: Mapping[str, Any]) -> NoReturn:
    """Refuse an unknown entry; name its unit's conversion, or the entries that exist."""
    near = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
    wrong = UNITS_TAKEN_FOR_OTHERS.get(key.rpartition("_")[2].lower())
    if wrong is not None:
        hint = f"; use {near[0]}" if near else ""
        raise PlatformError(f"{key} is in another unit than the file's{hint}, {wrong}")
    hint = f"did you mean {near[0]}?" if near else f"the entries are {', '.join(known)}"
    raise PlatformError(f"unknown entry {key}; {hint}")


def settings_of(platform: Platform) -> dict[str, Any]:
    """Return a platform's settings for a file: the entries of its kind that differ from their defaults."""
    defaults = {entry.name: entry.default for entry in fields(Platform)}
    found: dict[str, Any] = {}
    for key, entry in ENTRIES.items():
        value = getattr(platform, key)
        if platform.kind not in entry.kinds or (value == defaults.get(key) and key != "thrust_map"):
            continue
        if isinstance(value, Gains):
            value = {name: getattr(value, name) for name in GAINS if getattr(value, name) != 0.0}
        if value != {}:
            found[key] = value
    return found


def to_text(file: PlatformFile, head: str = "") -> str:
    """Return the text of a platform file, with unit and explanation of each entry; it reads back to the same."""
    lines = [f"# {line}" for line in head.splitlines()]
    lines += [f"name: {_text(file.platform.name)}", f"kind: {file.platform.kind}"]
    rows = [(key, _text(value), ENTRIES[key]) for key, value in settings_of(file.platform).items()]
    lines += [_line(f"{key}: {value}", entry.unit, entry.words) for key, value, entry in rows]
    if file.measured:
        lines.append("measured:")
        for key, value in file.measured.items():
            lines.append(_line(f"  {key}: {_text(value)}", MEASURED[key].unit, MEASURED[key].words))
    return "\n".join(lines) + "\n"


def _line(setting: str, unit: str, words: str) -> str:
    return f"{setting}  # {unit + '; ' if unit else ''}{words}"


def _text(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_text(part)}" for key, part in value.items()) + "}"
    if isinstance(value, tuple):
        return "[" + ", ".join(_text(part) for part in value) + "]"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(int(value)) if float(value).is_integer() and abs(value) < 1e15 else repr(float(value))
