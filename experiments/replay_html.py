"""A game saved as its file's name asks: a replay to scrub in a browser, which needs no server; data, film, picture.

Replays pack a record into text small enough to sit inside a page. Every number becomes a code of 16 (or 8) bits:
value = offset + scale * code, the largest code standing for NaN where there may be one. A column holds one series per
boat and coordinate, each over all time indices. Codes are stored as differences modulo 2**bits, from the time index
before (``against`` = "previous") or from another column (``filtered`` from ``nominal``), which deflate then shrinks.
All columns of a game are one run of bytes, little-endian, deflated and in base64. ``templates/replay_data.js`` is the
reader.
"""

from __future__ import annotations

import base64
import json
import os
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.env.record import Record, find_violations, read_meta, save, validate
from steerclear.env.render import Arena
from steerclear.shield.exceptions import ConfigError

from .console import progress
from .game_metrics import PairDistances
from .page import SCRIPT_SOURCES, as_json, render, write_page

FULL_TURN_DEG = 360.0
LAST_CODE = 2**16 - 1
HAS_FLAG, TAGGED, OUT = 1, 2, 4
SHOWN = (
    *("dt_s", "env_bounds_m", "agent_ids", "team", "flag_home", "catch_radius_m", "flag_keepout_m", "separation_m"),
    *("preset", "policies", "shielded", "seed", "reason_names", "platforms"),
)
"""What a page shows of a game's settings."""


@dataclass
class Packer:
    """Collects columns, JSON-ready as described, and their bytes."""

    columns: list[dict[str, Any]] = field(default_factory=list)
    content: list[bytes] = field(default_factory=list)
    _codes: dict[str, NDArray[Any]] = field(default_factory=dict)

    def add_codes(self, name: str, codes: NDArray[Any], against: str | None, **scale: float) -> None:
        """Add a column of codes (series, time), uint16 or uint8, with its ``offset``, ``scale`` and ``nan``."""
        self._codes[name] = codes
        stored = codes
        if against == "previous":
            stored = np.diff(codes, axis=1, prepend=np.zeros((len(codes), 1), codes.dtype))
        elif against is not None:
            stored = codes - self._codes[against]
        kind = codes.dtype.newbyteorder("<")
        entry = {
            "name": name,
            "start": sum(map(len, self.content)),
            "length": int(codes.size),
            "rows": int(codes.shape[1]),
            "bits": 8 * codes.dtype.itemsize,
            "against": against,
        }
        self.columns.append(entry | scale)
        self.content.append(np.ascontiguousarray(stored, dtype=kind).tobytes())

    def add_numbers(
        self, name: str, values: NDArray[Any], against: str | None, limits: tuple[float, float] | None = None
    ) -> None:
        """Add a column of numbers (series, time), NaN kept; the same limits give the same numbers the same codes."""
        offset, high = limits or span(values)
        scale = (high - offset) / (LAST_CODE - 1) or 1.0
        codes = np.full(values.shape, LAST_CODE, dtype=np.uint16)
        usable = np.isfinite(values)
        codes[usable] = np.round((values[usable] - offset) / scale)
        self.add_codes(name, codes, against, offset=offset, scale=scale, nan=LAST_CODE)

    def add_angles(self, name: str, values_deg: NDArray[Any], against: str | None) -> None:
        """Add a column of angles, deg; where not finite the angle is 0, and another column must tell."""
        turns = np.where(np.isfinite(values_deg), values_deg, 0.0) / FULL_TURN_DEG
        codes = np.round(turns * (LAST_CODE + 1)).astype(np.int64).astype(np.uint16)
        self.add_codes(name, codes, against, offset=0.0, scale=FULL_TURN_DEG / (LAST_CODE + 1))


def pack(record: Record, title: str) -> dict[str, Any]:
    """Pack a record, JSON-ready.

    Raises:
        TraceError: the record is incomplete.
    """
    validate(record)
    packer, states = Packer(), len(record["position"])
    packer.add_numbers("position", record["position"].reshape(states, -1).T, "previous")
    packer.add_angles("heading", record["heading_deg"].T, "previous")
    packer.add_numbers("speed", record["speed_mps"].T, "previous")
    packer.add_numbers("flag_position", record["flag_position"].reshape(states, -1).T, "previous")
    bits = HAS_FLAG * record["has_flag"] + TAGGED * record["is_tagged"] + OUT * record["oob"]
    packer.add_codes("bits", bits.T.astype(np.uint8), None)
    # a command counts where speed and heading are finite
    nominal, filtered = (
        np.where(np.isfinite(one).all(axis=-1, keepdims=True), one, np.nan)
        for one in (record["nominal"], record["filtered"])
    )
    limits = span(np.stack([nominal[..., 0], filtered[..., 0]]))
    packer.add_numbers("nominal_speed", nominal[..., 0].T, "previous", limits)
    packer.add_numbers("filtered_speed", filtered[..., 0].T, "nominal_speed", limits)
    packer.add_angles("nominal_heading", nominal[..., 1].T, "previous")
    packer.add_angles("filtered_heading", filtered[..., 1].T, "nominal_heading")
    packer.add_numbers("safety_margin", record["safety_margin_m"].T.astype(np.float64), "previous")
    packer.add_codes("reason", record["reason"].T.astype(np.uint8), None)
    packer.add_codes("intervened", record["intervened"].T.astype(np.uint8), None)
    content = b"".join(packer.content)
    changed = np.flatnonzero(np.any(np.diff(record["captures"], axis=0) != 0, axis=1)) + 1
    return {
        "title": title,
        "meta": page_meta(record),
        "steps": len(record["nominal"]),
        "columns": packer.columns,
        "violations": np.round(record["violations"], 3).tolist(),
        "captures": [[int(step), *map(int, record["captures"][step])] for step in (0, *changed)],
        "data": base64.b64encode(zlib.compress(content, 9)).decode(),
    }


