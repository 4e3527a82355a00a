"""Loading of competition submissions, which are played unchanged, with the past observations that they request."""

from __future__ import annotations

import contextlib
import inspect
import logging
import random
import sys
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.foreign import describe_error, plain_text

from ..actions import SeenGame, seen_game
from ..adapters import call_fault
from ..foreign import Answer, ForeignCode, GameFacts, GuardedTeam
from .made_for import MadeFor, check_game, made_for, words_of_less
from .sandbox import Sandbox
from .stage import ENTRY_FILE, MAX_BYTES, Stage

logger = logging.getLogger(__name__)
CONFIG_FILE, CLASS_NAME, METHOD_NAME = "gen_config.py", "solution", "compute_action"
ARGUMENTS = ("agent_id", "full_obs_normalized", "full_obs", "global_state")
_MEANING = "full_obs_normalized and full_obs are dicts by agent id, global_state is one dict of the whole game"
ARGUMENTS_OF_2024 = 3
"""(agent_id as a number, observation_normalized, observation), both of that boat alone."""
FAILURE_NAME = "steerclear_failure"
"""Method of a shielded zip's class: what went wrong inside for a boat that its shield answered for."""


class GlobalState(dict[Any, Any]):
    """The global state, which also returns itself for ``global_state[agent_id]``.

    Submissions read it both ways: by the state's own keys, or by agent id first, as with observations.
    """

    def __init__(self, state: Mapping[Any, Any], agent_ids: Sequence[str]) -> None:
        super().__init__(state)
        self._ids = frozenset(agent_ids)

    def __missing__(self, key: Any) -> Any:
        if key in self._ids:
            return self
        raise KeyError(key)

    def get(self, key: Any, default: Any = None) -> Any:
        """Return an entry as a dict does, also for agent ids."""
        return self if key in self._ids else super().get(key, default)


