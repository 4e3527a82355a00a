"""What ``steerclear deploy`` and ``steerclear preflight`` share: options, how checks and outcomes are shown."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.text import Text
from steerclear.shield.bridge.preflight_checks import CheckResult, not_passed

from ..deploy.orders import Outcome
from ..provenance import machine, versions

Boat = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="The one boat this process commands (coordination: per_boat)."),
]
Accept = Annotated[
    list[str] | None,
    typer.Option(
        metavar="CHECK", help="Start although this check does not pass; it is logged. May be repeated: latency:blue_1."
    ),
]
Speed = Annotated[
    float, typer.Option(metavar="X", help="Times faster than real time, as sim-boats was started; never real boats.")
]
Wait = Annotated[float, typer.Option(metavar="S", help="How long boats are waited for.")]
WithParent = Annotated[
    bool, typer.Option("--with-parent", help="End when standard input is closed: for programs that start this one.")
]
NoTlog = Annotated[bool, typer.Option("--no-tlog", help="Do not keep raw MAVLink packets beside the black box.")]


def show_check(console: Console, result: CheckResult, accepted: Sequence[str] = ()) -> None:
    """One line per check; one that was accepted beforehand looks like no failure."""
    failed = bool(not_passed([result], accepted))
    mark = (
        ("FAIL", "bold red") if failed else ("ok  ", "green") if result.passed else ("not passed, accepted:", "yellow")
    )
    console.print(Text(*mark), end=" ")
    console.print(f"{result.name}: {result.text}", markup=False, soft_wrap=True)


def show_outcome(console: Console, outcome: Outcome) -> None:
    """What boats were left doing and where the logs are; why nothing was begun."""
    for text in outcome.left:
        console.print(text, markup=False, soft_wrap=True)
    if outcome.refused:
        names = " ".join(f"--accept {result.name}" for result in outcome.refused)
        console.print(f"not started: {len(outcome.refused)} checks do not pass. Put them right, or go on with {names}",
                      markup=False, soft_wrap=True)  # fmt: skip
    if outcome.log is not None:
        console.print(f"{outcome.log}", markup=False, soft_wrap=True)


def content_of(command: str, settings: dict[str, Any], outcome: Outcome, started_s: float) -> dict[str, Any]:
    """The outcome for a JSON file, of a command begun at that time of `time.perf_counter`."""
    return {
        "command": command,
        "settings": settings,
        "versions": versions(),
        "machine": machine(),
        "wall_s": time.perf_counter() - started_s,
        "ended": outcome.ended,
        "refused": [result.name for result in outcome.refused],
        "checks": [vars(result) | {"figures": dict(result.figures)} for result in outcome.checks],
        "left": list(outcome.left),
        "log": None if outcome.log is None else str(outcome.log),
        "figures": outcome.figures,
    }


def on_terminal() -> bool:
    """Whether a person sits before it: keys can be read and the screen be drawn."""
    return sys.stdin.isatty() and sys.stdout.isatty()
