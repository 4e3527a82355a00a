"""Packing a record into text small enough to sit inside a page.

Every number becomes a code of 16 (or 8) bits: value = offset + scale * code, the largest code standing for
NaN where there may be one. A column holds one series per boat and coordinate, each over all time indices.
Codes are stored as differences modulo 2**bits, from the time index before (``against`` = "previous") or from
another column (``sent`` from ``wanted``), which deflate then shrinks. All columns of a game are one run of
bytes, little-endian, deflated and in base64. ``templates/replay_data.js`` is the reader.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.env.record import Record, read_meta, validate
from steerclear.env.render import Arena

FULL_TURN_DEG = 360.0
LAST_CODE = 2**16 - 1
HAS_FLAG, TAGGED, OUT = 1, 2, 4


@dataclass
class Packer:
    """Collects columns and their bytes.

    Attributes:
        columns: JSON-ready description of each column.
        content: Bytes of each column.
    """

    columns: list[dict[str, Any]] = field(default_factory=list)
    content: list[bytes] = field(default_factory=list)
    _codes: dict[str, NDArray[Any]] = field(default_factory=dict)

    def add_codes(self, name: str, codes: NDArray[Any], against: str | None, **scale: float) -> None:
        """Add a column of codes.

        Args:
            name: Of the column.
            codes: (series, time) uint16 or uint8.
            against: "previous", another column's name, or None.
            **scale: ``offset``, ``scale`` and ``nan`` of the column.
        """
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
        """Add a column of numbers.

        Args:
            name: Of the column.
            values: (series, time); NaN is kept.
            against: "previous", another column's name, or None.
            limits: Smallest and largest number that codes must reach; those of the values when left out.
                Columns with the same limits have the same codes for the same numbers.
        """
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


def pack(record: Record, title: str, compress: bool = True) -> dict[str, Any]:
    """Pack a record.

    Args:
        record: A record.
        title: Its name in the page.
        compress: Deflate; a page without needs no newer browser but is some three times as large.

    Returns:
        JSON-ready.

    Raises:
        TraceError: The record is incomplete.
    """
    validate(record)
    packer = Packer()
    _add_states(packer, record)
    _add_commands(packer, record)
    content = b"".join(packer.content)
    return {
        "title": title,
        "meta": page_meta(record),
        "steps": len(record["wanted"]),
        "columns": packer.columns,
        "breaches": np.round(record["breaches"], 3).tolist(),
        "captures": score_changes(record["captures"]),
        "deflated": compress,
        "data": base64.b64encode(zlib.compress(content, 9) if compress else content).decode(),
    }


def _add_states(packer: Packer, record: Record) -> None:
    states = len(record["position"])
    packer.add_numbers("position", record["position"].reshape(states, -1).T, "previous")
    packer.add_angles("heading", record["heading_deg"].T, "previous")
    packer.add_numbers("speed", record["speed_mps"].T, "previous")
    packer.add_numbers("flag_position", record["flag_position"].reshape(states, -1).T, "previous")
    bits = HAS_FLAG * record["has_flag"] + TAGGED * record["is_tagged"] + OUT * record["oob"]
    packer.add_codes("bits", bits.T.astype(np.uint8), None)


def _add_commands(packer: Packer, record: Record) -> None:
    wanted, sent = _usable(record["wanted"]), _usable(record["sent"])
    limits = span(np.stack([wanted[..., 0], sent[..., 0]]))
    packer.add_numbers("wanted_speed", wanted[..., 0].T, "previous", limits)
    packer.add_numbers("sent_speed", sent[..., 0].T, "wanted_speed", limits)
    packer.add_angles("wanted_heading", wanted[..., 1].T, "previous")
    packer.add_angles("sent_heading", sent[..., 1].T, "wanted_heading")
    packer.add_numbers("certificate", record["safety_margin_m"].T.astype(np.float64), "previous")
    packer.add_codes("reason", record["reason"].T.astype(np.uint8), None)
    packer.add_codes("intervened", record["intervened"].T.astype(np.uint8), None)


def _usable(commands: NDArray[Any]) -> NDArray[Any]:
    """Return commands whose speed is NaN wherever speed or heading is not finite."""
    kept = commands.copy()
    kept[~np.isfinite(commands).all(axis=-1)] = np.nan
    return kept


def span(values: NDArray[Any]) -> tuple[float, float]:
    """Return the smallest and largest finite value; zeros where there is none."""
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)


def score_changes(captures: NDArray[Any]) -> list[list[int]]:
    """Return [step, blue, red] for the start and for every step at which the score changes."""
    changed = np.flatnonzero(np.any(np.diff(captures, axis=0) != 0, axis=1)) + 1
    return [[int(step), *map(int, captures[step])] for step in (0, *changed)]


def page_meta(record: Record) -> Mapping[str, Any]:
    """Return what the page needs to know of a game."""
    meta = read_meta(record)
    arena = Arena.from_meta(meta)
    circles = [[o.radius_m, o.points_m[0]] for o in arena.obstacles if o.radius_m > 0.0]
    polygons = [o.points_m for o in arena.obstacles if o.radius_m == 0.0]
    kept: tuple[str, ...] = (
        "dt_s",
        "env_bounds_m",
        "agent_ids",
        "team",
        "flag_home",
        "catch_radius_m",
        "flag_keepout_m",
    )
    kept += ("separation_m", "preset", "policies", "shielded", "seed", "reason_names", "platforms")
    drawn = {"scrimmage": arena.scrimmage_m, "obstacles": {"circle": circles, "polygon": polygons}}
    return {key: meta[key] for key in kept} | drawn
