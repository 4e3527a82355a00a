"""Saving a game in the form that a file's name asks for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.env.record import Record, read_meta, save
from steerclear.shield.exceptions import ConfigError

from .console import progress
from .game_metrics import PairDistances
from .replay_html import write_replay

ENDINGS = (".npz", ".html", ".mp4", ".gif", ".png")


def check_endings(paths: Sequence[Path]) -> None:
    """Refuse names whose ending says no known form.

    Raises:
        ConfigError: another ending.
    """
    for path in paths:
        if path.suffix.lower() not in ENDINGS:
            raise ConfigError(f"cannot save {path.name!r}; end the name in one of {', '.join(ENDINGS)}")


def save_record(record: Record, path: Path, at_s: float | None = None, speedup: float = 4.0) -> Path:
    """Write a record as data, replay, film or picture, by the ending of the name, one of `ENDINGS`.

    Args:
        record: the game.
        path: where to.
        at_s: moment that a picture shows, s; None takes the closest approach.
        speedup: times faster than the game, for films.

    Raises:
        ConfigError: the moment is not in the game, or the place cannot be written to.
    """
    ending = path.suffix.lower()
    if ending == ".npz":
        return save(record, path)
    if ending == ".html":
        return write_replay(record, path)
    from steerclear.env.render import save_animation, save_frame  # draws with pygame: only where a picture is wanted

    if ending == ".png":
        return save_frame(record, closest_step(record) if at_s is None else step_at(record, at_s), path)
    with progress(ending[1:], len(record["wanted"])) as notice:
        return save_animation(record, path, speedup=speedup, progress=notice)


def step_at(record: Record, at_s: float) -> int:
    """Return the step of a moment.

    Raises:
        ConfigError: the game has no such moment.
    """
    dt_s, steps = float(read_meta(record)["dt_s"]), len(record["wanted"])
    if not -0.5 * dt_s <= at_s <= (steps + 0.5) * dt_s:
        raise ConfigError(f"--at is {at_s:g}; the game has 0 to {steps * dt_s:g} s")
    return min(max(round(at_s / dt_s), 0), steps)


def closest_step(record: Record) -> int:
    """Find the step at which a shielded boat (any boat, without a shield) is closest to another."""
    covered: Any = record["intervened"].any(axis=0)
    distances = PairDistances.of(record["position"])
    if covered.any():
        distances = distances.of_pairs(covered[distances.pairs].any(axis=1))
    if distances.distance_m.size == 0:
        return 0
    return int(np.argmin(distances.distance_m.min(axis=1))) + 1
