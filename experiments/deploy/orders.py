"""Orders and outcome of a run, the stored preflight, and checks of a fleet file before any packet is sent."""

from __future__ import annotations

import hashlib
import logging
import math
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError
from steerclear.shield import Fleet, Shield
from steerclear.shield.bridge.blackbox.disk import explain
from steerclear.shield.bridge.clock import Clock
from steerclear.shield.bridge.drill import counted_words
from steerclear.shield.bridge.fleet_file import FleetFile, load_with_text
from steerclear.shield.bridge.mavlink.signing import read_key
from steerclear.shield.bridge.messages import TickSink
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.preflight_checks import CheckResult
from steerclear.shield.bridge.session import CONNECT_S
from steerclear.shield.bridge.static_obstacles import StaticObstacles
from steerclear.shield.exceptions import BridgeError, ConfigError, FleetFileError, SteerclearError
from steerclear.shield.platforms import fresh_state
from steerclear.shield.surroundings import Surroundings

from .referee import game_config, game_obstacles

LOG = logging.getLogger(__name__)

VALID_S = 12.0 * 3600.0  # a drill is valid for this long, s: one day on the water
DRILLED = ("course", "response", "model")  # checks that only a drill performs


class Kept(BaseModel):
    """A stored preflight."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    fleet: str  # fingerprint of the file's text and its boats' platforms; what has changed needs a new drill
    unix_s: float  # end time, s since 1970
    refused: list[str]  # names of checks neither passed nor accepted
    checks: list[CheckResult]  # all results


def keep(fleet: FleetFile, text: str, boat: str | None, results: Sequence[CheckResult], refused: Sequence[str]) -> Path:
    """Store a preflight's check results and its file's fingerprint, for one boat's process or the team's.

    Raises:
        BridgeError: it cannot be written.
    """
    checks = [
        replace(one, figures={name: float(value) for name, value in one.figures.items() if math.isfinite(value)})
        for one in results
    ]
    kept = Kept(fleet=_fingerprint(fleet, text), unix_s=time.time(), refused=list(refused), checks=checks)
    path = path_of(fleet, boat)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(kept.model_dump_json(indent=1), encoding="utf-8")
    except OSError as error:
        raise BridgeError(f"cannot write {path} ({error.strerror}); free space, or change log_dir") from None
    return path


def path_of(fleet: FleetFile, boat: str | None) -> Path:
    """Return the path of the stored preflight."""
    return fleet.log_dir / f"preflight_{boat or fleet.team}.json"


def check_drill(
    fleet: FleetFile, text: str, boat: str | None, commanded: Sequence[str], accept: Sequence[str] = ()
) -> CheckResult:
    """Check that these boats were drilled recently, with this very file, and moved as their platforms predict."""
    found = _read(path_of(fleet, boat))
    why = "no preflight of these boats" if found is None else _outdated(found, _fingerprint(fleet, text), commanded)
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
    """Return the longest delay from command to effect that the drill measured, s; None: not measured."""
    found = _read(path_of(fleet, boat))
    checks = () if found is None else found.checks
    delays = [check.figures.get("delay_s") for check in checks if check.name.startswith("response:")]
    return max((delay for delay in delays if delay is not None), default=None)


def _fingerprint(fleet: FleetFile, text: str) -> str:
    """Digest of the fleet file and of every boat's model, which may lie in a file of its own."""
    models = [
        repr((name, platform, dict(fleet.measured_of(name)))) for name, platform in sorted(fleet.platform_of.items())
    ]
    return hashlib.sha256("\n".join([text, *models]).encode()).hexdigest()


def _outdated(found: Kept, fingerprint: str, commanded: Sequence[str]) -> str:
    """Return why a preflight does not count for these boats, or an empty string."""
    if found.fleet != fingerprint:
        return "the fleet file, or a platform file that it names, has changed since its preflight"
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


LONGEST_MINUTES = 120.0  # log duration for which disk space is required when the run has no end time
LONGEST_WAIT_S, FASTEST = 3600.0, 1000.0
"""Limits of the wait in s and of the simulated speed; larger values are taken for typing errors."""
RENAMED_CHECKS = {"certificate": "backup"}
"""Old names that ``--accept`` took until 0.9 and still takes for one more release."""
APART_M = 100.0  # spacing of the boats in `boats_of`; large, because their positions do not matter there


