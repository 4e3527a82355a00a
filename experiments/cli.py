"""The command ``steerclear``."""

from __future__ import annotations

from . import here as here  # isort: split

import sys
from importlib import import_module
from typing import Annotated, Any

import typer
from rich.markup import escape
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.extras import missing

from .cli_encounters import attack, encounters
from .cli_entry import app as entry_app
from .cli_games import ablate, demonstrate, evaluate, play
from .cli_reach import app as reach_app
from .cli_tools import bench, compare, docs, parity, platforms_app, render, warm_up
from .cli_tournament import tournament
from .cli_train import export, train, train_study
from .console import EXIT_CODES, App, leave_failed
from .provenance import package_version
from .terminal import prepare

app = App(
    name="steerclear",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
BASE = (
    *(play, evaluate, ablate, compare, tournament, demonstrate, train, export, encounters, attack, parity, bench),
    *(render, docs, warm_up, train_study),
)
OF_BOATS = {"cli_boats": ("deploy", "preflight", "referee", "sea-trial"), "cli_logs": ("replay", "fit", "sim-boats")}
"""Commands that need the extra ``[boats]``, by their module."""


def _add_boats(module: str, names: tuple[str, ...]) -> None:
    """Add commands of boats, or what says which extra they lack."""
    try:
        found = import_module(f".{module}", __package__)
    except ModuleNotFoundError as error:
        for name in names:
            lacking = missing(error, f"steerclear {name}")
            if lacking is None:
                raise
            _add_refusal(name, lacking)
    else:
        for name in names:
            app.command(name)(getattr(found, name.replace("-", "_")))


def _add_refusal(name: str, lacking: ConfigError) -> None:
    anything: dict[str, Any] = {"ignore_unknown_options": True, "allow_extra_args": True, "help_option_names": []}

    @app.command(name, context_settings=anything, help=escape(f"Not installed: {lacking}"))
    def refuse(context: typer.Context) -> None:
        raise lacking


for function in BASE:
    app.command(function.__name__.replace("_", "-"))(function)
for module, names in OF_BOATS.items():
    _add_boats(module, names)
app.add_typer(reach_app, name="reach")
app.add_typer(platforms_app, name="platform")
app.add_typer(entry_app, name="entry")


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"steerclear {package_version()}")
        raise typer.Exit


@app.callback(
    help="A safety shield for boats: play, compare and measure it in Maritime Capture the Flag.\n\n"
    f"Exit status of every command: {', '.join(f'{code:d} {words}' for code, words in EXIT_CODES.items())}."
)
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Take the options that stand before any command."""


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
