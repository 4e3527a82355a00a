"""The command ``steerclear``."""

from __future__ import annotations

from . import here as here  # isort: split

import sys
from typing import Annotated

import typer

from .commands.ablate import ablate
from .commands.attack import attack
from .commands.bench import bench
from .commands.compare import compare
from .commands.console import leave_failed
from .commands.demonstrate import demonstrate
from .commands.docs import docs
from .commands.encounters import encounters
from .commands.entry import app as entry_app
from .commands.evaluate import evaluate
from .commands.export import export
from .commands.once import App
from .commands.parity import parity
from .commands.platform import app as platform_app
from .commands.play import play
from .commands.reach import app as reach_app
from .commands.render import render
from .commands.tournament import tournament
from .commands.train import train
from .commands.train_study import train_study
from .commands.warm_up import warm_up
from .optional import optional_command
from .provenance import package_version
from .terminal import prepare

app = App(
    name="steerclear",
    help="A safety shield for boats: play, compare and measure it in Maritime Capture the Flag.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for function in (
    play,
    evaluate,
    ablate,
    compare,
    tournament,
    demonstrate,
    train,
    export,
    encounters,
    attack,
    parity,
    bench,
    render,
    docs,
):
    app.command()(function)
for name in ("deploy", "preflight", "replay", "referee", "fit", "sim-boats", "sea-trial"):
    optional_command(app, name)
app.command("warm-up")(warm_up)
app.command("train-study")(train_study)
app.add_typer(reach_app, name="reach")
app.add_typer(platform_app, name="platform")
app.add_typer(entry_app, name="entry")


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"steerclear {package_version()}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """A safety shield for boats: play, compare and measure it in Maritime Capture the Flag.

    Exit status of every command: 0 done, 1 a bar is not met, 2 bad input, 70 a fault of steerclear, 130 interrupted.
    """


def main() -> None:
    """Run the command line; whatever happens ends in words, not in a traceback."""
    prepare()
    try:
        app(prog_name="steerclear")
    except BrokenPipeError:
        raise  # Python ends quietly
    except Exception as error:
        try:
            leave_failed(error)
        except typer.Exit as leaving:
            sys.exit(leaving.exit_code)


if __name__ == "__main__":
    main()
