"""Tracks of all boats and the fleet made of them: ages, errors, what is refused, what is left out."""

import math

import numpy as np
import pytest
from bridge_fakes import fleet_of
from steerclear.shield.bridge.messages import BoatReading, Contact
from steerclear.shield.bridge.tracker import Tracker
from steerclear.shield.platforms import layout as L


def contact(boat="red_1", x=10.0, fixed_s=100.0, **changed):
    values = {"heading_rad": 0.0, "speed_mps": 1.0, "error_m": 0.2, "source": "test"}
    values.update(changed)
    return Contact(boat, (x, 5.0), values["heading_rad"], values["speed_mps"], fixed_s, values["error_m"], "test")


def own(x=0.0, now_s=100.0, age_s=0.0, **changed):
    values = {"heading_rad": 0.0, "speed_mps": 0.0, "position_m": (x, 0.0)}
    values.update(changed)
    return BoatReading("blue_1", now_s, position_age_s=age_s, heading_age_s=age_s, velocity_age_s=age_s, **values)


def roster_of(**settings):
    fleet = fleet_of(blue=1, red=1, **settings)
    return Tracker(fleet, ["blue_1"])


def test_the_fleet_is_in_the_files_order_with_ages_and_errors():
    roster = roster_of(more="shield: {position_error_m: 0.1}")
    roster.update(100.0, {"blue_1": own()}, [contact(fixed_s=99.4)])
    fleet = roster.assemble({"blue_1"})
    assert fleet.names == ("blue_1", "red_1")
    assert fleet.controlled.tolist() == [True, False]
    assert fleet.age_s == pytest.approx([0.0, 0.6])
    assert fleet.position_error_m == pytest.approx([0.1, 0.2])
    assert np.isnan(fleet.state[1, L.THRUST])


def test_a_boat_never_seen_is_left_out_and_one_once_seen_stays():
    roster = roster_of()
    roster.update(100.0, {"blue_1": own()}, [])
    assert roster.assemble({"blue_1"}).names == ("blue_1",)
    roster.update(100.1, {"blue_1": own(now_s=100.1)}, [contact()])
    roster.update(300.0, {"blue_1": own(now_s=300.0)}, [])
    fleet = roster.assemble({"blue_1"})
    assert fleet.names == ("blue_1", "red_1")
    assert fleet.age_s[1] == pytest.approx(5.0), "a ghost grows no further"
    assert roster.assemble({"blue_1"}, without={"red_1"}).names == ("blue_1",)


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        (contact(x=math.nan, fixed_s=100.5), "not finite"),
        (contact(speed_mps=30.0, fixed_s=100.5), "beyond"),
        (contact(x=60.0, fixed_s=100.1), "jumped"),
        (contact(error_m=math.nan, fixed_s=100.5), "no bound"),
        (contact(error_m=-1.0, fixed_s=100.5), "no bound"),
        (contact(fixed_s=105.0), "future"),
    ],
)
def test_impossible_contacts_are_refused_and_said(bad, said):
    roster = roster_of()
    roster.update(100.0, {}, [contact()])
    roster.update(100.5, {}, [bad])
    assert said in roster.faults["red_1"]
    assert roster.contact_age_s("red_1") == pytest.approx(0.5)
    roster.update(100.6, {}, [contact(fixed_s=100.6)])
    assert roster.faults == {}
    assert roster.contact_age_s("red_1") == 0.0


def test_a_late_contact_changes_nothing():
    roster = roster_of()
    roster.update(100.0, {}, [contact(x=11.0, fixed_s=100.0)])
    roster.update(100.1, {}, [contact(x=10.0, fixed_s=99.0)])
    assert roster.track("red_1").row[L.X] == 11.0


def test_a_stranger_is_said_and_left_out():
    roster = roster_of()
    for k in range(400):
        roster.update(100.0 + k, {}, [contact(boat=f"nobody_{k}")])
    assert "not in the fleet file" in roster.faults["nobody_399"]
    assert len(roster._logged_s) <= 300, "names on the feed are anybody's: nothing may grow with them"


def test_an_own_boat_without_all_its_fields_is_unknown():
    roster = roster_of()
    roster.update(100.0, {"blue_1": own(heading_rad=math.nan)}, [])
    assert roster.navigation_age_s("blue_1") == math.inf
    roster.update(100.0, {"blue_1": BoatReading("blue_1", 100.0)}, [])
    assert roster.track("blue_1") is None


def test_a_lost_boat_is_known_from_the_feed_when_that_is_younger():
    roster = roster_of()
    roster.update(100.0, {"blue_1": own()}, [])
    roster.update(104.0, {}, [contact(boat="blue_1", x=3.0, fixed_s=103.9)])
    assert roster.track("blue_1").row[L.X] == 3.0
    assert roster.navigation_age_s("blue_1") == pytest.approx(4.0)


def test_an_old_track_of_ours_has_a_growing_error():
    roster = roster_of(more="shield: {track_error_mps: 0.5}")
    roster.update(100.0, {"blue_1": own()}, [])
    errors = []
    for k in range(1, 100):
        roster.update(100.0 + 0.1 * k, {}, [])
        errors.append(roster.assemble(set()).position_error_m[0])
    assert errors[9] == pytest.approx(0.5)
    assert max(errors) == pytest.approx(2.5)
    assert np.diff(errors).min() >= -1e-12


def test_what_policies_see_is_run_on_to_now():
    roster = roster_of()
    roster.update(100.0, {"blue_1": own()}, [contact(fixed_s=99.0, speed_mps=2.0, heading_rad=math.pi / 2)])
    seen = roster.seen_now()
    assert seen[1] == pytest.approx([12.0, 5.0, 90.0, 2.0])
    assert np.isnan(roster_of().seen_now()).all()