@dataclass(frozen=True)
class Orders:
    """Settings of a run; `ConfigError` where the speed or the wait is out of range."""

    fleet_file: Path  # path of the FLEET.yaml
    policy: str  # name or path, as `steerclear.policies.make` takes it
    boat: str | None = None  # name of this process's boat (coordination per_boat); None: the whole team
    minutes: float | None = None  # duration; None: until ended
    accept: tuple[str, ...] = ()  # names of checks that may fail
    seed: int = 0  # of the policy's random draws
    tlog: bool = True  # whether raw packets are also stored
    speed: float = 1.0  # factor of real time, for simulated boats that run at it
    connect_s: float = CONNECT_S  # how long to wait for boats, s
    trust: bool = False  # also load a model stored among other teams' entries
    # delay from command to effect if neither file, drill nor fit gives it, s; None: one step
    unknown_delay_s: float | None = None
    begun_unix_s: float | None = None  # start time that names all files, s since 1970; None: when they are opened

    def __post_init__(self) -> None:
        if not 0.0 < self.connect_s <= LONGEST_WAIT_S:
            raise ConfigError(f"boats are waited for {self.connect_s:g} s; give --wait more than 0, at most an hour")
        if not 0.0 < self.speed <= FASTEST:
            raise ConfigError(f"boats live {self.speed:g} times as fast; give --speed more than 0, at most {FASTEST:g}")
        if RENAMED_CHECKS.keys() & {*self.accept}:
            LOG.warning("checks are renamed: %s", ", ".join(f"{old} is {new}" for old, new in RENAMED_CHECKS.items()))
            object.__setattr__(self, "accept", tuple(RENAMED_CHECKS.get(name, name) for name in self.accept))


@dataclass
class Outcome:
    """Result of a run."""

    ended: str = ""  # why it ended
    refused: list[CheckResult] = field(default_factory=list)  # checks that prevented the start; no boat moved
    checks: list[CheckResult] = field(default_factory=list)  # results of all checks
    left: tuple[str, ...] = ()  # what each boat was left doing, and who was approaching it
    near: tuple[str, ...] = ()  # boats approaching one of the own boats at the end
    log: Path | None = None  # path of the black box; None if it never began
    missing: str = ""  # what the black box lacks; empty: nothing
    figures: dict[str, float] = field(default_factory=dict)  # of the loop and its decisions


@dataclass(frozen=True)
class Surface:
    """User interface of a run."""

    shown: Callable[[CheckResult], None] = lambda result: None  # called with each check's result
    # makes further sinks, such as a dashboard, when the run begins
    sinks: Callable[[FleetFile, Operator, Clock], Sequence[TickSink]] = lambda fleet, operator, clock: ()


def read_fleet(orders: Orders) -> tuple[FleetFile, str]:
    """Return the fleet file, completed by `with_delay`, and its text.

    Raises:
        FleetFileError: the file cannot be used, or commands no boat.
        ConfigError: its signing key cannot be read, or other users can read it.
    """
    fleet, text = load_with_text(orders.fleet_file)
    if fleet.agent_ids:
        game_config(fleet)
    commanded = fleet.commanded(orders.boat)
    if not commanded:
        why = f"no boat of team {fleet.team} has a link; give one to command it"
        raise FleetFileError(f"{orders.fleet_file}: {why}")
    if fleet.signing is not None:
        read_key(fleet.signing.key_file)
    return with_delay(fleet, orders.boat, orders.unknown_delay_s), text


def with_delay(fleet: FleetFile, boat: str | None = None, unknown_s: float | None = None) -> FleetFile:
    """Return the file with a delay: its own, else the last drill's, else the longest of its platform files."""
    if "delay_s" in fleet.shield:
        return fleet
    delay_s = measured_delay_s(fleet, boat)
    if delay_s is None:
        fitted = [fleet.measured_of(entry.name).get("delay_s", 0.0) for entry in fleet.commanded(boat)]
        delay_s = max(fleet.dt_s if unknown_s is None else unknown_s, *fitted)
    return fleet.with_shield(delay_s=delay_s)


def refuse_early(fleet: FleetFile) -> None:
    """Check that a run of this file can begin and its logs can be written, before anything is sent to a boat.

    Raises:
        FleetFileError: see `rehearse`; or the game's rules are invalid.
        BridgeError: the log folder cannot be made or written; says why and what to do.
    """
    rehearse(fleet, game_obstacles(fleet))
    try:
        fleet.log_dir.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=fleet.log_dir) as file:
            file.write(b"steerclear")
            file.flush()
    except OSError as error:
        raise BridgeError(f"cannot write logs into {fleet.log_dir}: {explain(error)}") from None


def rehearse(fleet: FleetFile, fixed: Surroundings) -> None:
    """Build once everything that the loop builds from a file, as at its first turn.

    ``fixed`` are the game's static obstacles, see `referee.game_obstacles`.

    Raises:
        FleetFileError: the shield's settings leave no free water, or the shield rejects these boats.
    """
    try:
        for form in StaticObstacles(fleet, fixed).forms:
            Shield(fleet.shield_config, form)
        boats_of(fleet).check()
    except SteerclearError as error:
        raise FleetFileError(f"the shield cannot be built for this file: {error}") from None


def boats_of(fleet: FleetFile) -> Fleet:
    """Return all boats of a file, at rest and far apart."""
    ours = {boat.name for boat in fleet.ours}
    return Fleet(
        state=np.array([fresh_state(APART_M * i, 0.0, 0.0) for i in range(len(fleet.names))]),
        team=np.array([fleet.team_of[name] for name in fleet.names], dtype=np.int64),
        platforms=tuple(fleet.kind_of[name] for name in fleet.names),
        controlled=np.array([name in ours for name in fleet.names]),
        names=fleet.names,
    )
