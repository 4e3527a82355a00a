"""Drawing of the field and of everything that moves on it: tracks, separation discs, commands, hulls, flags."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from steerclear.env.render.canvas import Canvas, Colour, Theme, mix
from steerclear.env.render.scene import Arena, Pair, Scene, boats_in_violation, closest_pair

LOOKAHEAD_S = 4.0
"""Commands and speeds are drawn as the distance covered in this time."""

CLOSE_SEPARATIONS = 4.0
"""The closest pair is joined by a line when nearer than this many separations."""

GRID_M = 10.0
MIN_HULL_PX = 30.0
_HALF_HULL = ((0.0, 0.5), (0.08, 0.41), (0.17, 0.25), (0.235, 0.04), (0.245, -0.22), (0.21, -0.47), (0.15, -0.5))
HULL = np.array(_HALF_HULL + tuple((-x, y) for x, y in _HALF_HULL[:0:-1]))
"""Outline of a hull of length 1 that points north: starboard from the bow, then port."""

DECK = np.array([(0.0, 0.2), (0.08, 0.02), (0.085, -0.3), (-0.085, -0.3), (-0.08, 0.02)])


def draw_field(canvas: Canvas, arena: Arena, theme: Theme) -> None:
    """Draw everything that does not move, on a cleared canvas."""
    width, height = arena.bounds_m
    corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
    canvas.surface.fill(theme.page)
    for team, home in enumerate(arena.flag_home_m):
        half = cut_by_line(corners, *arena.scrimmage_m, keep=home)
        if len(half) >= 3:
            canvas.polygon(half, theme.water[team])
    for x in np.arange(GRID_M, width - 1e-9, GRID_M):
        canvas.line([(x, 0.0), (x, height)], theme.grid, 0.8)
    for y in np.arange(GRID_M, height - 1e-9, GRID_M):
        canvas.line([(0.0, y), (width, y)], theme.grid, 0.8)
    canvas.dashed_line(*ends_in_field(arena), theme.edge, 1.8, 8)
    canvas.line([*corners, corners[0]], theme.edge, 1.6)
    for team, home in enumerate(arena.flag_home_m):
        tint = mix(theme.water[team], theme.team[team], 0.12)
        canvas.disc(home, arena.catch_radius_m, tint, 0.75)
        canvas.dashed_ring(home, arena.catch_radius_m, mix(tint, theme.team[team], 0.55), 1.3, 5)
        if arena.corner_radius_m > 0.0:
            _draw_corners(canvas, team, arena, theme)
        if arena.flag_keepout_m > 0.0:
            canvas.disc(home, arena.flag_keepout_m, theme.team[team], 0.16)
            canvas.ring(home, arena.flag_keepout_m, theme.team[team], 1.0, 0.6)
    outline = mix(theme.obstacle, theme.ink, 0.4)
    for obstacle in arena.obstacles:
        if obstacle.radius_m > 0.0:
            canvas.disc(obstacle.points_m[0], obstacle.radius_m, theme.obstacle)
            canvas.ring(obstacle.points_m[0], obstacle.radius_m, outline, 1.2)
        else:
            canvas.polygon(obstacle.points_m, theme.obstacle, outline)


def _draw_corners(canvas: Canvas, team: int, arena: Arena, theme: Theme) -> None:
    """Draw where a team captures and is untagged: quarter discs at the corners of its side."""
    radius_m, (width, height) = arena.corner_radius_m, arena.bounds_m
    angles = np.linspace(0.0, np.pi / 2.0, 19)
    x = np.abs(team * width - radius_m * np.cos(angles))
    for y in (radius_m * np.sin(angles), height - radius_m * np.sin(angles)):
        arc = list(zip(x.tolist(), y.tolist(), strict=True))
        corner = (team * width, 0.0 if y[0] == 0.0 else height)
        canvas.polygon([corner, *arc], mix(theme.water[team], theme.team[team], 0.14))
        canvas.line(arc, theme.team[team], 1.0)


def ends_in_field(arena: Arena) -> tuple[Pair, Pair]:
    """Return where the scrimmage line meets the field's edge."""
    width, height = arena.bounds_m
    corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
    half = cut_by_line(corners, *arena.scrimmage_m, keep=arena.flag_home_m[0])
    on_line = [point for point in half if abs(_side(point, *arena.scrimmage_m)) < 1e-9 * width * height]
    return (on_line[0], on_line[-1]) if len(on_line) > 1 else arena.scrimmage_m


def cut_by_line(polygon: Sequence[Pair], start: Pair, end: Pair, keep: Pair) -> list[Pair]:
    """Return the part of a convex polygon on the same side of the line ``start`` to ``end`` as the point ``keep``."""
    sign = 1.0 if _side(keep, start, end) >= 0.0 else -1.0
    part: list[Pair] = []
    for here, there in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
        a, b = sign * _side(here, start, end), sign * _side(there, start, end)
        if a >= 0.0:
            part.append(here)
        if a * b < 0.0:
            share = a / (a - b)
            part.append((here[0] + share * (there[0] - here[0]), here[1] + share * (there[1] - here[1])))
    return part


def _side(point: Pair, start: Pair, end: Pair) -> float:
    """Return a number whose sign tells on which side of the line a point lies."""
    return (end[0] - start[0]) * (point[1] - start[1]) - (end[1] - start[1]) * (point[0] - start[0])


