"""What NAV_* and NODE_REPORTs say, how old that is, and what is refused."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from steerclear.shield.bridge.fleet_settings import ContactLimit
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.moos.state import MoosContacts, Navigation, parse_report
from steerclear.shield.bridge.moos.wire import Message
from steerclear.shield.bridge.tracker import ContactFusion

FRAME = FieldFrame(42.0, -71.0)
REPORT = "NAME=red_1,X=10.5,Y=-3,SPD=1.5,HDG=90,TYPE=HERON,MODE=DRIVE,TIME={time},LENGTH=4"


def nav(key, value, data="D"):
    return Message("N", key, data, "sim", value=value)


def fed(navigation, time_s, x=0.0, y=0.0, heading=0.0, speed=0.0):
    values = {"NAV_X": x, "NAV_Y": y, "NAV_HEADING": heading, "NAV_SPEED": speed}
    return [navigation.hear(nav(key, value), time_s, time_s + 0.01) for key, value in values.items()]


def test_values_of_one_stamp_are_one_fix_in_the_field():
    navigation = Navigation(FieldFrame(42.0, -71.0, 90.0), corner_m=(100.0, 50.0))
    fed(navigation, 5.0, x=110.0, y=50.0, heading=90.0, speed=-1.25)
    assert navigation.position_m == pytest.approx((0.0, 10.0))  # the field's y axis points east
    assert navigation.heading_rad == pytest.approx(0.0)
    assert (navigation.speed_mps, navigation.position_s, navigation.speed_s) == (-1.25, 5.0, 5.0)


def test_x_of_one_moment_and_y_of_another_are_no_position():
    navigation = Navigation(FRAME)
    navigation.hear(nav("NAV_X", 1.0), 5.0, 5.0)
    navigation.hear(nav("NAV_Y", 2.0), 5.1, 5.1)
    assert math.isnan(navigation.position_m[0])
    navigation.hear(nav("NAV_X", 1.1), 5.1, 5.1)
    assert navigation.position_m == (1.1, 2.0)


def test_one_that_comes_late_or_again_changes_nothing_and_one_that_begins_anew_is_told():
    navigation = Navigation(FRAME)
    for time_s, x in ((5.0, 1.0), (4.9, 2.0), (5.0, 3.0)):
        fed(navigation, time_s, x=x)
    assert navigation.position_m == (1.0, 0.0)
    assert any("started anew" in text for text in fed(navigation, 1.0, x=9.0))
    fed(navigation, 1.1, x=9.0)
    assert navigation.position_m == (9.0, 0.0)


@pytest.mark.parametrize("key", ["NAV_X", "NAV_Y", "NAV_HEADING", "NAV_SPEED"])
@pytest.mark.parametrize("value", [math.nan, -math.inf, 1e300])
def test_no_number_and_no_place_is_taken_for_one(key, value):
    navigation = Navigation(FRAME)
    fed(navigation, 5.0, x=1.0, y=2.0, heading=3.0, speed=1.0)
    assert "refused" in navigation.hear(nav(key, value), 5.1, 5.1)
    assert sum(navigation.faults.values()) == 1
    assert (navigation.position_m, navigation.speed_mps) == ((1.0, 2.0), 1.0)


def test_a_string_and_a_stamp_of_tomorrow_are_told_in_words():
    navigation = Navigation(FRAME)
    assert "restart the MOOSDB" in navigation.hear(nav("NAV_X", -1.0, "S"), 5.0, 5.0)
    assert "MOOSTimeWarp" in navigation.hear(nav("NAV_X", 1.0), 50.0, 5.0)
    assert navigation.faults == {"type_clash": 1, "clock": 1}


@pytest.fixture
def contacts():
    return MoosContacts(FRAME, (0.5, 0.0), ("red_1", "blue_1"), 0.3)


def test_both_forms_of_a_report_are_read_and_braces_keep_their_commas():
    plain = parse_report("NAME=red_1,TRAJECTORY={1,2:3,4,id=7},X=1,,junk,SPD=2")
    assert plain == {"NAME": "red_1", "TRAJECTORY": "{1,2:3,4,id=7}", "X": "1", "SPD": "2"}
    assert parse_report('{"name":"red_1","X":1.5,"SPD":"2"}') == {"NAME": "red_1", "X": "1.5", "SPD": "2"}


def test_a_report_is_a_contact_with_the_age_of_its_time(contacts):
    assert contacts.hear(REPORT.format(time=1000.0), "blue_1", -900.0, 100.4) == ""
    (contact,) = contacts.read()
    assert contact.position_m == pytest.approx((10.0, -3.0))
    assert (contact.speed_mps, contact.fixed_s, contact.source) == (1.5, 100.0, "moos:blue_1")
    assert contact.heading_rad == pytest.approx(math.pi / 2)
    contacts.hear(REPORT.format(time=2000.0), "blue_1", -900.0, 101.0)  # a clock that is ahead gains nothing
    assert contacts.read()[0].fixed_s == 101.0
    contacts.hear("NAME=red_1,LAT=42.0001,LON=-71,SPD=0,HDG=0,TIME=1", "blue_1", 0.0, 1.0)
    assert contacts.read()[0].position_m == pytest.approx((0.0, 11.1), abs=0.1), "without X and Y"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "cannot be read"),
        ("NAME=red_1,X=1,Y=2,SPD=nan,HDG=0,TIME=1", "no number"),
        ("NAME=red_1,X=1,Y=inf,SPD=1,HDG=0,TIME=1", "no number"),
        ("NAME=red_1,X=one,Y=2,SPD=1,HDG=0,TIME=1", "cannot be read"),
        ("NAME=red_1,SPD=1,HDG=0,TIME=1", "cannot be read"),
        ("NAME=red_1,LAT=95,LON=0,SPD=1,HDG=0,TIME=1", "cannot be read"),
        ('{"NAME":', "cannot be read"),
        ("[1,2]", "cannot be read"),
        ("A" * 70_000, "cannot be read"),
    ],
)
def test_what_is_no_report_is_told_and_leaves_nothing(contacts, text, why):
    assert why in contacts.hear(text, "blue_1", 0.0, 1.0)
    assert contacts.read() == ()


@given(st.text(max_size=200))
def test_no_text_breaks_the_reader(text):
    heard = MoosContacts(FRAME, (0.0, 0.0), ("red_1",), 0.3)
    heard.hear(text, "blue_1", 0.0, 1.0)
    assert all(math.isfinite(value) for contact in heard.read() for value in contact.position_m)


def test_a_boat_that_is_not_in_the_file_raises_an_alarm_while_it_reports(contacts):
    contacts.hear(REPORT.format(time=1.0).replace("red_1", "stranger"), "blue_1", 0.0, 1.0)
    assert "nobody keeps clear of 'stranger', which is not in the fleet file: add it" in contacts.alarms()[0].text
    contacts.hear(REPORT.format(time=7.0), "blue_1", 0.0, 7.0)
    assert contacts.alarms() == ()


def test_a_contact_that_stands_still_while_its_speed_says_otherwise_is_old_whatever_its_time_says(contacts):
    fusion, ages = ContactFusion(2.0, ContactLimit().max_age_s, ContactLimit().lost_after_s), []
    for k in range(20):  # 2 Hz, fresh stamps, frozen X and Y, 1.5 m/s
        now = 0.5 * k
        contacts.hear(REPORT.format(time=now), "blue_1", 0.0, now)
        text = fusion.take(contacts.read()[0], now)
        ages.append(now - fusion.view(now).contact.fixed_s)
    assert "frozen" in text
    assert ages[-1] > 8.0
    assert next(0.5 * k for k, age in enumerate(ages) if age > 1.0) <= 2.5
