"""`LogHeader`: what a log must know besides its ticks, so that the shield can be built again as it was."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from ...config import ShieldConfig
from ...exceptions import ConfigError, LogError, SteerclearError
from ...platforms import Gains, Platform, get_platform
from ...surroundings import OPEN_WATER, Surroundings
from ..frame import FieldFrame
from .chain import ChainHead
from .numbers import plain, restored
from .origin import describe_machine, source_digest, table_digests, versions

LOG_VERSION = 2
LATEST_S = 1e12
"""No clock of a loop tells a later time, s."""
READ_VERSIONS = (1, 2)
"""Logs of version 1 have no chain, and texts where numbers are not finite."""


@dataclass(frozen=True)
class LoggedBoat:
    """One boat of the fleet file.

    Attributes:
        name: of the boat.
        agent: its place in the game, "" for a boat outside it.
        team: 0 blue, 1 red, 2 outside the game.
        platform: name of its platform.
        ours: whether this process commands it.
    """

    name: str
    agent: str
    team: int
    platform: str
    ours: bool


@dataclass(frozen=True)
class LogHeader:
    """First message of a log.

    Attributes:
        config: settings the shield was built with.
        surroundings: static constraints it was built with.
        platforms: parameters of the platforms, by name.
        boats: of the fleet file, in its order.
        frame: where the field is, None when it is nowhere on earth.
        field_size_m: of the field along x and y, m.
        fleet_text: the FLEET.yaml, word for word.
        preset: rules of the game.
        policy: name of the policy.
        notes: anything else worth keeping, such as checks that were accepted.
        clock_s: time on the loop's clock when the log began, s.
        unix_ns: wall clock at that moment, ns since 1970; all times in the log are counted from it on the loop's clock.
        versions: of Python and the packages that decisions depend on.
        sources: digest of the sources of the shield.
        tables: digests of the value tables for pairs of those platforms; None: those there are now.
        machine: processor architecture, system and C library, which sines and cosines come from.
        version: of the log's format.
        chain: where the file's chain begins; None in logs of version 1.
    """

    config: ShieldConfig
    surroundings: Surroundings = OPEN_WATER
    platforms: Mapping[str, Platform] = field(default_factory=dict)
    boats: tuple[LoggedBoat, ...] = ()
    frame: FieldFrame | None = None
    field_size_m: tuple[float, float] | None = None
    fleet_text: str = ""
    preset: str = ""
    policy: str = ""
    notes: Mapping[str, str] = field(default_factory=dict)
    clock_s: float = 0.0
    unix_ns: int = field(default_factory=time.time_ns)
    versions: Mapping[str, str] = field(default_factory=versions)
    sources: str = field(default_factory=source_digest)
    tables: Mapping[str, str] | None = None
    machine: str = field(default_factory=describe_machine)
    version: int = LOG_VERSION
    chain: ChainHead | None = field(default_factory=ChainHead.new)

    def __post_init__(self) -> None:
        if self.tables is None:
            object.__setattr__(self, "tables", table_digests(self.platforms))

    def time_ns(self, clock_s: float) -> int:
        """Nanoseconds since 1970 of a time of the loop's clock, never before 1970."""
        return max(0, self.unix_ns + round((clock_s - self.clock_s) * 1e9))

    def to_message(self) -> dict[str, Any]:
        """The message; what has no fixed form is JSON in a text, so that log viewers can show it."""
        shown = {
            "version": self.version,
            "fleet_yaml": self.fleet_text,
            "preset": self.preset,
            "policy": self.policy,
            "clock_s": plain(self.clock_s),
            "unix_ns": str(self.unix_ns),
            "sources": self.sources,
            "machine": self.machine,
        }
        hidden = {
            "shield": asdict(self.config),
            "surroundings": asdict(self.surroundings),
            "platforms": {name: asdict(kind) for name, kind in self.platforms.items()},
            "boats": [asdict(boat) for boat in self.boats],
            "frame": None if self.frame is None else asdict(self.frame),
            "field_size_m": self.field_size_m,
            "notes": dict(self.notes),
            "versions": dict(self.versions),
            "tables": dict(self.tables or {}),
            "chain": None if self.chain is None else asdict(self.chain),
        }
        return shown | {name: json.dumps(plain(value), allow_nan=False) for name, value in hidden.items()}

    @classmethod
    def from_message(cls, message: Mapping[str, Any]) -> LogHeader:
        """The header such a message came from.

        Raises:
            LogError: the message is of another version, or a part is missing or makes no sense.
        """
        found = message.get("version")
        if found not in READ_VERSIONS or isinstance(found, bool):
            raise LogError(
                f"the log is of version {found}, this program reads versions {', '.join(map(str, READ_VERSIONS))}; use "
                "the one that wrote it"
            )
        try:
            return cls(**_parts(message))
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


