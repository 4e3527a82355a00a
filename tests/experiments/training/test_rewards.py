"""What cannot be earned again and again without a capture."""

from types import SimpleNamespace

import numpy as np
from steerclear.experiments.training.rewards import TERMS, Advance, Denied, Progress
from steerclear.shield.platforms.layout import N_STATE, X, Y

NOW = np.ones(1, np.bool_)


def game():
    """One blue boat of one game, 80 x 40 m, at the own flag."""
    core = SimpleNamespace(
        state=np.zeros((1, 1, N_STATE)),
        has_flag=np.zeros((1, 1), np.bool_),
        is_tagged=np.zeros((1, 1), np.bool_),
        flag_taken=np.zeros((1, 2), np.bool_),
        flag_home=np.array([[10.0, 20.0], [70.0, 20.0]]),
        events=np.zeros((1, 2, 4), np.int64),
        config=SimpleNamespace(env_bounds_m=(80.0, 40.0)),
    )
    core.state[0, 0, [X, Y]] = 10.0, 20.0
    return SimpleNamespace(core=core, boats=np.array([0]), others=np.zeros(0, np.int64), team=0)


def played(term, batch, moments):
    """The term's sum over moments (x, carries, tagged, captured)."""
    term.begin(batch, NOW)
    total = 0.0
    for x, carries, tagged, captured in moments:
        core = batch.core
        core.state[0, 0, X] = x
        core.has_flag[:], core.is_tagged[:], core.flag_taken[0, 1] = carries, tagged, carries
        core.events[0, 0, 0] = captured
        total += float(term.reward(batch, NOW)[0, 0])
    return total


TAGGED = [(30, 0, 0, 0), (60, 1, 0, 0), (50, 1, 0, 0), (45, 0, 1, 0), (12, 0, 0, 0)]
BROUGHT_HOME = [(30, 0, 0, 0), (60, 1, 0, 0), (50, 1, 0, 0), (39, 0, 0, 1), (38, 0, 0, 0)]


def test_a_way_that_ends_in_a_tag_earns_nothing():
    assert abs(played(Advance(), game(), TAGGED * 3)) < 1e-12
    assert played(TERMS["own"](), game(), TAGGED * 3) == 0.0
    assert played(Progress(), game(), TAGGED) > 0.1


KEPT = (20.0 + 10.0) / 80.0
"""What the way to the capture earned: 20 m to the flag, 10 m home with it, in widths."""


def test_a_capture_keeps_what_it_earned():
    batch, term = game(), Advance()
    earned = played(term, batch, BROUGHT_HOME)
    assert earned > 0.3
    term.begin = lambda batch, games: None  # it goes on
    lost = played(term, batch, [(45, 0, 0, 0), (45, 0, 1, 0)])
    assert abs(earned + lost - KEPT) < 1e-9
    assert played(TERMS["own"](), game(), BROUGHT_HOME) == 3.0


def test_who_tags_is_paid_and_nobody_else():
    made = np.array([[-1, 4, -1, -1, 0, -1]])
    ours = SimpleNamespace(core=SimpleNamespace(made_tag=made), boats=np.arange(3), team=0)
    assert TERMS["tagging"]().reward(ours, NOW).tolist() == [[0.0, 1.0, 0.0]]


def seen_by_the_others(batch):
    """The same game with the learners, two of them, in the other team."""
    core = batch.core
    learners = np.array([1, 2])
    core.state, core.has_flag, core.is_tagged = (
        np.concatenate([a, a, a], axis=1) for a in (core.state, core.has_flag, core.is_tagged)
    )
    return SimpleNamespace(core=core, boats=learners, others=batch.boats, team=1)


def earned_by_defending(moments):
    """The sum of `Denied` for two learners over moments (x, carries, tagged, captured) of one opponent."""
    batch, term = seen_by_the_others(game()), Denied()
    term.begin(batch, NOW)
    total = np.zeros((1, 2))
    for x, carries, tagged, _ in moments:
        core = batch.core
        core.state[0, 0, X], core.has_flag[0, 0], core.is_tagged[0, 0] = x, carries, tagged
        core.flag_taken[0, 1] = carries
        total += term.reward(batch, NOW)
    return total


def test_a_tag_gives_the_defenders_what_the_tagged_boat_had_gained():
    np.testing.assert_allclose(earned_by_defending(TAGGED[:3]), -KEPT)
    np.testing.assert_allclose(earned_by_defending(TAGGED), 0.0, atol=1e-12)
    np.testing.assert_allclose(earned_by_defending(BROUGHT_HOME), -KEPT + 1.0 / 80.0)  # it sails 1 m off
