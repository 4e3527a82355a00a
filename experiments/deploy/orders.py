"""What to run, what came of it, and the steps that `deploy` and `preflight` share."""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from steerclear.shield import Fleet, Shield
from steerclear.shield.bridge.blackbox.disk import explain
from steerclear.shield.bridge.clock import Clock
from steerclear.shield.bridge.fleet_file import FleetFile, load_with_text
from steerclear.shield.bridge.mavlink.signing import read_key
from steerclear.shield.bridge.messages import TickSink
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.preflight_checks import Check, CheckResult, not_passed, run_checks, validate_accepted
from steerclear.shield.bridge.session import CONNECT_S
from steerclear.shield.bridge.static_obstacles import StaticObstacles
from steerclear.shield.exceptions import BridgeError, ConfigError, FleetFileError, SteerclearError
from steerclear.shield.platforms import fresh_state
from steerclear.shield.surroundings import Surroundings

from .preflight_file import measured_delay_s
from .rules import game_config, game_obstacles

LOG = logging.getLogger(__name__)

LONGEST_MINUTES = 120.0
"""Room for so long a log is asked for when no end is given."""

LONGEST_WAIT_S = 3600.0
"""Nobody means to wait longer for boats; more is a slip of the keyboard."""

FASTEST = 1000.0
"""Simulated boats live no faster, times real time."""

Shown = Callable[[CheckResult], None]


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

    shown: Shown = lambda result: None
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
    if not fleet.commanded(orders.boat):
        raise FleetFileError(f"{orders.fleet_file}: {_nothing_to_command(fleet)}")
    if fleet.signing is not None:
        read_key(fleet.signing.key_file)
    if "delay_s" not in fleet.shield:
        fleet = fleet.with_shield(delay_s=_delay_s(fleet, orders.boat, orders.untold_delay_s))
    return fleet, text


def _nothing_to_command(fleet: FleetFile) -> str:
    """Why, and what to do: a boat outside the game is nobody's until its team is said."""
    for boat in fleet.boats:
        if boat.link is not None and boat.commanded and boat.agent is None and boat.team is None:
            return f"{boat.name} has a link but no agent or team; add team: {fleet.team} to command it"
    return f"no boat of team {fleet.team} has a link; give one to command it"


def _delay_s(fleet: FleetFile, boat: str | None, untold_s: float | None = None) -> float:
    """What the last drill measured, else the longest that the platforms' files say, see `Orders.untold_delay_s`."""
    drilled = measured_delay_s(fleet, boat)
    if drilled is not None:
        return drilled
    told = [fleet.measured_of(entry.name).get("delay_s", 0.0) for entry in fleet.commanded(boat)]
    return max(fleet.dt_s if untold_s is None else untold_s, *told)


def check_accepted(checks: Sequence[Check], accept: Sequence[str], elsewhere: Sequence[str] = ()) -> None:
    """See that every name to accept is a check's, before any is run.

    Args:
        checks: that will be run.
        accept: names that may fail.
        elsewhere: kinds of checks that are made in the drill and may be accepted too.

    Raises:
        ConfigError: a name is no check's.
    """
    known = [*checks, *(Check(kind, lambda: CheckResult("", False, "")) for kind in elsewhere)]
    validate_accepted([name for name in accept if name.split(":")[0] not in elsewhere], known)


def may_start(checks: Sequence[Check], accept: Sequence[str], surface: Surface, outcome: Outcome) -> bool:
    """Run checks; whether they allow to go on.

    Args:
        checks: to run.
        accept: names that may fail, see `check_accepted`.
        surface: where results are shown.
        outcome: gets results and refusals.
    """
    outcome.checks = run_checks(checks, surface.shown)
    outcome.refused = not_passed(outcome.checks, accept)
    for result in outcome.checks:
        if not result.passed and result not in outcome.refused:
            LOG.warning("accepted although not passed: %s: %s", result.name, result.text)
    return not outcome.refused


APART_M = 100.0
"""Boats of the rehearsal lie so far apart: only who they are counts."""


def refuse_early(fleet: FleetFile) -> None:
    """See that a run of this file can begin, before anything is sent to a boat.

    Raises:
        FleetFileError: as `rehearse`, or the game's rules make no sense.
        BridgeError: as `check_log_folder`.
    """
    rehearse(fleet, game_obstacles(fleet))
    check_log_folder(fleet.log_dir)


def rehearse(fleet: FleetFile, fixed: Surroundings) -> None:
    """Build all that the loop will build of a file, once, as it will be at its first turn.

    Args:
        fleet: the file, with its measured delay.
        fixed: static constraints of the game, see `rules.game_obstacles`.

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


def check_log_folder(folder: Path) -> None:
    """Make the folder of the logs, and see that it takes a file.

    Raises:
        BridgeError: it cannot be made or written; what is wrong and what to do.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"steerclear")
            file.flush()
    except OSError as error:
        raise BridgeError(f"cannot write logs into {folder}: {explain(error)}") from None
