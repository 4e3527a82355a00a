"""Pictures of a game: ``Renderer`` for a live one, ``save_frame`` and ``save_animation`` for a record.

Each is imported on first use: drawing needs pygame (extra ``game``), films need ffmpeg (extra ``film``).
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

from steerclear.shield.extras import missing

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # otherwise importing pygame writes to standard output

if TYPE_CHECKING:
    from steerclear.env.render.animation import save_animation, save_frame
    from steerclear.env.render.canvas import THEMES
    from steerclear.env.render.renderer import MODES, Picture, Renderer
    from steerclear.env.render.scene import Arena, Overlay, Scene

__all__ = ["MODES", "THEMES", "Arena", "Overlay", "Picture", "Renderer", "Scene", "save_animation", "save_frame"]
_HOME = {
    "animation": ("save_animation", "save_frame"),
    "canvas": ("THEMES",),
    "renderer": ("MODES", "Picture", "Renderer"),
    "scene": ("Arena", "Overlay", "Scene"),
}


def __getattr__(name: str) -> Any:
    """Import a name from the module that holds it.

    Raises:
        ConfigError: a drawing package is not installed; the message names the extra.
    """
    home = next((module for module, names in _HOME.items() if name in names), None)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(import_module(f".{home}", __name__), name)
    except ModuleNotFoundError as error:
        raise missing(error, f"{__name__}.{name}") or error from error
