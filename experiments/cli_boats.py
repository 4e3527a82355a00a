"""Commands that steer boats, behind the shield: preflight, deploy, sea-trial; and the referee, who steers none."""

from __future__ import annotations

import logging
import shlex
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text
from steerclear import policies
from steerclear.shield.bridge.blackbox import log_path
from steerclear.shield.bridge.clock import Clock, MonotonicClock
from steerclear.shield.bridge.feed_packets import GameState
from steerclear.shield.bridge.fleet_file import FleetFile, load_fleet
from steerclear.shield.bridge.messages import TickSink
from steerclear.shield.bridge.moos import POLICY as MOOS_POLICY
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.preflight_checks import SITUATION, CheckResult, not_passed
from steerclear.shield.exceptions import ConfigError

from . import cli_options as o
from .console import Interrupted, command, err, finish, out, say, warn
from .deploy.dashboard import Dashboard
from .deploy.demo import Demo, demo_file, end_with_parent
from .deploy.keys import figure_rows
from .deploy.orders import Orders, Outcome, Surface
from .deploy.plain import PlainLines
from .deploy.quiet import logging_aside
from .deploy.referee import RATE_HZ, Referee, game_config
from .deploy.run import deploy as run_boats
from .deploy.run import preflight as check_boats
from .deploy.run import sea_trial as try_boats
from .deploy.sea_trial import MANOEUVRES, SeaTrial
from .play.spec import check_seed
from .policy_checks import say_of_elsewhere, say_what_runs
from .provenance import head_of
from .result_files import write_json
from .sim_boats.demo import demo_fleet, demo_text
from .words import count_text
from .workers import COMPILES, LOG

DEMO_WAIT_S = 300.0
"""Simulated boats may have to be compiled first."""
STOPPED = "interrupted; boats were stopped as said above"
GRAVE = {*SITUATION, "autopilot", "commanders", "fence"}
"""Kinds of checks without which boats are not safe: no line invites to accept them."""
SIMULATED = " (drill: in simulation only)"
Fleet = Annotated[Path, typer.Argument(metavar="FLEET.yaml", help="The runner's own file.", show_default=False)]
WithParent = Annotated[
    bool, o.flag("End when standard input is closed: for programs that start this one.", "--with-parent")
]


@dataclass(frozen=True)
class BoatOptions:
    """How a process commands boats."""

    boat: Annotated[str | None, o.option("NAME", "The one boat this process commands (coordination: per_boat).")] = None
    accept: Annotated[
        list[str] | None,
        o.option("CHECK", "Start although this check does not pass; it is logged. May be repeated: latency:blue_1."),
    ] = None
    speed: Annotated[
        float, o.option("X", "Times faster than real time, as sim-boats was started; never real boats.")
    ] = 1.0
    wait: Annotated[float, o.option("S", "How long boats are waited for.")] = 15.0
    no_tlog: Annotated[bool, o.flag("Do not keep raw MAVLink packets beside the black box.", "--no-tlog")] = False

    def orders(self, fleet: Path, policy: str = "", **more: Any) -> Orders:
        """What a run is told."""
        given = {"accept": tuple(self.accept or ()), "speed": self.speed, "connect_s": self.wait, "boat": self.boat}
        return Orders(fleet, policy, **{"minutes": None, "seed": 0, "tlog": not self.no_tlog, **given, **more})


@command()
def preflight(
    fleet: Fleet,
    how: BoatOptions,
    no_drill: Annotated[bool, o.flag("Move no boat; deploy will want the drill later.", "--no-drill")] = False,
    json_file: o.JsonFile = None,
) -> None:
    """Check rates, delays, clocks, fixes, settings, geofence, safety margins and disk; then drive each boat 20 s.

    Boats move in the drill, one after the other, all of them behind the shield. Exit status: 0 all pass, 1 not all, 2
    bad input, 130 interrupted.
    """
    orders, started = how.orders(fleet, begun_unix_s=time.time()), time.perf_counter()
    with logging_aside(log_path(load_fleet(fleet).log_dir, ".log", orders.begun_unix_s), shown=True):
        outcome = check_boats(orders, _surface(out(), orders), drill=not no_drill)
    show_outcome(outcome, "no boat was moved" if no_drill else "not ready")
    if no_drill and not outcome.refused and not outcome.ended:
        say("checks passed; no boat was moved")
    _write(json_file, "preflight", orders, outcome, started)
    if outcome.ended:
        raise Interrupted(STOPPED)
    finish(not outcome.refused)


