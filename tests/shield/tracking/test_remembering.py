"""What is remembered of boats that come and go, and of autopilots that tell nothing of themselves."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from shield_loops import fill, packed, step_all
from shield_scenes import bits, fleet_of, head_on, relative
from steerclear.shield import Commands, Fleet, Shield
from steerclear.shield.autopilots import SURPRISE, Autopilots
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


CROWD = [(0, 0, 0, 1.0), (4.0, 14.0, 180.0, 1.0), (-9.0, 5.0, 90.0, 1.2), (9.0, 6.0, -90.0, 1.4)]


def hidden(fleet):
    """The fleet as its users see it: place, heading and speed alone."""
    return Fleet.of(
        position_m=fleet.position_m,
        heading_rad=fleet.heading_rad,
        speed_mps=fleet.speed_mps,
        team=fleet.team,
        platforms=fleet.platforms,
        names=fleet.names,
    )


def sailing(platforms):
    """Four boats of ours, their autopilots new, under thrust for their speed."""
    fleet = fleet_of(CROWD, [0] * len(CROWD), platforms)
    fill(fleet.state, packed(fleet.platforms))
    return fleet


def loop(shield, fleet, see, absolute):
    """Sent commands, reasons and certificates while the boats cross each other's way; ``see`` makes what is seen."""
    state, params, told, late = fleet.state.copy(), packed(fleet.platforms), [], []
    for step in range(150):
        now = Fleet(state.copy(), fleet.team, fleet.platforms, fleet.controlled, fleet.names)
        heading = np.array([0.0, 180.0, 90.0, -90.0]) + 40.0 * (step // 60)
        if absolute:
            wanted = Commands.absolute_rad(np.stack([np.full(4, 1.6), np.radians(heading)], axis=1))
        else:
            error = (heading - state[:, L.HEADING] + 180.0) % 360.0 - 180.0
            wanted = relative(*np.stack([np.full(4, 1.6), error], axis=1))
        answer = shield.decide(see(now), wanted)
        told.append(np.column_stack([answer.filtered.values, answer.reason, answer.safety_margin_m]))
        sent = answer.filtered.as_relative_deg(state[:, L.HEADING])
        late.append(np.stack([sent[:, 0], sent[:, 1] + state[:, L.HEADING]], axis=1))
        steps = round(shield.config.delay_s / shield.config.dt_s)
        if step < steps:
            way = state[:, L.SPEED] * shield.config.dt_s
            state[:, L.X] += way * np.sin(np.radians(state[:, L.HEADING]))
            state[:, L.Y] += way * np.cos(np.radians(state[:, L.HEADING]))
            continue
        works = late[step - steps].copy()
        works[:, 1] = (works[:, 1] - state[:, L.HEADING] + 180.0) % 360.0 - 180.0
        step_all(params, state[None], works[None], shield.config.dt_s)
    return np.array(told)


def part_hidden(*columns):
    """What is seen when some columns of the memory are not told."""

    def see(fleet):
        fleet.state[:, columns] = np.nan
        return fleet

    return see


@pytest.mark.parametrize("columns", [(L.THRUST,), (L.HEADING_ERROR,), (L.SPEED_ERROR, L.HEADING_ERROR)])
def test_what_alone_is_not_told_is_known_as_well(columns):
    """Thrust told without the last heading error must not be worse than neither."""
    fleet = sailing("heron")
    known, unknown = (loop(Shield(), fleet, see, True) for see in (lambda boats: boats, part_hidden(*columns)))
    np.testing.assert_allclose(unknown, known, atol=1e-6)


@pytest.mark.parametrize(("delay_s", "coordination"), [(0.0, "team"), (0.3, "team"), (0.3, "per_boat")])
@pytest.mark.parametrize("platforms", ["heron", "surveyor"])
def test_decisions_are_those_with_the_memory_told(platforms, delay_s, coordination):
    fleet = sailing(platforms)
    settings = {"delay_s": delay_s, "coordination": coordination}
    known, unknown = (loop(Shield(**settings), fleet, see, True) for see in (lambda boats: boats, hidden))
    assert (known[:, :, 2] != 0).any()
    np.testing.assert_allclose(unknown, known, atol=1e-6)


def believed_after(fleet, commands, steps, obeys):
    """What is believed of one boat after some steps; it does what it is told, or stays as it is."""
    autopilots, state, params = Autopilots.of(1), fleet.state.copy(), packed(fleet.platforms)
    for _ in range(steps):
        seen = state.copy()
        seen[:, L.THRUST :] = np.nan
        autopilots.fill(seen, np.array([True]), 0.1)
        autopilots.go_on(np.array([True]), params, commands, 0.1)
        if obeys:
            step_all(params, state[None], commands[None], 0.1)
    return autopilots, state


@pytest.mark.parametrize("platform", ["heron", "surveyor"])
@pytest.mark.parametrize("commands", [(2.0, 0.0), (0.5, 120.0)])
def test_a_boat_that_does_not_obey_is_taken_for_what_her_speed_tells(platform, commands):
    """Told to speed up or turn she lies still: a thrust built up in the model alone would promise her backups."""
    fleet = fleet_of([(0, 0, 0, 0.0)], [0], platform)
    disobeying, _ = believed_after(fleet, np.array([commands]), 200, False)
    obeying, _ = believed_after(fleet, np.array([commands]), 200, True)
    assert (np.abs(disobeying.off) <= SURPRISE).all()  # found out again and again
    assert disobeying.after[0, 0, L.THRUST] < 0.7 * obeying.after[0, 0, L.THRUST]


def test_a_boat_that_jumped_is_not_believed_to_be_the_one_before():
    fleet = fleet_of([(0, 0, 0, 1.0)], [0], "heron")
    autopilots, state = believed_after(fleet, np.array([(1.0, 20.0)]), 10, True)
    seen = state.copy()
    seen[:, L.THRUST :] = np.nan
    seen[0, L.X] += 1.6
    autopilots.fill(seen, np.array([True]), 0.1)
    assert np.isnan(seen[0, L.THRUST :]).all()


def test_what_was_believed_before_the_memory_was_told_is_not_believed_after_it():
    """Nor what was when a decision failed, or somebody else steered: only the step just past is known."""
    fleet = fleet_of([(0, 0, 0, 1.0)], [0], "heron")
    wanted = Commands.absolute_rad([[2.0, 0.0]])
    shield, fresh = Shield(), Shield()
    params = packed(fleet.platforms)
    told = fleet.state.copy()
    told[:, [L.SPEED_ERROR, L.HEADING_ERROR]] = 0.0
    fill(told, params)
    for _ in range(5):
        shield.decide(fleet, wanted)
    away = Fleet(fleet.state, fleet.team, fleet.platforms, np.array([False]), fleet.names)
    for between in (Fleet(told, fleet.team, fleet.platforms, fleet.controlled, fleet.names), away):
        shield.decide(fleet, wanted)
        shield.decide(between, wanted)
        assert shield._autopilots is None
    shield.decide(fleet, wanted)
    fresh.decide(fleet, wanted)
    np.testing.assert_array_equal(shield._autopilots.after, fresh._autopilots.after)
