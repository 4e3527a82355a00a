"""A decision whose work is at its limit searches no further: it keeps what it has verified, and says so."""

import numpy as np
import pytest
from shield_loops import Wander, sail, sail_games, scattered
from shield_scenes import crowded_edge, distances, fleet_of
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig, Surroundings
from steerclear.shield.decision import Reason
from steerclear.shield.platforms import fresh_state
from steerclear.shield.platforms import layout as L

LEAST = 1000.0
"""The lowest limit there is."""


def on_a_circle(n, radius_m, top_mps):
    """Boats on a circle, each heading for the opposite point."""
    angle = 2.0 * np.pi * np.arange(n) / n
    rows = [fresh_state(radius_m * np.sin(a), radius_m * np.cos(a), np.degrees(a) + 180.0, top_mps) for a in angle]
    return np.array(rows)


def fleet_of_rows(state, team, platform):
    n = len(state)
    return Fleet(state, np.array(team), (platform,) * n, np.array(team) == 0, tuple(f"boat_{i}" for i in range(n)))


@pytest.mark.parametrize(("platform", "top_mps"), [("heron", 2.0), ("surveyor", 3.0)])
def test_team_mates_that_may_hardly_search_keep_their_distance(platform, top_mps):
    state = on_a_circle(6, 40.0, top_mps)
    straight = np.tile([top_mps, 0.0], (6, 1))
    run = sail(Shield(work_budget=LEAST), fleet_of_rows(state, [0] * 6, platform), lambda *_: straight, 350)
    assert (run.reason != Reason.PASSED).any()
    assert distances(run.position).min() >= 2.5


def crowd(seed):
    """Twelve boats of ours among eight others, all near each other, and commands that take them into each other."""
    state = scattered(np.random.default_rng(seed), 1, ["heron"] * 20, 30.0)[0]
    return fleet_of_rows(state, [0] * 12 + [1] * 8, "heron"), Commands.relative_deg(np.tile([2.0, 120.0], (20, 1)))


def test_it_is_told_that_the_search_was_cut_short():
    fleet, wanted = crowd(1)
    cut = Shield(work_budget=LEAST).decide(fleet, wanted)
    free = Shield(work_budget=np.inf).decide(fleet, wanted)
    assert [d.cut_short for d in cut] == [True] * 12 + [False] * 8  # never of boats that are not decided for
    assert not any(d.cut_short for d in free)
    assert np.isfinite(cut.filtered.values).all()


def test_ordinary_decisions_do_not_come_near_the_limit():
    """The same bits with the default limit and without one, in crowded games of three against three."""
    platforms, team = ["heron"] * 6, [0, 0, 0, 1, 1, 1]
    state = scattered(np.random.default_rng(2), 6, platforms, 20.0)
    runs = [
        sail_games(ShieldConfig(**one), state.copy(), platforms, team, Wander(3, 6, platforms), 100)
        for one in ({}, {"work_budget": np.inf})
    ]
    assert (runs[0].sent == runs[1].sent).all()
    assert (runs[0].reason != Reason.PASSED).any()


def test_who_backs_up_when_the_search_is_over_is_not_sent_what_it_wanted():
    """Though teammates have just joined, and not all have a manoeuvre from where they are."""
    backed_up = 0
    for seed in range(25):
        random = np.random.default_rng(seed)
        rows, team, courses = map(list.__add__, crowded_edge(random, 100.0), crowded_edge(random, 112.0))

        def wanted(_, state, courses=courses):
            error = (np.array(courses) - state[:, L.HEADING] + 180.0) % 360.0 - 180.0
            return np.stack([np.full(len(state), 2.0), error], axis=-1)

        config, around = ShieldConfig(work_budget=LEAST, edge_m=0.2), Surroundings(field=(0.0, 0.0, 900.0, 80.0))
        run = sail(Shield(config, around), fleet_of(rows, team), wanted, 100)
        backs_up = (run.reason == Reason.BACKUP) & run.cut_short
        backed_up += backs_up.sum()
        assert run.intervened[backs_up].all()
    assert backed_up > 100


def test_a_search_that_is_cut_short_does_not_lose_the_plan_there_was():
    """Twelve herons make for one point; whoever is joined to a backup has one, too, at the lowest limit."""
    lost = cut = 0
    for seed in range(6):
        random = np.random.default_rng(seed)
        state = scattered(random, 1, ["heron"] * 12, 30.0, gap_m=3.2, speed=(0.0, 1.0))[0]
        away = random.uniform(-180.0, 180.0, 12)

        def wanted(step, state, away=away):
            middle = np.degrees(np.arctan2(15.0 - state[:, L.X], 15.0 - state[:, L.Y]))
            error = ((middle if step < 60 else away) - state[:, L.HEADING] + 180.0) % 360.0 - 180.0
            return np.stack([np.full(12, 2.0), error], axis=-1)

        run = sail(Shield(work_budget=LEAST), fleet_of_rows(state, [0] * 12, "heron"), wanted, 150)
        assert run.closest(np.ones(12, bool)).min() >= 2.5
        safe = run.safety_margin_m.min(axis=-1) >= 0.0
        lost += (safe[:-1] & ~safe[1:]).sum()
        cut += run.cut_short.any(axis=-1).sum()
    assert cut > 300
    assert lost <= 5
