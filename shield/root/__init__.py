"""steerclear: a safety shield for boats. The parts are `steerclear.shield`, `.env`, `.policies` and `.experiments`."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("steerclear")
except PackageNotFoundError:  # run from a copy that nobody installed
    __version__ = "unknown"

__all__ = ["__version__"]