def _surface(console: Console, orders: Orders) -> Surface:
    """Checks and events as lines."""
    return Surface(
        lambda result: show_check(console, result, orders.accept),
        lambda file, operator, clock: (PlainLines(warn),),
    )


def show_check(console: Console, result: CheckResult, accepted: Sequence[str] = ()) -> None:
    """One line per check; one that was accepted beforehand looks like no failure."""
    failed = bool(not_passed([result], accepted))
    mark = (
        ("FAIL", "bold red") if failed else ("ok  ", "green") if result.passed else ("not passed, accepted:", "yellow")
    )
    console.print(Text(*mark), end=" ")
    console.print(f"{result.name}: {result.text}", markup=False, soft_wrap=True)


def show_outcome(outcome: Outcome, so: str = "not started") -> None:
    """What boats were left doing and where the logs are; which checks do not pass, and what is ``so`` for that."""
    say(*outcome.left)
    if outcome.refused:
        names = [result.name for result in outcome.refused]
        light = [name for name in names if name.partition(":")[0] not in GRAVE]
        grave = [name for name in names if name not in light]
        say(f"{so}: {count_text(len(names), 'check does', 'checks do')} not pass")
        if grave:
            say(f"put right, boats are not safe without: {', '.join(grave)}")
        if light:
            only = SIMULATED if "drill" in light else ""
            say(f"put right, or accept: {' '.join(f'--accept {name}' for name in light)}{only}")
    if outcome.log is not None:
        say(outcome.log)
    if outcome.missing:
        warn(outcome.missing)


def _write(file: Path | None, name: str, orders: Orders, outcome: Outcome, started_s: float) -> None:
    if file is None:
        return
    content = {
        **head_of(name, {**asdict(orders), "fleet_file": str(orders.fleet_file)}, started_s),
        "ended": outcome.ended,
        "refused": [result.name for result in outcome.refused],
        "checks": [vars(result) | {"figures": dict(result.figures)} for result in outcome.checks],
        "left": list(outcome.left),
        "log": None if outcome.log is None else str(outcome.log),
        "figures": outcome.figures,
    }
    write_json(file, content)


@dataclass(frozen=True)
class DemoOptions:
    """Boats that come with the package."""

    demo: Annotated[
        bool, o.flag("Simulate the boats and keep the game too; without FLEET.yaml: 3 against 3.", "--demo")
    ] = False
    opponents: Annotated[str, o.option("NAME", "With --demo: policy of the other team.")] = "medium"
    link: Annotated[str, o.option("KIND", "With --demo: what our boats run, mavlink or moos.")] = "mavlink"


@dataclass(frozen=True)
class PolicyOptions:
    """What steers."""

    policy: Annotated[str, o.option("NAME", "Policy of our boats: a name or a submission's path.")] = "medium"
    seed: o.DrawSeed = 0
    trust: o.Trust = False


@command()
def deploy(
    how: BoatOptions,
    demo: DemoOptions,
    what: PolicyOptions,
    fleet: Annotated[
        Path | None, typer.Argument(metavar="FLEET.yaml", help="Boats, links, geofence, limits.", show_default=False)
    ] = None,
    minutes: Annotated[float | None, o.option("MIN", "How long.", default="until q or Ctrl-C")] = None,
    plain: Annotated[bool, o.flag("Lines instead of the dashboard; no keys but Ctrl-C.", "--plain")] = False,
    json_file: o.JsonFile = None,
) -> None:
    """Steer the boats of a FLEET.yaml by a policy, every command through the shield; boats are left stopped.

    Exit status: 0 done, 1 checks do not allow the start, 2 bad input, 130 interrupted.
    """
    policy = what.policy
    if demo.demo:
        policies.check(demo.opponents)
        demo_text(demo.link)
    if policy != MOOS_POLICY:
        policies.check(policy)
        say_what_runs((policy,), what.trust, warn)
    if fleet is None and not demo.demo:
        raise ConfigError("give a FLEET.yaml, or --demo for boats that come with the package")
    if minutes is not None and not 0.0 < minutes <= 24.0 * 60.0:
        raise ConfigError(f"--minutes is {minutes:g}; give more than 0, at most a day")
    check_seed(what.seed)
    if how.boat is not None and fleet is None:
        demo_fleet(demo.link).commanded(how.boat)  # before its boats are simulated
    settings = {"minutes": minutes, "seed": what.seed, "trust": what.trust, "begun_unix_s": time.time()}
    if demo.demo:  # simulated boats on this machine obey at once
        settings |= {"unknown_delay_s": 0.0} | ({"connect_s": max(how.wait, 60.0)} if how.wait > 0.0 else {})
    orders = how.orders(fleet or Path(), policy, **settings)
    if fleet is None:  # a folder, once all else is sound
        orders = replace(orders, fleet_file=demo_file(link=demo.link))
    file = load_fleet(orders.fleet_file)
    if demo.demo:
        orders = replace(orders, accept=(*orders.accept, *_not_simulated(file)))
    if file.agent_ids and policy != MOOS_POLICY:
        say_of_elsewhere((policy,), game_config(file), warn)
    started = time.perf_counter()
    outcome = _steer(orders, file, demo.opponents if demo.demo else "", on_terminal() and not plain)
    if outcome.figures:
        out().print(_table(outcome.figures))
    show_outcome(outcome)
    _write(json_file, "deploy", orders, outcome, started)
    if outcome.ended.startswith("SIG"):
        raise Interrupted(STOPPED)
    finish(not outcome.refused)


