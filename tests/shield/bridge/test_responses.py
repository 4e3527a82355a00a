"""What each response asks for, and where it began."""

import math

import numpy as np
import pytest
from bridge_fakes import fleet_of
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield import Commands, Fleet, Shield, Surroundings
from steerclear.shield.bridge.responses import STRENGTH, Responder, strongest
from steerclear.shield.platforms import fresh_state, get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.step import step_boat

FENCE = fleet_of().geofence


def responder():
    return Responder(get_platform("heron"), FENCE)


def test_hold_course_keeps_what_was_when_it_began():
    made = responder()
    assert made.wanted("hold_course", fresh_state(0.0, 0.0, 90.0, 1.5)) == (1.5, pytest.approx(math.pi / 2))
    assert made.wanted("hold_course", fresh_state(5.0, 0.0, 120.0, 0.5)) == (1.5, pytest.approx(math.pi / 2))
    made.clear()
    assert made.wanted("hold_course", fresh_state(5.0, 0.0, 180.0, 0.5)) == (0.5, pytest.approx(math.pi))


def test_slow_halves_and_stop_stops():
    assert responder().wanted("slow", fresh_state(0.0, 0.0, -90.0, 2.0)) == (1.0, pytest.approx(1.5 * math.pi))
    assert responder().wanted("stop", fresh_state(0.0, 0.0, 0.0, 2.0)) == (0.0, 0.0)


def test_a_boat_told_to_stop_takes_the_heading_it_was_turned_to():
    made = responder()
    assert made.wanted("stop", fresh_state(0.0, 0.0, 90.0, 2.0)) == (0.0, pytest.approx(0.5 * math.pi))
    assert made.wanted("stop", fresh_state(0.0, 0.0, 120.0, 2.0)) == (0.0, pytest.approx(math.radians(120.0)))


@pytest.mark.parametrize("heading_deg", [-34.4, 0.0, 20.0, 75.0])
def test_a_boat_told_to_stop_near_an_edge_comes_to_rest_inside(heading_deg):
    """Sent back to the heading it had, towards the edge, it crept along it for minutes."""
    heron, shield = get_platform("heron").pack(), Shield(surroundings=Surroundings(field=(-5, -5, 85, 45)))
    state = fresh_state(45.0, 41.5, heading_deg, 1.7)
    state[L.THRUST] = 80.0
    made = responder()
    for _ in range(400):
        fleet = Fleet.of(
            position_m=state[None, [L.X, L.Y]],
            heading_rad=np.radians(state[[L.HEADING]]),
            speed_mps=state[[L.SPEED]],
            team=[0],
            platforms="heron",
            thrust=state[[L.THRUST]],
        )
        sent = shield.decide(fleet, Commands.absolute_rad([made.wanted("stop", state)])).sent.values[0]
        error = (math.degrees(sent[1]) - state[L.HEADING] + 180.0) % 360.0 - 180.0
        step_boat(heron, state, sent[0], error, 0.1)
        assert state[L.Y] < 45.0
    assert state[L.SPEED] < 0.1


def test_hold_station_steers_back_when_far():
    made = responder()
    assert made.wanted("hold_station", fresh_state(10.0, 10.0, 0.0, 1.0))[0] == 0.0
    assert made.wanted("hold_station", fresh_state(12.0, 10.0, 0.0, 1.0))[0] == 0.0
    speed, heading = made.wanted("hold_station", fresh_state(14.0, 10.0, 0.0, 0.0))
    assert (speed, heading) == (1.0, pytest.approx(1.5 * math.pi))


def test_return_steers_to_the_nearest_water_inside():
    speed, heading = responder().wanted("return", fresh_state(20.0, 70.0, 0.0, 1.0))
    assert (speed, heading) == (1.0, pytest.approx(math.pi))
    assert responder().wanted("return", fresh_state(20.0, 20.0, 0.0, 1.0))[0] == 0.0


def test_another_response_begins_anew():
    made = responder()
    made.wanted("hold_course", fresh_state(0.0, 0.0, 90.0, 1.5))
    assert made.wanted("slow", fresh_state(0.0, 0.0, 0.0, 1.0)) == (0.5, 0.0)


@settings(max_examples=60, derandomize=True)
@given(
    st.sampled_from([name for name in STRENGTH if name != "go_on"]),
    st.floats(-200, 200), st.floats(-200, 200), st.floats(-180, 180), st.floats(-1.0, 3.0),
)  # fmt: skip
def test_every_response_is_a_finite_command(response, x, y, heading, speed):
    wanted = responder().wanted(response, fresh_state(x, y, heading, speed))
    assert 0.0 <= wanted[0] <= 3.0
    assert 0.0 <= wanted[1] < 2.0 * math.pi + 1e-12


def test_the_strongest_wins():
    assert strongest([]) == "go_on"
    assert strongest(["slow", "hold_course"]) == "slow"
    assert strongest(["hold_station", "stop", "return"]) == "stop"
