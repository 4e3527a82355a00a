"""``Picture`` turns scenes into surfaces; it keeps the field, which does not change, ready drawn."""

from __future__ import annotations

import math

import numpy as np
import pygame
from steerclear.env.render.arena import Arena
from steerclear.env.render.boats import draw_boats
from steerclear.env.render.canvas import Canvas
from steerclear.env.render.field import draw_field
from steerclear.env.render.labels import draw_labels
from steerclear.env.render.panel import FOOTER_PX, HEADER_PX, draw_header, draw_legend
from steerclear.env.render.scene import Scene
from steerclear.env.render.theme import get_theme
from steerclear.shield.exceptions import ConfigError

MARGIN_PX = 24
MIN_WIDTH_PX = 320
MAX_WIDTH_PX = 4096
BLOCK_PX = 16
"""Both sides are multiples of this, because video encoders work in such blocks."""


class Picture:
    """Draws scenes of one arena.

    Args:
        arena: The field.
        width_px: Width of the picture; the height follows from the field.
        theme: "light" or "dark".

    Raises:
        ConfigError: The width or the theme cannot be used.
    """

    def __init__(self, arena: Arena, width_px: int = 1280, theme: str = "light") -> None:
        if not MIN_WIDTH_PX <= width_px <= MAX_WIDTH_PX:
            raise ConfigError(f"width_px is {width_px}; choose {MIN_WIDTH_PX} to {MAX_WIDTH_PX} pixels.")
        self.arena, self.theme = arena, get_theme(theme)
        width_px = BLOCK_PX * round(width_px / BLOCK_PX)
        inner_px = width_px - 2 * MARGIN_PX
        scale = min(inner_px / arena.bounds_m[0], inner_px / arena.bounds_m[1])
        field_px = arena.bounds_m[0] * scale, arena.bounds_m[1] * scale
        height_px = BLOCK_PX * math.ceil((HEADER_PX + field_px[1] + FOOTER_PX) / BLOCK_PX)
        origin_px = ((width_px - field_px[0]) / 2, HEADER_PX + field_px[1])
        self.size_px = (width_px, height_px)
        self._canvas = Canvas(self.size_px, origin_px, scale)
        draw_field(self._canvas, arena, self.theme)
        self._field = self._canvas.surface.copy()

    def still(self) -> pygame.Surface:
        """Return the field alone."""
        self._canvas.surface.blit(self._field, (0, 0))
        return self._canvas.finished()

    def draw(self, scene: Scene, show_commands: bool = True) -> pygame.Surface:
        """Draw a moment.

        Args:
            scene: The moment.
            show_commands: Draw wanted and sent commands, where the scene has them.

        Returns:
            A surface of ``size_px``.
        """
        self._canvas.surface.blit(self._field, (0, 0))
        draw_boats(self._canvas, scene, self.arena, self.theme, show_commands)
        surface = self._canvas.finished()
        draw_labels(surface, self._canvas, scene, self.arena, self.theme)
        draw_header(surface, scene, self.arena, self.theme, MARGIN_PX)
        draw_legend(surface, self.arena, self.theme, MARGIN_PX)
        return surface


def pixels(surface: pygame.Surface) -> np.ndarray:
    """Return a surface as (height, width, 3) uint8, red-green-blue."""
    return np.ascontiguousarray(pygame.surfarray.array3d(surface).swapaxes(0, 1))
