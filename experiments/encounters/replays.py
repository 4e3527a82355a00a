"""Games of a film as records, which replays, films and pictures are made of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from steerclear.env.record import NOT_COVERED, Record, find_breaches, make_record
from steerclear.shield.decision import Reason
from steerclear.shield.platforms import layout as L

from .guards import NONE
from .play import Film
from .scenes import DT_S

EDGE_M = 5.0
"""Water around open-water encounters, m."""
SHAPE = 1.6
"""Width over height of its picture."""
Water = tuple[tuple[float, float], tuple[float, float]]
"""Lower left corner and size of what a replay shows, m."""


def records_of(films: Sequence[tuple[Film, str]], game: int, name: str) -> list[Record]:
    """One game, played with different guards, as records that show the same water.

    Args:
        films: what was played, and the name of the guard.
        game: which of the games.
        name: of the encounter.
    """
    water = _water_of(films[0][0], [film.state[:, game, :, :2] for film, _ in films])
    return [record_of(film, game, f"{name}, {guard}", guard != NONE, water) for film, guard in films]


def record_of(film: Film, game: int, title: str, guarded: bool, water: Water | None = None) -> Record:
    """One game of a film as the record that replays, films and pictures are made of.

    Args:
        film: what was played.
        game: which of its games.
        title: shown as the game's name.
        guarded: whether its commands passed a guard.
        water: what the picture shows; around what happens when left out.
    """
    scenes, steps = film.scenes, film.scenes.steps
    state = film.state[:, game]
    corner, bounds = water or _water_of(film, [state[:, :, :2]])
    position = state[:, :, :2] - np.array(corner)
    heading = state[:, :, L.HEADING]
    n = len(scenes.team)
    own = np.broadcast_to(scenes.own & guarded, (steps, n))
    wanted, sent = (_absolute(commands[:, game], heading[:-1]) for commands in (film.wanted, film.sent))
    meta = _meta(film, bounds, title, guarded)
    return make_record(
        meta,
        position=position,
        heading_deg=(heading + 180.0) % 360.0 - 180.0,
        speed_mps=state[:, :, L.SPEED],
        has_flag=np.zeros((steps + 1, n), bool),
        is_tagged=np.zeros((steps + 1, n), bool),
        oob=np.zeros((steps + 1, n), bool),
        flag_position=np.tile(np.array(meta["flag_home"]), (steps + 1, 1, 1)),
        captures=np.zeros((steps + 1, 2), np.int64),
        wanted=wanted,
        sent=sent,
        reason=np.where(own, film.reason[:, game], NOT_COVERED).astype(np.uint8),
        intervened=own & (film.sent[:, game] != film.wanted[:, game]).any(axis=2),
        certificate_m=np.where(own & np.isfinite(film.certificate_m[:, game]), film.certificate_m[:, game], np.nan),
        breaches=_own_breaches(position, scenes.own, film.conditions.radius_m),
    )


def _own_breaches(position: np.ndarray, own: np.ndarray, radius_m: float) -> np.ndarray:
    found = find_breaches(position, radius_m)
    pairs = found[:, 1:3].astype(np.int64)
    return found[own[pairs].any(axis=1)]


def _water_of(film: Film, positions: Sequence[np.ndarray]) -> Water:
    """The field; in open water what is around all positions (T+1, n, 2), wider than high."""
    field = film.scenes.field
    if field is not None:
        return (field[0], field[1]), (field[2] - field[0], field[3] - field[1])
    low = np.min([places.min(axis=(0, 1)) for places in positions], axis=0) - EDGE_M
    high = np.max([places.max(axis=(0, 1)) for places in positions], axis=0) + EDGE_M
    size, middle = high - low, 0.5 * (low + high)
    size = np.maximum(size, [SHAPE * size[1], size[0] / SHAPE])
    corner = middle - 0.5 * size
    return (float(corner[0]), float(corner[1])), (float(size[0]), float(size[1]))


def _absolute(commands: np.ndarray, heading_deg: np.ndarray) -> np.ndarray:
    absolute = commands.copy()
    absolute[..., 1] = (commands[..., 1] + heading_deg + 180.0) % 360.0 - 180.0
    return absolute


def _meta(film: Film, bounds: tuple[float, float], title: str, guarded: bool) -> dict[str, Any]:
    scenes, names = film.scenes, [f"agent_{k}" for k in range(len(film.scenes.team))]
    return {
        "dt_s": DT_S,
        "env_bounds_m": bounds,
        "team_size": int(scenes.own.sum()),
        "agent_ids": names,
        "team": scenes.team.tolist(),
        "flag_home": [[-1e4, -1e4], [-1e4, -1e4]],  # an encounter has no flags: out of sight
        "scrimmage": [[bounds[0], 0.0], [bounds[0], bounds[1]]],
        "catch_radius_m": 0.0,
        "flag_keepout_m": 0.0,
        "agent_radius_m": film.conditions.radius_m / 2.0,
        "separation_m": film.conditions.radius_m,
        "preset": scenes.family,
        "policies": {"blue": "goals", "red": "scripts"},
        "shielded": [name for name, own in zip(names, scenes.own, strict=True) if own and guarded],
        "seed": None,
        "reason_names": [reason.name for reason in Reason],
        "platforms": list(scenes.platforms),
        "title": title,
    }
