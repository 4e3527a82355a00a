"""Brute force over all bang sequences finds nothing that the analysis misses, and every plan holds when replayed."""

import math

import numpy as np
import pytest
from oracle_runs import DT_S, random_run
from steerclear.env.record import find_violations
from steerclear.experiments.oracle import Outcome, Settings, judge
from steerclear.experiments.oracle.verdict import FULL
from steerclear.shield.jit import kernel
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms import step_boat
from steerclear.shield.platforms.actuator import command_for_turn, largest_turn, thrust_after

RADIUS_M = 2.5
FINER = FULL._replace(width=4 * FULL.width, cells=tuple(size / 2 for size in FULL.cells))
SHORT = Settings(settle_s=0.5, longest_s=0.8, look_back_s=4.0)


@kernel
def _hold(params, state, choice, rudder, steps, others, k, radius_m, dt_s):
    for i in range(k + 1, k + steps + 1):
        speed_mps = state[L.SPEED]
        if choice == 0:
            speed_mps = 0.0
        elif choice == 2:
            speed_mps = params[L.MAX_SPEED]
        trial = state.copy()
        trial[L.THRUST] = thrust_after(params, state, speed_mps, dt_s)
        turn_deg = rudder * largest_turn(params, trial, dt_s)
        step_boat(params, state, speed_mps, command_for_turn(params, state, speed_mps, turn_deg, dt_s), dt_s)
        for m in range(others.shape[1]):
            if math.hypot(others[i, m, 0] - state[L.X], others[i, m, 1] - state[L.Y]) <= radius_m:
                return False
    return True


@kernel
def any_sequence(params, start, others, rudders, macro, radius_m, dt_s):
    """Whether some sequence of (speed choice, rudder), each held for ``macro`` steps, stays clear to the end."""
    steps = others.shape[0] - 1
    depth = (steps + macro - 1) // macro
    choices = 3 * rudders.size
    stack = np.empty((depth + 1, start.size))
    stack[0] = start
    taken = np.zeros(depth, dtype=np.int64)
    level = 0
    while level >= 0:
        if level == depth:
            return True
        if taken[level] == choices:
            taken[level] = 0
            level -= 1
            continue
        action = taken[level]
        taken[level] += 1
        state = stack[level].copy()
        k = level * macro
        length = min(macro, steps - k)
        if _hold(
            params, state, action // rudders.size, rudders[action % rudders.size], length, others, k, radius_m, dt_s
        ):
            level += 1
            stack[level] = state
    return False


def replayed(states, rows, verdict):
    """Closest distance when the plan is driven with the package's boat, by relative and by absolute heading."""
    plan, own = verdict.plan, verdict.own
    closest = []
    for absolute in (False, True):
        state = states[plan.begin_step, own].copy()
        nearest = np.inf
        for k in range(len(plan.speed_mps)):
            error_deg = plan.heading_error_deg[k]
            if absolute:
                error_deg = (plan.heading_deg[k] - state[2] + 180.0) % 360.0 - 180.0
            step_boat(rows[own], state, plan.speed_mps[k], error_deg, DT_S)
            others = np.delete(states[plan.begin_step + k + 1, :, :2], own, axis=0)
            nearest = min(nearest, np.hypot(*(others - state[:2]).T).min())
        closest.append(nearest)
    return closest


def close_calls(name, seed, size_m, boats=3):
    """Violations of short runs in a small basin."""
    states, rows = random_run(name, boats, size_m, 150, seed, chasers=boats - 1)
    return states, rows, [row for row in find_violations(states[:, :, :2], RADIUS_M) if row[0] > 1]


def brute_last(states, rows, verdict, rudders, macro, back):
    """Latest of the last ``back`` steps from which brute force avoids the violation; None when there is none."""
    others = np.ascontiguousarray(np.delete(states[:, :, :2], verdict.own, axis=1))
    for begin in range(verdict.step - 1, max(-1, verdict.step - 1 - back), -1):
        start = states[begin, verdict.own]
        if np.hypot(*(others[begin] - start[:2]).T).min() <= RADIUS_M:
            return None
        tracks = others[begin : verdict.end_step + 1]
        if any_sequence(rows[verdict.own], start, tracks, rudders, macro, RADIUS_M, DT_S):
            return begin
    return None