def draw_boats(canvas: Canvas, scene: Scene, arena: Arena, theme: Theme, show_commands: bool = True) -> None:
    """Draw everything that moves on the field."""
    boats = range(len(scene.position_m))
    for boat in boats:
        canvas.trail(scene.trail_m[:, boat], theme.team[arena.team[boat]], 2.0)
    _draw_separation(canvas, scene, arena, theme)
    pair = closest_pair(scene, arena)
    if pair is not None and pair[2] <= CLOSE_SEPARATIONS * arena.separation_m:
        colour = theme.violation if pair[2] <= arena.separation_m else theme.muted
        canvas.dashed_line(scene.position_m[pair[0]], scene.position_m[pair[1]], colour, 1.4, 3)
    for team, home in enumerate(arena.flag_home_m):
        canvas.disc(home, 0.35, theme.team[team], 0.5)
    if show_commands and scene.overlay is not None:
        for boat in boats:
            _draw_command(canvas, scene, boat, arena, theme)
    for boat in boats:
        _draw_hull(canvas, scene, boat, arena, theme)
    for team in (0, 1):
        _draw_flag(canvas, scene.flag_position_m[team], theme.team[team], theme.ink)


def _draw_separation(canvas: Canvas, scene: Scene, arena: Arena, theme: Theme) -> None:
    """Draw a disc of half the separation around each boat: two discs that touch violate it.

    If any boat is shielded, only violations that involve a shielded boat are marked.
    """
    covered = {boat for boat, name in enumerate(arena.names) if name in arena.shielded}
    pairs = boats_in_violation(scene, arena.separation_m)
    violated = {boat for pair in pairs if not covered or covered & set(pair) for boat in pair}
    radius_m = arena.separation_m / 2
    for boat, centre in enumerate(scene.position_m):
        colour, strength, width = theme.team[arena.team[boat]], 0.10, 1.0
        if scene.overlay is not None and scene.overlay.intervened[boat]:
            colour, strength, width = theme.changed, 0.28, 1.8
        if boat in violated:
            colour, strength, width = theme.violation, 0.35, 2.4
        canvas.disc(centre, radius_m, colour, strength)
        canvas.ring(centre, radius_m, colour, width, 0.9 if strength > 0.2 else 0.55)


def along(heading_deg: float, length_m: float) -> np.ndarray:
    """Return the vector of a heading (clockwise from north)."""
    return length_m * np.array([np.sin(np.radians(heading_deg)), np.cos(np.radians(heading_deg))])


def command_end(start_m: np.ndarray, command: np.ndarray) -> np.ndarray:
    """Return where a boat at ``start_m`` gets under a command in ``LOOKAHEAD_S``; the start if it is not finite."""
    if not np.isfinite(command).all():
        return np.asarray(start_m, dtype=float)
    return start_m + along(float(command[1]), float(command[0]) * LOOKAHEAD_S)


def _draw_command(canvas: Canvas, scene: Scene, boat: int, arena: Arena, theme: Theme) -> None:
    overlay, start = scene.overlay, scene.position_m[boat]
    assert overlay is not None
    filtered_end = command_end(start, overlay.filtered[boat])
    if not overlay.intervened[boat]:
        canvas.arrow(start, filtered_end, mix(theme.team[arena.team[boat]], theme.page, 0.25), 1.6)
        return
    canvas.arrow(start, command_end(start, overlay.nominal[boat]), theme.nominal, 1.6)
    canvas.arrow(start, filtered_end, theme.changed, 4.6, theme.plate)


def _draw_hull(canvas: Canvas, scene: Scene, boat: int, arena: Arena, theme: Theme) -> None:
    centre, heading_deg = scene.position_m[boat], float(scene.heading_deg[boat])
    colour, tagged = theme.team[arena.team[boat]], bool(scene.is_tagged[boat])
    length_m = max(arena.hull_length_m(boat), MIN_HULL_PX / canvas.scale_px_per_m)
    sin, cos = np.sin(np.radians(heading_deg)), np.cos(np.radians(heading_deg))
    turn = length_m * np.array([[cos, -sin], [sin, cos]])
    if not (scene.overlay is not None and scene.overlay.intervened[boat]):
        bow = centre + along(heading_deg, length_m / 2)
        tip = bow + along(heading_deg, float(scene.speed_mps[boat]) * LOOKAHEAD_S / 2)
        canvas.line([bow, tip], colour, 1.2)
    fill = mix(colour, theme.page, 0.72) if tagged else colour
    canvas.polygon(centre + HULL @ turn, fill, colour if tagged else theme.plate)
    canvas.polygon(centre + DECK @ turn, colour if tagged else mix(colour, theme.plate, 0.5))
    if scene.is_disabled[boat]:
        canvas.ring(centre, length_m * 0.62, theme.muted, 2.6, 1.0)
        _draw_bar(canvas, centre, length_m * 0.62, (1.0, -1.0), theme.muted, 2.6)
    if tagged:
        for slant in ((1.0, 1.0), (1.0, -1.0)):
            _draw_bar(canvas, centre, length_m * 0.36, slant, theme.ink, 2.0)
    if arena.names[boat] in arena.steered:  # by a human
        for share in (1.0, 1.25):
            canvas.ring(centre, share * 0.75 * length_m, theme.ink, 1.8, 1.0)


def _draw_bar(canvas: Canvas, centre: np.ndarray, reach_m: float, slant: Pair, colour: Colour, width: float) -> None:
    """Draw a slanted bar through a boat."""
    arm = reach_m * np.array(slant) / np.sqrt(2.0)
    canvas.line([centre - arm, centre + arm], colour, width)


def _draw_flag(canvas: Canvas, foot: np.ndarray, colour: Colour, pole: Colour) -> None:
    """Draw a flag whose pole stands at a point."""
    unit_m = 1.0 / canvas.scale_px_per_m
    top = foot + np.array([0.0, 24 * unit_m])
    cloth = [top, top + np.array([17, -5]) * unit_m, top + np.array([0, -11]) * unit_m]
    canvas.polygon(cloth, colour, pole)
    canvas.line([foot, top], pole, 1.8)
    canvas.disc(foot, 2.4 * unit_m, pole)
