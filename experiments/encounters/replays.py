"""Games of a film as records, and the worst encounters of a run played again for a replay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.env.record import NOT_COVERED, Record, find_breaches, make_record
from steerclear.shield.decision import Reason
from steerclear.shield.platforms import layout as L

from ..replay_html import write_replay
from .campaign import Cell
from .families import draw
from .guards import NONE, SHIELD
from .play import Film, play
from .scenes import DT_S, Conditions
from .tally import Columns
from .verdicts import SIDES

MOST_WORST = 10
EDGE_M = 5.0
"""Water around open-water encounters, m."""
FAR_M = 1e4
"""A certificate beyond this, m, says that nobody is near."""
SHAPE = 1.6
"""Width over height of its picture."""


def record_of(film: Film, game: int, title: str, guarded: bool) -> Record:
    """One game of a film as the record that replays, films and pictures are made of.

    Args:
        film: what was played.
        game: which of its games.
        title: shown as the game's name.
        guarded: whether its commands passed a guard.
    """
    scenes, steps = film.scenes, film.scenes.steps
    state = film.state[:, game]
    position, bounds = _placed(film, state[:, :, :2])
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


def _placed(film: Film, position: np.ndarray) -> tuple[np.ndarray, tuple[float, float]]:
    """Positions within (0, 0) .. bounds: open water gets edges around what happens, wider than high."""
    field = film.scenes.field
    if field is not None:
        return position - np.array(field[:2]), (field[2] - field[0], field[3] - field[1])
    low, high = position.min(axis=(0, 1)) - EDGE_M, position.max(axis=(0, 1)) + EDGE_M
    size, middle = high - low, 0.5 * (low + high)
    size = np.maximum(size, [SHAPE * size[1], size[0] / SHAPE])
    return position - middle + 0.5 * size, (float(size[0]), float(size[1]))


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


def worst_encounters(columns: Mapping[Cell, Columns], most: int = MOST_WORST) -> list[dict[str, Any]]:
    """The worst encounters of all cells with a shield: avoidable breaches first, then the closest.

    Without such a cell, those with another guard, or with none.
    """
    shields = [cell for cell in columns if cell.guard.partition(":")[0] == SHIELD]
    cells = shields or [cell for cell in columns if cell.guard != NONE] or list(columns)
    found = []
    for cell in cells:
        values = columns[cell]
        order = np.lexsort((values["closest_m"], -values["avoidable"]))[:most]
        found += [
            {
                "guard": cell.guard,
                "own": cell.own,
                "other": cell.other,
                "family": cell.family,
                "number": int(values["number"][k]),
                "variant": int(values["variant"][k]),
                "closest_m": float(values["closest_m"][k]),
                "breaches": int(values["breaches_teammate"][k] + values["breaches_opponent"][k]),
                "avoidable": int(values["avoidable"][k]),
                "last_preventable_s": _finite(values["last_preventable_s"][k]),
                "responsible": None if np.isnan(values["responsible"][k]) else SIDES[int(values["responsible"][k])],
                "start_certificate_m": _finite(values["start_certificate_m"][k]),
            }
            for k in order
        ]
    return sorted(found, key=lambda entry: (-entry["avoidable"], entry["closest_m"]))[:most]


def _finite(value: float) -> float | None:
    return float(value) if abs(value) < FAR_M else None


def replay_worst(worst: Sequence[Mapping[str, Any]], conditions: Conditions, seed: int, path: Path) -> Path:
    """Play encounters again, with their guard and without, into one replay."""
    records = []
    for entry in worst:
        scenes = draw(entry["family"], entry["own"], entry["other"], conditions, seed, entry["number"], 1)
        scenes = scenes.take([entry["variant"]])
        name = f"{entry['family']} {entry['number']}, {entry['own']} and {entry['other']}"
        records.append(_record(scenes, entry["guard"], conditions, name))
        if entry["guard"] != NONE:
            records.append(_record(scenes, NONE, conditions, name))
    return write_replay(records, path, title="The worst encounters")


def _record(scenes: Any, guard: str, conditions: Conditions, name: str) -> Record:
    return record_of(play(scenes, guard, conditions), 0, f"{name}, {guard}", guard != NONE)
