"""The rules over boats that something else moves, and games set from outside."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.shield.exceptions import GameError
from steerclear.shield.platforms import layout as L

SEEN = [L.X, L.Y, L.HEADING, L.SPEED]
RULED = (
    "is_tagged", "has_flag", "oob", "on_side", "tagging_cooldown_s", "made_tag", "collisions", "new_collisions",
    "touching", "flag_position", "flag_taken", "captures", "grabs", "tags", "events", "time_s", "terminated",
    "truncated", "previous_position",
)  # fmt: skip


@settings(derandomize=True, deadline=None, max_examples=8)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["heron", "si"]), st.sampled_from(["own_side", "own_base"]))
def test_a_referee_of_a_game_comes_to_the_games_own_verdicts(seed, platform, capture_at):
    config = GameConfig.preset(
        "aamas2024", platforms=platform, capture_at=capture_at, default_start=False, max_score=3, flag_keepout_m=0.0
    )
    game, referee = BatchedMctf(config, n_games=3, seed=seed), BatchedMctf(config, n_games=3, seed=1)
    referee.start_seen(game.state[..., SEEN])
    random = np.random.default_rng(seed)
    goals = random.uniform(0.0, 1.0, (3, 6, 2)) * config.env_bounds_m
    for step in range(250):
        if step % 60 == 0:
            goals = random.uniform(-0.05, 1.05, (3, 6, 2)) * config.env_bounds_m
        dx, dy = np.moveaxis(goals - game.state[..., :2], -1, 0)
        heading = (np.degrees(np.arctan2(dx, dy)) - game.state[..., L.HEADING] + 180.0) % 360.0 - 180.0
        game.step(np.stack([np.full((3, 6), 2.0), heading], axis=-1))
        referee.follow(game.state[..., SEEN], config.dt_s)
        for name in RULED:
            assert np.array_equal(getattr(game, name), getattr(referee, name)), f"{name}, step {step}"
        assert (referee.observe() == game.observe()).all()


def test_the_rules_above_are_put_to_use():
    """The games of the property above hold tags, grabs, captures and boats out of bounds."""
    config = GameConfig.preset("aamas2024", platforms="si", flag_keepout_m=0.0)
    referee = BatchedMctf(config, seed=0)
    seen = referee.state[..., SEEN].copy()
    referee.start_seen(seen)
    for place in ((69.0, 20.0), (69.5, 20.0), (41.0, 20.0), (39.0, 20.0), (38.0, 20.0)):
        seen[0, 0, :2] = place
        referee.follow(seen, 0.1)
    assert (referee.grabs[0, 0], referee.captures[0, 0]) == (1, 1)
    seen[0, 0, 1] = -1.0
    referee.follow(seen, 0.1)
    assert referee.oob[0, 0]
    assert referee.is_tagged[0, 0]
    assert referee.state[0, 0, L.Y] == -1.0, "nothing moves a boat that is followed"


def test_hitting_an_obstacle_costs_what_it_costs_in_the_game():
    config = GameConfig.preset(
        "aamas2024", team_size=1, platforms="si", tag_on_collision=True, obstacles={"circle": [(3.0, (50.0, 5.0))]}
    )
    game, referee = BatchedMctf(config, seed=0), BatchedMctf(config, seed=0)
    game.reset_game(0, {"agent_position": {"agent_0": (50.0, 12.0)}, "agent_has_flag": {"agent_0": 1}})
    referee.restore(game.view())
    hits = 0
    for _ in range(20):
        game.step(np.array([[[5.0, 180.0 - game.state[0, 0, L.HEADING]], [0.0, 0.0]]]))
        referee.follow(game.state[..., SEEN], 0.1)
        assert (referee.is_tagged == game.is_tagged).all()
        assert (referee.has_flag == game.has_flag).all()
        hits += int(game.is_tagged[0, 0])
    assert hits
    assert not referee.has_flag.any()


def test_a_boat_that_is_nowhere_is_out_of_play_until_seen_again():
    referee = BatchedMctf("aamas2024", seed=0)
    seen = referee.state[..., SEEN].copy()
    seen[0, 0, :2] = (69.0, 20.0)
    referee.start_seen(seen)
    assert referee.has_flag[0, 0]
    lost = seen.copy()
    lost[0, 0] = np.nan
    referee.follow(lost, 0.1)
    assert referee.oob[0, 0]
    assert not referee.has_flag.any()
    np.testing.assert_array_equal(referee.flag_position[0], referee.flag_home)
    for _ in range(5):
        referee.follow(lost, 0.1)
    assert referee.events[0].sum() == 0
    seen[0, 0, :2] = (12.0, 20.0)
    referee.follow(seen, 0.1)
    assert not referee.oob[0, 0]
    assert not referee.is_tagged[0, 0], "seen again at its own flag"
    assert np.isnan(lost[0, 0]).all(), "what is handed over is not written to"


def test_clock_and_cooldown_go_by_the_time_given():
    referee = BatchedMctf("aamas2024", seed=0)
    seen = referee.state[..., SEEN].copy()
    referee.start_seen(seen)
    referee.tagging_cooldown_s[0, 2] = 1.0
    for dt_s in (0.37, 0.0, 2.0):
        referee.follow(seen, dt_s)
    assert referee.time_s[0] == pytest.approx(2.37)
    assert referee.tagging_cooldown_s[0, 2] == pytest.approx(3.37)
    assert referee.tagging_cooldown_s[0, 0] == 10.0
    assert referee.rules.dt_s == 0.1


@pytest.mark.parametrize(
    ("seen", "dt_s", "words"),
    [
        (np.zeros((1, 6, 3)), 0.1, r"seen has shape \(1, 6, 3\)"),
        (np.full((1, 6, 4), np.inf), 0.1, "not finite"),
        (np.where(np.arange(4) == 2, np.nan, 1.0) * np.ones((1, 6, 4)), 0.1, "NaN as the x"),
        (np.ones((1, 6, 4)), -0.1, "dt_s is -0.1"),
        (np.ones((1, 6, 4)), np.nan, "dt_s is nan"),
    ],
)
def test_unusable_sights_are_refused(seen, dt_s, words):
    referee = BatchedMctf("aamas2024", seed=0)
    before = referee.state.copy()
    with pytest.raises(GameError, match=words):
        referee.follow(seen, dt_s)
    np.testing.assert_array_equal(referee.state, before)


def test_a_restored_game_looks_like_the_original():
    played = MctfEnv("aamas2024")
    played.reset(seed=3)
    for step in range(120):
        actions = {a: (step // 10 + i) % 17 for i, a in enumerate(played.agents)}
        observations, _, _, _, infos = played.step(actions)
    other = MctfEnv("aamas2024")
    other.core.restore(played.view())
    restored, restored_infos = other.core.observe(), other._info_writer.infos()
    for i, agent_id in enumerate(played.possible_agents):
        np.testing.assert_array_equal(restored[0, i], observations[agent_id])
        assert restored_infos[agent_id]["unnorm_obs"] == infos[agent_id]["unnorm_obs"]
    for name, value in vars(played.view()).items():
        if name != "config":
            np.testing.assert_array_equal(getattr(other.view(), name), value)


def test_a_view_of_other_boats_is_refused():
    one, other = BatchedMctf("aamas2024"), BatchedMctf(GameConfig.preset("aamas2024", team_size=2))
    with pytest.raises(GameError, match="state of the view has shape"):
        one.restore(other.view())
    with pytest.raises(GameError, match="there is no game 1"):
        one.restore(one.view(), 1)
