"""``steerclear deploy``: a policy steers boats, every command through the shield."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from steerclear import policies
from steerclear.shield.bridge.blackbox import log_path
from steerclear.shield.bridge.clock import Clock
from steerclear.shield.bridge.fleet_file import FleetFile, load_fleet
from steerclear.shield.bridge.messages import TickSink
from steerclear.shield.bridge.moos.links import POLICY as MOOS_POLICY
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.exceptions import ConfigError

from ..deploy.dashboard import Dashboard
from ..deploy.demo import Demo, demo_file
from ..deploy.keys import figure_rows
from ..deploy.orders import Orders, Surface
from ..deploy.plain import PlainLines, logging_aside
from ..deploy.rules import game_config
from ..deploy.run import deploy as run_boats
from ..play.spec import check_seed
from ..result_files import write_json
from ..sim_boats.demo import demo_fleet, demo_text
from . import deploying as d
from . import options as o
from .console import Interrupted, command, err, finish, out
from .policies_tried import say_of_elsewhere, say_what_runs

Fleet = Annotated[
    Path | None, typer.Argument(metavar="FLEET.yaml", help="Boats, links, geofence, limits.", show_default=False)
]
Policy = Annotated[str, typer.Option(metavar="NAME", help="Policy of our boats: a name or a submission's path.")]
Minutes = Annotated[float | None, typer.Option(metavar="MIN", help="How long.", show_default="until q or Ctrl-C")]
DemoOption = Annotated[
    bool, typer.Option("--demo", help="Simulate the boats and keep the game too; without FLEET.yaml: 3 against 3.")
]
Opponents = Annotated[str, typer.Option(metavar="NAME", help="With --demo: policy of the other team.")]
Plain = Annotated[bool, typer.Option("--plain", help="Lines instead of the dashboard; no keys but Ctrl-C.")]

LinkOption = Annotated[str, typer.Option(metavar="KIND", help="With --demo: what our boats run, mavlink or moos.")]

DEMO_WAIT_S = 300.0
"""Simulated boats may have to be compiled first."""


@command
def deploy(
    fleet: Fleet = None,
    policy: Policy = "medium",
    boat: d.Boat = None,
    minutes: Minutes = None,
    accept: d.Accept = None,
    demo: DemoOption = False,
    opponents: Opponents = "medium",
    link: LinkOption = "mavlink",
    speed: d.Speed = 1.0,
    wait: d.Wait = 15.0,
    seed: o.DrawSeed = 0,
    plain: Plain = False,
    no_tlog: d.NoTlog = False,
    trust: o.Trust = False,
    json_file: o.JsonFile = None,
) -> None:
    """Steer the boats of a FLEET.yaml by a policy, every command through the shield; boats are left stopped.

    Exit status: 0 done, 1 checks do not allow the start, 2 bad input, 130 interrupted.
    """
    if demo:
        policies.check(opponents)
        demo_text(link)
    if policy != MOOS_POLICY:
        policies.check(policy)
        say_what_runs((policy,), trust)
    demo_link = link if demo else ""
    orders = _orders(fleet, policy, boat, minutes, accept or [], demo_link, (speed, wait, seed, not no_tlog, trust))
    file = load_fleet(orders.fleet_file)
    if demo:
        orders = replace(orders, accept=(*orders.accept, *_not_simulated(file)))
    if file.agent_ids and policy != MOOS_POLICY:
        say_of_elsewhere((policy,), game_config(file))
    dashboard = d.on_terminal() and not plain
    operator, console, started = Operator(), out(), time.perf_counter()

    def sinks(file: FleetFile, operator: Operator, clock: Clock) -> Sequence[TickSink]:
        if dashboard:
            return (Dashboard(file, operator, clock),)
        return (PlainLines(lambda text: err().print(text, markup=False, soft_wrap=True)),)

    with ExitStack() as stack:
        stack.enter_context(logging_aside(log_path(file.log_dir, ".log", orders.begun_unix_s), shown=not dashboard))
        if demo:
            water = stack.enter_context(Demo(orders.fleet_file, opponents, speed))
            with err().status("simulated boats are starting; the first time all is compiled, which takes minutes"):
                water.wait(DEMO_WAIT_S)
        surface = Surface(lambda result: d.show_check(console, result, orders.accept), sinks)
        outcome = run_boats(orders, surface, operator)
    if outcome.figures:
        console.print(_table(outcome.figures))
    d.show_outcome(console, outcome)
    if json_file is not None:
        settings = {**asdict(orders), "fleet_file": str(orders.fleet_file)}
        write_json(json_file, d.content_of("deploy", settings, outcome, started))
    if outcome.ended.startswith("SIG"):
        raise Interrupted("interrupted; boats were stopped as said above")
    finish(not outcome.refused)


def _orders(
    fleet: Path | None,
    policy: str,
    boat: str | None,
    minutes: float | None,
    accept: Sequence[str],
    demo: str,
    more: tuple[float, float, int, bool, bool],
) -> Orders:
    speed, wait_s, seed, tlog, trust = more
    if fleet is None and not demo:
        raise ConfigError("give a FLEET.yaml, or --demo for boats that come with the package")
    if minutes is not None and not 0.0 < minutes <= 24.0 * 60.0:
        raise ConfigError(f"--minutes is {minutes:g}; give more than 0, at most a day")
    check_seed(seed)
    if boat is not None and fleet is None:
        demo_fleet(demo).commanded(boat)  # before its boats are simulated
    orders = Orders(
        fleet_file=fleet or Path(),
        policy=policy,
        boat=boat,
        minutes=minutes,
        accept=tuple(accept),
        seed=seed,
        tlog=tlog,
        speed=speed,
        connect_s=max(wait_s, 60.0) if demo and wait_s > 0.0 else wait_s,
        trust=trust,
        untold_delay_s=0.0 if demo else None,  # simulated boats on this machine obey at once
        begun_unix_s=time.time(),
    )
    # a folder, once all else is sound
    return orders if fleet is not None else replace(orders, fleet_file=demo_file(link=demo))


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
