"""Positions that cannot be."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield.bridge.mavlink.position_guard import SETTLED_S, PositionGuard

DT = 0.05


def drive(guard, count, start=(0.0, 0.0), velocity=(1.0, 0.5), at=0.0):
    """Verdicts on a boat that goes straight on; where and when it is afterwards."""
    verdicts = []
    for i in range(count):
        place = (start[0] + velocity[0] * DT * i, start[1] + velocity[1] * DT * i)
        verdicts.append(guard.refuse(place, velocity, at + DT * i))
    return verdicts, (start[0] + velocity[0] * DT * count, start[1] + velocity[1] * DT * count), at + DT * count


@settings(deadline=None)
@given(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0), st.floats(0.0, 6.28))
def test_a_boat_that_drives_is_believed(speed, rate, heading):
    guard, x, y = PositionGuard(), 0.0, 0.0
    for i in range(100):
        heading += rate * DT * 0.2
        vx, vy = speed * math.sin(heading), speed * math.cos(heading)
        x, y = x + vx * DT, y + vy * DT
        noise = 0.02 * math.sin(7.0 * i)
        assert guard.refuse((x + noise, y - noise), (vx, vy), DT * i) == ""


def test_a_jump_is_refused_and_the_way_back_believed():
    guard = PositionGuard()
    _, place, now = drive(guard, 40)
    assert guard.refuse((place[0] + 30.0, place[1]), (1.0, 0.5), now) == "jump"
    assert 29.0 < guard.jumped_m < 31.0
    assert guard.refuse((place[0] + 0.05, place[1] + 0.025), (1.0, 0.5), now + DT) == ""


def test_a_position_that_stays_away_is_believed_after_it_held():
    guard = PositionGuard()
    _, place, now = drive(guard, 40)
    verdicts, _, _ = drive(guard, 80, (place[0], place[1] + 30.0), at=now)
    first = verdicts.index("moved")
    assert set(verdicts[:first]) == {"jump"}
    assert set(verdicts[first + 1 :]) == {""}
    assert SETTLED_S <= first * DT <= SETTLED_S + 2 * DT


def test_positions_that_jump_about_are_never_believed():
    guard = PositionGuard()
    _, (x, y), now = drive(guard, 40)
    for i in range(100):
        assert guard.refuse((x + 30.0 * (1 + i % 3), y), (1.0, 0.5), now + DT * i) == "jump"
        if i > 40:
            break


def test_a_position_that_stands_while_the_boat_runs_is_frozen():
    guard = PositionGuard()
    _, place, now = drive(guard, 40, velocity=(2.0, 0.0))
    verdicts = [guard.refuse(place, (2.0, 0.0), now + DT * i) for i in range(20)]
    assert verdicts.index("frozen") * DT <= 0.25
    assert set(verdicts[verdicts.index("frozen") :]) == {"frozen"}
    assert guard.refuse((place[0] + 2.0, place[1]), (2.0, 0.0), now + 1.0) == "", "and is believed when it moves again"


def test_a_boat_at_rest_is_not_frozen():
    guard = PositionGuard()
    assert {guard.refuse((3.0, 4.0), (0.0, 0.0), DT * i) for i in range(1000)} == {""}


def test_after_a_gap_a_boat_may_be_farther_off():
    guard = PositionGuard()
    _, (x, y), now = drive(guard, 40)
    assert guard.refuse((x + 20.0, y + 8.0), (1.0, 0.5), now + 12.0) == ""


def test_what_is_no_number_is_refused():
    guard = PositionGuard()
    _, _, now = drive(guard, 40)
    assert guard.refuse((math.nan, 0.0), (1.0, 0.5), now) == "jump"
