"""What to run and what came of it; the drill that was kept; refusing what cannot be run before any packet."""

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


LONGEST_MINUTES = 120.0
"""Room for so long a log is asked for when no end is given."""
LONGEST_WAIT_S, FASTEST = 3600.0, 1000.0
"""Nobody means to wait longer for boats, or simulates them faster: more is a slip of the keyboard."""
RENAMED_CHECKS = {"certificate": "backup"}
"""Names that ``--accept`` took until 0.9, and takes for one more release."""
APART_M = 100.0
"""Boats of the rehearsal lie so far apart: only who they are counts."""


@dataclass(frozen=True)
class Orders:
    """What to run.

    Attributes:
        fleet_file: path of the FLEET.yaml.
        policy: name or path, as `steerclear.policies.make` takes it.
        boat: name of this process's boat (coordination per_boat); None: all of the team.
        minutes: how long; None: until ended.
        accept: names of checks that may fail.
        seed: of what the policy draws.
        tlog: whether raw packets are kept as well.
        speed: times faster than real time, for simulated boats that live so.
        connect_s: how long boats are waited for, s.
        trust: also load a model that lies among entries of others.
        untold_delay_s: from command to effect where neither file, drill nor fit says it, s; None: one step.
        begun_unix_s: when it was begun, s since 1970, which all its files are named after; None: when they are opened.

    Raises:
        ConfigError: the speed is not above 0 or the wait is out of range.
    """

    fleet_file: Path
    policy: str
    boat: str | None = None
    minutes: float | None = None
    accept: tuple[str, ...] = ()
    seed: int = 0
    tlog: bool = True
    speed: float = 1.0
    connect_s: float = CONNECT_S
    trust: bool = False
    untold_delay_s: float | None = None
    begun_unix_s: float | None = None

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
    """What came of it.

    Attributes:
        ended: why it ended.
        refused: checks that forbade the start; nothing moved.
        checks: results of all checks.
        left: what each boat was left doing, and who was on the way to it.
        near: boats on their way to one of ours at the end of the run.
        log: path of the black box; None when it never began.
        figures: of the loop and its decisions.
    """

    ended: str = ""
    refused: list[CheckResult] = field(default_factory=list)
    checks: list[CheckResult] = field(default_factory=list)
    left: tuple[str, ...] = ()
    near: tuple[str, ...] = ()
    log: Path | None = None
    figures: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Surface:
    """Where a person sees and steers the run.

    Attributes:
        shown: called with each check's result.
        sinks: makes further sinks, such as a dashboard, once the run begins.
    """

    shown: Callable[[CheckResult], None] = lambda result: None
    sinks: Callable[[FleetFile, Operator, Clock], Sequence[TickSink]] = lambda fleet, operator, clock: ()


def read_fleet(orders: Orders) -> tuple[FleetFile, str]:
    """The file, with the delay the last drill or a fit measured where it declares none, and its text.

    Raises:
        FleetFileError: it cannot be used, or there is nothing to command.
        ConfigError: its signing key cannot be read, or others can read it.
    """
    fleet, text = load_with_text(orders.fleet_file)
    if fleet.agent_ids:
        game_config(fleet)
    commanded = fleet.commanded(orders.boat)
    if not commanded:
        nobodys = [b for b in fleet.boats if b.link and b.commanded and b.agent is None and b.team is None]
        why = f"no boat of team {fleet.team} has a link; give one to command it"
        if nobodys:
            why = f"{nobodys[0].name} has a link but no agent or team; add team: {fleet.team} to command it"
        raise FleetFileError(f"{orders.fleet_file}: {why}")
    if fleet.signing is not None:
        read_key(fleet.signing.key_file)
    return with_delay(fleet, orders.boat, orders.untold_delay_s), text


def with_delay(fleet: FleetFile, boat: str | None = None, untold_s: float | None = None) -> FleetFile:
    """The file with a delay: its own, else what the last drill measured, else the longest that its platforms say."""
    if "delay_s" in fleet.shield:
        return fleet
    delay_s = measured_delay_s(fleet, boat)
    if delay_s is None:
        fitted = [fleet.measured_of(entry.name).get("delay_s", 0.0) for entry in fleet.commanded(boat)]
        delay_s = max(fleet.dt_s if untold_s is None else untold_s, *fitted)
    return fleet.with_shield(delay_s=delay_s)


def refuse_early(fleet: FleetFile) -> None:
    """See that a run of this file can begin, and its logs be written, before anything is sent to a boat.

    Raises:
        FleetFileError: as `rehearse`, or the game's rules make no sense.
        BridgeError: the folder of the logs cannot be made, or takes no file; what is wrong and what to do.
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
    """Build all that the loop will build of a file, once, as it will be at its first turn.

    ``fixed`` are static constraints of the game, see `rules.game_obstacles`.

    Raises:
        FleetFileError: the shield's settings leave nothing of the water, or it would refuse these boats.
    """
    try:
        for form in StaticObstacles(fleet, fixed).forms:
            Shield(fleet.shield_config, form)
        boats_of(fleet).check()
    except SteerclearError as error:
        raise FleetFileError(f"the shield cannot be built for this file: {error}") from None


def boats_of(fleet: FleetFile) -> Fleet:
    """All boats of a file, at rest and far apart."""
    ours = {boat.name for boat in fleet.ours}
    return Fleet(
        state=np.array([fresh_state(APART_M * i, 0.0, 0.0) for i in range(len(fleet.names))]),
        team=np.array([fleet.team_of[name] for name in fleet.names], dtype=np.int64),
        platforms=tuple(fleet.kind_of[name] for name in fleet.names),
        controlled=np.array([name in ours for name in fleet.names]),
        names=fleet.names,
    )
