"""Options that are given twice are refused: of two values the last would count, and nobody would be told."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import typer
from typer.core import TyperCommand, TyperOption


class OnceCommand(TyperCommand):
    """A command each of whose options counts once, but for those that may be repeated."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse as usual what gives no option twice.

        Raises:
            UsageError: it does.
        """
        _, _, given = self.make_parser(ctx).parse_args(args=list(args))
        for option in given:
            if isinstance(option, TyperOption) and not option.multiple and given.count(option) > 1:
                joined = ", values joined by commas" if "," in (option.metavar or "") else ""
                ctx.fail(f"{option.opts[0]} is given twice; give it once{joined}")
        return list(super().parse_args(ctx, args))


class App(typer.Typer):
    """Commands of the kind `OnceCommand`."""

    def command(self, name: str | None = None, **settings: Any) -> Callable[..., Any]:
        """As Typer's."""
        return super().command(name, **{"cls": OnceCommand, **settings})
