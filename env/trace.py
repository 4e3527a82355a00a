"""Recorded games of the reference simulator: reading, checking and cutting of the files."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.shield.exceptions import ConfigError, TraceError

from .config import GameConfig
from .pyquaticus_config import from_pyquaticus
from .whole_file import Axes, check_finite, check_shapes, read_arrays, save_arrays

OBSERVATION_EVERY = 5
"""Decisions between recorded observations, unless the trace says otherwise."""

_BOATS: Axes = ("T+1", "n")
_TEAMS: Axes = ("T+1", 2)
LAYOUT: dict[str, Axes] = {
    "action": ("T", "n", 2),
    "position": ("T+1", "n", 2),
    "flag_position": ("T+1", 2, 2),
    "global_state": ("T+1", "g"),
    "obs": ("S", "n", "k"),
    "obs_normalized": ("S", "n", "k"),
    "heading": _BOATS,
    "speed": _BOATS,
    "thrust": _BOATS,
    "rudder": _BOATS,
    "on_side": _BOATS,
    "oob": _BOATS,
    "has_flag": _BOATS,
    "is_tagged": _BOATS,
    "tagging_cooldown": _BOATS,
    "agent_collisions": _BOATS,
    "flag_taken": _TEAMS,
    "captures": _TEAMS,
    "tags": _TEAMS,
    "grabs": _TEAMS,
    "is_disabled": _BOATS,
    "contacts": _BOATS,
}
"""Axes of each array: T decisions, S of them observed, n boats, g numbers of the global state, k of an observation."""

OF_2026 = ("is_disabled", "contacts")
"""Arrays of games with several steps per decision or with power plays; `load_trace` can derive ``contacts``."""

MOST_BOATS = 100
"""Largest team."""
META_KEYS = ("config", "team_size", "agent_ids", "dt", "obs_keys", "global_state_keys", "agent_radius")

_REMEDY = "Record or copy it again."


@dataclass(frozen=True)
class Trace:
    """One recorded game of T decisions and n boats.

    Attributes:
        path: the file.
        meta: its settings, under Pyquaticus' own names.
        config: the same game as a `GameConfig`.
        arrays: those of `LAYOUT`, in m, m/s, deg and s; index t is before, t+1 after action t.
    """

    path: Path
    meta: dict[str, Any]
    config: GameConfig
    arrays: dict[str, np.ndarray]

    @property
    def steps(self) -> int:
        """Number of recorded decisions T."""
        return len(self.arrays["action"])

    @property
    def observed_every(self) -> int:
        """Decisions from one recorded observation to the next."""
        return int(self.meta.get("obs_every", OBSERVATION_EVERY))

    def cut(self, steps: int) -> Trace:
        """Return the first ``steps`` decisions."""
        if not 1 <= steps <= self.steps:
            raise TraceError(f"cannot cut {self.path.name} to {steps} steps; give 1..{self.steps}")
        ends = {"T": steps, "T+1": steps + 1, "S": steps // self.observed_every + 1}
        return replace(self, arrays={name: a[: ends[str(LAYOUT[name][0])]] for name, a in self.arrays.items()})

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the trace and return the path."""
        save_arrays(Path(path), {"meta": np.array(json.dumps(self.meta)), **self.arrays})
        return Path(path)


def load_trace(path: str | os.PathLike[str]) -> Trace:
    """Read a recorded game and check that it is complete.

    Raises:
        TraceError: the file is missing, cut short, not a trace, lacks an array or fits no game.
    """
    source = Path(path)
    arrays = read_arrays(source, "trace", _REMEDY)
    try:
        meta = _read_meta(source, arrays)
        config = from_pyquaticus(meta["config"], team_size=meta["team_size"], dt_s=meta["dt"])
        if "sub_position" in arrays and "contacts" not in arrays:
            arrays["contacts"] = _count_contacts(arrays["sub_position"], config)
        trace = Trace(source, meta, config, {name: arrays[name] for name in LAYOUT if name in arrays})
        _check(trace)
    except TraceError:
        raise
    except ConfigError as error:
        raise TraceError(f"{source}: its settings fit no game: {error}") from error
    except (TypeError, ValueError, LookupError, AttributeError, ArithmeticError) as error:  # whatever the file contains
        raise TraceError(f"{source} is no trace ({type(error).__name__}: {error}). {_REMEDY}") from error
    return trace


def _read_meta(source: Path, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    if "meta" not in arrays:
        raise TraceError(f"{source} lacks meta. {_REMEDY}")
    try:
        meta = json.loads(str(arrays["meta"]))
    except (ValueError, RecursionError) as error:
        raise TraceError(f"{source}: meta is not JSON ({error}). {_REMEDY}") from error
    missing = [key for key in META_KEYS if not isinstance(meta, dict) or key not in meta]
    if missing:
        raise TraceError(f"{source}: meta lacks {', '.join(missing)}. {_REMEDY}")
    for name, value, high in (
        ("obs_every", meta.get("obs_every", OBSERVATION_EVERY), np.inf),
        ("team_size", meta["team_size"], MOST_BOATS),
    ):
        if type(value) is not int or not 1 <= value <= high:
            raise TraceError(f"{name} in meta is {value!r}; give a whole number from 1 to {high}. {_REMEDY}")
    for name in ("obs_keys", "global_state_keys"):
        meta[name] = [tuple(key) if isinstance(key, list) else key for key in meta[name]]
    return dict(meta)


def _count_contacts(after: np.ndarray, config: GameConfig) -> np.ndarray:
    """Count the contacts of each boat so far, (T+1, n), from places (T, S, n, 2), m, after every step.

    A contact is an entry into the sum of two boats' radii.
    """
    decisions, steps, n = after.shape[:3]
    radius = np.array(config.agent_radius_m)
    gap_m = np.linalg.norm(after[..., :, None, :] - after[..., None, :, :], axis=-1).reshape(-1, n, n)
    touch = (gap_m <= radius[:, None] + radius) & ~np.eye(n, dtype=bool)
    before = np.concatenate([np.zeros((1, n, n), dtype=bool), touch[:-1]])
    entries = (touch & ~before).sum(axis=2).reshape(decisions, steps, n).sum(axis=1)
    return np.concatenate([np.zeros((1, n), dtype=np.int64), np.cumsum(entries, axis=0)])


def _check(trace: Trace) -> None:
    """Check that arrays are present, fit together and hold usable numbers."""
    arrays, source = trace.arrays, trace.path
    missing = [name for name in LAYOUT if name not in arrays and name not in OF_2026]
    if missing:
        raise TraceError(f"{source} lacks {', '.join(missing)}. {_REMEDY}")
    if trace.steps == 0:
        raise TraceError(f"{source}: action has shape {arrays['action'].shape}, expected one row at least. {_REMEDY}")
    sizes = {"T": trace.steps, "T+1": trace.steps + 1, "S": trace.steps // trace.observed_every + 1}
    sizes |= {"n": trace.config.n_boats, "k": len(trace.meta["obs_keys"]), "g": arrays["global_state"].shape[-1]}
    layout = {name: LAYOUT[name] for name in arrays}
    check_shapes(arrays, layout, sizes, f"{source}: ", _REMEDY)
    for name, values in arrays.items():
        if values.dtype.kind not in "fiub":
            raise TraceError(f"{source}: {name} holds {values.dtype}, expected numbers. {_REMEDY}")
    check_finite(arrays, ("position", "heading", "speed"), f"{source}: ", _REMEDY)
