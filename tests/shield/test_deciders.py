"""Decisions one after another: single and batched, boats that decide for themselves, a search cut short."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from shield_loops import Wander, bearing_deg, fill, on_course, packed, sail, sail_games, scattered, step_all
from shield_scenes import bits, crowded_edge, distances, fleet_of, relative
from steerclear.shield import Commands, Fleet, Reason, Shield, ShieldConfig, Surroundings
from steerclear.shield.batch import BatchedShield
from steerclear.shield.platforms import fresh_state

TEAM = (0, 0, 0, 1, 1)


def crowd(seed):
    """Three herons of ours among two opponents, in 15 m."""
    random = np.random.default_rng(seed)
    rows = np.column_stack(
        [random.uniform(0.0, 15.0, (5, 2)), random.uniform(-180.0, 180.0, 5), random.uniform(0.5, 2.0, 5)]
    )
    fleet = fleet_of(rows, TEAM)
    fill(fleet.state, packed(fleet.platforms))
    return fleet


@pytest.mark.parametrize("delay_s", [0.0, 0.3])
def test_a_single_decision_is_a_batch_of_one_bit_for_bit(delay_s):
    config = ShieldConfig(delay_s=delay_s)
    single, batch = Shield(config), BatchedShield(config, 2, ("heron",) * 5, TEAM)
    fleets, changed = [crowd(1), crowd(2)], 0
    states = np.stack([fleet.state for fleet in fleets])
    singles = [single, copy.deepcopy(single)]
    ours = np.array([fleet.controlled for fleet in fleets])
    for step in range(60):
        wanted = np.random.default_rng(step).uniform([0.0, -90.0], [2.0, 90.0], (2, 5, 2))
        sent = batch.decide(states, wanted, ours).copy()
        for game, guard in enumerate(singles):
            answer = guard.decide(replace(fleets[game], state=states[game].copy()), Commands.game_deg(wanted[game]))
            assert bits(answer.filtered.values) == bits(sent[game])
            assert bits(answer.safety_margin_m) == bits(batch.safety_margin_m[game])
            assert (answer.reason == batch.reason[game]).all()
            changed += int(answer.intervened.sum())
        if step == 30:  # copies go on as what they are copies of
            batch, singles = copy.deepcopy(batch), pickle.loads(pickle.dumps(singles))
        step_all(packed(("heron",) * 5), states, sent, 0.1)
    assert changed > 20


@pytest.mark.parametrize("threads", [2, 9])
def test_threads_share_the_games_of_a_batch_and_another_goes_on_from_what_it_remembered(threads):
    """Without what is remembered the same states and commands are decided otherwise, so it does matter."""
    config, otherwise = ShieldConfig(delay_s=0.2), 0
    alone, shared, late, fresh = (BatchedShield(config, 7, ("heron",) * 5, TEAM, threads=k) for k in (1, threads, 1, 1))
    states = np.stack([crowd(seed).state for seed in range(7)])
    ours, more = np.tile(np.array(TEAM) == 0, (7, 1)), states.copy()
    for step in range(40):
        wanted = np.random.default_rng(step).uniform([0.0, -90.0], [2.0, 90.0], (7, 5, 2))
        sent = alone.decide(states, wanted, ours)
        assert bits(sent) == bits(shared.decide(more, wanted, ours))
        assert bits(alone.safety_margin_m) == bits(shared.safety_margin_m)
        assert (alone.reason == shared.reason).all()
        if step > 20:
            assert bits(late.decide(states, wanted, ours)) == bits(sent)
            otherwise += (fresh.decide(states, wanted, ours) != sent).any()
        step_all(packed(("heron",) * 5), states, sent, 0.1)
        more[:] = states
        if step == 20:
            for name, values in late.remembered.items():
                values[...] = alone.remembered[name]
            shared = copy.deepcopy(shared)
            for batch in (alone, shared, late):
                batch.reset(np.arange(7) > 4)
    assert (alone.reason != Reason.PASSED).any()
    assert otherwise > 0


@pytest.mark.parametrize("teams", [(0, 1, -1), (-1, 1, 1)])
def test_whoever_is_of_no_team_of_ours_is_feared_whatever_its_number(teams):
    fleet = fleet_of([(0, 0, 0, 2.0), (20.0, 0, 0, 2.0), (10.0, 40.0, 180.0, 2.0)], teams)
    fleet = replace(fleet, controlled=np.array([True, True, False]))
    assert Shield().decide(fleet, relative(*[(2.0, 0.0)] * 3)).adversary_horizon_s[2] > 0.0


@pytest.mark.parametrize("solver", ["active_set", "daqp"])
@pytest.mark.parametrize("coordination", ["team", "per_boat"])
@pytest.mark.parametrize("delay_s", [0.0, 0.2])
@pytest.mark.filterwarnings("error")
def test_whatever_is_wanted_and_wherever_boats_are_what_is_sent_is_a_command(delay_s, coordination, solver):
    """Nobody, one boat, boats on one point; wanted is no number, or none that a boat could do."""
    around = Surroundings(field=(-20.0, -20.0, 20.0, 20.0), keep_out=((0.0, 5.0, 2.0),))
    for team in ([], [0], [0, 0], [0, 1], [0, 0, 1]):
        shield = Shield(surroundings=around, coordination=coordination, solver=solver, delay_s=delay_s)
        fleet = fleet_of([(0.0, 0.0, 0.0, 1.0)] * len(team), team)
        for value in (1.0, np.nan, np.inf, -np.inf, 1e9, -1e9):
            decisions = shield.decide(fleet, relative(*[(value, value)] * len(team)))
            sent, own = decisions.filtered.values[fleet.controlled], fleet.controlled
            assert (np.abs(sent) <= 1e6).all()
            assert (decisions.reason[own] != Reason.NOT_COVERED).all()
            assert np.isfinite(decisions.slack_m).all()
            if not np.isfinite(value):
                assert (decisions.reason[own] != Reason.PASSED).all()


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


def twenty(seed):
    """Twelve boats of ours among eight others, all near each other, and commands that take them into each other."""
    state = scattered(np.random.default_rng(seed), 1, ["heron"] * 20, 30.0)[0]
    return fleet_of_rows(state, [0] * 12 + [1] * 8, "heron"), Commands.relative_deg(np.tile([2.0, 120.0], (20, 1)))


def test_it_is_told_that_the_search_was_cut_short():
    fleet, wanted = twenty(1)
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
        config, around = ShieldConfig(work_budget=LEAST, edge_m=0.2), Surroundings(field=(0.0, 0.0, 900.0, 80.0))
        run = sail(Shield(config, around), fleet_of(rows, team), on_course(courses, 2.0), 100)
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

        def courses(step, state, away=away):
            return bearing_deg(15.0 - state[:, :2]) if step < 60 else away

        fleet = fleet_of_rows(state, [0] * 12, "heron")
        run = sail(Shield(work_budget=LEAST), fleet, on_course(courses, 2.0), 150)
        assert run.closest(np.ones(12, bool)).min() >= 2.5
        safe = run.safety_margin_m.min(axis=-1) >= 0.0
        lost += (safe[:-1] & ~safe[1:]).sum()
        cut += run.cut_short.any(axis=-1).sum()
    assert cut > 300
    assert lost <= 5
