"""What every run on boats goes through: checks, a black box, boats that obey; they are always left stopped."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from steerclear.shield.bridge.blackbox import McapWriter, header_of_fleet, log_path
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.control_loop import ControlLoop
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import TickSink, WantedSource
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.preflight_checks import Check
from steerclear.shield.bridge.session import VehicleSession

from .checks import checks_of
from .grounds import grounds_of
from .orders import LONGEST_MINUTES, Orders, Outcome, Surface, check_accepted, may_start
from .quiet import ended_by_signals, undisturbed


@dataclass(frozen=True)
class Begun:
    """A run whose boats obey.

    Attributes:
        session: links and feed, prepared.
        box: the black box.
        orders, surface, operator: as given.
        outcome: to be filled in.
    """

    session: VehicleSession
    box: McapWriter
    orders: Orders
    surface: Surface
    operator: Operator
    outcome: Outcome

    def sail(
        self,
        nominal: WantedSource,
        seconds: float | None,
        sinks: Sequence[TickSink] = (),
        *,
        plays: bool = False,
        begins: Callable[[ControlLoop], None] = lambda loop: None,
    ) -> ControlLoop:
        """Steer by nominal commands, each through the shield, until the time is over or somebody ends it.

        Args:
            nominal: where they come from.
            seconds: how long; None: until ended.
            sinks: get every tick, besides the black box and the surface's.
            plays: whether the referee's state of the game counts.
            begins: is given the loop before its first turn.
        """
        fleet, clock = self.session.fleet, self.session.clock
        with contextlib.ExitStack() as stack:
            shown = self.surface.sinks(fleet, self.operator, clock)
            for sink in (*sinks, *shown):
                stack.callback(sink.close)
            parts = self.session.parts(nominal, (self.box, *sinks, *shown), grounds_of(fleet), plays=plays)
            loop = ControlLoop(fleet, parts, self.operator, clock)
            begins(loop)
            with undisturbed():
                self.outcome.ended = loop.run(seconds)
        return loop


def run_boats(
    orders: Orders,
    surface: Surface,
    operator: Operator,
    read: tuple[FleetFile, str],
    policy: str,
    drive: Callable[[Begun], None] | None,
    *,
    clock: MonotonicClock | None = None,
    opened: Callable[[VehicleSession], Sequence[Check]] = lambda session: (),
    elsewhere: Sequence[str] = (),
) -> Outcome:
    """Open the boats, run the checks, and drive when they allow it.

    Args:
        orders: of the run.
        surface: where a person sees it.
        operator: whose orders count.
        read: the file and its text, see `orders.read_fleet`.
        policy: name of what steers, for the log.
        drive: steers boats that obey; None: no boat is moved.
        clock: the loop's; None: a new one.
        opened: called with the open session before anything is sent; its further checks.
        elsewhere: kinds of checks made elsewhere that may be accepted too.

    Raises:
        ConfigError: a name to accept is no check's.
        BridgeError: a port is taken, a boat does not answer or refuses; boats heard until then are left stopped.
    """
    fleet, text = read
    outcome, clock = Outcome(), clock or MonotonicClock(orders.speed)
    session = VehicleSession(fleet, orders.boat, clock, tlog=orders.tlog, begun_unix_s=orders.begun_unix_s)
    try:
        with session, ended_by_signals(operator):
            checks = [*checks_of(session, orders.minutes or LONGEST_MINUTES), *opened(session)]
            check_accepted(checks, orders.accept, elsewhere)
            session.connect(orders.connect_s)  # the first packets to boats; whatever needs none was refused by now
            if may_start(checks, orders.accept, surface, outcome) and drive is not None and not operator.ended:
                with contextlib.closing(_black_box(session, text, policy, outcome)) as box:
                    outcome.log = box.path
                    session.prepare()
                    drive(Begun(session, box, orders, surface, operator, outcome))
    finally:
        outcome.left = (*session.left, *(f"at the end {text}: take it over by hand" for text in outcome.near))
    return outcome


def _black_box(session: VehicleSession, text: str, policy: str, outcome: Outcome) -> McapWriter:
    """Begin the log; checks that were accepted although they did not pass are noted."""
    header = header_of_fleet(
        session.fleet,
        text,
        policy=policy,
        commanded=session.links,
        clock_s=session.clock.now_s(),
        notes={f"accepted {result.name}": result.text for result in outcome.checks if not result.passed},
    )
    return McapWriter(log_path(session.fleet.log_dir, ".mcap", session.begun_unix_s), header, key=session.key)
