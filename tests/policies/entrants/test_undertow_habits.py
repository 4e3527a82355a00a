"""Undertow's habits: who goes on as before is known ahead, who sails at our boats is not."""

import math

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.policies.entrants.sight import look
from steerclear.policies.entrants.undertow.habits import LEAD, WARY, Habits
from test_undertow import moved

ROUND_S = 20.0


@pytest.fixture
def sight():
    env = MctfEnv("aamas2024")
    env.reset(seed=1)
    return look(env.core, 0)


def circling(time_s):
    """Where a boat is that circles once in `ROUND_S`."""
    angle = 2.0 * math.pi * time_s / ROUND_S
    return {"x": 60.0 + 5.0 * math.cos(angle), "y": 20.0 - 5.0 * math.sin(angle), "heading": angle + math.pi}


def watched(sight, seconds, place=circling, begin_s=0, habits=None):
    """Habits of opponents of which the third does as it is told."""
    habits = habits or Habits(3)
    for second in range(begin_s, begin_s + seconds):
        assert habits.look(moved(sight, float(second), foes={2: {"on_side": True, "tagged": False, **place(second)}}))
    return habits


def test_it_looks_once_a_second(sight):
    habits = Habits(3)
    assert habits.look(sight)
    assert not habits.look(moved(sight, 0.9))
    assert habits.look(moved(sight, 1.0))


def test_who_circles_is_expected_to_go_on_circling(sight):
    habits = watched(sight, 60)
    assert habits.settled(2)
    track = habits.track(2, 70)
    expected = [(circling(60 + k)["x"], circling(60 + k)["y"]) for k in range(70)]
    np.testing.assert_allclose(track[:, :2], expected, atol=1e-6)
    assert track[:, 2].all()


def test_nothing_is_known_before_the_first_round_is_over(sight):
    habits = watched(sight, int(ROUND_S) + LEAD)
    assert not habits.settled(2)
    assert habits.track(2, 10) is None


def test_who_leaves_its_circle_is_not_relied_on_for_long(sight):
    habits = watched(sight, 60)
    watched(sight, 5, lambda second: {"x": 60.0 - 2.0 * (second - 60), "y": 20.0, "heading": 0.0}, 60, habits)
    assert not habits.settled(2)
    watched(sight, 4 * WARY, begin_s=65, habits=habits)
    assert not habits.settled(2)
    watched(sight, 12 * WARY, begin_s=65 + 4 * WARY, habits=habits)
    assert habits.settled(2)


def test_a_tagged_boat_is_likened_to_tagged_ones_and_cannot_tag(sight):
    def place(second):
        phase = second % 14
        return {"x": 45.0 + 2.0 * min(phase, 14 - phase), "y": 20.0, "heading": math.pi / 2.0, "tagged": phase < 7}

    habits = watched(sight, 60, place)
    assert habits.track(2, 20)[:, 2].tolist() == [1.0 - place(60 + k)["tagged"] for k in range(20)]


@pytest.mark.parametrize(("name", "some"), [("chao", True), ("easy", True), ("hard", False), ("medium", False)])
def test_of_the_opponents_those_that_never_chase_keep_a_habit(name, some):
    """Circling boats and patrols do; guards and attackers that see us do not, with a team that sails about."""
    config = GameConfig.preset("aamas2024", default_start=False)
    env = MctfEnv(config, action_kind="continuous")
    observations, infos = env.reset(seed=3)
    own, foes = policies.make("undertow"), policies.make(name)
    own.reset(env, env.possible_agents[:3], 1)
    foes.reset(env, env.possible_agents[3:], 2)
    while env.core.time_s[0] < 75.0:
        actions = own.act(observations, infos) | foes.act(observations, infos)
        observations, _, _, _, infos = env.step(actions)
    assert any(own._raid.watch.habits.settled(number) for number in range(3)) == some
