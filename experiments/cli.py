"""The command ``steerclear``."""

from __future__ import annotations

from . import here as here  # isort: split

import sys
from functools import cache
from importlib import import_module
from typing import Annotated, Any

import typer
from rich.markup import escape
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.extras import missing

from .console import EXIT_CODES, App, leave_failed
from .provenance import package_version
from .terminal import prepare

COMMANDS = {
    **dict.fromkeys(("play", "evaluate", "ablate"), "cli_games"),
    **{"compare": "cli_tools", "tournament": "cli_games"},
    **dict.fromkeys(("train", "export"), "cli_train"),
    **dict.fromkeys(("encounters", "attack"), "cli_encounters"),
    **dict.fromkeys(("parity", "bench", "render", "docs", "warm-up"), "cli_tools"),
    "train-study": "cli_train",
    **dict.fromkeys(("deploy", "preflight", "referee", "sea-trial"), "cli_boats"),
    **dict.fromkeys(("replay", "fit", "sim-boats"), "cli_logs"),
}
"""Commands, as help lists them, and the modules they are in."""
GROUPS = {"reach": ("cli_reach", "app"), "platform": ("cli_tools", "platforms_app"), "entry": ("cli_entry", "app")}
"""Groups of commands, their modules and names there."""
OF_BOATS = ("cli_boats", "cli_logs")
"""Modules whose commands need the extra ``[boats]``."""


def build(only: str | None = None) -> App:
    """The command line, or no more of it than one command or group, which is there in half the time."""
    app = App(
        name="steerclear",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback(
        help="A safety shield for boats: play, compare and measure it in Maritime Capture the Flag.\n\n"
        f"Exit status of every command: {', '.join(f'{code:d} {words}' for code, words in EXIT_CODES.items())}."
    )(options)
    for name, module in COMMANDS.items():
        if only in (None, name):
            _add(app, name, module)
    for name, (module, group) in GROUPS.items():
        if only in (None, name):
            app.add_typer(getattr(import_module(f".{module}", __package__), group), name=name)
    return app


def _add(app: App, name: str, module: str) -> None:
    """Add a command, or what says which extra it lacks."""
    try:
        found = import_module(f".{module}", __package__)
    except ModuleNotFoundError as error:
        lacking = missing(error, f"steerclear {name}") if module in OF_BOATS else None
        if lacking is None:
            raise
        _add_refusal(app, name, lacking)
    else:
        app.command(name)(getattr(found, name.replace("-", "_")))


def _add_refusal(app: App, name: str, lacking: ConfigError) -> None:
    anything: dict[str, Any] = {"ignore_unknown_options": True, "allow_extra_args": True}

    @app.command(name, context_settings=anything, help=escape(f"Not installed: {lacking}"))
    def refuse(context: typer.Context) -> None:
        raise lacking


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"steerclear {package_version()}")
        raise typer.Exit


def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Take the options that stand before any command."""


@cache
def _whole() -> App:
    return build()


def __getattr__(name: str) -> Any:
    """``app``, the whole command line, made when it is asked for."""
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _whole()


def main() -> None:
    """Run the command line; whatever happens ends in words, not in a traceback."""
    prepare()
    try:
        first = sys.argv[1] if len(sys.argv) > 1 else ""
        app = build(first if first in {*COMMANDS, *GROUPS, "--version"} else None)
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