def _finite(value: Any) -> float:
    number = float(restored(value))
    if not abs(number) < LATEST_S:
        raise ValueError(f"{number} is no time")
    return number


def _texts(text: str) -> dict[str, str]:
    """Names with texts, from JSON."""
    return {str(name): str(value) for name, value in dict(json.loads(text)).items()}


def _boat(row: Mapping[str, Any]) -> LoggedBoat:
    boat = LoggedBoat(**row)
    if boat.team not in (0, 1, 2) or not all(isinstance(text, str) for text in (boat.name, boat.agent, boat.platform)):
        raise ValueError(f"{row} is no boat")
    return replace(boat, team=int(boat.team), ours=bool(boat.ours))


def _parts(message: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of `LogHeader` from its message."""
    size = json.loads(message["field_size_m"])
    frame = json.loads(message["frame"])
    return {
        "config": ShieldConfig.of(**_settings(restored(json.loads(message["shield"])))),
        "surroundings": Surroundings(**restored(json.loads(message["surroundings"]))),
        "platforms": {name: platform_from(row) for name, row in json.loads(message["platforms"]).items()},
        "boats": tuple(_boat(row) for row in json.loads(message["boats"])),
        "frame": None if frame is None else FieldFrame(**frame),
        "field_size_m": None if size is None else (float(size[0]), float(size[1])),
        "fleet_text": str(message["fleet_yaml"]),
        "preset": str(message["preset"]),
        "policy": str(message["policy"]),
        "notes": _texts(message["notes"]),
        "clock_s": _finite(message["clock_s"]),
        "unix_ns": int(message["unix_ns"]),
        "versions": _texts(message["versions"]),
        "tables": _texts(message["tables"]),
        "sources": str(message["sources"]),
        "machine": str(message["machine"]),
        "version": message["version"],
        "chain": ChainHead.from_text(str(message["chain"])) if message["version"] > 1 else None,
    }


def _settings(told: dict[str, Any]) -> dict[str, Any]:
    """Settings of the shield of a log, as this version calls them.

    In those that do not know `mate_cap_m` team-mates' margins had the one cap; in those that do not know `adversary_s`
    opponents did their worst for ever, or held their course.

    Raises:
        ConfigError: the log's shield granted opponents a part of their turn, or a time, that no setting stands for.
    """
    settings = {"mate_cap_m": told.get("margin_cap_m", ShieldConfig.margin_cap_m), **told}
    share, hunt_s = settings.pop("opponent_share", 1.0), settings.pop("hunt_s", None)
    if share not in (0.0, 1.0) or hunt_s is not None:
        raise ConfigError(f"opponent_share {share} and hunt_s {hunt_s} are no settings of this version any more")
    settings.pop("hysteresis_m", None)  # a margin that no encounter showed; such logs are decided otherwise anyhow
    if "adversary_s" not in settings:
        settings["profile"] = "rammers" if share == 1.0 else "hold-course"
    return settings


def platform_to_text(kind: Platform) -> str:
    """A platform's parameters as JSON."""
    return json.dumps(plain(asdict(kind)), allow_nan=False)


def platform_from(row: Mapping[str, Any]) -> Platform:
    """The platform with such parameters.

    Raises:
        LogError: they are not a platform's.
        PlatformError: a value makes no sense.
    """
    values = restored(dict(row))
    try:
        values["speed_pid"], values["heading_pid"] = Gains(**values["speed_pid"]), Gains(**values["heading_pid"])
        values["thrust_map"] = tuple((float(thrust), float(speed)) for thrust, speed in values["thrust_map"])
        return Platform(**values)
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, SteerclearError):
            raise
        raise LogError(f"the log holds a platform that does not fit this version ({error})") from None


def platforms_of(kinds: Iterable[str | Platform]) -> dict[str, Platform]:
    """Platforms by name, for a header.

    Raises:
        PlatformError: one is unknown.
    """
    return {kind.name: kind for kind in map(get_platform, kinds)}
