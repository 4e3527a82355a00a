"""Config files of trainings: YAML in, checked settings out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from steerclear.shield.bridge.fleet_yaml import read_settings
from steerclear.shield.exceptions import ConfigError, FleetFileError

from .settings import TrainingSettings, settings_of

MOST_BYTES = 2**20


def read_config(path: Path) -> TrainingSettings:
    """Settings from a file.

    Raises:
        ConfigError: it cannot be read, is no YAML, or a key or value in it is unusable.
    """
    return settings_of(_content(path), str(path))


def _content(path: Path) -> Any:
    try:
        if path.stat().st_size > MOST_BYTES:
            raise ConfigError(f"{path} is larger than {MOST_BYTES} bytes; give a config file (docs/train.md)")
        return read_settings(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"cannot read {path} ({error.strerror}); give a config file (docs/train.md)") from error
    except FleetFileError as error:
        raise ConfigError(f"{path}: {error}") from error
    except ValueError as error:
        raise ConfigError(f"{path} is no text in UTF-8 ({error}); give a config file (docs/train.md)") from error
