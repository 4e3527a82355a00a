"""Games of encounters as records, which replays, films and pictures are made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.env.record import NOT_COVERED, Record, find_violations, make_record
from steerclear.shield.decision import Reason
from steerclear.shield.platforms import layout as L

from ..baselines.registry import NONE
from ..replay_html import write_replay
from .builder import wrapped
from .scenarios import draw
from .scene import DT_S, Conditions, Scenes
from .simulate import Trajectory, play

EDGE_M, SHAPE = 5.0, 1.6
"""Water around open-water encounters, m, and width over height of its picture."""
OUT_OF_SIGHT_M = [[-1e4, -1e4], [-1e4, -1e4]]
"""Where the flags are, of which an encounter has none."""
Water = tuple[np.ndarray, np.ndarray]
"""Lower left corner and size of what a replay shows, m."""


def records_with_and_without(scenes: Scenes, safety_filter: str, conditions: Conditions, name: str) -> list[Record]:
    """The first game of some scenes, played with a filter and without, as records that show the same water."""
    words = {safety_filter: f"filter {safety_filter}", NONE: "no filter"}
    played = [(play(scenes, one, conditions), one) for one in words]
    water = _water_of([one.state[:, 0, :, :2] for one, _ in played], scenes)
    return [record_of(one, 0, f"{name}, {words[by]}", by != NONE, water) for one, by in played]


def replay_worst(worst: Sequence[Mapping[str, Any]], conditions: Conditions, seed: int, path: Path) -> Path:
    """Play the worst encounters again, with their filter and without, into one replay."""
    records = []
    for entry in worst:
        scenes = draw(entry["family"], entry["own"], entry["other"], conditions, seed, entry["number"], 1)
        name = f"{entry['family']} {entry['number']}, {entry['own']} and {entry['other']}"
        records += records_with_and_without(scenes.take([entry["variant"]]), entry["filter"], conditions, name)
    return write_replay(records, path, title="The worst encounters")


def record_of(played: Trajectory, game: int, title: str, is_filtered: bool, water: Water | None = None) -> Record:
    """One game as a record; ``is_filtered``: its commands passed a filter; ``water``: shown; around all if left out."""
    scenes, steps, n, radius_m = played.scenes, played.scenes.steps, len(played.scenes.team), played.conditions.radius_m
    state, margin_m = played.state[:, game], played.safety_margin_m[:, game]
    corner, size = water or _water_of([state[:, :, :2]], scenes)
    position, heading = state[:, :, :2] - corner, state[:, :, L.HEADING]
    own = np.broadcast_to(scenes.own & is_filtered, (steps, n))
    nominal, filtered = (of[:, game].copy() for of in (played.nominal, played.filtered))
    changed = (nominal != filtered).any(axis=2)
    for commands in (nominal, filtered):
        commands[..., 1] = wrapped(commands[..., 1] + heading[:-1])
    found = find_violations(position, radius_m)
    return make_record(
        _meta_of(played, title, size.tolist(), is_filtered),
        position=position,
        heading_deg=wrapped(heading),
        speed_mps=state[:, :, L.SPEED],
        **{name: np.zeros((steps + 1, n), bool) for name in ("has_flag", "is_tagged", "oob")},
        flag_position=np.tile(np.array(OUT_OF_SIGHT_M), (steps + 1, 1, 1)),
        captures=np.zeros((steps + 1, 2), np.int64),
        nominal=nominal,
        filtered=filtered,
        reason=np.where(own, played.reason[:, game], NOT_COVERED).astype(np.uint8),
        intervened=own & changed,
        safety_margin_m=np.where(own & np.isfinite(margin_m), margin_m, np.nan),
        violations=found[scenes.own[found[:, 1:3].astype(np.int64)].any(axis=1)],
    )


def _meta_of(played: Trajectory, title: str, bounds: list[float], is_filtered: bool) -> dict[str, Any]:
    """Settings of a game that an encounter is shown as."""
    scenes, radius_m = played.scenes, played.conditions.radius_m
    names = [f"agent_{k}" for k in range(len(scenes.team))]
    return {
        "dt_s": DT_S,
        "env_bounds_m": bounds,
        "team_size": int(scenes.own.sum()),
        "agent_ids": names,
        "team": scenes.team.tolist(),
        "flag_home": OUT_OF_SIGHT_M,
        "scrimmage": [[bounds[0], 0.0], bounds],
        "catch_radius_m": 0.0,
        "flag_keepout_m": 0.0,
        "agent_radius_m": radius_m / 2.0,
        "separation_m": radius_m,
        "preset": scenes.family,
        "policies": {"blue": "goals", "red": "scripts"},
        "shielded": [name for name, own in zip(names, scenes.own, strict=True) if own and is_filtered],
        "seed": None,
        "reason_names": [reason.name for reason in Reason],
        "platforms": list(scenes.platforms),
        "title": title,
    }


def _water_of(positions: Sequence[np.ndarray], scenes: Scenes) -> Water:
    """The field; in open water what is around all positions (T+1, n, 2), wider than high."""
    if scenes.field is not None:
        return np.array(scenes.field[:2]), np.array(scenes.field[2:]) - scenes.field[:2]
    low = np.min([places.min(axis=(0, 1)) for places in positions], axis=0) - EDGE_M
    high = np.max([places.max(axis=(0, 1)) for places in positions], axis=0) + EDGE_M
    size = np.maximum(high - low, [SHAPE * (high - low)[1], (high - low)[0] / SHAPE])
    return 0.5 * (low + high) - 0.5 * size, size
