"""The autopilot's parameters: those a runner reads or sets."""

from __future__ import annotations

import difflib
from collections.abc import Mapping

from steerclear.shield.exceptions import ConfigError

_REAL32, _INT8, _INT16, _INT32 = 9, 2, 4, 6

_DEFAULTS: dict[str, tuple[float, int]] = {
    "SYSID_THISMAV": (1.0, _INT16),
    "SYSID_MYGCS": (255.0, _INT16),
    "ARMING_CHECK": (1.0, _INT32),
    "CRUISE_SPEED": (2.0, _REAL32),
    "FRAME_CLASS": (2.0, _INT8),
    "AVOID_ENABLE": (3.0, _INT8),
    "FENCE_ACTION": (2.0, _INT8),
    "FENCE_ENABLE": (0.0, _INT8),
    "FS_ACTION": (2.0, _INT8),
    "FS_GCS_ENABLE": (0.0, _INT8),
    "FS_GCS_TIMEOUT": (5.0, _REAL32),
    "FS_TIMEOUT": (1.5, _REAL32),
    "INITIAL_MODE": (0.0, _INT8),
    "LOIT_RADIUS": (2.0, _REAL32),
    "OA_TYPE": (0.0, _INT8),
    "WP_SPEED": (2.0, _REAL32),
}


class Parameters:
    """Values by name; types never change.

    Args:
        given: values that differ from the defaults.
        has_timeout: whether GUID_TIMEOUT exists.

    Raises:
        ConfigError: a name the autopilot does not have.
    """

    def __init__(self, given: Mapping[str, float], has_timeout: bool = False) -> None:
        table = dict(_DEFAULTS)
        if has_timeout:
            table["GUID_TIMEOUT"] = (3.0, _REAL32)
        self._values = {name: value for name, (value, _) in table.items()}
        self._types = {name: kind for name, (_, kind) in table.items()}
        for name, value in given.items():
            if name not in self._values:
                near = difflib.get_close_matches(name, self._values, n=1)
                hint = f"did you mean {near[0]}?" if near else f"it has {', '.join(self._values)}"
                raise ConfigError(f"the simulated autopilot has no parameter {name!r}; {hint}")
            self._values[name] = float(value)
        self.names = sorted(self._values)

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def get(self, name: str, default: float) -> float:
        """Value of a parameter, or the default where it does not exist."""
        return self._values.get(name, default)

    def set(self, name: str, value: float) -> bool:
        """Set a known parameter, integers rounded; False when there is none of that name."""
        if name not in self._values:
            return False
        self._values[name] = float(value) if self._types[name] == _REAL32 else float(round(value))
        return True

    def type_of(self, name: str) -> int:
        """MAV_PARAM_TYPE of a parameter."""
        return self._types[name]
