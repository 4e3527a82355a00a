"""The rules of the 2026 competition: several steps a decision, corners, power plays; parity with recorded games."""

from pathlib import Path

import numpy as np
import pytest
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.env.parity import compare, replay_trace
from steerclear.env.pyquaticus_config import from_pyquaticus
from steerclear.env.trace import load_trace
from steerclear.shield.exceptions import ConfigError, GameError
from steerclear.shield.platforms import layout as L

TRACES = sorted((Path(__file__).parents[1] / "data" / "traces_2026").glob("*.npz"))


def same_commands(_, commands):
    return commands.copy()


def random_wishes(t, games, boats):
    rng = np.random.default_rng(t)
    return np.stack([rng.uniform(0, 3, (games, boats)), rng.uniform(-60, 60, (games, boats))], axis=-1)


@pytest.mark.parametrize("path", TRACES, ids=lambda path: path.stem)
def test_recorded_games_are_replayed(path):
    report = replay_trace(path)
    assert (report.mismatches, report.over()) == ((), {})


def test_the_recorded_games_hold_what_is_new():
    traces = [load_trace(path) for path in TRACES]
    last = [trace.arrays for trace in traces]
    assert {trace.config.decision_steps for trace in traces} == {1, 4, 10}
    assert sum(int(arrays["captures"][-1].sum()) for arrays in last) > 3
    assert all(arrays["is_disabled"].any() for arrays in last)
    assert any((arrays["is_disabled"].sum(axis=1) == 2).any() for arrays in last)
    unseen = [
        arrays["contacts"][-1].sum() - arrays["agent_collisions"][-1].sum() for arrays in last if "contacts" in arrays
    ]
    assert max(unseen) > 0


def test_a_contact_that_the_game_does_not_see_is_found():
    trace = load_trace(next(path for path in TRACES if path.stem == "powerplay10"))
    trace.arrays["contacts"][-1, 0] += 1
    (found,) = compare(trace).mismatches
    assert (found.event, found.who) == ("contacts", "agent_0")


def test_the_competitions_own_settings_are_the_preset():
    settings = load_trace(TRACES[0]).meta["config"]
    assert from_pyquaticus(settings, team_size=3, preset_name="mctf2026") == GameConfig.preset("mctf2026")


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


def test_games_of_a_batch_are_those_played_alone():
    many, alone = BatchedMctf("mctf2026", 4, seed=7), BatchedMctf("mctf2026", 1, seed=7)
    for t in range(40):
        wanted = random_wishes(t, 4, 6)
        many.step(wanted)
        alone.step(wanted[:1])
    np.testing.assert_array_equal(many.state[0], alone.state[0])
    np.testing.assert_array_equal(many.power_start[0], alone.power_start[0])


def test_a_held_relative_heading_turns_the_boat_for_the_whole_decision():
    held, course = BatchedMctf("mctf2026", seed=0), BatchedMctf(GameConfig.preset("mctf2026", decision_steps=1), seed=0)
    wanted = np.tile([3.0, 40.0], (1, 6, 1))
    for core, decisions in ((held, 1), (course, 10)):
        core.reset()
        core.state[..., L.THRUST], core.state[..., L.SPEED] = 100.0, 3.0
        start = core.state[0, 0, L.HEADING]
        for _ in range(decisions):
            core.step(wanted)
    turned = (held.state[0, 0, L.HEADING] - start + 180.0) % 360.0 - 180.0
    assert turned > 8.0
    np.testing.assert_allclose(held.state, course.state, atol=1e-9)


def test_power_plays_disable_one_boat_of_each_team_for_a_fifth_of_the_game_and_never_both():
    core = BatchedMctf(GameConfig.preset("mctf2026", max_time_s=100.0), 50, seed=3)
    disabled = []
    for _ in range(100):
        core.step(np.zeros((50, 6, 2)))
        disabled.append(core.is_disabled.copy())
    seen = np.array(disabled)
    assert (seen.sum(axis=2) <= 1).all()
    assert (seen[..., :3].any(axis=2).sum(axis=0) == 20).all()
    assert (seen[..., 3:].any(axis=2).sum(axis=0) == 20).all()
    starts = core.power_start
    assert (np.abs(starts[:, 0] - starts[:, 1]) >= 20).all()
    assert len(np.unique(starts)) > 20


def test_a_disabled_boat_coasts_cannot_tag_and_is_told_of():
    places = {f"agent_{i}": (69.4, 40.0) if i == 0 else (5.0, 20.0 * i) for i in range(3)}
    places |= {"agent_3": (79.9, 40.0), "agent_4": (150.0, 10.0), "agent_5": (150.0, 70.0)}
    init = {"agent_position": places, "agent_speed": {"agent_0": 1.0, "agent_3": 3.0}}
    init |= {"agent_heading": {"agent_0": 0.0, "agent_3": -90.0}}
    env = MctfEnv("mctf2026", seed=0)
    env.reset(options={"init_dict": init | {"power_play_start": (0, 300), "power_play_boats": (0, 3)}})
    obs, *_, infos = env.step({"agent_0": (3.0, 90.0)})
    core = env.core
    assert (core.is_disabled[0].tolist(), core.driven[0, 0]) == ([True, *[False] * 5], True)
    assert core.state[0, 0, L.HEADING] == 0.0
    assert 0.5 < core.state[0, 0, L.SPEED] < 1.0
    assert infos["agent_0"]["unnorm_obs"]["is_disabled"] is True
    assert infos["agent_3"]["unnorm_obs"][("opponent_0", "is_disabled")] is True
    assert infos["agent_3"]["global_state"][("agent_0", "is_disabled")] is True
    assert env.players["agent_0"].is_disabled
    assert np.hypot(*(core.state[0, 0, :2] - core.state[0, 3, :2])) < 9.0
    assert not core.is_tagged[0].any()
    assert obs["agent_0"].shape == (67,)


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


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"decision_steps": 0}, "decision_steps is 0; give a whole number >= 1"),
        ({"decision_steps": 2.5}, "decision_steps is 2.5; give a whole number"),
        ({"decision_steps": 10**6}, "give at most 1000"),
        ({"tag_probability": 1.5}, "tag_probability is 1.5; it must be <= 1.0"),
        ({"power_play_share": 0.6}, "power_play_share is 0.6; it must be <= 0.5"),
        ({"untag_at": "home"}, "choose one of 'own_flag', 'own_corners'"),
        ({"shows_disabled": 1}, "shows_disabled is 1"),
    ],
)
def test_settings_that_no_game_has_are_refused(settings, message):
    with pytest.raises(ConfigError, match=message):
        GameConfig.preset("mctf2026", **settings)


@pytest.mark.parametrize("speedup", [0, 2.5, "10"])
def test_speedups_that_are_no_whole_number_are_refused(speedup):
    with pytest.raises(ConfigError, match="decision_steps is"):
        from_pyquaticus({"sim_speedup_factor": speedup}, team_size=3)


@pytest.mark.parametrize("boats", [(0, 1), (-1, 3), (0.5, 3), "01", ((0, 1, 2), (3, 4, 5))])
def test_power_plays_of_no_boats_are_refused(boats):
    with pytest.raises(GameError, match="power_play_boats is"):
        BatchedMctf("mctf2026").reset_game(0, {"power_play_boats": boats})
