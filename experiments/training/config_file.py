"""Config files of trainings: YAML in, checked settings out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from steerclear.shield.exceptions import ConfigError

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
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"cannot read {path} ({error.strerror}); give a config file (docs/train.md)") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        why = " ".join(str(error).split())[:200]
        raise ConfigError(f"{path} is no YAML ({why}); give a config file (docs/train.md)") from error
