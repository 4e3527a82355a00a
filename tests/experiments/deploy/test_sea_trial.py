"""The sea trial's manoeuvres on a boat without sockets: all are driven, inside the geofence, and can be fitted."""

import math
import types

import numpy as np
import pytest
from steerclear.experiments.deploy.sea_trial import MANOEUVRES, Leg, SeaTrial, longest_s
from steerclear.experiments.fit.runs import NEEDED, Streams, silent
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.messages import Snapshot
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L

TEXT = """
version: 1
field: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, size_m: [80, 40]}
geofence: {xmin_m: -40, ymin_m: -30, xmax_m: 120, ymax_m: 70}
team: blue
boats:
  - {name: one, team: blue, platform: PLATFORM, link: {kind: mavlink, address: "udpin:127.0.0.1:14550", system_id: 1}}
  - {name: two, team: blue, platform: PLATFORM, link: {kind: mavlink, address: "udpin:127.0.0.1:14550", system_id: 2}}
"""


def driven(platform, boats=("one",), start=(10.0, 0.0)):
    """A trial driven to its end; rows (time, x, y, heading, speed, told speed, told heading) of the first boat."""
    fleet = parse_fleet(TEXT.replace("PLATFORM", platform))
    told, rows, names = [], [], fleet.names
    trial = SeaTrial(fleet, boats, tell=told.append)
    params = get_platform(platform).pack()
    states = [fresh_state(*start, 0.0), fresh_state(100.0, 60.0, 0.0)]
    for k in range(round(longest_s(len(boats)) / 0.1)):
        seen = np.array([[s[L.X], s[L.Y], s[L.HEADING], s[L.SPEED]] for s in states])
        trial.offer(Snapshot(k, 0.1 * k, seen))
        values = trial.latest().commands.values
        rows.append((0.1 * k, *seen[0], values[0, 0], math.degrees(values[0, 1])))
        for i in range(len(names)):
            error = math.remainder(math.degrees(values[i, 1]) - states[i][L.HEADING], 360.0)
            step_boat(params, states[i], values[i, 0], error, 0.1)
        if trial.done:
            break
    return trial, told, np.array(rows)


@pytest.mark.parametrize("platform", ["ardurover_boat", "otter", "heron", "heron_v22"])
def test_every_manoeuvre_is_driven_inside_the_geofence(platform):
    trial, told, rows = driven(platform)
    assert trial.done
    assert [text.partition(": ")[2] for text in told] == [name for name, *_ in MANOEUVRES]
    assert rows[:, 1].min() > -40.0
    assert rows[:, 1].max() < 120.0
    assert rows[:, 2].min() > -30.0
    assert rows[:, 2].max() < 70.0
    assert len(rows) * 0.1 < 15 * 60.0


@pytest.mark.parametrize(("name", "side"), [("starboard", 1.0), ("port", -1.0)])
def test_a_turning_circle_goes_on_ahead_of_headings_that_jump_back(name, side):
    (steer,) = [steer for title, _, steer in MANOEUVRES if title == f"turning circle to {name}"]
    leg, asked = Leg(0.0), []
    for heading in (10.0, 19.0, 15.0, 24.0, 20.0, 29.0):
        leg.turned_deg = side * (heading - 10.0)
        asked.append(side * steer(leg, 1.0, side * heading)[1])
    assert asked == pytest.approx([85.0, 94.0, 94.0, 99.0, 99.0, 104.0])


def test_the_trial_shows_turns_and_stops_of_both_sides():
    _, _, rows = driven("ardurover_boat")
    turn = np.diff(np.unwrap(rows[:, 3], period=360.0)) / 0.1
    assert turn.max() > 30.0
    assert turn.min() < -30.0
    assert rows[:, 4].max() > 2.8
    log = Streams("trial", silent)
    for time_s, *values in rows:
        for what, value in zip(NEEDED, values, strict=True):
            log.add(what, time_s, value)
    runs = log.runs(NEEDED)
    assert sum(run.seconds for run in runs) > 120.0


def test_commands_the_shield_changed_are_counted():
    trial = SeaTrial(parse_fleet(TEXT.replace("PLATFORM", "heron")), ("one",))
    for changed in (True, False, True):
        fleet = types.SimpleNamespace(names=("one", "two"))
        trial.take(types.SimpleNamespace(decisions=types.SimpleNamespace(intervened=[changed, False]), fleet=fleet))
    assert trial.changed == {"one": [2, 3]}


@pytest.mark.parametrize("before", ["", "SIGINT"])
def test_a_trial_that_is_done_ends_the_run_unless_somebody_did(before):
    operator = Operator()
    if before:
        operator.end(before)
    trial = SeaTrial(parse_fleet(TEXT.replace("PLATFORM", "heron")), (), operator=operator)
    trial.take(types.SimpleNamespace(decisions=None, fleet=None))
    assert trial.done
    assert operator.ended == (before or "the trial is done")
