"""The window of render mode "human" and the keyboard of a human player."""

from __future__ import annotations

import os

import pygame
from steerclear.shield.exceptions import ConfigError

UNSEEN = ("dummy", "offscreen")
"""Drivers SDL falls back to where there is no display: windows open, and nobody sees them."""


class Window:
    """A window on the screen.

    Args:
        size_px: Width and height.
        title: Text of the title bar.

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
        """Whether the user has closed the window."""

    def show(self, surface: pygame.Surface, frames_per_s: float | None) -> None:
        """Show a picture, answer the window system, and wait so that frames come no faster than asked.

        Args:
            surface: The picture.
            frames_per_s: Most pictures per second; None does not wait.
        """
        self._screen.blit(surface, (0, 0))
        pygame.display.flip()
        self.pump()
        self._clock.tick(frames_per_s or 0)

    def pump(self) -> None:
        """Take in what the window system and the keyboard have to say."""
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
        self.pump()
        held, self._tapped = self._keys | self._tapped, set()
        return held

    def close(self) -> None:
        """Close the window."""
        pygame.display.quit()
