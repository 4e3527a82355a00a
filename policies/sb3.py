"""Models saved by Stable-Baselines3, as a team policy: ``sb3:PATH.zip``."""

from __future__ import annotations

import importlib
import json
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.shield.exceptions import PolicyError

from .guard import Answer, ForeignCode, GuardedTeam
from .scripted.team import game_core

ALGORITHMS = ("PPO", "A2C", "DQN", "SAC", "TD3", "DDPG")
_MARKS = (("clip_range", "PPO"), ("exploration_fraction", "DQN"), ("target_entropy", "SAC"), ("policy_delay", "TD3"))


class Sb3Code(ForeignCode):
    """One model playing every boat from its own observation, deterministically.

    A Discrete model sends action numbers; a Box model sends (speed m/s, relative heading deg), or, when its space is
    [-1, 1], the same scaled to 0..top speed and -180..180 deg.

    Args:
        path: the saved model.
        algorithm: one of ``ALGORITHMS``; None tells it from the file.

    Raises:
        PolicyError: the extra ``[train]`` is missing, or the file is no model this can play.
    """

    def __init__(self, path: str | Path, algorithm: str | None = None) -> None:
        self._path = Path(path).expanduser()
        if not self._path.is_file():
            raise PolicyError(f"there is no model at {self._path}; give the zip that model.save wrote")
        name = algorithm or saved_algorithm(self._path)
        if name not in ALGORITHMS:
            raise PolicyError(f"unknown algorithm {name!r}; choose one of {', '.join(ALGORITHMS)}")
        try:
            library = importlib.import_module("stable_baselines3")
        except ImportError as error:
            raise PolicyError("sb3 models need the extra: pip install 'steerclear[train]'") from error
        try:
            self._model = getattr(library, name).load(self._path, device="cpu")
        except Exception as error:  # whatever the unpickler meets, it is this file that cannot be used
            raise PolicyError(f"{self._path} cannot be loaded as {name}: {error}; name its algorithm") from error
        self._scaled = _is_unit_box(self._model.action_space)

    def begin(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Check that the model was made for these observations."""
        core = game_core(env)
        shape = tuple(self._model.observation_space.shape or ())
        if shape != (core.n_obs,):
            raise PolicyError(
                f"{self._path} takes observations {shape}, this game makes ({core.n_obs},): other team_size?"
            )
        self._top_speed = dict(zip(core.config.agent_ids, core.max_speed_mps.tolist(), strict=True))

    def prepare(self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]) -> Answer:
        """Predict one boat's action."""
        return lambda agent_id: self._predict(agent_id, observations[agent_id])

    def _predict(self, agent_id: str, observation: np.ndarray) -> Any:
        action, _ = self._model.predict(observation, deterministic=True)
        if np.ndim(action) == 0:
            return int(action)
        if self._scaled:
            return 0.5 * (float(action[0]) + 1.0) * self._top_speed[agent_id], 180.0 * float(action[1])
        return action


def saved_algorithm(path: Path) -> str:
    """Which algorithm wrote a model, told from the settings it saved.

    Raises:
        PolicyError: the file is not a saved model.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            saved = json.loads(archive.read("data"))
    except (zipfile.BadZipFile, KeyError, ValueError) as error:
        raise PolicyError(f"{path} is not a Stable-Baselines3 model: {error}; give the zip model.save wrote") from error
    for mark, algorithm in _MARKS:
        if mark in saved:
            return algorithm
    return "A2C"


def _is_unit_box(space: Any) -> bool:
    low, high = getattr(space, "low", None), getattr(space, "high", None)
    return low is not None and high is not None and bool(np.all(low == -1.0) and np.all(high == 1.0))


def load_sb3(path: str | Path, algorithm: str | None = None, name: str | None = None) -> GuardedTeam:
    """A saved Stable-Baselines3 model as a team policy.

    Args:
        path: the zip ``model.save`` wrote.
        algorithm: one of ``ALGORITHMS``; None tells it from the file.
        name: name for records and reports; None takes the file's.

    Raises:
        PolicyError: the extra ``[train]`` is missing, or the file is no such model.
    """
    return GuardedTeam(name or Path(path).stem, Sb3Code(path, algorithm))
