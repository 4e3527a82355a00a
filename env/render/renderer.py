"""``Renderer`` shows a live game, in a window or as arrays."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np
from steerclear.env.config import GameConfig
from steerclear.env.render.arena import Arena
from steerclear.env.render.picture import Picture, pixels
from steerclear.env.render.scene import TRAIL_S, Overlay, Scene
from steerclear.env.render.window import Window
from steerclear.shield.exceptions import ConfigError

MODES = ("human", "rgb_array")


class Renderer:
    """Shows a live game. "rgb_array" needs no display; "human" opens a window at the first picture.

    Args:
        game: The game's config, a record's ``meta``, or an ``Arena``.
        mode: One of ``MODES``.
        width_px: Width of the picture; the height follows from the field.
        theme: "light" or "dark".
        show_commands: Draw wanted and sent commands when ``draw`` is given them.
        speedup: In a window, how many times faster than real time to go at most; None does not wait. It may be
            changed at any time.

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
        self.mode, self.arena = mode, _arena_of(game)
        self.show_commands = show_commands
        self._looks = (width_px, theme)
        self._picture = Picture(self.arena, *self._looks)
        self.speedup = speedup
        self.overlay: Overlay | None = None
        """What `draw` shows when it is given no overlay: whoever sends the commands may leave them here."""
        self._window: Window | None = None
        self._track: deque[np.ndarray] = deque(maxlen=max(2, round(TRAIL_S / self.arena.dt_s)))
        self._last_s = -np.inf

    def describe(self, game: Mapping[str, Any] | Arena) -> None:
        """Take over what the game's config does not tell: shielded boats, separation, policies, reasons.

        Args:
            game: A record's ``meta``, see ``meta_of``, or an ``Arena``; of the same field.

        Raises:
            TraceError: The settings cannot be drawn.
        """
        self.arena = _arena_of(game)
        self._picture = Picture(self.arena, *self._looks)

    def draw(self, view: Any, overlay: Overlay | None = None) -> np.ndarray | None:
        """Show a moment; the track behind the boats is made of the moments shown so far.

        Args:
            view: A ``GameView``.
            overlay: Commands of the last step and what the shield made of them; None takes ``self.overlay``.

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
            self._window.close()
            self._window = None


def _arena_of(game: GameConfig | Mapping[str, Any] | Arena) -> Arena:
    if isinstance(game, Arena):
        return game
    return Arena.from_config(game) if isinstance(game, GameConfig) else Arena.from_meta(game)
