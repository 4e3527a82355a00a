"""Config files of trainings: YAML in, one of `config`'s models out, what is wrong in one line."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError
from steerclear.shield.bridge.fleet_yaml import read_settings
from steerclear.shield.exceptions import ConfigError, FleetFileError

from ..play.spec import near
from .config import CloningConfig, Part, PpoConfig, QmixConfig, RaidsConfig, TwoPartConfig

MOST_BYTES = 2**20
REMEDY = "give a config file (docs/train.md)"
Config = PpoConfig | TwoPartConfig | QmixConfig | RaidsConfig | CloningConfig
ALGORITHMS: dict[str, Any] = {
    name: kind for kind in get_args(Config) for name in get_args(kind.model_fields["algorithm"].annotation)
}
"""What a config's ``algorithm`` says which model it is of."""


def read_config(path: Path) -> Any:
    """The config in a file, one of `Config`.

    Raises:
        ConfigError: it cannot be read, says what programs read otherwise, or a key or value in it is unusable.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise ConfigError(f"{path} is larger than {MOST_BYTES} bytes; {REMEDY}")
        return config_of(read_settings(path.read_text(encoding="utf-8")), str(path))
    except OSError as error:
        raise ConfigError(f"cannot read {path} ({error.strerror}); {REMEDY}") from error
    except FleetFileError as error:
        raise ConfigError(f"{path}: {error}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path} is no text in UTF-8 ({error.reason}); {REMEDY}") from error


def config_of(content: Any, where: str = "the config") -> Any:
    """The config that keys and values make, one of `Config`.

    Raises:
        ConfigError: an unknown key (the message names near ones), one that the algorithm has no use for, or a value
            that cannot be.
    """
    if not isinstance(content, Mapping):
        raise ConfigError(f"{where} is {type(content).__name__}; give keys and values (docs/train.md)")
    algorithm = content.get("algorithm", "ppo")
    if algorithm not in ALGORITHMS:
        raise ConfigError(f"algorithm in {where} is {algorithm!r}; {near(str(algorithm), ALGORITHMS)}")
    try:
        return ALGORITHMS[algorithm].model_validate(dict(content))
    except ValidationError as error:
        raise ConfigError(_words(error, algorithm, where)) from None


def _words(error: ValidationError, algorithm: str, where: str) -> str:
    """The first thing that is wrong, in one line: where, what was found, what to give."""
    first = error.errors()[0]
    *parents, name = [str(step) for step in first["loc"] if not isinstance(step, int)] or [""]
    path = ".".join([*parents, name])
    if first["type"] == "extra_forbidden":
        known = [fields for kind in ALGORITHMS.values() if (fields := _fields(kind, parents)) and name in fields]
        if known:
            return f"{where}: algorithm {algorithm} has no use for {path}; leave it out"
        return f"{where}: unknown key {path!r}; {near(name, _fields(ALGORITHMS[algorithm], parents))}"
    text = first["msg"].removeprefix("Value error, ")
    if not path:
        return f"{where}: {text}"
    return f"{where}: {path} is {str(first['input'])[:80]!r}; {text.replace('Input should', 'it should')}"


def _fields(kind: Any, path: list[str]) -> list[str]:
    """Names of the keys at a path of a config; none where there is no such part."""
    for step in path:
        annotation = kind.model_fields[step].annotation if step in kind.model_fields else None
        parts = (annotation, *get_args(annotation))
        kind = next((one for one in parts if isinstance(one, type) and issubclass(one, Part)), None)
        if kind is None:
            return []
    return list(kind.model_fields)
