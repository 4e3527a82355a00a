"""Red plays the same game as blue: turned half round and with the teams swapped, everything comes out the same."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.shield.platforms import layout as L

ISLANDS = {"circle": [(3.0, (25.0, 12.0)), (3.0, (55.0, 28.0))]}


@pytest.mark.parametrize(("platform", "obstacles"), [("heron", ISLANDS), ("surveyor", None), ("si", ISLANDS)])
@settings(derandomize=True, deadline=None, max_examples=6)
@given(seed=st.integers(0, 10_000))
def test_swapped_teams_play_the_turned_game(platform, obstacles, seed):
    config = GameConfig.preset(
        "aamas2024", platforms=platform, obstacles=obstacles, default_start=False, on_side_start=False
    )
    core, turned = BatchedMctf(config, seed=seed), BatchedMctf(config, seed=seed)
    swap = [3, 4, 5, 0, 1, 2]
    assume(not core.events.any())  # what the places themselves cause would happen twice
    turned.reset_game(0, turned_start(core, swap))
    random = np.random.default_rng(seed)
    wanted = np.zeros((1, 6, 2))
    for t in range(200):
        if t % 10 == 0:
            wanted[0] = np.stack([random.uniform(0, 6, 6), random.uniform(-90, 90, 6)], axis=-1)
        core.step(wanted)
        turned.step(wanted[:, swap])
        assert_turned(core, turned, swap)


def turned_start(core, swap):
    state = core.state[0][swap]
    init = {
        "agent_position": core.field.size - state[:, :2],
        "agent_speed": state[:, L.SPEED],
        "agent_heading": (state[:, L.HEADING] + 360.0) % 360.0 - 180.0,
        "agent_has_flag": core.has_flag[0][swap],
        "agent_is_tagged": core.is_tagged[0][swap],
        "agent_tagging_cooldown": core.tagging_cooldown_s[0][swap],
    }
    return init | {name: getattr(core, name)[0][::-1] for name in ("captures", "tags", "grabs")}


def assert_turned(core, turned, swap):
    np.testing.assert_allclose(turned.state[0, :, :2], core.field.size - core.state[0][swap][:, :2], atol=1e-6)
    np.testing.assert_allclose(turned.state[0, :, L.SPEED], core.state[0][swap][:, L.SPEED], atol=1e-6)
    for name in ("is_tagged", "has_flag", "oob", "on_side", "driven", "collisions"):
        np.testing.assert_array_equal(getattr(turned, name)[0], getattr(core, name)[0][swap], err_msg=name)
    for name in ("captures", "grabs", "tags", "flag_taken", "events"):
        np.testing.assert_array_equal(getattr(turned, name)[0], getattr(core, name)[0][::-1], err_msg=name)
    np.testing.assert_allclose(turned.rewards[0], core.rewards[0][swap])
    # the obstacles, which come last, change places
    difference = turned.observations[0, :, :61].astype(float) - core.observations[0][swap][:, :61]
    # normalised bearings of +1 and -1 are one direction
    assert np.minimum(np.abs(difference), np.abs(np.abs(difference) - 2.0)).max() < 1e-5
