"""Models saved by Stable-Baselines3, as a team policy: ``sb3:PATH.zip``.

Such a file holds pickled objects: loading it runs code of whoever made it.
"""

from __future__ import annotations

import importlib
import io
import json
import logging
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.extras import install_command

from .foreign import Answer, ForeignCode, GuardedTeam, game_facts
from .submissions.stage import ENTRY_FILE, check_members

ALGORITHMS = ("PPO", "A2C", "DQN", "SAC", "TD3", "DDPG")
_MARKS = (("clip_range", "PPO"), ("exploration_fraction", "DQN"), ("target_entropy", "SAC"), ("policy_delay", "TD3"))
CARD, MOST_CARD_BYTES = "steerclear_card.json", 2**16
"""Member of a zip of ``steerclear train`` with the game that the model learned; SB3 ignores it."""
MAX_BYTES, MAX_DATA_BYTES = 1024**3, 64 * 1024**2
"""Largest unpacked size of a model, and of the settings in it, bytes."""
ENTRIES = frozenset({"entries", "entry", "submissions", "submission", "tournament", "tournaments"})
"""Names of folders that hold other people's entries."""
UNREADABLE = (zipfile.BadZipFile, KeyError, ValueError, RecursionError, RuntimeError, EOFError, OSError, zlib.error)
"""Exceptions from reading a damaged or hostile zip."""
logger = logging.getLogger(__name__)
_SAID: set[Path] = set()