class History:
    """Past observations of all boats. Until the game is old enough, its first observation replaces older ones.

    Args:
        ages: requested ages in steps, newest (0) first; (0,) for the present only.
    """

    def __init__(self, ages: tuple[int, ...]) -> None:
        self._ages = ages
        self._past: deque[tuple[dict[str, Any], dict[str, Any]]] = deque(maxlen=ages[-1] + 1)

    def clear(self) -> None:
        """Begin a new game."""
        self._past.clear()

    def push(self, normalized: dict[str, Any], raw: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Add the present observations by agent and return those for the submission.

        Returns:
            Both dicts as given if no history is requested. Otherwise, per agent, an array (k, n_obs) and an array (k,)
            of dicts, newest first.
        """
        if self._ages == (0,):
            return normalized, raw
        if not self._past:
            self._past.extend([(normalized, raw)] * (self._ages[-1] + 1))
        self._past.appendleft((normalized, raw))
        chosen = [self._past[age] for age in self._ages]
        stacked = {agent_id: np.stack([step[0][agent_id] for step in chosen]) for agent_id in normalized}
        dicts = {agent_id: np.empty(len(chosen), dtype=object) for agent_id in raw}
        for agent_id, array in dicts.items():
            array[:] = [step[1][agent_id] for step in chosen]
        return stacked, dicts


def ages_of(module: ModuleType) -> tuple[int, ...]:
    """Return the ages of the observations that a loaded ``gen_config.py`` requests; the rest of it is not used."""
    found = {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, Mapping) and ("short_obs_hist_length" in value or "lidar_obs" in value)
    }
    names = sorted(found, key=lambda name: "competition" not in name)  # the competition's, should there be several
    config = found[names[0]] if names else {}
    if config.get("lidar_obs", False):
        raise PolicyError(f"{CONFIG_FILE} asks for lidar observations, which this game does not make")
    ages: set[int] = set()
    for kind in ("short", "long"):
        length, interval = (_count(config, f"{kind}_obs_hist_{word}") for word in ("length", "interval"))
        ages.update(range(0, length * interval, interval))
    return tuple(sorted(ages))


def _count(config: Mapping[str, Any], name: str) -> int:
    value = config.get(name, 1)
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 10_000:
        raise PolicyError(f"{CONFIG_FILE}: {name} is {value!r}; it must be a whole number from 1")
    return value


def check_interface(instance: Any, source: object) -> None:
    """Check before the game that a ``solution`` can be called for actions; otherwise its boats would hold all game."""
    method = getattr(instance, METHOD_NAME, None)
    if not callable(method):
        raise PolicyError(f"solution() of {source} has no method {METHOD_NAME!r}; define one")
    fault = call_fault(method, ARGUMENTS)
    if fault is None:
        return
    remedy = f"define {METHOD_NAME}(self, {', '.join(ARGUMENTS)})"
    with contextlib.suppress(Exception):  # foreign signatures may raise anything
        inspect.signature(method).bind(*range(ARGUMENTS_OF_2024))
        old = "it looks like the interface of 2024, whose observations this game does not make: port it, and "
        remedy = f"{old}{remedy}"
    raise PolicyError(f"{METHOD_NAME} of {source} {fault}; {remedy}: {_MEANING}")


class SubmissionCode(ForeignCode):
    """A ``solution`` object and its folder.

    Args:
        source: folder, zip, or its ``solution.py``.
        max_bytes: largest unpacked size of a zip.

    Raises:
        PolicyError: it cannot be loaded or built, or requests observations that this game does not make.
    """

    def __init__(self, source: str | Path, max_bytes: int = MAX_BYTES) -> None:
        self.stage = Stage(source, max_bytes)
        self._sandbox = Sandbox(self.stage.folder)
        try:
            self._class, ages = self._load()
            instance = self._build()
            with self._sandbox.active():
                check_interface(instance, self.stage.source)
        except BaseException:
            self.close()
            raise
        self._history = History(ages)
        self._made = made_for(self.stage.folder)
        self._told = ""

    def begin(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Build a fresh instance for each game, with libraries seeded from the game's seed."""
        if self._made is not None and not isinstance(env, GameFacts):  # a runner of this process checked it
            self._check_game(self._made, seen_game(env))
        self._instance = self._build(seed)
        self._history.clear()

    def _check_game(self, made: MadeFor, game: SeenGame) -> None:
        check_game(made, game, self.stage.source)
        words = words_of_less(made, game, self.stage.source)
        if words and words != self._told:
            logger.warning("%s", words)
        self._told = words

    def prepare(self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]) -> Answer:
        """Return the answers on copies, so that nothing the submission writes reaches the game or its opponent."""
        try:
            raw = {agent_id: dict(infos[agent_id]["unnorm_obs"]) for agent_id in observations}
            state = GlobalState(next(iter(infos.values()))["global_state"], tuple(observations))
        except (KeyError, StopIteration, TypeError) as error:
            raise PolicyError(f"infos lack {error} for a submission; pass those of MctfEnv.reset or step") from error
        normalized = {agent_id: np.array(row) for agent_id, row in observations.items()}
        normalized, raw = self._history.push(normalized, raw)
        compute_action = getattr(self._instance, METHOD_NAME)
        return lambda agent_id: compute_action(agent_id, normalized, raw, state)

    def failed_within(self, agent_id: str) -> tuple[str, str] | None:
        """Return a failure that a shielded zip reports of the entry in it."""
        told = getattr(self._instance, FAILURE_NAME, None)
        try:
            kind, text = told(agent_id) or (None, None) if callable(told) else (None, None)
        except Exception:  # another's method of that name
            return None
        return None if kind is None else (plain_text(kind, 80), plain_text(self.told(str(text)), 500))

    def told(self, text: str) -> str:
        """Return a text with the submission's own files in place of the copies that ran."""
        return self.stage.told(text)

    def around(self) -> contextlib.AbstractContextManager[Any]:
        """Return a context with the submission's working directory and imports."""
        return self._sandbox.active()

    def close(self) -> None:
        """Remove the temporary folder."""
        self.stage.close()

    def _load(self) -> tuple[type, tuple[int, ...]]:
        with self._sandbox.active():
            asked = (self.stage.folder / CONFIG_FILE).is_file()
            ages = ages_of(self._run(CONFIG_FILE)) if asked else (0,)
            module = self._run(ENTRY_FILE)
            found = getattr(module, CLASS_NAME, None)
            alike = [name for name in vars(module) if name != CLASS_NAME and name.lower() == CLASS_NAME]
        if not isinstance(found, type):
            remedy = f"rename {alike[0]!r}: capitals count" if alike else "define one"
            raise PolicyError(f"{ENTRY_FILE} of {self.stage.source} has no class {CLASS_NAME!r}; {remedy}")
        if not callable(getattr(found, METHOD_NAME, None)):
            raise PolicyError(f"class {CLASS_NAME!r} of {self.stage.source} has no method {METHOD_NAME!r}; define one")
        return found, ages

    def _run(self, file: str) -> Any:
        try:
            return self._sandbox.load(file)
        except (Exception, SystemExit) as error:
            raise self._unusable(f"{file} cannot be imported", error) from error

    def _build(self, seed: int | None = None) -> Any:
        with self._sandbox.active():
            if seed is not None:
                seed_libraries(seed)
            try:
                return self._class()
            except (Exception, SystemExit) as error:
                raise self._unusable(f"{CLASS_NAME}() cannot be built", error) from error

    def _unusable(self, what: str, error: BaseException) -> PolicyError:
        remedy = ""
        if isinstance(error, ModuleNotFoundError):
            remedy = f"; install {error.name!r} here or put it beside {ENTRY_FILE}"
        elif isinstance(error, FileNotFoundError):
            remedy = f"; put the file beside {ENTRY_FILE} and open it by Path(__file__).parent"
        elif isinstance(error, TypeError) and "__init__()" in str(error):
            remedy = "; its __init__ is given no arguments"
        return PolicyError(f"submission {self.stage.source}: {what}: {self.told(describe_error(error))}{remedy}")


def seed_libraries(seed: int) -> None:
    """Seed the global random numbers that a submission may use: Python's, NumPy's and, if loaded, PyTorch's."""
    random.seed(seed)
    np.random.seed(seed % 2**32)  # noqa: NPY002 (the submission's own choice of generator)
    torch = sys.modules.get("torch")
    if torch is not None and hasattr(torch, "manual_seed"):
        torch.manual_seed(seed)


def load_submission(path: str | Path, name: str | None = None, max_bytes: int = MAX_BYTES) -> GuardedTeam:
    """Load a competition submission as a team policy."""
    code = SubmissionCode(path, max_bytes)
    return GuardedTeam(name or code.stage.source.stem, code)
