"""``steerclear referee``: keeps the game of real or simulated boats by the env's rules."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.feed import GameState
from steerclear.shield.bridge.fleet_file import load_fleet
from steerclear.shield.exceptions import ConfigError

from ..deploy.demo import end_with_parent
from ..deploy.referee import RATE_HZ, Referee
from ..provenance import machine, versions
from ..result_files import write_json
from . import deploying as d
from . import options as o
from .console import Interrupted, command, err, out

Fleet = Annotated[Path, typer.Argument(metavar="FLEET.yaml", help="The runners' own file.", show_default=False)]
Listen = Annotated[
    str | None, typer.Option(metavar="HOST:PORT", help="Hear positions here.", show_default="feed.referee of the file")
]
Publish = Annotated[
    list[str] | None,
    typer.Option("--publish", metavar="HOST:PORT", help="Tell also this listener; may be repeated."),
]
Links = Annotated[bool, typer.Option("--links", help="Hear boats that have a link there too; nothing is commanded.")]
Rate = Annotated[float, typer.Option(metavar="HZ", help="Looks a second.")]
Speed = Annotated[float, typer.Option(metavar="X", help="Times faster than real time, as sim-boats was started.")]
Minutes = Annotated[float | None, typer.Option(metavar="MIN", help="Longest time.", show_default="until the end")]


@command
def referee(
    fleet: Fleet,
    listen: Listen = None,
    publish: Publish = None,
    links: Links = False,
    rate: Rate = RATE_HZ,
    speed: Speed = 1.0,
    minutes: Minutes = None,
    with_parent: d.WithParent = False,
    json_file: o.JsonFile = None,
) -> None:
    """Watch boats, apply the game's rules without moving any, and tell all runners how the game stands.

    The game begins when every boat has been heard of. Exit status: 0 the game or the time is over, 2 bad input, 130
    interrupted.
    """
    if with_parent:
        end_with_parent()
    _check(rate, minutes)
    file = load_fleet(fleet)
    started = time.perf_counter()
    events: list[dict[str, Any]] = []
    with Referee(file, MonotonicClock(speed), listen, publish or (), links) as kept, _ended() as stopped:
        with err().status("waiting for boats") as status:
            why = kept.run(
                lambda state, happened: _tell(state, happened, events, status),
                stopped,
                rate,
                None if minutes is None else 60.0 * minutes,
            )
        state = kept.umpire.state()
        faults = {} if kept.hearing.feed is None else kept.hearing.feed.faults()
    out().print(_table(state))
    if json_file is not None:
        settings = {"listen": listen, "publish": publish or [], "links": links, "rate": rate, "speed": speed}
        content = {"command": "referee", "settings": settings, "versions": versions(), "machine": machine()}
        content |= {"wall_s": time.perf_counter() - started, "ended": why, "faults": faults}
        write_json(json_file, {**content, "game": state.as_dict(), "events": events})
    if why == "stopped":
        raise Interrupted("interrupted; boats are where they are, and their runners miss the referee")


def _check(rate: float, minutes: float | None) -> None:
    if not 1.0 <= rate <= 50.0:
        raise ConfigError(f"--rate is {rate:g}; give 1 to 50 looks a second")
    if minutes is not None and not 0.0 < minutes < 1e6:
        raise ConfigError(f"--minutes is {minutes:g}; give a time > 0")


def _tell(state: GameState, happened: Sequence[str], events: list[dict[str, Any]], status: Any) -> None:
    score = f"blue {state.captures[0]} : {state.captures[1]} red"
    for text in happened:
        out().print(f"{state.time_s:8.1f} s  {text}", markup=False, soft_wrap=True)
        events.append({"time_s": state.time_s, "text": text})
    status.update(Text(f"{state.time_s:.0f} s, {score}" + (f"; {state.note}" if state.note else "")))


def _table(state: GameState) -> Table:
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
