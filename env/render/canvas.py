"""Drawing in metres with smooth edges: shapes are drawn on an enlarged surface, which is then shrunk.

The surface is in memory, so no display is needed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import matplotlib
import numpy as np
import pygame

OVERSAMPLE = 2
Point = Sequence[float] | np.ndarray
Colour = tuple[int, int, int]


@dataclass(frozen=True)
class Theme:
    """A set of colours, red-green-blue 0..255."""

    page: Colour  # Around the field
    water: tuple[Colour, Colour]  # Field of team 0 and of team 1
    grid: Colour  # Lines every 10 m
    edge: Colour  # Border of the field and the scrimmage line
    ink: Colour  # Text and strong marks
    muted: Colour  # Secondary text
    team: tuple[Colour, Colour]  # Team 0 and team 1
    nominal: Colour  # Arrow of a nominal command that the shield replaced
    changed: Colour  # Arrow and halo of a command the shield changed
    violation: Colour  # Two boats that violate the separation
    obstacle: Colour  # Fixed obstacles
    plate: Colour  # Behind labels


THEMES = {
    "light": Theme(
        page=(248, 250, 252),
        water=((226, 238, 250), (251, 233, 229)),
        grid=(255, 255, 255),
        edge=(100, 116, 139),
        ink=(15, 23, 42),
        muted=(84, 98, 118),
        team=((29, 92, 208), (206, 58, 48)),
        nominal=(71, 85, 105),
        changed=(240, 130, 0),
        violation=(190, 24, 147),
        obstacle=(120, 113, 108),
        plate=(255, 255, 255),
    ),
    "dark": Theme(
        page=(11, 18, 32),
        water=((16, 38, 66), (56, 27, 36)),
        grid=(38, 56, 84),
        edge=(120, 140, 168),
        ink=(236, 242, 250),
        muted=(148, 163, 184),
        team=((86, 156, 255), (255, 108, 96)),
        nominal=(190, 202, 220),
        changed=(255, 171, 46),
        violation=(255, 92, 214),
        obstacle=(148, 140, 132),
        plate=(20, 30, 48),
    ),
}
"""The themes by name."""


def mix(first: Colour, second: Colour, share: float) -> Colour:
    """Blend two colours; ``share`` 0 gives the first, 1 the second."""
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(first, second, strict=True))
    return red, green, blue


@lru_cache(maxsize=32)
def font(size_px: int, bold: bool = False) -> pygame.font.Font:
    """Return a typeface that is the same on every machine: the one that comes with matplotlib."""
    pygame.font.init()
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return pygame.font.Font(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name), size_px)


class Canvas:
    """A field of metres on a surface of pixels.

    Args:
        size_px: Width and height of the finished picture.
        origin_px: Pixel of the field's lower left corner.
        scale_px_per_m: Pixels of the finished picture per metre.
    """

    def __init__(self, size_px: tuple[int, int], origin_px: tuple[float, float], scale_px_per_m: float) -> None:
        self.size_px = size_px
        self.scale_px_per_m = scale_px_per_m
        self._origin = (origin_px[0] * OVERSAMPLE, origin_px[1] * OVERSAMPLE)
        self._scale = scale_px_per_m * OVERSAMPLE
        self.surface = pygame.Surface((size_px[0] * OVERSAMPLE, size_px[1] * OVERSAMPLE), 0, 32)

    def to_px(self, point_m: Point) -> tuple[float, float]:
        """Return the pixel of the finished picture at which a point of the field lies."""
        x, y = self._at(point_m)
        return x / OVERSAMPLE, y / OVERSAMPLE

    def finished(self) -> pygame.Surface:
        """Return the picture at its own size."""
        return pygame.transform.smoothscale(self.surface, self.size_px)

    def polygon(self, points_m: Sequence[Point] | np.ndarray, colour: Colour, outline: Colour | None = None) -> None:
        """Fill a polygon, with a thin outline if a colour is given."""
        points = [self._at(point) for point in points_m]
        pygame.draw.polygon(self.surface, colour, points)
        if outline is not None:
            pygame.draw.polygon(self.surface, outline, points, max(1, round(1.2 * OVERSAMPLE)))

    def disc(self, centre_m: Point, radius_m: float, colour: Colour, opacity: float = 1.0) -> None:
        """Fill a circle."""
        self._circle(centre_m, radius_m * self._scale, colour, opacity, 0)

    def ring(self, centre_m: Point, radius_m: float, colour: Colour, width_px: float, opacity: float = 1.0) -> None:
        """Draw a circle's outline."""
        self._circle(centre_m, radius_m * self._scale, colour, opacity, max(1, round(width_px * OVERSAMPLE)))

    def dashed_ring(self, centre_m: Point, radius_m: float, colour: Colour, width_px: float, dash_px: float) -> None:
        """Draw a circle's outline in dashes."""
        dashes = max(8, round(2 * math.pi * radius_m * self.scale_px_per_m / (2 * dash_px)))
        for start in np.arange(dashes) * (2 * math.pi / dashes):
            turn = np.linspace(start, start + math.pi / dashes, 6)
            arc = np.asarray(centre_m) + radius_m * np.stack([np.cos(turn), np.sin(turn)], axis=1)
            self.line(arc, colour, width_px)

    def line(self, points_m: Sequence[Point] | np.ndarray, colour: Colour, width_px: float) -> None:
        """Draw a line through points, with rounded ends."""
        points = [self._at(point) for point in points_m]
        width = max(1.0, width_px * OVERSAMPLE)
        for start, end in pairwise(points):
            _bar(self.surface, start, end, width, colour)
        if width >= 3:
            for point in points:
                pygame.draw.circle(self.surface, colour, point, width / 2)

    def dashed_line(self, start_m: Point, end_m: Point, colour: Colour, width_px: float, dash_px: float) -> None:
        """Draw a straight line in dashes."""
        start, end = np.asarray(start_m, float), np.asarray(end_m, float)
        count = max(1, round(float(np.linalg.norm(end - start)) * self.scale_px_per_m / (2 * dash_px)))
        for k in range(count):
            first, last = start + (end - start) * k / count, start + (end - start) * (k + 0.5) / count
            _bar(self.surface, self._at(first), self._at(last), width_px * OVERSAMPLE, colour)

    def trail(self, points_m: np.ndarray, colour: Colour, width_px: float) -> None:
        """Draw a track that fades towards its beginning."""
        points = [self._at(point) for point in points_m]
        if len(points) < 2:
            return
        corner = np.floor(np.min(points, axis=0)) - 8
        span = np.ceil(np.max(points, axis=0)) + 8 - corner
        layer = pygame.Surface((int(span[0]), int(span[1])), pygame.SRCALPHA, 32)
        for k in range(1, len(points)):
            alpha = round(190 * (k / len(points)) ** 1.5)
            start, end = np.subtract(points[k - 1], corner), np.subtract(points[k], corner)
            _bar(layer, tuple(start), tuple(end), width_px * OVERSAMPLE, (*colour, alpha))
        self.surface.blit(layer, tuple(corner))

    def arrow(self, start_m: Point, end_m: Point, colour: Colour, width_px: float, edge: Colour | None = None) -> None:
        """Draw an arrow; ``edge`` outlines it so that it stands out."""
        start, end = np.array(self._at(start_m)), np.array(self._at(end_m))
        length = float(np.linalg.norm(end - start))
        if length < 2.0:
            return
        along = (end - start) / length
        across = np.array([-along[1], along[0]])
        half, head = width_px * OVERSAMPLE / 2, min(length, (4 + 2.6 * width_px) * OVERSAMPLE)
        neck, wing = end - along * head * 0.85, head * 0.48
        shaft = [start - across * half, neck - across * half, neck - across * wing, end]
        points = [*shaft, neck + across * wing, neck + across * half, start + across * half]
        if edge is not None:
            pygame.draw.polygon(self.surface, edge, points, 2 * OVERSAMPLE + 1)
        pygame.draw.polygon(self.surface, colour, points)

    def _at(self, point_m: Point) -> tuple[float, float]:
        return self._origin[0] + point_m[0] * self._scale, self._origin[1] - point_m[1] * self._scale

    def _circle(self, centre_m: Point, radius: float, colour: Colour, opacity: float, width: int) -> None:
        """Draw a translucent disc, or a ring if ``width`` > 0."""
        x, y = self._at(centre_m)
        half = math.ceil(radius + width + 2)
        box = pygame.Rect(round(x) - half, round(y) - half, 2 * half, 2 * half)
        layer = pygame.Surface(box.size, pygame.SRCALPHA, 32)
        middle = (box.width / 2, box.height / 2)
        pygame.draw.circle(layer, (*colour, round(255 * opacity)), middle, radius + width / 2, width)
        self.surface.blit(layer, box)


def _bar(
    surface: pygame.Surface, start: Sequence[float], end: Sequence[float], width: float, colour: Sequence[int]
) -> None:
    """Draw a straight bar of any width; pygame's own thick lines have slanted ends."""
    along_x, along_y = end[0] - start[0], end[1] - start[1]
    length = math.hypot(along_x, along_y)
    if length == 0.0:
        return
    x, y = -along_y / length * width / 2, along_x / length * width / 2
    corners = [(start[0] + x, start[1] + y), (end[0] + x, end[1] + y)]
    corners += [(end[0] - x, end[1] - y), (start[0] - x, start[1] - y)]
    pygame.draw.polygon(surface, colour, corners)
