"""Runs of boats to be judged, made with the package's own dynamics; the oracle's model has no part in them."""

import numpy as np
from steerclear.env.record import find_violations
from steerclear.shield.platforms import fresh_state, get_platform, step_boat

DT_S = 0.1


def straight_track(start_m, velocity_mps, steps):
    """State rows of a point that moves on a straight line whatever happens."""
    rows = np.zeros((steps + 1, 11))
    rows[:, :2] = np.asarray(start_m) + np.arange(steps + 1)[:, None] * DT_S * np.asarray(velocity_mps)
    return rows


def driven_track(params, state, commands):
    """State rows of a boat that obeys commands (speed m/s, relative heading deg)."""
    rows = [state.copy()]
    for speed_mps, error_deg in commands:
        step_boat(params, state, speed_mps, error_deg, DT_S)
        rows.append(state.copy())
    return np.array(rows)


def random_run(name, boats, size_m, steps, seed, chasers=0):
    """Boats between random waypoints; the last few chase. States (T+1, n, 11), rows (n, 38)."""
    random = np.random.default_rng(seed)
    platform = get_platform(name)
    params, top_mps = platform.pack(), platform.max_speed_mps
    spread = [
        (*random.uniform(0, size_m, 2), random.uniform(-180, 180), random.uniform(0, top_mps)) for _ in range(boats)
    ]
    state = np.array([fresh_state(*place) for place in spread])
    goal = random.uniform(0, size_m, (boats, 2))
    rows = [state.copy()]
    for _ in range(steps):
        for i in range(boats):
            if i >= boats - chasers:
                prey = state[: boats - chasers, :2]
                goal[i] = prey[np.argmin(np.hypot(*(prey - state[i, :2]).T))]
            elif np.hypot(*(goal[i] - state[i, :2])) < 3.0 or random.random() < 0.005:
                goal[i] = random.uniform(0, size_m, 2)
            towards = np.degrees(np.arctan2(*(goal[i] - state[i, :2])))
            step_boat(params, state[i], top_mps, (towards - state[i, 2] + 180.0) % 360.0 - 180.0, DT_S)
        rows.append(state.copy())
    return np.array(rows), np.array([params] * boats)


def first_violation(states, radius_m, pair=(0, 1)):
    """Step at which a pair first comes within the radius; None when it never does."""
    found = find_violations(states[:, list(pair), :2], radius_m)
    return int(found[0, 0]) if len(found) else None
