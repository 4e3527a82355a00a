"""Tracks of a log as the record of a game, for the oracle, the counts and the browser."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.env.config import GameConfig
from steerclear.env.record import NOT_COVERED, Record, find_breaches, make_record
from steerclear.shield.bridge.blackbox import LogHeader
from steerclear.shield.decision import Reason
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import layout as L

from .replaying_tracks import Array, Tracks

OFF_M = 1e6
"""Where boats are that are not there, m, each as far from the next."""
_MARKS = {"has_flag": "has_flag", "is_tagged": "tagged", "oob": "oob"}


def placed(states: Array) -> Array:
    """States (T+1, n, N_STATE) with boats that are not there put far away from everything and one another."""
    found = states.copy()
    for i in range(states.shape[1]):
        gone = ~np.isfinite(states[:, i, L.X])
        found[gone, i] = 0.0
        found[gone, i, L.X] = OFF_M * (i + 1)
        found[gone, i, L.Y] = OFF_M
    return found


def drawn(states: Array) -> Array:
    """States with boats that are not there left where they were last, or will be first."""
    found = states.copy()
    for i in range(states.shape[1]):
        known = np.flatnonzero(np.isfinite(states[:, i, L.X]))
        if len(known) == 0:
            found[:, i] = 0.0
            continue
        last = known[np.clip(np.searchsorted(known, np.arange(len(states)), side="right") - 1, 0, None)]
        found[:, i] = states[last, i]
    return found


def record_of(header: LogHeader, tracks: Tracks, states: Array, title: str, shielded: bool) -> Record:
    """The record of a game.

    Args:
        header: of the log.
        tracks: what happened.
        states: (T+1, n, N_STATE) the boats' states to record, the tracks' own or those without the shield.
        title: of the record.
        shielded: whether boats were sent what the shield said; otherwise what was wanted.
    """
    seen = drawn(states)
    marks = _marks(tracks)
    covered = shielded & (tracks.reason != NOT_COVERED)
    wanted = _degrees(tracks.wanted)
    return make_record(
        _meta(header, tracks, title, shielded),
        position=seen[:, :, : L.Y + 1],
        heading_deg=seen[:, :, L.HEADING],
        speed_mps=seen[:, :, L.SPEED],
        **marks,
        wanted=wanted,
        sent=_degrees(tracks.sent) if shielded else wanted,
        reason=np.where(covered, tracks.reason, NOT_COVERED),
        intervened=tracks.intervened & covered,
        certificate_m=np.where(covered, tracks.certificate_m, np.nan),
        breaches=find_breaches(placed(states)[:, :, : L.Y + 1], header.config.separation_m),
    )


def _degrees(commands: Array) -> Array:
    found = commands.copy()
    found[..., 1] = (np.degrees(found[..., 1]) + 180.0) % 360.0 - 180.0
    return found


def _marks(tracks: Tracks) -> dict[str, NDArray[Any]]:
    """Flags, tags and scores as the game's state had them; nobody has anything where there was none."""
    games = [*tracks.games, tracks.games[-1]]
    marks: dict[str, NDArray[Any]] = {
        array: np.array([[_mark(game, name, key) for name in tracks.names] for game in games])
        for array, key in _MARKS.items()
    }
    marks["flag_position"] = np.array([_flags(game) for game in games], dtype=np.float64)
    marks["captures"] = np.array([_pair(game.get("captures")) for game in games], dtype=np.int64)
    return marks


def _mark(game: Mapping[str, Any], name: str, key: str) -> bool:
    boat = (game.get("boats") or {}).get(name)
    return isinstance(boat, Mapping) and bool(boat.get(key))


def _pair(values: Any) -> tuple[int, int]:
    return (int(values[0]), int(values[1])) if isinstance(values, list | tuple) and len(values) == 2 else (0, 0)


def _flags(game: Mapping[str, Any]) -> list[tuple[float, float]]:
    flags = game.get("flags")
    if not isinstance(flags, list | tuple) or len(flags) != 2:
        return [(0.0, 0.0), (0.0, 0.0)]
    return [(float(flag["x_m"]), float(flag["y_m"])) for flag in flags]


def _meta(header: LogHeader, tracks: Tracks, title: str, shielded: bool) -> dict[str, Any]:
    rules = _rules(header.preset)
    radii = rules.agent_radius_m
    flags = [_flags(game) for game in tracks.games if game.get("flags")]
    size = header.field_size_m or tuple(float(value) for value in np.nanmax(np.abs(tracks.positions), axis=(0, 1)))
    ours = "blue" if int(tracks.team[tracks.ours].min(initial=1)) == 0 else "red"
    return {
        "dt_s": tracks.dt_s,
        "env_bounds_m": size,
        "team_size": int(np.count_nonzero(tracks.team == 0)),
        "agent_ids": list(tracks.names),
        "team": [min(int(team), 1) for team in tracks.team],
        "flag_home": flags[0] if flags else [(size[0] / 8, size[1] / 2), (size[0] * 7 / 8, size[1] / 2)],
        "catch_radius_m": rules.catch_radius_m,
        "flag_keepout_m": rules.flag_keepout_m,
        "agent_radius_m": radii if isinstance(radii, float) else radii[0],
        "separation_m": header.config.separation_m,
        "preset": header.preset,
        "policies": {"blue": "", "red": ""} | {ours: header.policy},
        "shielded": [name for name, own in zip(tracks.names, tracks.ours, strict=True) if own and shielded],
        "seed": None,
        "reason_names": [reason.name for reason in Reason],
        "platforms": list(tracks.platforms),
        "title": title,
    }


def _rules(preset: str) -> GameConfig:
    """Radii to draw: the preset's, or the usual ones where the log names none that is known."""
    try:
        return GameConfig.preset(preset)
    except ConfigError:
        return GameConfig.preset("aamas2024")
