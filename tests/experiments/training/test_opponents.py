"""Opponents: drawn by the league's rule, kept to a game's end, held back, asked seldom."""

import numpy as np
import pytest
from steerclear.experiments.training.config import SELF, League, Stage, config_of
from steerclear.experiments.training.env import core_of
from steerclear.experiments.training.opponents import EachGame, Pool
from steerclear.policies.entrants.learned.network import Features, Network
from steerclear.shield.platforms import layout as L

NONE = Features(np.zeros(0, np.int64), np.zeros(0, np.int64), 0.0)


def test_those_who_beat_the_learner_come_more_often():
    pool = Pool(Stage(opponents=("hold", "easy")), League(power=2.0, floor=0.1), 0)
    pool.scores["hold"].extend([1.0] * 10)
    pool.scores["easy"].extend([0.0] * 10)
    assert pool.weights() == pytest.approx({"hold": 0.1, "easy": 1.1})
    draws = [pool._draw() for _ in range(600)]
    assert 0.85 < draws.count("easy") / 600 < 0.97


def test_a_game_that_ended_counts_as_won_drawn_or_lost_by_the_learner():
    core = core_of(config_of({}), 3, 0)
    core.reset(seed=0)
    pool = Pool(Stage(opponents=("hold",)), League(), 0)
    pool.reset(core, 1, 0)
    core.captures[:] = [[2, 0], [1, 1], [0, 1]]
    pool.ended(core, np.array([True, True, True]))
    assert list(pool.scores["hold"]) == [1.0, 0.5, 0.0]


def test_a_game_keeps_its_opponent_to_its_end():
    """Also a snapshot that made room for a later one: it is drawn no more."""
    core = core_of(config_of({}), 20, 0)
    core.reset(seed=0)
    pool = Pool(Stage(opponents=("hold", SELF)), League(keep=1), 0)
    network = Network([np.zeros((1, core.n_obs, 17), np.float32)], [np.zeros((1, 17), np.float32)], NONE, "tanh",
                      "discrete", 10, core.n_obs)  # fmt: skip
    pool.add_snapshot(network, 1)
    pool.reset(core, 1, 0)
    before = pool.playing.copy()
    assert set(before) == {"hold", "self_1"}
    pool.add_snapshot(network, 2)
    pool.act(core, 1)
    assert (pool.playing == before).all()
    pool.restart(np.ones(20, np.bool_), 1)
    assert set(pool.playing) == {"hold", "self_2"}
    assert set(pool.members) == {"hold", "self_2"}


def test_each_game_draws_how_long_its_opponents_wait_and_anew_when_it_begins_anew():
    core = core_of(config_of({}), 50, 0)
    core.reset(seed=0)
    pool = Pool(Stage(opponents=("hold",), cooldown_s=(10.0, 30.0)), League(), 0)
    pool.reset(core, 1, 0)
    before = pool.waits_s.copy()
    assert 10.0 <= before.min() < 14.0
    assert 26.0 < before.max() <= 30.0
    chosen = np.arange(50) < 10
    pool.restart(chosen, 1)
    assert ((pool.waits_s != before) == chosen).all()
    core.tagging_cooldown_s[:] = 0.0
    for _ in range(100):
        pool.act(core, 1)
        core.step(np.zeros((50, core.n_boats, 2)))
    assert core.tagging_cooldown_s[:, 3:] == pytest.approx(
        np.repeat(100.0 / pool.waits_s[:, None], 3, axis=1), abs=0.11
    )


def test_a_policy_of_single_games_that_is_asked_seldom_holds_its_courses_in_between():
    core = core_of(config_of({}), 1, 0)
    core.reset(seed=3)
    seldom = EachGame("meo", 10)
    seldom.reset(core, 1, 0)
    courses, commands = [], np.zeros((1, core.n_boats, 2))
    for _ in range(30):
        commands[:, 3:] = seldom.act(core, 1)
        courses.append((core.state[0, 3:, L.HEADING] + commands[0, 3:, 1]) % 360.0)
        core.step(commands)
    changed = [k for k in range(1, 30) if not np.allclose(courses[k], courses[k - 1], atol=1e-6)]
    assert changed == [10, 20]
