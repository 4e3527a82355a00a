"""``Picture`` draws a moment; ``Renderer`` shows a live game, in a window or as arrays."""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np
import pygame
from steerclear.env.config import GameConfig
from steerclear.env.render.boats import draw_boats, draw_field
from steerclear.env.render.canvas import THEMES, Canvas
from steerclear.env.render.panel import FOOTER_PX, HEADER_PX, MARGIN_PX, draw_header, draw_labels, draw_legend
from steerclear.env.render.scene import TRAIL_S, Arena, Overlay, Scene
from steerclear.shield.exceptions import ConfigError

MODES = ("human", "rgb_array")
MIN_WIDTH_PX, MAX_WIDTH_PX = 320, 4096
BLOCK_PX = 16
"""Both sides are multiples of this, the block size of video encoders."""

UNSEEN = ("dummy", "offscreen")
"""Drivers that SDL falls back to without a display: windows open, but nobody sees them."""


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
        if theme not in THEMES:
            raise ConfigError(f"there is no theme {theme!r}; choose {' or '.join(THEMES)}.")
        self.arena, self.theme = arena, THEMES[theme]
        width_px = BLOCK_PX * round(width_px / BLOCK_PX)
        inner_px = width_px - 2 * MARGIN_PX
        scale = min(inner_px / arena.bounds_m[0], inner_px / arena.bounds_m[1])
        field_px = arena.bounds_m[0] * scale, arena.bounds_m[1] * scale
        height_px = BLOCK_PX * math.ceil((HEADER_PX + field_px[1] + FOOTER_PX) / BLOCK_PX)
        self.size_px = (width_px, height_px)
        self._canvas = Canvas(self.size_px, ((width_px - field_px[0]) / 2, HEADER_PX + field_px[1]), scale)
        draw_field(self._canvas, arena, self.theme)
        self._field = self._canvas.surface.copy()

    def still(self) -> pygame.Surface:
        """Return the field alone."""
        self._canvas.surface.blit(self._field, (0, 0))
        return self._canvas.finished()

    def draw(self, scene: Scene, show_commands: bool = True) -> pygame.Surface:
        """Return a surface of ``size_px`` with a moment, with or without its commands."""
        self._canvas.surface.blit(self._field, (0, 0))
        draw_boats(self._canvas, scene, self.arena, self.theme, show_commands)
        surface = self._canvas.finished()
        draw_labels(surface, self._canvas, scene, self.arena, self.theme)
        draw_header(surface, scene, self.arena, self.theme)
        draw_legend(surface, self.arena, self.theme)
        return surface


def pixels(surface: pygame.Surface) -> np.ndarray:
    """Return a surface as (height, width, 3) uint8, red-green-blue."""
    return np.ascontiguousarray(pygame.surfarray.array3d(surface).swapaxes(0, 1))


