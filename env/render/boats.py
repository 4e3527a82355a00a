"""The moving part of the picture: tracks, separation discs, commands, hulls, flags."""

from __future__ import annotations

import numpy as np
from steerclear.env.render.arena import Arena
from steerclear.env.render.canvas import Canvas
from steerclear.env.render.scene import Scene, boats_in_breach, closest_pair
from steerclear.env.render.theme import Colour, Theme, mix

LOOKAHEAD_S = 4.0
"""Commands and speeds are drawn as the way gone in this time, s."""

CLOSE_SEPARATIONS = 4.0
"""The closest pair is joined by a line when nearer than this many separations."""

MIN_HULL_PX = 30.0
_HALF_HULL = ((0.0, 0.5), (0.08, 0.41), (0.17, 0.25), (0.235, 0.04), (0.245, -0.22), (0.21, -0.47), (0.15, -0.5))
HULL = ((0.0, 0.5), (0.07, 0.42), (0.15, 0.26), (0.205, 0.05), (0.215, -0.2), (0.18, -0.46), (0.13, -0.5))
HULL = np.array(_HALF_HULL + tuple((-x, y) for x, y in _HALF_HULL[:0:-1]))
"""Outline of a hull of length 1 that points north: starboard from the bow, then port."""

DECK = np.array([(0.0, 0.2), (0.08, 0.02), (0.085, -0.3), (-0.085, -0.3), (-0.08, 0.02)])


def along(heading_deg: float, length_m: float) -> np.ndarray:
    """Return the vector of a heading (clockwise from north)."""
    return length_m * np.array([np.sin(np.radians(heading_deg)), np.cos(np.radians(heading_deg))])


def turned(points: np.ndarray, heading_deg: float) -> np.ndarray:
    """Turn points that face north to a heading."""
    sin, cos = np.sin(np.radians(heading_deg)), np.cos(np.radians(heading_deg))
    return points @ np.array([[cos, -sin], [sin, cos]])


def draw_boats(canvas: Canvas, scene: Scene, arena: Arena, theme: Theme, show_commands: bool = True) -> None:
    """Draw all that moves.

    Args:
        canvas: Where to draw, over the field.
        scene: The moment.
        arena: The field.
        theme: Colours.
        show_commands: Draw wanted and sent commands, where the scene has them.
    """
    boats = range(len(scene.position_m))
    for boat in boats:
        canvas.trail(scene.trail_m[:, boat], theme.team[arena.team[boat]], 2.0)
    _draw_separation(canvas, scene, arena, theme)
    _draw_closest(canvas, scene, arena, theme)
    for team, home in enumerate(arena.flag_home_m):
        canvas.disc(home, 0.35, theme.team[team], 0.5)
    for boat in boats:
        if show_commands and scene.overlay is not None:
            _draw_command(canvas, scene, boat, arena, theme)
    for boat in boats:
        _draw_hull(canvas, scene, boat, arena, theme)
        if arena.names[boat] in arena.steered:
            _mark_steered(canvas, scene.position_m[boat], arena.hull_length_m(boat), theme)
    for team in (0, 1):
        draw_flag(canvas, scene.flag_position_m[team], theme.team[team], theme.ink)


def _draw_separation(canvas: Canvas, scene: Scene, arena: Arena, theme: Theme) -> None:
    """Draw a disc of half the separation around each boat: two discs that touch are a breach.

    Where boats are shielded, a breach is one of theirs: for others among themselves no shield answers.
    """
    pairs = boats_in_breach(scene, arena.separation_m)
    covered = {boat for boat, name in enumerate(arena.names) if name in arena.shielded}
    breached = {boat for pair in pairs if not covered or covered & set(pair) for boat in pair}
    radius_m = arena.separation_m / 2
    for boat, centre in enumerate(scene.position_m):
        changed = scene.overlay is not None and bool(scene.overlay.intervened[boat])
        colour, strength, width = theme.team[arena.team[boat]], 0.10, 1.0
        if changed:
            colour, strength, width = theme.changed, 0.28, 1.8
        if boat in breached:
            colour, strength, width = theme.breach, 0.35, 2.4
        canvas.disc(centre, radius_m, colour, strength)
        canvas.ring(centre, radius_m, colour, width, 0.9 if strength > 0.2 else 0.55)


