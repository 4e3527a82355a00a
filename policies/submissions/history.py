"""Observation settings a submission was trained with, read from the ``gen_config.py`` beside it."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from steerclear.shield.exceptions import PolicyError

CONFIG_FILE = "gen_config.py"


@dataclass(frozen=True)
class ObservationSettings:
    """Which past observations a submission is given: ``ages`` in steps, newest (0) first; (0,) for the present only."""

    ages: tuple[int, ...] = (0,)

    @classmethod
    def from_module(cls, module: ModuleType) -> ObservationSettings:
        """Settings of a loaded ``gen_config.py``; everything but the observations is the game's affair.

        Raises:
            PolicyError: it asks for observations this game does not make.
        """
        config = _config_dict(module)
        if config.get("lidar_obs", False):
            raise PolicyError(f"{CONFIG_FILE} asks for lidar observations, which this game does not make")
        ages: set[int] = set()
        for kind in ("short", "long"):
            length = _count(config, f"{kind}_obs_hist_length")
            interval = _count(config, f"{kind}_obs_hist_interval")
            ages.update(range(0, length * interval, interval))
        return cls(tuple(sorted(ages)))


class History:
    """Past observations of all boats. Before the game is old enough, its first observation stands in.

    Args:
        settings: which ones are asked for.
    """

    def __init__(self, settings: ObservationSettings) -> None:
        self._ages = settings.ages
        self._past: deque[tuple[dict[str, Any], dict[str, Any]]] = deque(maxlen=settings.ages[-1] + 1)

    def clear(self) -> None:
        """A new game begins."""
        self._past.clear()

    def push(self, normalized: dict[str, Any], raw: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Take in the present step's observations by agent and answer those the submission is to see.

        Returns:
            Both dicts as given when no history is asked for; else per agent an array (k, n_obs) and an array (k,) of
            dicts, newest first.
        """
        if self._ages == (0,):
            return normalized, raw
        if not self._past:
            self._past.extend([(normalized, raw)] * (self._ages[-1] + 1))
        self._past.appendleft((normalized, raw))
        chosen = [self._past[age] for age in self._ages]
        stacked = {agent_id: np.stack([step[0][agent_id] for step in chosen]) for agent_id in normalized}
        return stacked, {agent_id: _objects([step[1][agent_id] for step in chosen]) for agent_id in raw}


def _objects(items: list[Any]) -> np.ndarray:
    array = np.empty(len(items), dtype=object)
    array[:] = items
    return array


def _config_dict(module: ModuleType) -> Mapping[str, Any]:
    """The settings dict of the file: the competition's, should there be several."""
    found = {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, Mapping) and ("short_obs_hist_length" in value or "lidar_obs" in value)
    }
    for name in sorted(found, key=lambda name: "competition" not in name):
        return found[name]
    return {}


def _count(config: Mapping[str, Any], name: str) -> int:
    value = config.get(name, 1)
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 10_000:
        raise PolicyError(f"{CONFIG_FILE}: {name} is {value!r}; it must be a whole number from 1")
    return value