class Renderer:
    """Shows a live game. "rgb_array" needs no display; "human" opens a window at the first picture.

    Args:
        game: The game's config, a record's ``meta``, or an ``Arena``.
        mode: One of ``MODES``.
        width_px: Width of the picture; the height follows from the field.
        theme: "light" or "dark".
        show_commands: Draw nominal and filtered commands if ``draw`` gets them.
        speedup: In a window, how many times faster than real time to go at most; None does not wait. It may be changed
            at any time.

    Raises:
        ConfigError: The mode, the width or the theme cannot be used.
    """

    def __init__(
        self,
        game: GameConfig | Mapping[str, Any] | Arena,
        mode: str = "rgb_array",
        width_px: int = 1280,
        theme: str = "light",
        show_commands: bool = True,
        speedup: float | None = 1.0,
    ) -> None:
        if mode not in MODES:
            raise ConfigError(f"there is no render mode {mode!r}; choose {' or '.join(MODES)}.")
        if speedup is not None and not speedup > 0.0:
            raise ConfigError(f"speedup is {speedup}; it must be positive, or None to go as fast as can be.")
        self.mode, self.show_commands, self.speedup = mode, show_commands, speedup
        self._looks = (width_px, theme)
        self.describe(game)
        self.overlay: Overlay | None = None
        """Overlay that `draw` shows by default; whoever sends the commands may set it."""
        self._window: Window | None = None
        self._track: deque[np.ndarray] = deque(maxlen=max(2, round(TRAIL_S / self.arena.dt_s)))
        self._last_s = -np.inf

    def describe(self, game: GameConfig | Mapping[str, Any] | Arena) -> None:
        """Set what the game's config lacks: shielded boats, separation, policies, reasons.

        Args:
            game: A record's ``meta``, see ``meta_of``, or an ``Arena``; of the same field.

        Raises:
            TraceError: The settings cannot be drawn.
        """
        if isinstance(game, GameConfig):
            game = Arena.from_config(game)
        self.arena = game if isinstance(game, Arena) else Arena.from_meta(game)
        self._picture = Picture(self.arena, *self._looks)

    def draw(self, view: Any, overlay: Overlay | None = None) -> np.ndarray | None:
        """Show a moment. The tracks behind the boats consist of the moments shown so far.

        Args:
            view: A ``GameView``.
            overlay: Nominal and filtered commands of the last step; None takes ``self.overlay``.

        Returns:
            (height, width, 3) uint8 in mode "rgb_array", None in mode "human".

        Raises:
            ConfigError: Mode "human" without a display.
        """
        if float(view.time_s) < self._last_s:
            self._track.clear()
        if float(view.time_s) != self._last_s or not self._track:
            self._track.append(np.array(view.state[:, :2], dtype=float))
        self._last_s = float(view.time_s)
        scene = Scene.from_view(view, np.array(self._track), overlay or self.overlay)
        surface = self._picture.draw(scene, self.show_commands)
        if self.mode == "rgb_array":
            return pixels(surface)
        if self._window is None:
            self._window = Window(self._picture.size_px, "steerclear")
        self._window.show(surface, None if self.speedup is None else self.speedup / self.arena.dt_s)
        return None

    def keys(self) -> set[str]:
        """Return the names of the keys held down ("left", "w", "space"); empty without a window."""
        return self._window.keys() if self._window is not None else set()

    @property
    def window_closed(self) -> bool:
        """Whether the user has closed the window."""
        return self._window is not None and self._window.closed

    def close(self) -> None:
        """Close the window, if there is one; may be called again."""
        if self._window is not None:
            pygame.display.quit()
            self._window = None


class Window:
    """A window on the screen.

    Raises:
        ConfigError: There is no display to open a window on.
    """

    def __init__(self, size_px: tuple[int, int], title: str) -> None:
        try:
            pygame.display.init()
            if pygame.display.get_driver() in UNSEEN and "SDL_VIDEODRIVER" not in os.environ:
                raise pygame.error("no display")
            self._screen = pygame.display.set_mode(size_px)
        except pygame.error as error:
            pygame.display.quit()
            raise ConfigError(
                f"no window can be opened ({error}). Use render_mode='rgb_array' or save a video instead."
            ) from error
        pygame.display.set_caption(title)
        self._clock = pygame.time.Clock()
        self._keys: set[str] = set()
        self._tapped: set[str] = set()
        self.closed = False

    def show(self, surface: pygame.Surface, frames_per_s: float | None) -> None:
        """Show a picture, handle window events, and wait so that frames do not exceed the given rate."""
        self._screen.blit(surface, (0, 0))
        pygame.display.flip()
        self._pump()
        self._clock.tick(frames_per_s or 0)

    def _pump(self) -> None:
        """Read events of the window system and the keyboard."""
        for event in pygame.event.get():
            if event.type == pygame.QUIT:
                self.closed = True
            elif event.type == pygame.KEYDOWN:
                self._keys.add(pygame.key.name(event.key))
                self._tapped.add(pygame.key.name(event.key))
            elif event.type == pygame.KEYUP:
                self._keys.discard(pygame.key.name(event.key))
            elif event.type == pygame.WINDOWFOCUSLOST:
                self._keys.clear()

    def keys(self) -> set[str]:
        """Return the names of the keys held down, or pressed since the last call: "left", "w", "space" and so on."""
        self._pump()
        held, self._tapped = self._keys | self._tapped, set()
        return held
