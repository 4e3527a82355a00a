"""Commands as a user types them."""

from functools import cache

import typer.testing
from steerclear.experiments import cli

typer.testing._get_command = cache(typer.testing._get_command)  # it takes longer than most commands do in tests


def run(*words, **options):
    """Run a command of ``steerclear`` in this process; its outcome."""
    return typer.testing.CliRunner().invoke(cli.app, [str(word) for word in words], **options)
