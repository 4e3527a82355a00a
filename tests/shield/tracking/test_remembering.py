"""Boats that come into view or go do not make a shield forget the others."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from shield_loops import fill, packed, step_all
from shield_scenes import bits, fleet_of, head_on, relative
from steerclear.shield import Fleet, Shield
from steerclear.shield.memory import Memory, new_memory, put_memory, take_memory
from steerclear.shield.platforms import layout as L
from steerclear.shield.tracking.remembering import Known, Stayed, carry_over, meets_new

FAR_AWAY = (1300.0, 0.0, 0.0, 0.0)
STEPS = 120


def meeting(platforms="heron"):
    """A boat of ours and an opponent that comes nearly head on; a third boat far away."""
    fleet = fleet_of([(0, 0, 0, 2.0), (1.0, 30.0, 180.0, 2.0), FAR_AWAY], [0, 1, 1], platforms)
    fill(fleet.state, packed(fleet.platforms))
    return fleet


def part(fleet, boats):
    """Only some boats of a fleet, in that order."""
    chosen = list(boats)
    platforms, names = (tuple(entry[k] for k in chosen) for entry in (fleet.platforms, fleet.names))
    return Fleet(fleet.state[chosen].copy(), fleet.team[chosen], platforms, fleet.controlled[chosen], names)


def decisions(shield, fleet, seen_at):
    """What is sent to the first boat, its reasons and certificates, when ``seen_at(step)`` are the boats in view."""
    state, params, told = fleet.state.copy(), packed(fleet.platforms), []
    for step in range(STEPS):
        boats = seen_at(step)
        now = part(replace(fleet, state=state), boats)
        own = boats.index(0)
        answer = shield.decide(now, relative(*[(2.0, 0.0)] * len(boats)))
        told.append((*answer.sent.values[own], answer.reason[own], answer.certificate_m[own]))
        commands = np.array([answer.sent.values[own], (2.0, 0.0), (0.0, 0.0)])
        step_all(params, state[None], commands[None], 0.1)
    return np.array(told)


@pytest.mark.parametrize("coordination", ["team", "per_boat"])
@pytest.mark.parametrize("delay_s", [0.0, 0.3])
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
    assert bits(used.decide(scene, wanted).sent.values) == bits(fresh.decide(scene, wanted).sent.values)


def known(fleet):
    return Stayed.between(Known.of(fleet), fleet)


def test_boats_are_told_by_name_platform_and_team():
    fleet = meeting()
    assert known(fleet).now.tolist() == [0, 1, 2]
    swapped = Stayed.between(Known.of(fleet), part(fleet, (2, 0)))
    assert (swapped.now.tolist(), swapped.then.tolist()) == ([0, 1], [2, 0])
    for other in (
        replace(fleet, team=np.array([1, 1, 1])),
        replace(fleet, platforms=("surveyor", "heron", "heron")),
        replace(fleet, names=("new", "boat_1", "boat_2")),
    ):
        assert Stayed.between(Known.of(fleet), other).now.tolist() == [1, 2]
    twins = replace(fleet, names=("a", "a", "b"))
    assert len(known(twins).now) == len(Stayed.between(None, fleet).now) == 0


def test_a_boat_that_meets_a_new_one_keeps_its_backup_but_no_margin():
    old, new = new_memory(2), new_memory(3)
    old.has_backup[:], old.side[:], old.target_deg[:] = True, (-1.0, 1.0), (30.0, 60.0)
    old.margin_m[:], old.threat_m[:] = (1.5, -0.5), [[0.0, 1.0], [0.5, 0.0]]
    carry_over(old, new, Stayed(np.array([2, 0]), np.array([0, 1])), np.array([True, True, False]))
    assert new.has_backup.tolist() == [True, False, True]
    assert new.side[[2, 0]].tolist() == [-1.0, 1.0]
    assert new.target_deg[[2, 0]].tolist() == [30.0, 60.0]
    assert new.margin_m.tolist() == [-0.5, 0.0, 1.5]
    assert new.threat_m.tolist() == [[0.0, 0.0, 0.5], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]


@pytest.mark.parametrize(("gap_m", "met"), [(20.0, True), (1300.0, False)])
def test_only_new_boats_that_can_come_near_count(gap_m, met):
    fleet = fleet_of([(0, 0, 0, 2.0), (0, gap_m, 180.0, 2.0)], [0, 1])
    shield = Shield()
    shield.decide(fleet, relative((0.0, 0.0), (0.0, 0.0)))
    stayed = Stayed.between(Known.of(part(fleet, (0,))), fleet)
    assert meets_new(fleet, stayed, shield._boats, shield._tuning).tolist() == [met, False]


def numbered(memory, first):
    """Fill every field of a memory with numbers of its own: the flags with every other one."""
    assert memory._asdict().keys() == set(Memory._fields)
    for k, array in enumerate(memory):
        numbers = first + 100 * k + np.arange(array.size).reshape(array.shape)
        array[...] = numbers % 2 if array.dtype == np.bool_ else numbers


def test_games_of_a_batch_keep_their_memory_apart():
    """All of it is taken and put back: a field left out would pass from one game to the next."""
    games, own = new_memory(3, 4), new_memory(4)
    numbered(games, 1)
    numbered(own, 7)
    before = {name: array.copy() for name, array in games._asdict().items()}
    take_memory(games, 1, own)
    for name, array in own._asdict().items():
        np.testing.assert_array_equal(array, before[name][1], err_msg=name)
    numbered(own, 50_000)  # flags the other way round, too
    put_memory(own, 2, games)
    for name, array in games._asdict().items():
        np.testing.assert_array_equal(array[:2], before[name][:2], err_msg=name)
        np.testing.assert_array_equal(array[2], getattr(own, name), err_msg=name)
        assert (array[2] != before[name][2]).any(), name


def test_a_copy_decides_on_its_own():
    """A shield copied with all it works with goes on as the first would have, and neither is changed by the other."""
    first = Shield(delay_s=0.2)
    fleet, wanted = head_on(9.0), relative((2.0, 0.0), (2.0, 0.0))
    first.decide(fleet, wanted)
    second = copy.deepcopy(first)
    told = [[shield.decide(fleet, wanted).sent.values for _ in range(3)] for shield in (first, second)]
    np.testing.assert_array_equal(*told)
    alone = Shield(delay_s=0.2)
    np.testing.assert_array_equal([alone.decide(fleet, wanted).sent.values for _ in range(4)][1:], told[0])
