"""The rules of the 2026 competition: several steps a decision, corners, power plays."""

import numpy as np
import pytest
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.shield.exceptions import GameError


def same_commands(_, commands):
    return commands.copy()


def random_wishes(t, games, boats):
    rng = np.random.default_rng(t)
    return np.stack([rng.uniform(0, 3, (games, boats)), rng.uniform(-60, 60, (games, boats))], axis=-1)


@pytest.mark.parametrize("steps", [1, 3, 10])
@pytest.mark.parametrize("preset", ["aamas2024", "mctf2025", "mctf2026"])
def test_every_preset_holds_commands_for_any_number_of_steps(preset, steps):
    """A filter that changes nothing, asked before every step, and none at all play the same game."""
    config = GameConfig.preset(preset, decision_steps=steps, default_start=False, on_side_start=False, max_time_s=60.0)
    one, two = BatchedMctf(config, 3, seed=5), BatchedMctf(config, 3, seed=5)
    for t in range(25):
        wanted = random_wishes(t, 3, 6)
        one.step(wanted)
        two.step(wanted, same_commands)
    for name in ("state", "is_tagged", "is_disabled", "collisions", "contacts", "observations", "time_s"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name), err_msg=name)
    assert one.time_s[0] == pytest.approx(25 * steps * 0.1)


@pytest.mark.parametrize(
    ("share", "time_s", "length"),
    [(0.2, 100.0, 20), (0.5, 100.0, 50), (0.5, 97.0, 48), (0.4, 100.0, 40), (0.07, 100.0, 7), (0.3, 98.0, 29)],
)
def test_power_plays_disable_one_boat_of_each_team_for_a_share_of_the_game_and_never_both(share, time_s, length):
    """Also where the share is no whole number of decisions, and where both together last as long as the game."""
    core = BatchedMctf(GameConfig.preset("mctf2026", max_time_s=time_s, power_play_share=share), 50, seed=3)
    disabled = []
    for _ in range(int(time_s)):
        core.step(np.zeros((50, 6, 2)))
        disabled.append(core.is_disabled.copy())
    seen = np.array(disabled)
    assert (seen.sum(axis=2) <= 1).all()
    assert (seen[..., :3].any(axis=2).sum(axis=0) == length).all()
    assert (seen[..., 3:].any(axis=2).sum(axis=0) == length).all()
    starts = core.power_start
    assert (np.abs(starts[:, 0] - starts[:, 1]) >= length).all()
    assert len(np.unique(starts)) > (20 if share < 0.5 else 1)


def test_a_filter_that_fails_before_anything_moved_leaves_the_power_play_to_begin():
    def failing(_, commands):
        raise GameError("no")

    core = BatchedMctf(GameConfig.preset("mctf2026", max_time_s=10.0), seed=1)
    core.reset_game(0, {"power_play_start": (0, 5), "power_play_boats": ((1, 2), (3, 4))})
    with pytest.raises(GameError):
        core.step(np.zeros((1, 6, 2)), failing)
    assert not core.is_disabled.any()
    core.step(np.zeros((1, 6, 2)))
    assert np.flatnonzero(core.is_disabled[0]).tolist() == [1]


def test_tags_may_fail_by_chance_and_cost_the_cool_down():
    config = GameConfig.preset("mctf2026", tag_probability=0.3, power_play_share=0.0, team_size=1, max_score=1)
    games = BatchedMctf(config, 400, seed=2)
    init = {"agent_position": [(70.0, 40.0), (84.0, 40.0)], "agent_speed": [0.0, 3.0], "agent_heading": [90.0, -90.0]}
    for b in range(400):
        games.reset_game(b, init)
    for _ in range(8):
        games.step(np.array([[[0.0, 0.0], [3.0, 0.0]]] * 400))
    tried = (games.tagging_cooldown_s < 60.0).any(axis=1)
    share = games.tags.sum() / tried.sum()
    assert tried.sum() > 300
    assert 0.2 < share < 0.4


@pytest.mark.parametrize("boats", [(0, 1), (-1, 3), (0.5, 3), "01", ((0, 1, 2), (3, 4, 5))])
def test_power_plays_of_no_boats_are_refused(boats):
    with pytest.raises(GameError, match="power_play_boats is"):
        BatchedMctf("mctf2026").reset_game(0, {"power_play_boats": boats})
