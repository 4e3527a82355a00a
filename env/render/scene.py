"""One moment of a game, ready to be drawn: from a live game or from a record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.env.record_file import NOT_COVERED
from steerclear.env.render.arena import Arena
from steerclear.shield.platforms.layout import HEADING, SPEED, X, Y

TRAIL_S = 12.0
"""Length of the track drawn behind each boat, s."""


@dataclass(frozen=True)
class Overlay:
    """What was asked of the boats and what the shield made of it, for n boats.

    Attributes:
        wanted: (n, 2) speed m/s and absolute heading deg asked for.
        sent: (n, 2) likewise, what the boats were told.
        reason: (n,) shield reason codes.
        intervened: (n,) bool.
        safety_margin_m: (n,) NaN where there is none.
    """

    wanted: np.ndarray
    sent: np.ndarray
    reason: np.ndarray
    intervened: np.ndarray
    safety_margin_m: np.ndarray

    @classmethod
    def of_commands(cls, wanted: np.ndarray, sent: np.ndarray) -> Overlay:
        """Show commands of which nothing but the values is known; those that differ count as changed.

        Args:
            wanted: (n, 2) speed m/s and absolute heading deg asked for.
            sent: (n, 2) likewise, what the boats were told.

        Returns:
            The overlay, without reasons and certificates.
        """
        changed = np.any(np.not_equal(wanted, sent), axis=1)
        return cls(wanted, sent, np.full(len(changed), NOT_COVERED), changed, np.full(len(changed), np.nan))


@dataclass(frozen=True)
class Scene:
    """One moment, n boats.

    Attributes:
        time_s: Time since the start.
        position_m: (n, 2).
        heading_deg: (n,) clockwise from north.
        speed_mps: (n,).
        has_flag: (n,) bool.
        is_tagged: (n,) bool.
        oob: (n,) bool, out of bounds.
        is_disabled: (n,) bool, stopped by a power play.
        flag_position_m: (2, 2).
        captures: (2,) captures made by each team.
        trail_m: (k, n, 2) positions up to now, oldest first.
        overlay: Commands, or None.
    """

    time_s: float
    position_m: np.ndarray
    heading_deg: np.ndarray
    speed_mps: np.ndarray
    has_flag: np.ndarray
    is_tagged: np.ndarray
    oob: np.ndarray
    is_disabled: np.ndarray
    flag_position_m: np.ndarray
    captures: np.ndarray
    trail_m: np.ndarray
    overlay: Overlay | None = None

    @classmethod
    def from_view(cls, view: Any, trail_m: np.ndarray, overlay: Overlay | None = None) -> Scene:
        """Take a live game.

        Args:
            view: A ``GameView``.
            trail_m: (k, n, 2) positions up to now.
            overlay: Commands of the last step.

        Returns:
            The scene.
        """
        state = np.asarray(view.state)
        return cls(
            float(view.time_s),
            state[:, [X, Y]],
            state[:, HEADING],
            state[:, SPEED],
            np.asarray(view.has_flag),
            np.asarray(view.is_tagged),
            np.asarray(view.oob),
            np.asarray(view.is_disabled),
            np.asarray(view.flag_position),
            np.asarray(view.captures),
            trail_m,
            overlay,
        )

    @classmethod
    def from_record(cls, record: Mapping[str, np.ndarray], step: int, dt_s: float) -> Scene:
        """Take a step of a record, with the command that is given at that step.

        Args:
            record: A record of T steps.
            step: 0..T; the last state shows the last command.
            dt_s: Length of a step.

        Returns:
            The scene.
        """
        first = max(0, step - round(TRAIL_S / dt_s))
        asked = min(step, len(record["wanted"]) - 1)
        commands = ("wanted", "sent", "reason", "intervened", "safety_margin_m")
        overlay = None if asked < 0 else Overlay(*(record[name][asked] for name in commands))
        trail_m = record["position"][first : step + 1]
        disabled = record["is_disabled"][step] if "is_disabled" in record else np.zeros(trail_m.shape[1], dtype=bool)
        states = ("position", "heading_deg", "speed_mps", "has_flag", "is_tagged", "oob")
        boats = (record[name][step] for name in states)
        flags = (record[name][step] for name in ("flag_position", "captures"))
        return cls(step * dt_s, *boats, disabled, *flags, trail_m, overlay)


def closest_pair(scene: Scene, arena: Arena) -> tuple[int, int, float] | None:
    """Find the closest two boats, of which a shielded one where there is any.

    Args:
        scene: The moment.
        arena: Names the shielded boats.

    Returns:
        Boat, boat, distance m; None with fewer than two boats.
    """
    n = len(scene.position_m)
    if n < 2:
        return None
    gap_m = np.linalg.norm(scene.position_m[:, None] - scene.position_m[None], axis=-1)
    gap_m[np.tril_indices(n)] = np.inf
    covered = np.array([name in arena.shielded for name in arena.names])
    if covered.any():
        gap_m[~(covered[:, None] | covered[None])] = np.inf
    first, second = np.unravel_index(int(gap_m.argmin()), gap_m.shape)
    return int(first), int(second), float(gap_m[first, second])


def boats_in_breach(scene: Scene, separation_m: float) -> list[tuple[int, int]]:
    """List the pairs of boats within the separation radius."""
    gap_m = np.linalg.norm(scene.position_m[:, None] - scene.position_m[None], axis=-1)
    first, second = np.nonzero(np.triu(gap_m <= separation_m, k=1))
    return list(zip(first.tolist(), second.tolist(), strict=True))
