"""What the decision core is measured by: rammers about boats of ours, teams that cross, and crowds of teammates.

Scenes hang on the seed alone, so that runs of two versions are of the same scenes: run this file in a checkout of each,
with ``-m study``, for the figures in docs/studies/core.md.
"""

import logging
import time
from typing import NamedTuple

import numpy as np
import pytest
from scipy.stats import chi2
from shield_loops import fill, packed, step_all
from steerclear.shield import ShieldConfig
from steerclear.shield.batch import BatchedShield
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L

LOG = logging.getLogger(__name__)
STEPS, DT_S, HIT_M, KEPT_M = 300, 0.1, 2.0, 2.499


class Family(NamedTuple):
    """Boats of ours about the origin, rammers around; and hits of rammers and teammates too near, in 500 scenes."""

    platform: str
    ours: int
    rammers: int
    hits: int
    too_near: int
    profile: str = "competitive"


FAMILIES = {
    "two rammers, heron": Family("heron", 1, 2, 0, 0),
    "three rammers, heron": Family("heron", 1, 3, 0, 0),
    "two rammers, heron, profile ramming": Family("heron", 1, 2, 0, 0, "ramming"),
    "two rammers, surveyor": Family("surveyor", 1, 2, 30, 0),
    "three rammers, surveyor": Family("surveyor", 1, 3, 37, 0),
    "four teammates, herons": Family("heron", 4, 0, 0, 0),
    "four teammates, surveyors": Family("surveyor", 4, 0, 0, 6),
    "three and three rammers, herons": Family("heron", 3, 3, 2, 0),
    "three and three rammers, surveyors": Family("surveyor", 3, 3, 41, 3),
}
"""With what 0.8.0 came to."""


def scenes(family, games):
    """States (B, n, N_STATE) of the boats, and where ours are bound for (B, ours, 2), m."""
    random, top = np.random.default_rng(7), get_platform(family.platform).max_speed_mps
    scale, n = top / 2.0, family.ours + family.rammers
    state, goal = np.zeros((games, n, L.N_STATE)), np.zeros((games, family.ours, 2))
    for g in range(games):
        for i in range(n):
            for _ in range(200):
                if i < family.ours:
                    place = random.uniform(-6, 6, 2) * (1 + 0.8 * family.ours) / 2.0 * scale
                else:
                    angle, far = random.uniform(0, 2 * np.pi), random.uniform(14.0, 40.0) * scale
                    place = far * np.array([np.sin(angle), np.cos(angle)])
                if all(np.hypot(*(place - state[g, j, :2])) > 4.0 * max(1.0, scale) for j in range(i)):
                    break
            state[g, i, :2], state[g, i, L.HEADING] = place, random.uniform(-180, 180)
            state[g, i, L.SPEED] = top * (random.uniform(0.3, 1.0) if i < family.ours else 1.0)
        for i in range(family.ours):
            angle = random.uniform(0, 2 * np.pi)
            goal[g, i] = 30 * scale * np.array([np.sin(angle), np.cos(angle)])
    state[..., L.THRUST] = np.nan
    params = packed([family.platform] * n)
    for game in state:
        fill(game, params)
    return state, goal


def headed_for(state, goal, family):
    """Commands (B, n, 2): ours to their goals and back, rammers to where a boat of ours will be."""
    ours, top = family.ours, get_platform(family.platform).max_speed_mps
    target = np.concatenate([goal, np.zeros((len(state), family.rammers, 2))], axis=1)
    goal *= np.where(np.hypot(*np.moveaxis(goal - state[:, :ours, :2], -1, 0)) < 3.0, -1.0, 1.0)[..., None]
    heading = np.radians(state[:, :ours, L.HEADING])
    velocity = state[:, :ours, L.SPEED, None] * np.stack([np.sin(heading), np.cos(heading)], -1)
    for j in range(family.rammers):
        at = state[:, j % ours, :2]
        lead_s = np.hypot(*(at - state[:, ours + j, :2]).T) / top
        target[:, ours + j] = at + velocity[:, j % ours] * lead_s[:, None] * 0.7
    way = target - state[..., :2]
    turn = np.degrees(np.arctan2(way[..., 0], way[..., 1])) - state[..., L.HEADING]
    return np.stack([np.full(turn.shape, top), (turn + 180.0) % 360.0 - 180.0], axis=-1)


def closest(family, games):
    """Closest distances (B,) of rammers and of teammates, m, share of commands changed, and us a decision."""
    (state, goal), ours = scenes(family, games), family.ours
    n, params = ours + family.rammers, packed([family.platform] * (ours + family.rammers))
    team, changed, spent_s = (0,) * ours + (1,) * family.rammers, 0, 0.0
    shield = BatchedShield(ShieldConfig(profile=family.profile), games, (family.platform,) * n, team)
    mine = np.tile(np.array(team) == 0, (games, 1))
    rammed, mates = np.full(games, np.inf), np.full(games, np.inf)
    for _ in range(STEPS):
        nominal = headed_for(state, goal, family)
        started = time.process_time()
        sent = shield.decide(state, nominal, mine)
        spent_s += time.process_time() - started
        changed += int((sent[:, :ours] != nominal[:, :ours]).any(-1).sum())
        step_all(params, state, sent, DT_S)
        gap = np.hypot(*np.moveaxis(state[:, :ours, None, :2] - state[:, None, :, :2], -1, 0))
        gap[:, range(ours), range(ours)] = np.inf
        rammed = np.minimum(rammed, gap[:, :, ours:].min(axis=(1, 2), initial=np.inf))
        mates = np.minimum(mates, gap[:, :, :ours].min(axis=(1, 2)))
    return rammed, mates, changed / (games * STEPS * ours), 1e6 * spent_s / (games * STEPS)


@pytest.mark.parametrize("name", FAMILIES)
def test_a_few_scenes_of_each_family_keep_apart(name):
    """Of herons none is hit, and no teammate comes too near."""
    family = FAMILIES[name]
    rammed, mates, _, _ = closest(family, 6)
    assert (mates >= KEPT_M).all()
    assert family.platform != "heron" or (rammed >= HIT_M).all()


@pytest.mark.study
@pytest.mark.parametrize("name", FAMILIES)
def test_no_more_is_hit_than_was(name):
    """Within the 95 % interval of a count (Garwood) of what 0.8.0 came to in the same 500 scenes."""
    family = FAMILIES[name]
    rammed, mates, changed, took_us = closest(family, 500)
    hits, near = int((rammed < HIT_M).sum()), int((mates < KEPT_M).sum())
    low = int((rammed < KEPT_M).sum())
    LOG.warning(
        "%s: %d hits, %d below 2.5 m, %d teammates below, least %.2f m, changed %.2f %%, %.0f us",
        *(name, hits, low, near, mates.min(), 100.0 * changed, took_us),
    )
    assert hits <= chi2.ppf(0.975, 2 * family.hits + 2) / 2.0
    assert near <= family.too_near