def _draw_closest(canvas: Canvas, scene: Scene, arena: Arena, theme: Theme) -> None:
    pair = closest_pair(scene, arena)
    if pair is not None and pair[2] <= CLOSE_SEPARATIONS * arena.separation_m:
        inside = pair[2] <= arena.separation_m
        colour = theme.breach if inside else theme.muted
        canvas.dashed_line(scene.position_m[pair[0]], scene.position_m[pair[1]], colour, 1.4, 3)


def command_end(start_m: np.ndarray, command: np.ndarray) -> np.ndarray:
    """Return where the arrow of a command ends.

    Args:
        start_m: Where the boat is.
        command: Speed m/s and absolute heading deg.

    Returns:
        The point that the boat would reach in ``LOOKAHEAD_S``; the start itself when the command is not finite.
    """
    if not np.isfinite(command).all():
        return np.asarray(start_m, dtype=float)
    return start_m + along(float(command[1]), float(command[0]) * LOOKAHEAD_S)


def _draw_command(canvas: Canvas, scene: Scene, boat: int, arena: Arena, theme: Theme) -> None:
    overlay, start = scene.overlay, scene.position_m[boat]
    if overlay is None:
        return
    sent_end = command_end(start, overlay.sent[boat])
    if not overlay.intervened[boat]:
        canvas.arrow(start, sent_end, mix(theme.team[arena.team[boat]], theme.page, 0.25), 1.6)
        return
    canvas.arrow(start, command_end(start, overlay.wanted[boat]), theme.wanted, 1.6)
    canvas.arrow(start, sent_end, theme.changed, 4.6, theme.plate)


def _draw_hull(canvas: Canvas, scene: Scene, boat: int, arena: Arena, theme: Theme) -> None:
    centre, heading_deg = scene.position_m[boat], float(scene.heading_deg[boat])
    colour = theme.team[arena.team[boat]]
    length_m = max(arena.hull_length_m(boat), MIN_HULL_PX / canvas.scale_px_per_m)
    if not (scene.overlay is not None and scene.overlay.intervened[boat]):
        bow = centre + along(heading_deg, length_m / 2)
        tip = bow + along(heading_deg, float(scene.speed_mps[boat]) * LOOKAHEAD_S / 2)
        canvas.line([bow, tip], colour, 1.2)
    tagged = bool(scene.is_tagged[boat])
    fill = mix(colour, theme.page, 0.72) if tagged else colour
    canvas.polygon(centre + turned(HULL * length_m, heading_deg), fill, colour if tagged else theme.plate)
    canvas.polygon(centre + turned(DECK * length_m, heading_deg), colour if tagged else mix(colour, theme.plate, 0.5))
    if scene.is_disabled[boat]:
        canvas.ring(centre, length_m * 0.62, theme.muted, 2.6, 1.0)
        canvas.line(list(_across(centre, length_m * 0.62)), theme.muted, 2.6)
    if tagged:
        _draw_cross(canvas, centre, length_m * 0.36, theme.ink)


def _across(centre: np.ndarray, reach_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the bar through the ring around a disabled boat."""
    arm = reach_m * np.array([1.0, -1.0]) / np.sqrt(2.0)
    return centre - arm, centre + arm


def _mark_steered(canvas: Canvas, centre: np.ndarray, length_m: float, theme: Theme) -> None:
    """Two rings around the boat that a human steers."""
    reach_m = 0.75 * max(length_m, MIN_HULL_PX / canvas.scale_px_per_m)
    for share in (1.0, 1.25):
        canvas.ring(centre, share * reach_m, theme.ink, 1.8, 1.0)


def _draw_cross(canvas: Canvas, centre: np.ndarray, reach_m: float, colour: Colour) -> None:
    for x, y in ((1.0, 1.0), (1.0, -1.0)):
        arm = reach_m * np.array([x, y]) / np.sqrt(2.0)
        canvas.line([centre - arm, centre + arm], colour, 2.0)


def draw_flag(canvas: Canvas, foot_m: np.ndarray, colour: Colour, pole: Colour) -> None:
    """Draw a flag whose pole stands at a point.

    Args:
        canvas: Where to draw.
        foot_m: Foot of the pole.
        colour: Cloth.
        pole: Pole.
    """
    unit_m = 1.0 / canvas.scale_px_per_m
    foot = np.asarray(foot_m, float)
    top = foot + np.array([0.0, 24 * unit_m])
    cloth = [top, top + np.array([17, -5]) * unit_m, top + np.array([0, -11]) * unit_m]
    canvas.polygon(cloth, colour, pole)
    canvas.line([foot, top], pole, 1.8)
    canvas.disc(foot, 2.4 * unit_m, pole)
