"""The searching entrant: what a search finds is what a whole rollout says, and a batch plays as single games do."""

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.arrays import make_rules
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.field import field_geometry
from steerclear.env.mctf import MctfEnv
from steerclear.policies.entrants.lucas import hints_for, home_of
from steerclear.policies.evolution import N_MOVES, STOP, copy_game, evolve, follow_plans, make_desk, roll_out, worth_of
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.platforms import layout as L

HORIZON = 8


def scenes(config, every=40, steps=400):
    """A live game of `medium` against `hard`, every so many steps."""
    core = BatchedMctf(config, n_games=2, seed=4)
    teams = [policies.make_batch("medium"), policies.make_batch("hard")]
    for team, policy in enumerate(teams):
        policy.reset(core, team, 1)
    half = config.team_size
    commands = np.zeros((2, 2 * half, 2))
    for step in range(steps):
        if step % every == 0:
            yield core
        commands[:, :half], commands[:, half:] = teams[0].act(core, 0), teams[1].act(core, 1)
        core.step(commands)


@pytest.mark.parametrize(
    "config",
    [
        GameConfig.preset("mctf2025", default_start=False, dt_s=0.2),
        GameConfig.preset("aamas2024", default_start=False, tag_probability=0.5),
        GameConfig.preset("mctf2025", default_start=False, decision_steps=10),
        GameConfig.preset("mctf2025", default_start=False, obstacles={"circle": [(6.0, (60.0, 40.0))]}),
    ],
    ids=["2025", "chance", "long decisions", "obstacle"],
)
def test_what_a_search_found_is_worth_what_a_whole_rollout_says(config):
    rules, rng = make_rules(config, field_geometry(config)), np.random.default_rng(3)
    desk, whole = (make_desk(config, 10, 3, HORIZON, 1.2) for _ in range(2))
    changed, tagged = 0, 0
    for number, core in enumerate(scenes(config)):
        game, boat = number % 2, number % core.n_boats
        plans = rng.integers(0, N_MOVES, (core.n_boats, HORIZON))
        before, home = plans.copy(), home_of(core, int(core.team[boat]), boat, game)
        hints = hints_for(core, boat, home, game)
        found = evolve(rules, core.games, game, plans, boat, hints, home, rng, desk)
        copy_game(whole.marks, 0, core.games, game)
        roll_out(rules, whole, plans, boat, 0, True)
        assert found == worth_of(rules, whole, boat, home)
        others = np.arange(core.n_boats) != boat
        assert (plans[others] == before[others]).all()
        roll_out(rules, whole, before, boat, 0, True)
        assert found >= worth_of(rules, whole, boat, home)
        changed += bool((plans != before).any())
        tagged += int(core.is_tagged.sum())
    assert changed > 5
    assert tagged > 0


def test_a_game_of_a_batch_is_played_as_a_single_one_and_only_those_asked_for():
    config = GameConfig.preset("mctf2025", default_start=False)
    core = BatchedMctf(config, n_games=3, seed=7)
    options = {"population": 4, "generations": 2, "horizon": 5}
    batch = policies.make_batch("lucas", **options)
    batch.reset(core, 1, 20)
    batch.plays(np.array([False, False, True]))
    env = MctfEnv(config, action_kind="continuous")
    env.reset(seed=0)
    team = policies.make("lucas", **options)
    ids = env.possible_agents[3:]
    commands, moved = np.zeros((3, 6, 2)), False
    for step in range(40):
        env.core.restore(core.view(2))
        if step == 0:
            team.reset(env, ids, 22)
        single = team.act({}, {})
        commands[:, 3:] = batch.act(core, 1)
        np.testing.assert_allclose(commands[2, 3:], [single[name] for name in ids], atol=1e-9)
        moved = moved or bool((commands[2, 3:, 0] > 0.0).any())
        core.step(commands)
    assert moved
    assert (batch._plans[:2] == STOP).all()
    assert len(batch.think_times_s) == 4  # one at once for all boats, then one each 1.2 s


def test_a_batch_that_was_not_reset_is_refused():
    with pytest.raises(PolicyError, match="was not reset for team 0"):
        policies.make_batch("lucas").act(BatchedMctf("mctf2025"), 0)
    with pytest.raises(PolicyError, match="'lucas' has no option 'depth'"):
        policies.make_batch("lucas", depth=3)


def test_a_boat_turns_away_from_one_that_is_near_and_not_past():
    core = BatchedMctf(GameConfig.preset("mctf2025", default_start=False), seed=1)
    state, plans, out = core.state[0], np.full((1, 6, 3), 2), np.zeros((1, 3, 2))
    state[:, L.X], state[:, L.Y], state[:, L.HEADING] = 20.0 * np.arange(6) + 10.0, 40.0, 90.0
    own = np.array([0, 1, 2])
    plans[0, 2] = STOP
    follow_plans(core.rules, core.games, plans, own, out)
    top = core.max_speed_mps[0]
    assert out[0].tolist() == [[top, 0.0], [top, 0.0], [0.0, 0.0]]
    state[3, :2] = state[0, 0] + 3.0, 40.0  # ahead of the first boat
    state[4, :2] = state[1, 0] - 3.0, 40.0  # astern of the second
    follow_plans(core.rules, core.games, plans, own, out)
    assert abs(out[0, 0, 1]) == pytest.approx(180.0)
    assert out[0, 1].tolist() == [top, 0.0]
