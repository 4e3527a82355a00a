"""The still part of the picture: water, grid, scrimmage line, flag zones, obstacles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from steerclear.env.render.arena import Arena
from steerclear.env.render.canvas import Canvas
from steerclear.env.render.theme import Theme, mix

GRID_M = 10.0


def draw_field(canvas: Canvas, arena: Arena, theme: Theme) -> None:
    """Draw all that does not move.

    Args:
        canvas: Where to draw; it is cleared first.
        arena: The field.
        theme: Colours.
    """
    canvas.surface.fill(theme.page)
    _draw_water(canvas, arena, theme)
    _draw_grid(canvas, arena, theme)
    for team, home in enumerate(arena.flag_home_m):
        tint = mix(theme.water[team], theme.team[team], 0.12)
        canvas.disc(home, arena.catch_radius_m, tint, 0.75)
        canvas.dashed_ring(home, arena.catch_radius_m, mix(tint, theme.team[team], 0.55), 1.3, 5)
        _draw_corners(canvas, team, arena, theme)
        if arena.flag_keepout_m > 0.0:
            canvas.disc(home, arena.flag_keepout_m, theme.team[team], 0.16)
            canvas.ring(home, arena.flag_keepout_m, theme.team[team], 1.0, 0.6)
    for obstacle in arena.obstacles:
        if obstacle.radius_m > 0.0:
            canvas.disc(obstacle.points_m[0], obstacle.radius_m, theme.obstacle)
            canvas.ring(obstacle.points_m[0], obstacle.radius_m, mix(theme.obstacle, theme.ink, 0.4), 1.2)
        else:
            canvas.polygon(obstacle.points_m, theme.obstacle, mix(theme.obstacle, theme.ink, 0.4))


def _draw_water(canvas: Canvas, arena: Arena, theme: Theme) -> None:
    width, height = arena.bounds_m
    corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
    for team, home in enumerate(arena.flag_home_m):
        half = cut_by_line(corners, *arena.scrimmage_m, keep=home)
        if len(half) >= 3:
            canvas.polygon(half, theme.water[team])


def _draw_corners(canvas: Canvas, team: int, arena: Arena, theme: Theme) -> None:
    """Draw where a team captures and is untagged at the corners of its side: the quarter discs inside the field."""
    radius_m, (width, height) = arena.corner_radius_m, arena.bounds_m
    if radius_m <= 0.0:
        return
    angles = np.linspace(0.0, np.pi / 2.0, 19)
    x = np.abs(team * width - radius_m * np.cos(angles))
    for y in (radius_m * np.sin(angles), height - radius_m * np.sin(angles)):
        arc = list(zip(x.tolist(), y.tolist(), strict=True))
        corner = (team * width, 0.0 if y[0] == 0.0 else height)
        canvas.polygon([corner, *arc], mix(theme.water[team], theme.team[team], 0.14))
        canvas.line(arc, theme.team[team], 1.0)


def _draw_grid(canvas: Canvas, arena: Arena, theme: Theme) -> None:
    width, height = arena.bounds_m
    for x in np.arange(GRID_M, width - 1e-9, GRID_M):
        canvas.line([(x, 0.0), (x, height)], theme.grid, 0.8)
    for y in np.arange(GRID_M, height - 1e-9, GRID_M):
        canvas.line([(0.0, y), (width, y)], theme.grid, 0.8)
    start, end = ends_in_field(arena)
    canvas.dashed_line(start, end, theme.edge, 1.8, 8)
    corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height), (0.0, 0.0)]
    canvas.line(corners, theme.edge, 1.6)


def ends_in_field(arena: Arena) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return where the scrimmage line meets the field's edge."""
    width, height = arena.bounds_m
    corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
    half = cut_by_line(corners, *arena.scrimmage_m, keep=arena.flag_home_m[0])
    on_line = [point for point in half if abs(_side(point, *arena.scrimmage_m)) < 1e-9 * width * height]
    return (on_line[0], on_line[-1]) if len(on_line) > 1 else arena.scrimmage_m


def cut_by_line(
    polygon: Sequence[tuple[float, float]],
    start: tuple[float, float],
    end: tuple[float, float],
    keep: tuple[float, float],
) -> list[tuple[float, float]]:
    """Cut a convex polygon along the line through two points.

    Args:
        polygon: Corners in order, m.
        start: A point of the line.
        end: Another one.
        keep: A point on the side to keep.

    Returns:
        Corners of the part on that side.
    """
    sign = 1.0 if _side(keep, start, end) >= 0.0 else -1.0
    kept: list[tuple[float, float]] = []
    for here, there in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
        a, b = sign * _side(here, start, end), sign * _side(there, start, end)
        if a >= 0.0:
            kept.append(here)
        if a * b < 0.0:
            share = a / (a - b)
            kept.append((here[0] + share * (there[0] - here[0]), here[1] + share * (there[1] - here[1])))
    return kept


def _side(point: tuple[float, float], start: tuple[float, float], end: tuple[float, float]) -> float:
    """Return a number whose sign says on which side of the line a point lies."""
    return (end[0] - start[0]) * (point[1] - start[1]) - (end[1] - start[1]) * (point[0] - start[0])
