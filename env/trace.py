"""Recorded games of the reference simulator: reading, checking and cutting the files."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.shield.exceptions import ConfigError, TraceError

from .config import GameConfig
from .npz_file import read_arrays
from .pyquaticus_config import from_pyquaticus
from .whole_file import whole_file

OBSERVATION_EVERY = 5
"""Observations are recorded at every so many decisions, where a trace does not say otherwise."""

ALWAYS = ("action", "position", "flag_position", "global_state", "obs", "obs_normalized")
PER_BOAT = (
    "heading",
    "speed",
    "thrust",
    "rudder",
    "on_side",
    "oob",
    "has_flag",
    "is_tagged",
    "tagging_cooldown",
    "agent_collisions",
)
OF_2026 = ("is_disabled", "contacts")
"""Per boat, of games of several steps a decision or with power plays; ``contacts`` may be told by ``sub_position``."""

PER_TEAM = ("flag_taken", "captures", "tags", "grabs")
MOST_BOATS = 100
"""Of a team."""
META_KEYS = ("config", "team_size", "agent_ids", "dt", "obs_keys", "global_state_keys", "agent_radius")

_REMEDY = "Record or copy it again."


@dataclass(frozen=True)
class Trace:
    """One recorded game of T decisions and n boats.

    Attributes:
        path: the file.
        meta: its settings, Pyquaticus' own names.
        config: the same game as a `GameConfig`.
        arrays: ``action`` (T, n, 2) and, at index t before and t+1 after that action, ``position`` (T+1, n, 2) m,
            ``flag_position`` (T+1, 2, 2) m, `PER_BOAT` and, where there are any, `OF_2026` (T+1, n), `PER_TEAM`
            (T+1, 2), ``global_state`` (T+1, g), and ``obs``, ``obs_normalized`` (T // every + 1, n, k).
    """

    path: Path
    meta: dict[str, Any]
    config: GameConfig
    arrays: dict[str, np.ndarray]

    @property
    def steps(self) -> int:
        """Recorded decisions T."""
        return len(self.arrays["action"])

    @property
    def observed_every(self) -> int:
        """Decisions from one recorded observation to the next."""
        return _observed_every(self.meta)

    def cut(self, steps: int) -> Trace:
        """The first ``steps`` steps.

        Raises:
            TraceError: fewer than one step, or more than there are.
        """
        if not 1 <= steps <= self.steps:
            raise TraceError(f"cannot cut {self.path.name} to {steps} steps; give 1..{self.steps}")
        seen = steps // self.observed_every + 1
        ends = {"action": steps, "obs": seen, "obs_normalized": seen}
        arrays = {name: values[: ends.get(name, steps + 1)] for name, values in self.arrays.items()}
        return Trace(self.path, self.meta, self.config, arrays)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the trace; returns the path.

        Raises:
            TraceError: the file cannot be written.
        """
        target = Path(path)
        with whole_file(target, TraceError) as part, part.open("wb") as stream:
            np.savez_compressed(stream, allow_pickle=False, meta=np.array(json.dumps(self.meta)), **self.arrays)
        return target


def load_trace(path: str | os.PathLike[str]) -> Trace:
    """Read a recorded game and check that it is whole.

    Raises:
        TraceError: the file is missing, cut short, not a trace, lacks an array or fits no game.
    """
    source = Path(path)
    arrays = read_arrays(source, "trace", _REMEDY)
    try:
        meta = _read_meta(source, arrays)
        config = from_pyquaticus(meta["config"], team_size=_team_size(meta), dt_s=meta["dt"])
        arrays = _what_counts(arrays, config)
        _check_shapes(source, arrays, config, meta)
    except TraceError:
        raise
    except ConfigError as error:
        raise TraceError(f"{source}: its settings fit no game: {error}") from error
    except (TypeError, ValueError, LookupError, AttributeError, ArithmeticError) as error:  # whatever the file held
        raise TraceError(f"{source} is no trace ({type(error).__name__}: {error}). {_REMEDY}") from error
    return Trace(source, meta, config, arrays)


def _read_meta(source: Path, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    if "meta" not in arrays:
        raise TraceError(f"{source} lacks meta. {_REMEDY}")
    try:
        meta = json.loads(str(arrays.pop("meta")))
    except (ValueError, RecursionError) as error:
        raise TraceError(f"{source}: meta is not JSON ({error}). {_REMEDY}") from error
    missing = [key for key in META_KEYS if not isinstance(meta, dict) or key not in meta]
    if missing:
        raise TraceError(f"{source}: meta lacks {', '.join(missing)}. {_REMEDY}")
    for name in ("obs_keys", "global_state_keys"):
        meta[name] = [tuple(key) if isinstance(key, list) else key for key in meta[name]]
    return meta


def _observed_every(meta: dict[str, Any]) -> int:
    every = meta.get("obs_every", OBSERVATION_EVERY)
    if isinstance(every, bool) or not isinstance(every, int) or every < 1:
        raise TraceError(f"obs_every in meta is {every!r}; give a whole number >= 1. {_REMEDY}")
    return every


def _what_counts(arrays: dict[str, np.ndarray], config: GameConfig) -> dict[str, np.ndarray]:
    """The arrays that a replay compares; contacts are counted from the places after every step, where there are any."""
    kept = {name: arrays[name] for name in (*ALWAYS, *PER_BOAT, *PER_TEAM, *OF_2026) if name in arrays}
    if "sub_position" in arrays and "contacts" not in kept:
        kept["contacts"] = _count_contacts(arrays["sub_position"], config)
    return kept


def _count_contacts(after: np.ndarray, config: GameConfig) -> np.ndarray:
    """Entries into the sum of radii so far of each boat, (T+1, n), from places (T, S, n, 2) m after every step."""
    decisions, steps, n = after.shape[:3]
    radius = np.array(config.agent_radius_m)
    gap_m = np.linalg.norm(after[..., :, None, :] - after[..., None, :, :], axis=-1).reshape(-1, n, n)
    touch = (gap_m <= radius[:, None] + radius) & ~np.eye(n, dtype=bool)
    before = np.concatenate([np.zeros((1, n, n), dtype=bool), touch[:-1]])
    entries = (touch & ~before).sum(axis=2).reshape(decisions, steps, n).sum(axis=1)
    return np.concatenate([np.zeros((1, n), dtype=np.int64), np.cumsum(entries, axis=0)])


def _team_size(meta: dict[str, Any]) -> int:
    size = meta["team_size"]
    if isinstance(size, bool) or not isinstance(size, int) or not 1 <= size <= MOST_BOATS:
        raise TraceError(f"team_size in meta is {size!r}; a trace has 1 to {MOST_BOATS} boats in a team. {_REMEDY}")
    return size


def _check_shapes(source: Path, arrays: dict[str, np.ndarray], config: GameConfig, meta: dict[str, Any]) -> None:
    more = [name for name in OF_2026 if name in arrays]
    names = (
        "action",
        "position",
        "flag_position",
        "global_state",
        "obs",
        "obs_normalized",
        *PER_BOAT,
        *PER_TEAM,
        *more,
    )
    missing = [name for name in names if name not in arrays]
    if missing:
        raise TraceError(f"{source} lacks {', '.join(missing)}. {_REMEDY}")
    n, steps = config.n_boats, len(arrays["action"])
    seen = (steps // _observed_every(meta) + 1, n, len(meta["obs_keys"]))
    expected: dict[str, tuple[int, ...]] = {"action": (steps, n, 2), "obs": seen, "obs_normalized": seen}
    expected |= {"position": (steps + 1, n, 2), "flag_position": (steps + 1, 2, 2)}
    expected |= dict.fromkeys((*PER_BOAT, *more), (steps + 1, n)) | dict.fromkeys(PER_TEAM, (steps + 1, 2))
    for name, shape in expected.items():
        if arrays[name].shape != shape or steps == 0:
            raise TraceError(f"{source}: {name} has shape {arrays[name].shape}, expected {shape}. {_REMEDY}")
    for name in names:
        if arrays[name].dtype.kind not in "fiub":
            raise TraceError(f"{source}: {name} holds {arrays[name].dtype}, expected numbers. {_REMEDY}")
    shape = arrays["global_state"].shape
    if len(shape) != 2 or shape[0] != steps + 1:
        raise TraceError(f"{source}: global_state has shape {shape}, expected {steps + 1} rows. {_REMEDY}")
    for name in ("position", "heading", "speed"):
        if not np.isfinite(arrays[name]).all():
            raise TraceError(f"{source}: {name} holds NaN or infinity. {_REMEDY}")