def compare(name, seed, size_m, rudders, macro, most, back=20):
    """Judge the first violations of a run both ways; returns how many were compared and found avoidable."""
    states, rows, violations = close_calls(name, seed, size_m)
    found = 0
    for step, a, b, _ in violations[:most]:
        for own, other in ((int(a), int(b)), (int(b), int(a))):
            verdict = judge(states, rows, own, int(step), RADIUS_M, other=other, settings=SHORT)
            last = brute_last(states, rows, verdict, rudders, macro, back)
            if last is not None:
                found += 1
                assert verdict.outcome is Outcome.AVOIDABLE
                assert verdict.last_step >= last
    return found


@pytest.mark.parametrize(("name", "size_m"), [("heron", 12.0), ("surveyor", 20.0), ("si", 25.0), ("di", 25.0)])
def test_brute_force_finds_nothing_more(name, size_m):
    found = [compare(name, seed, size_m, np.array([-1.0, 0.0, 1.0]), 5, most=3) for seed in range(3)]
    assert sum(found) > 2


@pytest.mark.study
@pytest.mark.parametrize(
    ("name", "size_m", "macro", "back"),
    [("heron", 12.0, 3, 8), ("surveyor", 20.0, 8, 25), ("large_usv", 60.0, 4, 12), ("di", 25.0, 5, 12)],
)
def test_large_brute_force_finds_nothing_more(name, size_m, macro, back):
    rudders = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
    found = [compare(name, seed, size_m, rudders, macro, most=3, back=back) for seed in range(100, 160)]
    assert sum(found) > 10


@pytest.mark.parametrize("name", ["heron", "mctf2024_sim", "large_usv", "di"])
def test_plans_hold_when_replayed_with_the_packages_boat(name):
    size_m = {"large_usv": 100.0, "di": 60.0}.get(name, 35.0)
    states, rows = random_run(name, 5, size_m, 900, seed=11, chasers=2)
    violations = [row for row in find_violations(states[:, :, :2], RADIUS_M) if row[0] > 1][:8]
    assert len(violations) >= 3
    checked = 0
    for step, a, b, _ in violations:
        verdict = judge(states, rows, int(a), int(step), RADIUS_M, other=int(b))
        if verdict.plan is None or not _apart(states, verdict):
            continue
        checked += 1
        closest = replayed(states, rows, verdict)
        assert min(closest) > RADIUS_M
        assert closest[0] == pytest.approx(verdict.plan.closest_m, abs=1e-6)
        assert (verdict.plan.speed_mps >= 0.0).all()
        assert (np.abs(verdict.plan.heading_error_deg) <= 180.0).all()
        assert len(verdict.plan.path_m) == len(verdict.plan.speed_mps) + 1 == verdict.end_step - verdict.last_step + 1
    assert checked >= 2


def _apart(states, verdict):
    """Whether no third boat was inside when the plan began."""
    begin = states[verdict.last_step]
    others = np.delete(begin[:, :2], verdict.own, axis=0)
    return np.hypot(*(others - begin[verdict.own, :2]).T).min() > RADIUS_M


@pytest.mark.study
@pytest.mark.parametrize("name", ["heron", "surveyor"])
def test_what_cannot_be_avoided_cannot_be_on_a_finer_search(name):
    # one step after the last preventable moment nothing was found: nothing is found there by a finer search either
    later = []
    for seed in range(8):
        states, rows, violations = close_calls(name, seed, {"heron": 18.0, "surveyor": 25.0}[name])
        if not violations:
            continue
        step, a, b = (int(value) for value in violations[0][:3])
        coarse = judge(states, rows, a, step, RADIUS_M, other=b, settings=Settings(look_back_s=8.0))
        fine = judge(states, rows, a, step, RADIUS_M, other=b, settings=Settings(look_back_s=8.0, full=FINER))
        later.append((fine.last_step or -1) - (coarse.last_step or -1))
        assert (fine.outcome, abs(later[-1]) <= 2) == (coarse.outcome, True)
    assert len(later) >= 2
