"""`LogHeader`: what a log must know besides its ticks, so that the shield can be built again as it was."""

from __future__ import annotations

import hashlib
import json
import platform as machine
import time
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from ...config import ShieldConfig
from ...exceptions import LogError, SteerclearError
from ...platforms import Platform, get_platform
from ...renamed import current_settings
from ...surroundings import OPEN_WATER, Surroundings
from ...tables.files import find_table
from ...tables.settings import OtherMay
from ..fleet_file import FleetFile
from ..frame import FieldFrame
from .format import object_schema, platform_from
from .hash_chain import ChainHead
from .nonfinite import plain, restored

LOG_VERSION = 2  # logs of version 1 (0.6 and before) are read by the program that wrote them
LATEST_S = 1e12  # no clock of a loop tells a later time, s
PACKAGES = ("steerclear", "numpy", "numba", "llvmlite", "qpsolvers", "daqp", "osqp", "quadprog", "pymavlink", "mcap")
"""Distributions whose versions a log notes."""


@cache
def versions() -> dict[str, str]:
    """Versions of Python and of `PACKAGES` as far as they are installed."""
    found = {"python": machine.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


@cache
def source_digest() -> str:
    """Digest of the shield's sources, the same wherever they are installed."""
    folder = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def table_digests(platforms: Iterable[str]) -> dict[str, str]:
    """Digests of the value table files for pairs of platforms, by name, which the shield may look opponents up in."""
    names = sorted(platforms)
    paths = {(own, other): find_table(own, other, OtherMay.WORST_CASE) for own in names for other in names}
    return {
        f"{own} with {other}": hashlib.sha256(path.read_bytes()).hexdigest()
        for (own, other), path in paths.items()
        if path is not None
    }


@cache
def describe_machine() -> str:
    """Architecture, system, C library and processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    processor = names[0] if names else machine.processor()
    return f"{machine.machine()} {machine.system()} {' '.join(machine.libc_ver())} {processor}".strip()


@dataclass(frozen=True)
class LoggedBoat:
    """One boat of the fleet file."""

    name: str  # of the boat
    agent: str  # its place in the game, "" for a boat outside it
    team: int  # 0 blue, 1 red, 2 outside the game
    platform: str  # name of its platform
    ours: bool  # whether this process commands it


@dataclass(frozen=True)
class LogHeader:
    """First message of a log."""

    config: ShieldConfig  # settings the shield was built with
    surroundings: Surroundings = OPEN_WATER  # static constraints it was built with
    platforms: Mapping[str, Platform] = field(default_factory=dict)  # parameters of the platforms, by name
    boats: tuple[LoggedBoat, ...] = ()  # of the fleet file, in its order
    frame: FieldFrame | None = None  # where the field is, None when it is nowhere on earth
    field_size_m: tuple[float, float] | None = None  # of the field along x and y, m
    fleet_text: str = ""  # the FLEET.yaml, word for word
    preset: str = ""  # rules of the game
    policy: str = ""  # name of the policy
    # anything else worth keeping, such as checks that were accepted
    notes: Mapping[str, str] = field(default_factory=dict)
    clock_s: float = 0.0  # time on the loop's clock when the log began, s
    # wall clock at that moment, ns since 1970; all times in the log are counted from it on the loop's clock
    unix_ns: int = field(default_factory=time.time_ns)
    versions: Mapping[str, str] = field(default_factory=versions)  # of Python and the packages that decisions depend on
    sources: str = field(default_factory=source_digest)  # digest of the sources of the shield
    # digests of the value tables for pairs of those platforms; None: those there are now
    tables: Mapping[str, str] | None = None
    # processor architecture, system and C library, which sines and cosines come from
    machine: str = field(default_factory=describe_machine)
    version: int = LOG_VERSION  # of the log's format
    chain: ChainHead = field(default_factory=ChainHead.new)  # where the file's chain begins

    def __post_init__(self) -> None:
        if self.tables is None:
            object.__setattr__(self, "tables", table_digests(self.platforms))

    def time_ns(self, clock_s: float) -> int:
        """Nanoseconds since 1970 of a time of the loop's clock, never before 1970."""
        return max(0, self.unix_ns + round((clock_s - self.clock_s) * 1e9))

    def to_message(self) -> dict[str, Any]:
        """The message; what has no fixed form is JSON in a text, so that log viewers can show it."""
        return {key: part.write(getattr(self, name)) for name, (key, part) in PARTS.items()}

    @classmethod
    def from_message(cls, message: Mapping[str, Any]) -> LogHeader:
        """The header such a message came from.

        Raises:
            LogError: the message is of another version, or a part is missing or makes no sense.
        """
        found = message.get("version")
        if found != LOG_VERSION or isinstance(found, bool):
            raise LogError(
                f"the log is of version {found}, this program reads version {LOG_VERSION}; use the one that wrote it, "
                f"steerclear {_writer(message)}"
            )
        try:
            return cls(**{name: part.read(message[key]) for name, (key, part) in PARTS.items()})
        except SteerclearError as error:
            raise LogError(
                f"the log's header does not fit this version ({error}); it was written by {_writer(message)}"
            ) from None
        except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
            raise LogError(f"the log's header is damaged ({type(error).__name__}: {error})") from None


def _writer(message: Mapping[str, Any]) -> str:
    try:
        return str(json.loads(str(message["versions"]))["steerclear"])
    except (KeyError, TypeError, ValueError, RecursionError):
        return "an unknown version"


def _time_s(value: Any) -> float:
    number = float(restored(value))
    if not abs(number) < LATEST_S:
        raise ValueError(f"{number} is no time")
    return number


def _unix_ns(value: Any) -> int:
    number = int(value)
    if not 0 <= number < 2**63:
        raise ValueError(f"{number} is no time in ns since 1970")
    return number


def _boat(row: Mapping[str, Any]) -> LoggedBoat:
    boat = LoggedBoat(**row)
    if boat.team not in (0, 1, 2) or not all(isinstance(text, str) for text in (boat.name, boat.agent, boat.platform)):
        raise ValueError(f"{row} is no boat")
    return replace(boat, team=int(boat.team), ours=bool(boat.ours))


@dataclass(frozen=True)
class Part:
    """How a part of the header is written into its message and read from it."""

    write: Callable[[Any], Any]
    read: Callable[[Any], Any]


def _hidden(write: Callable[[Any], Any], read: Callable[[Any], Any]) -> Part:
    """A part that is JSON in a text."""
    return Part(lambda value: json.dumps(plain(write(value)), allow_nan=False), lambda text: read(json.loads(text)))


def _optional(write: Callable[[Any], Any], read: Callable[[Any], Any]) -> Part:
    return _hidden(
        lambda value: None if value is None else write(value), lambda found: None if found is None else read(found)
    )


_TEXT = Part(str, str)
_TEXTS = _hidden(dict, lambda found: {str(name): str(value) for name, value in dict(found).items()})
PARTS: dict[str, tuple[str, Part]] = {
    "version": ("version", Part(int, int)),
    "fleet_text": ("fleet_yaml", _TEXT),
    "preset": ("preset", _TEXT),
    "policy": ("policy", _TEXT),
    "clock_s": ("clock_s", Part(plain, _time_s)),
    "unix_ns": ("unix_ns", Part(str, _unix_ns)),
    "sources": ("sources", _TEXT),
    "machine": ("machine", _TEXT),
    "config": ("shield", _hidden(asdict, lambda found: ShieldConfig.of(**current_settings(restored(found))))),
    "surroundings": ("surroundings", _hidden(asdict, lambda found: Surroundings(**restored(found)))),
    "platforms": (
        "platforms",
        _hidden(
            lambda kinds: {name: asdict(kind) for name, kind in kinds.items()},
            lambda found: {name: platform_from(row) for name, row in found.items()},
        ),
    ),
    "boats": ("boats", _hidden(lambda boats: list(map(asdict, boats)), lambda found: tuple(map(_boat, found)))),
    "frame": ("frame", _optional(asdict, lambda found: FieldFrame(**found))),
    "field_size_m": ("field_size_m", _optional(list, lambda found: (float(found[0]), float(found[1])))),
    "notes": ("notes", _TEXTS),
    "versions": ("versions", _TEXTS),
    "tables": ("tables", _TEXTS),
    "chain": ("chain", Part(lambda head: json.dumps(asdict(head)), lambda text: ChainHead.from_text(str(text)))),
}
"""Parts of a header: their names in the message, and how they are written and read."""
HEADER = object_schema(
    "steerclear.Header",
    "What the shield was built with; the first message. Texts that begin with a bracket are JSON.",
    **{key: {"version": int, "clock_s": float}.get(key, str) for key, _ in PARTS.values()},
)
"""JSON Schema of the message."""


def platforms_of(kinds: Iterable[str | Platform]) -> dict[str, Platform]:
    """Platforms by name, for a header.

    Raises:
        PlatformError: one is unknown.
    """
    return {kind.name: kind for kind in map(get_platform, kinds)}


def header_of_fleet(
    fleet: FleetFile,
    text: str,
    *,
    policy: str,
    commanded: Collection[str],
    clock_s: float,
    notes: Mapping[str, str] | None = None,
) -> LogHeader:
    """What a log of a fleet must begin with.

    Args:
        fleet: the file.
        text: its text, word for word.
        policy: name of the policy.
        commanded: names of the boats this process commands.
        clock_s: time on the loop's clock now, s.
        notes: anything else worth keeping.
    """
    rows = (
        (boat.name, boat.agent or "", fleet.team_of[boat.name], fleet.platform_of[boat.name]) for boat in fleet.boats
    )
    return LogHeader(
        config=fleet.shield_config,
        surroundings=fleet.surroundings,
        platforms={kind.name: kind for kind in fleet.platform_of.values()},
        boats=tuple(LoggedBoat(name, agent, team, kind.name, name in commanded) for name, agent, team, kind in rows),
        frame=fleet.frame,
        field_size_m=fleet.field.size_m,
        fleet_text=text,
        preset=fleet.preset,
        policy=policy,
        notes=notes or {},
        clock_s=clock_s,
    )