def _steer(orders: Orders, file: FleetFile, opponents: str, dashboard: bool) -> Outcome:
    """Run the boats; ``opponents``: first simulate them, against that policy."""
    notice = CompileNotice()

    def sinks(file: FleetFile, operator: Operator, clock: Clock) -> Sequence[TickSink]:
        notice.close()
        return (Dashboard(file, operator, clock),) if dashboard else (PlainLines(warn),)

    console = out()
    with ExitStack() as stack:
        stack.enter_context(logging_aside(log_path(file.log_dir, ".log", orders.begun_unix_s), shown=not dashboard))
        if dashboard:
            stack.enter_context(closing(notice)).open()
        if opponents:
            water = stack.enter_context(Demo(orders.fleet_file, opponents, orders.speed))
            with err().status("simulated boats are starting; the first time all is compiled, which takes minutes"):
                water.wait(DEMO_WAIT_S)
        surface = Surface(lambda result: show_check(console, result, orders.accept), sinks)
        return run_boats(orders, surface, Operator())


class CompileNotice(logging.Handler):
    """Says once on stderr that machine code is compiled: until the dashboard takes the screen nothing else would."""

    def open(self) -> None:
        """Listen from now on."""
        LOG.addHandler(self)

    def close(self) -> None:
        """Say nothing any more; may be called again."""
        LOG.removeHandler(self)
        super().close()

    def emit(self, record: logging.LogRecord) -> None:
        """Say it, the first time."""
        if COMPILES in record.getMessage():
            warn(record.getMessage())
            LOG.removeHandler(self)


def on_terminal() -> bool:
    """Whether a person sits before it: keys can be read and the screen be drawn."""
    return sys.stdin.isatty() and sys.stdout.isatty()


def _not_simulated(file: FleetFile) -> tuple[str, ...]:
    """Checks that simulated boats need not pass: nobody drilled them, and those that run MOOS have no mission file."""
    moos = any(boat.link is not None and boat.link.kind == "moos" for boat in file.ours)
    return ("drill", "mission") if moos else ("drill",)


def _table(figures: dict[str, float]) -> Table:
    table = Table(title="the run", title_justify="left", show_header=False)
    table.add_column("")
    table.add_column("", justify="right")
    for row in figure_rows(figures):
        table.add_row(*row)
    return table


@command()
def sea_trial(
    fleet: Fleet,
    how: BoatOptions,
    only: Annotated[str | None, o.option("NAME", "Drive this boat; the others lie still.", "--only")] = None,
    max_speed: Annotated[
        float | None, o.option("M/S", "Highest speed told.", default="the platform's top speed")
    ] = None,
) -> None:
    """Drive speed steps, right angles, zig-zag, turning circles and stops inside the geofence, all behind the shield.

    About 6 minutes a boat, one after the other. The log it writes is what ``steerclear fit`` wants. Exit status: 0
    done, 1 checks do not allow the start, 2 bad input, 130 interrupted.
    """
    if max_speed is not None and not 0.1 <= max_speed <= 40.0:
        raise ConfigError(f"--max-speed is {max_speed:g}; give m/s, 0.1 to 40")
    orders, console = how.orders(fleet), out()
    with logging_aside(None, shown=True):
        surface = _surface(console, orders)
        outcome, trial = try_boats(orders, surface, only=only, speed_mps=max_speed, tell=console.print)
    show_outcome(outcome)
    if outcome.ended.startswith("SIG"):
        raise Interrupted(f"{STOPPED}, the log holds what was driven")
    if trial is not None:
        _show_trial(trial)
        say(*(next_words(outcome.log, name) for name in trial.changed))
    finish(not outcome.refused)


