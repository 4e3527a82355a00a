"""What an extra of the package brings, and the one line that says so where it is missing."""

from __future__ import annotations

from .exceptions import ConfigError

EXTRA_OF = {
    "pygame": "game",
    "imageio_ffmpeg": "film",
    "pymavlink": "boats",
    "pymap3d": "boats",
    "mcap": "boats",
    "pydantic": "boats",
    "stable_baselines3": "train",
    "torch": "train",
    "ray": "cluster",
    "pyarrow": "parquet",
}
"""The extra that installs a module."""


def missing(error: ModuleNotFoundError, what: str) -> ConfigError | None:
    """The error that names the extra to install; None when the module is of no extra.

    Args:
        error: what importing raised.
        what: what cannot be had without it, as "steerclear deploy".
    """
    module = (error.name or "").partition(".")[0]
    if module not in EXTRA_OF:
        return None
    return ConfigError(f"{what} needs {module}; install the extra: pip install 'steerclear[{EXTRA_OF[module]}]'")
