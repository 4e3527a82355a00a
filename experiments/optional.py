"""Commands that need an extra: there where it is installed, else one line that names it."""

from __future__ import annotations

from importlib import import_module

import typer
from rich.markup import escape
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.extras import missing

from .commands.console import command


def optional_command(app: typer.Typer, name: str) -> None:
    """Add a command of ``commands/``, or one that says what it lacks.

    Args:
        app: where it is added.
        name: how it is called; its module and function have ``_`` for ``-``.
    """
    function = name.replace("-", "_")
    try:
        found = getattr(import_module(f".commands.{function}", __package__), function)
    except ModuleNotFoundError as error:
        lacking = missing(error, f"steerclear {name}")
        if lacking is None:
            raise
        _add_refusal(app, name, lacking)
    else:
        app.command(name)(found)


def _add_refusal(app: typer.Typer, name: str, lacking: ConfigError) -> None:
    anything = {"ignore_unknown_options": True, "allow_extra_args": True, "help_option_names": []}

    @app.command(name, context_settings=anything, help=escape(f"Not installed: {lacking}"))
    @command
    def refuse(context: typer.Context) -> None:
        raise lacking
