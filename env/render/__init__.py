"""Pictures of a game: ``Renderer`` for a live one, ``save_frame`` and ``save_animation`` for a record.

Each is imported when it is asked for: what draws needs pygame (extra ``game``), films need ffmpeg (extra ``film``).
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

from steerclear.shield.extras import missing

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # else importing pygame writes to standard output

if TYPE_CHECKING:
    from steerclear.env.render.animation import save_animation, save_frame
    from steerclear.env.render.renderer import MODES, Picture, Renderer
    from steerclear.env.render.scene import THEMES, Arena, Overlay, Scene

__all__ = ["MODES", "THEMES", "Arena", "Overlay", "Picture", "Renderer", "Scene", "save_animation", "save_frame"]
_HOME = {
    "MODES": "renderer",
    "Renderer": "renderer",
    "THEMES": "scene",
    "Arena": "scene",
    "Overlay": "scene",
    "Scene": "scene",
    "Picture": "renderer",
    "save_animation": "animation",
    "save_frame": "animation",
}


def __getattr__(name: str) -> Any:
    """One of the names, from the module that holds it.

    Raises:
        ConfigError: what it draws with is not installed; the message names the extra.
    """
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(import_module(f".{_HOME[name]}", __name__), name)
    except ModuleNotFoundError as error:
        raise missing(error, f"{__name__}.{name}") or error from error
