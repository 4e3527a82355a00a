"""Recording of a game, step by step; ``record_file`` describes, reads and writes the arrays."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from steerclear.env.config import GameConfig
from steerclear.env.record_file import (
    ARRAYS,
    LAYOUT,
    META_KEYS,
    NOT_COVERED,
    Record,
    load,
    make_record,
    plain,
    read_meta,
    save,
    validate,
)
from steerclear.shield.exceptions import TraceError
from steerclear.shield.platforms.layout import HEADING, SPEED, X, Y
from steerclear.shield.renamed import old_names, takes_old_keywords

__all__ = [
    "ARRAYS",
    "DEFAULT_SEPARATION_M",
    "META_KEYS",
    "NOT_COVERED",
    "GameRecorder",
    "Record",
    "absolute_commands",
    "find_violations",
    "load",
    "make_record",
    "meta_of",
    "read_meta",
    "save",
    "validate",
]


DEFAULT_SEPARATION_M = 2.5

_BESIDE_THE_GAME: dict[str, Any] = {
    "separation_m": DEFAULT_SEPARATION_M,
    "policies": {"blue": "", "red": ""},
    "shielded": [],
    "seed": None,
    "reason_names": [],
    "title": "",
}


def meta_of(config: GameConfig, **settings: Any) -> dict[str, Any]:
    """Return a record's ``meta`` for a game.

    Args:
        config: The game's settings.
        **settings: What the game does not know: ``separation_m``, ``policies`` {blue, red}, ``shielded`` (agent ids),
            ``seed``, ``reason_names`` and ``title``. Defaults describe an unshielded, unnamed game.

    Returns:
        A dict with all of ``record_file.META_KEYS``, the title, the scrimmage line and the obstacles. The radius is one
        number, or one per boat where they differ.

    Raises:
        TraceError: A setting is unknown.
    """
    unknown = sorted(set(settings) - set(_BESIDE_THE_GAME))
    if unknown:
        raise TraceError(f"unknown {', '.join(unknown)}; a record takes {', '.join(_BESIDE_THE_GAME)}.")
    width, height = config.env_bounds_m
    radii: Any = config.agent_radius_m
    platforms: Any = config.platforms
    same = ("dt_s", "decision_steps", "env_bounds_m", "team_size", "agent_ids", "catch_radius_m", "flag_keepout_m")
    game = {name: getattr(config, name) for name in (*same, "obstacles")} | {
        "corner_radius_m": config.corner_radius_m if "own_corners" in (config.capture_at, config.untag_at) else 0.0,
        "team": [0] * config.team_size + [1] * config.team_size,
        "flag_home": [
            config.blue_flag_home_m or (width / 8, height / 2),
            config.red_flag_home_m or (width * 7 / 8, height / 2),
        ],
        "scrimmage": config.scrimmage_m,
        "agent_radius_m": radii[0] if len(set(radii)) == 1 else radii,
        "platforms": [platform.name for platform in platforms],
        "preset": config.preset_name,
    }
    return game | _BESIDE_THE_GAME | settings


def absolute_commands(commands: np.ndarray, heading_deg: np.ndarray) -> np.ndarray:
    """Return commands (n, 2), speed m/s and relative heading deg, with absolute headings in [-180, 180) deg."""
    absolute = np.array(commands, dtype=np.float64)
    absolute[:, 1] = (absolute[:, 1] + heading_deg + 180.0) % 360.0 - 180.0
    return absolute


def find_violations(position: np.ndarray, separation_m: float) -> np.ndarray:
    """List every entry of two boats into the separation radius.

    The start position itself is not counted; a pair that starts inside counts at the first step.

    Args:
        position: (T+1, n, 2) positions, m.
        separation_m: Two centres at this distance or less violate the separation.

    Returns:
        (K, 4) in order of time: index (1..T) of the first state inside, boat a, boat b (a < b), closest distance m
        until the pair is apart again.

    Raises:
        TraceError: Another shape, or a radius that is not positive.
    """
    if position.ndim != 3 or position.shape[2] != 2:
        raise TraceError(f"positions have shape {position.shape}, expected (steps + 1, boats, 2).")
    if not separation_m > 0.0:
        raise TraceError(f"the separation radius is {separation_m}, it must be positive (metres).")
    found: list[tuple[float, float, float, float]] = []
    for a, b in zip(*np.triu_indices(position.shape[1], k=1), strict=True):
        distance_m = np.linalg.norm(position[1:, a] - position[1:, b], axis=1)
        edges = np.flatnonzero(np.diff(np.concatenate(([False], distance_m <= separation_m, [False]))))
        for first, after in edges.reshape(-1, 2):
            found.append((first + 1.0, float(a), float(b), float(distance_m[first:after].min())))
    return np.array(sorted(found), dtype=np.float64).reshape(-1, 4)


class GameRecorder:
    """Collects a game step by step.

    Example:
        ``recorder.start(env.view(), meta)``, after each step ``recorder.step(env.view(), nominal, filtered)``,
        at the end ``save(recorder.finish(violations), "game.npz")``.
    """

    def __init__(self) -> None:
        self._meta: dict[str, Any] | None = None
        self._rows: dict[str, list[np.ndarray]] = {}

    def start(self, view: Any, meta: Mapping[str, Any]) -> None:
        """Begin a new game from its ``GameView`` and its settings, see `meta_of`.

        Raises:
            TraceError: ``meta`` lacks a key.
        """
        read_meta({"meta": np.array(json.dumps(dict(meta), default=plain))})
        self._meta = dict(meta)
        self._rows = {name: [] for name in ARRAYS if name != "violations"}
        self._append(_state_of(view))

    @takes_old_keywords({"wanted": "nominal", "sent": "filtered"})
    def step(
        self,
        view: Any,
        nominal: np.ndarray,
        filtered: np.ndarray,
        reason: np.ndarray | None = None,
        intervened: np.ndarray | None = None,
        safety_margin_m: np.ndarray | None = None,
    ) -> None:
        """Add one step.

        Args:
            view: The game's state after the step.
            nominal: (n, 2) nominal commands before the step: speed m/s, absolute heading deg.
            filtered: (n, 2) likewise, the commands that the boats received.
            reason: (n,) reason codes; None: all ``NOT_COVERED``.
            intervened: (n,) bool; None: all False.
            safety_margin_m: (n,) safety margins, m; None: all NaN.

        Raises:
            TraceError: ``start`` was not called, or an array has the wrong shape.
        """
        if self._meta is None:
            raise TraceError("no game is being recorded. Call start() before step().")
        n = len(self._meta["agent_ids"])
        given = {
            "nominal": nominal,
            "filtered": filtered,
            "reason": np.full(n, NOT_COVERED) if reason is None else reason,
            "intervened": np.zeros(n, bool) if intervened is None else intervened,
            "safety_margin_m": np.full(n, np.nan) if safety_margin_m is None else safety_margin_m,
        }
        self._append(given | _state_of(view))

    @takes_old_keywords({"breaches": "violations"})
    def finish(self, violations: Sequence[Sequence[float]] | np.ndarray = ()) -> Record:
        """Close the game and return the validated record.

        Args:
            violations: (K, 4) separation violations as from ``find_violations``: first step, boat a, boat b, closest
                distance m.

        Raises:
            TraceError: ``start`` was not called, or the arrays do not fit together.
        """
        if self._meta is None:
            raise TraceError("no game is being recorded. Call start() before finish().")
        arrays = {name: np.array(rows).reshape(-1, *self._row_shape(name)) for name, rows in self._rows.items()}
        return make_record(self._meta, violations=np.array(violations, dtype=np.float64).reshape(-1, 4), **arrays)

    def _append(self, given: Mapping[str, Any]) -> None:
        """Add one row to each named array, or to none of them if one does not fit."""
        rows = {name: np.array(values, dtype=LAYOUT[name][1]) for name, values in given.items()}
        for name, row in rows.items():
            if row.shape != (want := self._row_shape(name)):
                raise TraceError(f"the game's {name} has shape {row.shape}, expected {want}: pass one row per boat.")
        for name, row in rows.items():
            self._rows[name].append(row)

    def _row_shape(self, name: str) -> tuple[int, ...]:
        boats = len((self._meta or {})["agent_ids"])
        return tuple(boats if axis == "n" else int(axis) for axis in LAYOUT[name][0][1:])


def _state_of(view: Any) -> dict[str, Any]:
    """Return the part of a record that a ``GameView`` holds."""
    state = np.asarray(view.state)
    moving = {"position": state[:, [X, Y]], "heading_deg": state[:, HEADING], "speed_mps": state[:, SPEED]}
    marks = ("has_flag", "is_tagged", "oob", "is_disabled", "flag_position", "captures")
    return moving | {name: getattr(view, name) for name in marks}


__getattr__ = old_names(globals(), {"find_breaches": "find_violations"})