class Sb3Code(ForeignCode):
    """A model that plays every boat from its own observation, deterministically.

    A Discrete model's answers are action numbers. A Box model's answers are (speed m/s, relative heading deg). If its
    space is [-1, 1], they are scaled to 0..top speed and -180..180 deg.

    Arguments and errors are those of `load_sb3`.
    """

    def __init__(
        self,
        path: str | Path,
        algorithm: str | None = None,
        allow_code: bool | None = None,
        max_bytes: int = MAX_BYTES,
    ) -> None:
        self._path = Path(path).expanduser()
        if not self._path.is_file():
            raise PolicyError(f"there is no model at {self._path}; give the zip that model.save wrote")
        if algorithm is not None and algorithm not in ALGORITHMS:
            raise PolicyError(f"unknown algorithm {algorithm!r}; choose one of {', '.join(ALGORITHMS)}")
        check_origin(self._path, allow_code)
        saved = saved_settings(self._path, max_bytes)
        name = algorithm or algorithm_of(saved)
        try:
            library = importlib.import_module("stable_baselines3")
        except ImportError as error:
            raise PolicyError(f"sb3 models need the extra: {install_command('train')}") from error
        if self._path.resolve() not in _SAID:  # once in this process
            _SAID.add(self._path.resolve())
            logger.warning("%s", code_warning(self._path))
        try:
            self._model = getattr(library, name).load(self._path, device="cpu")
        except Exception as error:  # the unpickler may raise anything for a file that cannot be used
            raise PolicyError(f"{self._path} cannot be loaded as {name}: {error}; name its algorithm") from error
        low, high = (getattr(self._model.action_space, name, None) for name in ("low", "high"))
        self._scaled = low is not None and high is not None and bool(np.all(low == -1.0) and np.all(high == 1.0))

    def begin(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Check that the model was made for these observations."""
        facts = game_facts(env)
        shape = tuple(self._model.observation_space.shape or ())
        if shape != (facts.n_obs,):
            raise PolicyError(
                f"{self._path} takes observations {shape}, this game makes ({facts.n_obs},): other team_size?"
            )
        self._top_speed = facts.top_speed_mps

    def prepare(self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]) -> Answer:
        """Return the function that predicts one boat's action."""
        return lambda agent_id: self._predict(agent_id, observations[agent_id])

    def _predict(self, agent_id: str, observation: np.ndarray) -> Any:
        action, _ = self._model.predict(observation, deterministic=True)
        if np.ndim(action) == 0:
            return int(action)
        if self._scaled:
            return 0.5 * (float(action[0]) + 1.0) * self._top_speed[agent_id], 180.0 * float(action[1])
        return action


def algorithm_of(saved: Mapping[str, Any]) -> str:
    """Return the algorithm that saved such settings."""
    for mark, algorithm in _MARKS:
        if mark in saved:
            return algorithm
    return "A2C"


def saved_settings(path: Path, max_bytes: int = MAX_BYTES) -> Mapping[str, Any]:
    """Return the settings in a saved model after checking its sizes; no code of it runs.

    Raises:
        PolicyError: the file is not a saved model, or too large.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            check_members(path, members, max_bytes)
            for member in members:
                if member.filename.endswith(".pth"):
                    content = io.BytesIO(archive.open(member).read(member.file_size))
                    inner = zipfile.ZipFile(content).infolist() if zipfile.is_zipfile(content) else []
                    if (total := sum(one.file_size for one in inner)) > max_bytes:
                        raise PolicyError(
                            f"{path}: its weights unpack to {total} bytes, more than {max_bytes}; raise max_bytes"
                        )
            data = archive.getinfo("data")
            if data.file_size > MAX_DATA_BYTES:
                raise PolicyError(f"{path}: its settings have {data.file_size} bytes, more than {MAX_DATA_BYTES}")
            saved = json.loads(archive.read(data))
    except UNREADABLE as error:
        raise PolicyError(f"{path} is not a Stable-Baselines3 model: {error}; give the zip model.save wrote") from error
    if not isinstance(saved, Mapping):
        raise PolicyError(f"{path} is not a Stable-Baselines3 model: no settings in it; give the zip model.save wrote")
    return saved


def check_origin(path: Path, allow_code: bool | None) -> None:
    """Refuse a model of others: one in a submission, or in a folder with a name such as entries.

    Args:
        path: the model.
        allow_code: None decides by the model's place; True allows any, False none.

    Raises:
        PolicyError: it is refused.
    """
    among = entries_around(path)
    if allow_code or (allow_code is None and among is None):
        return
    where = "and allow_code is False" if among is None else f"and it lies among entries of others ({among})"
    raise PolicyError(
        f"loading {path} runs code of whoever made it, {where}; if you trust them, give allow_code=True "
        "(--trust of the commands)"
    )


def entries_around(path: Path) -> Path | None:
    """Return the folder that marks a model as an entry, by a ``solution.py`` or its name; None if there is none."""
    for place in (path.absolute(), path.resolve()):
        for folder in place.parents:
            if folder.name.lower() in ENTRIES or (folder / ENTRY_FILE).is_file():
                return folder
    return None


def code_warning(path: str | Path) -> str:
    """Return the warning on loading a model."""
    return f"loading the model {path} runs code of whoever made it"


def trained_here(path: str | Path) -> bool:
    """Return whether ``steerclear train`` made a model, by the card in its zip; False for unreadable files."""
    try:
        return bool(read_card(Path(path).expanduser()).get("trained_with"))
    except PolicyError:
        return False


def read_card(file: Path) -> dict[str, Any]:
    """Return the card of a model of ours; empty if there is none. Nothing else of the zip is read.

    Raises:
        PolicyError: the zip or its card cannot be read.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            if CARD not in archive.namelist():
                return {}
            if archive.getinfo(CARD).file_size > MOST_CARD_BYTES:
                raise ValueError("its card is too large")
            card: Any = json.loads(archive.read(CARD))
            if not isinstance(card, dict):
                raise ValueError("its card is none")
            return card
    except UNREADABLE as error:
        why = " ".join(str(error).split())[:160]
        raise PolicyError(f"{file} is not a Stable-Baselines3 model: {why}; give the zip model.save wrote") from error


def load_sb3(
    path: str | Path,
    algorithm: str | None = None,
    name: str | None = None,
    allow_code: bool | None = None,
    max_bytes: int = MAX_BYTES,
) -> GuardedTeam:
    """Load a saved Stable-Baselines3 model as a team policy.

    The model decides anew in every step of the game. Loading it runs code of whoever made it; a warning is logged
    before. A model of ``steerclear train`` is refused: `make` plays it from its tensors alone, as it was trained.

    Args:
        path: the zip that ``model.save`` wrote.
        algorithm: one of ``ALGORITHMS``; None detects it from the file.
        name: name for records and reports; None uses the file's.
        allow_code: None refuses models among other people's entries (in a folder with a ``solution.py``, or with a name
            such as entries or submissions); True allows them, False refuses all.
        max_bytes: largest unpacked size.

    Raises:
        PolicyError: the extra ``[train]`` is missing, or the file is no such model, too large, or refused.
    """
    if trained_here(path):
        raise PolicyError(
            f"{path} was made by steerclear train and holds each decision for a time, which no other code knows of; "
            f"play it by name as sb3:{path}, or weights:final.npz of its training"
        )
    return GuardedTeam(name or Path(path).stem, Sb3Code(path, algorithm, allow_code, max_bytes))
