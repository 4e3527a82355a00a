"""Boats that come into view or go do not make a shield forget the others."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from shield_loops import fill, packed, step_all
from shield_scenes import bits, fleet_of, head_on, relative
from steerclear.shield import Fleet, Shield
from steerclear.shield.platforms import layout as L
from steerclear.shield.workspace import HAS_BACKUP

FAR_AWAY = (1300.0, 0.0, 0.0, 0.0)
STEPS = 120


def meeting(platforms="heron"):
    """A boat of ours and an opponent that comes nearly head on; a third boat far away."""
    fleet = fleet_of([(0, 0, 0, 2.0), (1.0, 30.0, 180.0, 2.0), FAR_AWAY], [0, 1, 1], platforms)
    fill(fleet.state, packed(fleet.platforms))
    return fleet


def part(fleet, boats):
    """Only some boats of a fleet, in that order."""
    rows = list(boats)
    platforms, names = (tuple(entry[k] for k in rows) for entry in (fleet.platforms, fleet.names))
    return Fleet(fleet.state[rows].copy(), fleet.team[rows], platforms, fleet.controlled[rows], names)


def decisions(shield, fleet, seen_at):
    """What is sent to the first boat, its reasons and certificates, when ``seen_at(step)`` are the boats in view."""
    state, params, told = fleet.state.copy(), packed(fleet.platforms), []
    for step in range(STEPS):
        boats = seen_at(step)
        now = part(replace(fleet, state=state), boats)
        own = boats.index(0)
        answer = shield.decide(now, relative(*[(2.0, 0.0)] * len(boats)))
        told.append((*answer.filtered.values[own], answer.reason[own], answer.safety_margin_m[own]))
        commands = np.array([answer.filtered.values[own], (2.0, 0.0), (0.0, 0.0)])
        step_all(params, state[None], commands[None], 0.1)
    return np.array(told)


@pytest.mark.parametrize(("delay_s", "coordination"), [(0.0, "team"), (0.3, "per_boat")])
@pytest.mark.parametrize("platforms", ["heron", "surveyor"])
def test_a_far_boat_that_flickers_changes_nothing(platforms, delay_s, coordination):
    fleet = meeting(platforms)
    views = [lambda _: (0, 1), lambda step: (0, 1, 2) if step % 2 else (0, 1), lambda step: (2, 1, 0)[step % 2 :]]
    steady, *flickering = (
        decisions(Shield(delay_s=delay_s, coordination=coordination), fleet, seen_at) for seen_at in views
    )
    assert (steady[:, 2] != 0).any()
    for told in flickering:
        np.testing.assert_allclose(told, steady, atol=1e-9)


def test_reset_forgets():
    fleet = meeting()
    used, fresh = Shield(), Shield()
    decisions(used, fleet, lambda _: (0, 1))
    used.reset()
    scene = part(fleet, (0, 1, 2))
    scene.state[1, L.Y] = 9.0
    wanted = relative((2.0, 0.0), (2.0, 0.0), (0.0, 0.0))
    assert bits(used.decide(scene, wanted).filtered.values) == bits(fresh.decide(scene, wanted).filtered.values)


def memory_of(shield):
    return shield._deciders.scene.memories[0].copy()


@pytest.mark.parametrize(
    ("change", "forgotten"),
    [
        ({"team": np.array([1, 1, 0])}, [0, 2]),
        ({"platforms": ("surveyor", "heron", "heron")}, [0]),
        ({"names": ("new", "boat_1", "boat_2")}, [2]),
        ({"names": ("boat_1", "boat_1", "boat_2")}, [0, 1, 2]),
    ],
)
def test_boats_are_told_by_name_platform_and_team(change, forgotten):
    fleet = replace(meeting(), controlled=np.array([True, True, True]))
    shield, kept = Shield(), []
    shield.decide(fleet, relative((2.0, 30.0), (2.0, 30.0), (0.0, 0.0)))
    shield._deciders_of(replace(fleet, **change), shield._static(shield.surroundings))
    kept = memory_of(shield)[:, HAS_BACKUP]
    assert np.flatnonzero(kept == 0.0).tolist() == forgotten


def test_a_copy_decides_on_its_own():
    """A shield copied with all it works with goes on as the first would have, and neither is changed by the other."""
    first = Shield(delay_s=0.2)
    fleet, wanted = head_on(9.0), relative((2.0, 0.0), (2.0, 0.0))
    first.decide(fleet, wanted)
    second = copy.deepcopy(first)
    told = [[shield.decide(fleet, wanted).filtered.values for _ in range(3)] for shield in (first, second)]
    np.testing.assert_array_equal(*told)
    alone = Shield(delay_s=0.2)
    np.testing.assert_array_equal([alone.decide(fleet, wanted).filtered.values for _ in range(4)][1:], told[0])