def next_words(log: Path | None, boat: str) -> str:
    """What to type next, as a shell takes it."""
    typed = shlex.join(["steerclear", "fit", str(log), "--boat", boat, "--out", f"{boat}.yaml"])
    return f"next: {typed}  # and name it in FLEET.yaml"


def _show_trial(trial: SeaTrial) -> None:
    for name, (changed, turns) in trial.changed.items():
        share = 100.0 * changed / max(1, turns)
        out().print(f"{name}: {len(MANOEUVRES)} manoeuvres, {share:.0f} % of its commands changed by the shield")
        if names := trial.broken_off[name]:
            say(f"{name}: ended at the geofence: {', '.join(names)}; a wider one tells more")


@command()
def referee(
    fleet: Annotated[Path, typer.Argument(metavar="FLEET.yaml", help="The runners' own file.", show_default=False)],
    listen: Annotated[
        str | None, o.option("HOST:PORT", "Hear positions here.", default="feed.referee of the file")
    ] = None,
    publish: Annotated[
        list[str] | None, o.option("HOST:PORT", "Tell also this listener; may be repeated.", "--publish")
    ] = None,
    rate: Annotated[float, o.option("HZ", "Looks a second.")] = RATE_HZ,
    speed: Annotated[float, o.option("X", "Times faster than real time, as sim-boats was started.")] = 1.0,
    minutes: Annotated[float | None, o.option("MIN", "Longest time.", default="until the end")] = None,
    with_parent: WithParent = False,
    json_file: o.JsonFile = None,
) -> None:
    """Watch boats, apply the game's rules without moving any, and tell all runners how the game stands.

    The game begins when every boat has been heard of. Exit status: 0 the game or the time is over, 2 bad input, 130
    interrupted.
    """
    if with_parent:
        end_with_parent()
    if not 1.0 <= rate <= 50.0:
        raise ConfigError(f"--rate is {rate:g}; give 1 to 50 looks a second")
    if minutes is not None and not 0.0 < minutes < 1e6:
        raise ConfigError(f"--minutes is {minutes:g}; give a time > 0")
    file, started = load_fleet(fleet), time.perf_counter()
    events: list[dict[str, Any]] = []
    with Referee(file, MonotonicClock(speed), listen, publish or ()) as kept, _ended() as stopped:
        with err().status("waiting for boats") as status:

            def tell(state: GameState, happened: Sequence[str]) -> None:
                score = f"blue {state.captures[0]} : {state.captures[1]} red"
                say(*(f"{state.time_s:8.1f} s  {text}" for text in happened))
                events.extend({"time_s": state.time_s, "text": text} for text in happened)
                status.update(Text(f"{state.time_s:.0f} s, {score}" + (f"; {state.note}" if state.note else "")))

            why = kept.run(tell, stopped, rate, None if minutes is None else 60.0 * minutes)
        state = kept.umpire.state()
        faults = kept.feed.faults()
    out().print(_game_table(state))
    if json_file is not None:
        settings = {"listen": listen, "publish": publish or [], "rate": rate, "speed": speed}
        content = {**head_of("referee", settings, started), "ended": why, "faults": faults}
        write_json(json_file, {**content, "game": state.as_dict(), "events": events})
    if why == "stopped":
        raise Interrupted("interrupted; boats are where they are, and their runners miss the referee")


def _game_table(state: GameState) -> Table:
    table = Table(title=f"after {state.time_s:.1f} s" + ("" if state.over else ", not over"))
    for title in ("", "captures", "grabs", "tags"):
        table.add_column(title, justify="left" if not title else "right")
    for team, side in enumerate(("blue", "red")):
        table.add_row(side, str(state.captures[team]), str(state.grabs[team]), str(state.tags[team]))
    return table


@contextmanager
def _ended() -> Iterator[Callable[[], bool]]:
    """Ctrl-C and SIGTERM end the game in order."""
    asked: list[int] = []
    before = {
        number: signal.signal(number, lambda got, frame: asked.append(got))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
