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


def test_pettingzoos_own_render_test_passes():
    def make(render_mode):
        return parallel_to_aec(MctfEnv(GameConfig.preset("aamas2024", team_size=1), render_mode=render_mode))

    render_test(make, {"rgb_array": lambda picture: isinstance(picture, np.ndarray) and picture.std() > 5})
