"""The package's extras, and the error that names a missing one."""

from __future__ import annotations

import json
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from urllib.request import url2pathname

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
    """Return the error that names the extra to install; None if no extra has the module.

    Args:
        error: what importing raised.
        what: the feature that needs it, such as "steerclear deploy".
    """
    module = (error.name or "").partition(".")[0]
    if module not in EXTRA_OF:
        return None
    return ConfigError(f"{what} needs {module}; install the extra: {install_command(EXTRA_OF[module])}")


def install_command(extra: str) -> str:
    """Return the command that installs an extra: from the clone this was installed from, or by name from an index."""
    origin = _origin()
    url = str(origin.get("url", ""))
    if "vcs_info" in origin:
        return f"pip install 'steerclear[{extra}] @ {origin['vcs_info'].get('vcs', 'git')}+{url}'"
    folder = Path(url2pathname(urlsplit(url).path)) if url.startswith("file:") else None
    if folder is None or not (folder / "pyproject.toml").is_file():
        return f"pip install 'steerclear[{extra}]'"
    editable = "-e " if (origin.get("dir_info") or {}).get("editable") else ""
    return f"pip install {editable}'{folder}[{extra}]'"


def _origin() -> dict[str, Any]:
    """Return pip's record of where this was installed from (PEP 610); empty: from an index, or not known."""
    try:
        return dict(json.loads(distribution("steerclear").read_text("direct_url.json") or "{}"))
    except (PackageNotFoundError, ValueError, TypeError):
        return {}
