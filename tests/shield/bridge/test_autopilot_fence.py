"""The autopilot's own fence is accepted only where no boat gets to before the shield has stopped it."""

import math
from types import SimpleNamespace

import pytest
from bridge_fakes import fleet_of, fleet_text
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.link_checks import check_fence, hard_line, needed_m, stopping_way_m
from steerclear.shield.bridge.mavlink.fence import FenceReader, FenceZone
from steerclear.shield.platforms import get_platform

FLEET = fleet_of(platform="ardurover_boat")
ON = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 4.0, "FENCE_MARGIN": 2.0, "AVOID_ENABLE": 0.0}
NEEDED_M = needed_m(FLEET, "blue_1", {"FENCE_MARGIN": 2.0, "AVOID_MARGIN": 2.0, "AVOID_ENABLE": 0.0})


def places(*points):
    return tuple(FLEET.frame.to_geodetic_deg(*point) for point in points)


def box(out_m, inside=True):
    """A rectangle so far outside the hard line."""
    xmin, ymin, xmax, ymax = hard_line(FLEET)
    a, b, c, d = xmin - out_m, ymin - out_m, xmax + out_m, ymax + out_m
    return FenceZone(inside, places((a, b), (c, b), (c, d), (a, d)))


def checked(zones, parameters=ON, home=None, fleet=FLEET):
    health = SimpleNamespace(parameters=parameters, fence=zones, home_deg=home)
    return check_fence("blue_1", fleet, SimpleNamespace(health=lambda: health))


def test_the_hard_line_lies_ten_metres_out_and_the_boat_needs_its_way_to_stop():
    assert hard_line(FLEET) == (-30.0, -30.0, 110.0, 70.0)
    assert stopping_way_m(get_platform("ardurover_boat")) + 2.0 < NEEDED_M
    assert stopping_way_m(get_platform("heron")) == pytest.approx(9.4, abs=0.5)


@pytest.mark.parametrize("more_m", [-1.0, -0.1, 0.1, 5.0])
def test_a_fence_around_the_water_is_taken_where_a_boat_can_stop_before_it(more_m):
    result = checked([box(NEEDED_M + more_m)])
    assert result.passed == (more_m > 0.0)
    assert result.figures["fence_room_m"] == pytest.approx(NEEDED_M + more_m, abs=0.05)
    assert f"{NEEDED_M:.1f} m" in result.text
    if not result.passed:
        assert "move the fence out by" in result.text


REFUSED = {
    "through the water": box(-5.0),
    "too near on one side": FenceZone(True, places((-200, -200), (111, -200), (111, 200), (-200, 200))),
    "a keep-out zone in the water": box(-45.0, inside=False),
    "a keep-out circle near": FenceZone(False, places((125.0, 20.0)), 10.0),
    "a circle to stay in": FenceZone(True, places((40.0, 20.0)), 80.0),
    "inside out": box(50.0, inside=False),
    "elsewhere": FenceZone(True, places((500, 500), (600, 500), (600, 600))),
    "an edge across a corner": FenceZone(
        True, places((-200, -200), (300, -200), (300, -130), (-130, 300), (-200, 300))
    ),
}


@pytest.mark.parametrize("case", sorted(REFUSED))
def test_a_fence_a_boat_may_meet_is_refused_with_figures(case):
    result = checked([box(80.0), REFUSED[case]])
    assert not result.passed
    assert "the hard line" in result.text
    assert result.figures["fence_room_m"] < NEEDED_M


def test_zones_far_off_are_taken():
    result = checked(
        [box(80.0), FenceZone(False, places((400.0, 20.0)), 10.0), FenceZone(True, places((40, 20)), 300.0)]
    )
    assert result.passed, result.text


def test_the_circle_around_home_counts():
    home = places((40.0, 20.0))[0]
    circle = {**ON, "FENCE_TYPE": 2.0}
    assert not checked((), {**circle, "FENCE_RADIUS": 60.0}, home).passed
    assert checked((), {**circle, "FENCE_RADIUS": 300.0}, home).passed
    assert "cannot be read" in checked((), {**circle, "FENCE_RADIUS": 300.0}).text


def test_a_fence_nobody_heard_is_not_taken_and_one_that_is_off_is():
    assert "cannot be read" in checked(None).text
    assert checked(None, {"FENCE_ENABLE": 0.0}).passed
    assert checked(None, {}).passed


@pytest.mark.parametrize(
    ("action", "words"),
    [(0.0, "only reports"), (1.0, "FENCE_ACTION is 1 (RTL)"), (4.0, "past the shield: set it to 2"), (2.0, "")],
)
def test_a_fence_is_a_last_resort_only_where_it_holds_the_boat(action, words):
    result = checked([box(80.0)], {**ON, "FENCE_ACTION": action})
    assert result.passed == (not words), result.text
    assert words in result.text


def test_where_boats_may_flee_for_ever_no_fence_is_taken():
    fleet = parse_fleet(fleet_text(platform="ardurover_boat").replace("geofence: {", "geofence: {then: flee, "))
    assert "then is flee" in checked([box(500.0)], fleet=fleet).text


class Autopilot:
    """Answers questions for a fence, every second one."""

    def __init__(self, items):
        self.items, self.asked, self.reader = items, 0, None

    def send(self, message):
        self.asked += 1
        if self.asked % 2:
            return True  # lost
        kind = message.get_type()
        if kind == "COMMAND_LONG":
            place = 420000000, -710000000, 0, 0.0, 0.0, 0.0
            self.reader.hear(mavlink.MAVLink_home_position_message(*place, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0))
        elif kind == "MISSION_REQUEST_LIST":
            self.reader.hear(mavlink.MAVLink_mission_count_message(255, 0, len(self.items), mission_type=1))
        else:
            self.reader.hear(self.items[message.seq])
        return True


def item(number, command, place, first=0.0):
    x, y = (round(1e7 * value) for value in place)
    return mavlink.MAVLink_mission_item_int_message(255, 0, number, 0, command, 0, 0, first, 0, 0, 0, x, y, 0, 1)


def test_a_fence_is_read_over_a_radio_that_loses_half():
    zone = box(30.0)
    circle = FenceZone(False, places((400.0, 20.0)), 12.0)
    items = [item(k, 5001, place, 4.0) for k, place in enumerate(zone.places)]
    items.append(item(4, 5004, circle.places[0], 12.0))
    boat = Autopilot(items)
    boat.reader = reader = FenceReader((1, 1), boat.send)
    assert reader.zones is None
    for _ in range(30):
        reader.ask()
    assert reader.is_known
    assert reader.home_deg == (42.0, -71.0)
    found = reader.zones
    assert [one.inside for one in found] == [True, False]
    assert found[1].radius_m == 12.0
    for one, other in zip(found[0].places, zone.places, strict=True):
        assert math.dist(one, other) < 1e-6


def test_items_of_another_mission_are_no_fence():
    boat = Autopilot([])
    boat.reader = reader = FenceReader((1, 1), boat.send)
    reader.hear(mavlink.MAVLink_mission_count_message(255, 0, 3, mission_type=0))
    reader.hear(item(0, 5001, (42.0, -71.0), 3.0))
    assert reader.zones is None
