"""Commands as a user types them."""

from steerclear.experiments import cli
from typer.testing import CliRunner


def run(*words, **options):
    """Run a command of ``steerclear`` in this process; its outcome."""
    return CliRunner().invoke(cli.app, [str(word) for word in words], **options)
