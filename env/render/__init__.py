"""Pictures of a game: ``Renderer`` for a live one, ``save_frame`` and ``save_animation`` for a record."""

import os

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # else importing pygame writes to standard output

from steerclear.env.render.animation import save_animation, save_frame
from steerclear.env.render.arena import Arena
from steerclear.env.render.picture import Picture
from steerclear.env.render.renderer import MODES, Renderer
from steerclear.env.render.scene import Overlay, Scene
from steerclear.env.render.theme import THEMES

__all__ = ["MODES", "THEMES", "Arena", "Overlay", "Picture", "Renderer", "Scene", "save_animation", "save_frame"]