def span(values: NDArray[Any]) -> tuple[float, float]:
    """Return the smallest and largest finite value; zeros where there is none."""
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)


def page_meta(record: Record) -> Mapping[str, Any]:
    """Return what the page needs to know of a game."""
    meta = read_meta(record)
    arena = Arena.from_meta(meta)
    circles = [[o.radius_m, o.points_m[0]] for o in arena.obstacles if o.radius_m > 0.0]
    polygons = [o.points_m for o in arena.obstacles if o.radius_m == 0.0]
    drawn = {"scrimmage": arena.scrimmage_m, "obstacles": {"circle": circles, "polygon": polygons}}
    return {key: meta[key] for key in SHOWN} | drawn


SCRIPTS = tuple(f"replay_{part}.js" for part in ("data", "labels", "draw", "timeline", "pane", "app"))


def write_replay(
    records: Record | Sequence[Record],
    path: str | os.PathLike[str],
    title: str = "steerclear replay",
) -> Path:
    """Write a replay of one record or several.

    Several games can be chosen from a list and shown side by side, scrubbed together; the first two are shown
    at the start. Games without a shield count hits at the radius that the shield of another keeps. A link to
    ``replay.html#t=12.5`` opens it at that time.

    Raises:
        TraceError: a record is incomplete.
        ConfigError: there is no record, or the file cannot be written.
    """
    games = [records] if isinstance(records, Mapping) else list(records)
    if not games:
        raise ConfigError("there is no record to replay; pass at least one.")
    games = at_one_radius(games)
    metas = [read_meta(game) for game in games]
    own, names = {"own_team": own_team(metas)}, [game_title(meta) for meta in metas]
    titles = [name if names.count(name) == 1 else f"{k}. {name}" for k, name in enumerate(names, start=1)]
    packed = [pack(game, name) | own for game, name in zip(games, titles, strict=True)]
    data = as_json({"games": packed})
    return write_page(path, render("replay.html", title=title, data=data, scripts=SCRIPTS, sources=SCRIPT_SOURCES))


def at_one_radius(records: Sequence[Record]) -> list[Record]:
    """The records, those without a shield at the radius that the shields of the others keep, if that is larger."""
    kept_m = [meta["separation_m"] for meta in map(read_meta, records) if meta["shielded"]]
    found = []
    for record in records:
        meta = read_meta(record)
        if kept_m and not meta["shielded"] and meta["separation_m"] < max(kept_m):
            violations = find_violations(record["position"], max(kept_m))
            shown = json.dumps({**meta, "separation_m": max(kept_m)})
            record = {**record, "meta": np.array(shown), "violations": violations}
        found.append(record)
    return found


def own_team(metas: Sequence[Mapping[str, Any]]) -> int:
    """Return the team whose separation violations count: that of the first shielded boat in any game, else blue."""
    for meta in metas:
        for name, team in zip(meta["agent_ids"], meta["team"], strict=True):
            if name in meta["shielded"]:
                return int(team)
    return 0


def game_title(meta: Mapping[str, Any]) -> str:
    """Return the game's own title, or who plays whom and whether a shield is on."""
    blue, red = (meta["policies"].get(side) or side for side in ("blue", "red"))
    return meta.get("title") or f"{blue} – {red}, {'shield on' if meta['shielded'] else 'shield off'}"


ENDINGS = (".npz", ".html", ".mp4", ".gif", ".png")


def check_endings(paths: Sequence[Path]) -> None:
    """Refuse (ConfigError) names whose ending says no form that a game is saved in."""
    for path in paths:
        if path.suffix.lower() not in ENDINGS:
            raise ConfigError(f"cannot save {path.name!r}; end the name in one of {', '.join(ENDINGS)}")


def save_record(record: Record, path: Path, at_s: float | None = None, speedup: float = 4.0) -> Path:
    """Write a record in the form of the name's ending.

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
        return save_frame(record, _closest_step(record) if at_s is None else _step_at(record, at_s), path)
    with progress(ending[1:], len(record["nominal"])) as notice:
        return save_animation(record, path, speedup=speedup, progress=notice)


def _step_at(record: Record, at_s: float) -> int:
    dt_s, steps = float(read_meta(record)["dt_s"]), len(record["nominal"])
    if not -0.5 * dt_s <= at_s <= (steps + 0.5) * dt_s:
        raise ConfigError(f"--at is {at_s:g}; the game has 0 to {steps * dt_s:g} s")
    return min(max(round(at_s / dt_s), 0), steps)


def _closest_step(record: Record) -> int:
    """The step at which a shielded boat (any boat, without a shield) is closest to another."""
    covered: Any = record["intervened"].any(axis=0)
    distances = PairDistances.of(record["position"])
    if covered.any():
        distances = distances.of_pairs(covered[distances.pairs].any(axis=1))
    return int(np.argmin(distances.distance_m.min(axis=1))) + 1 if distances.distance_m.size else 0
