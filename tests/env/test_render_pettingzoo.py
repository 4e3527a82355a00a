import warnings

import numpy as np
import pytest
from pettingzoo.utils import parallel_to_aec
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # pettingzoo.test imports games of its own the old way
    from pettingzoo.test import render_test


@pytest.fixture(autouse=True)
def _no_screen(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


class Dark(MctfEnv):
    """Draws nothing."""

    def render(self, overlay=None):
        picture = super().render(overlay)
        return None if picture is None else np.zeros_like(picture)


class Flat(MctfEnv):
    """Draws without colours."""

    def render(self, overlay=None):
        picture = super().render(overlay)
        return None if picture is None else picture.mean(axis=2).astype(np.uint8)


def check(game):
    """PettingZoo's suite, which asserts itself, and that a picture shows something."""

    def make(render_mode):
        return parallel_to_aec(game(GameConfig.preset("aamas2024", team_size=1), render_mode=render_mode))

    render_test(make, {"rgb_array": lambda picture: picture.std() > 5})


def test_pettingzoos_own_render_test_passes():
    """Every render mode is asserted by the suite: see the broken games below."""
    check(MctfEnv)


@pytest.mark.parametrize("broken", [Dark, Flat])
def test_the_render_suite_notices_broken_games(broken):
    with pytest.raises(AssertionError):
        check(broken)
