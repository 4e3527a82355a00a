"""Tracks of all boats and the fleet made of them; several who tell of one boat: none wins for being fresher."""

import math

import numpy as np
import pytest
from bridge_fakes import fleet_of
from steerclear.shield import Commands
from steerclear.shield.bridge.failsafe import Failsafe, Seen
from steerclear.shield.bridge.fleet_settings import ContactLimit
from steerclear.shield.bridge.messages import Answer, BoatReading, Contact
from steerclear.shield.bridge.operator import Override
from steerclear.shield.bridge.tracker import MOST_GROUPS, ContactFusion, Tracker
from steerclear.shield.platforms import layout as L

LIMIT = ContactLimit()


def contact(source="hub", x=10.0, fixed_s=100.0, error_m=0.2, speed=0.0, boat="red_1", heading=0.0):
    return Contact(boat, (x, 5.0), heading, speed, fixed_s, error_m, source)


def own(now_s=100.0, heading=0.0):
    return BoatReading("blue_1", now_s, (0.0, 0.0), 0.0, heading, 0.0, 0.0, velocity_age_s=0.0)


def tracker_with(*contacts, reading=True, **settings):
    tracker = Tracker(fleet_of(blue=1, red=1, **settings), ["blue_1"])
    tracker.update(100.0, {"blue_1": own()} if reading else {}, contacts)
    return tracker


def test_the_fleet_is_in_the_files_order_with_ages_and_errors():
    fleet = tracker_with(contact(fixed_s=99.4), more="shield: {position_error_m: 0.1}").assemble({"blue_1"})
    assert fleet.names == ("blue_1", "red_1")
    assert fleet.controlled.tolist() == [True, False]
    assert fleet.age_s == pytest.approx([0.0, 0.6])
    assert fleet.position_error_m == pytest.approx([0.1, 0.2])
    assert np.isnan(fleet.state[1, L.THRUST])


def test_each_fault_of_a_boat_is_logged_and_the_same_one_with_other_figures_seldom(caplog):
    """The texts of two faults may begin with one word."""
    tracker = tracker_with(contact())
    for k, x in enumerate((2e5, 2.1e5, 60.0, 61.0)):
        at = 100.1 + 0.01 * k
        tracker.update(at, {}, [contact(x=x, fixed_s=at)])
    told = [record.message for record in caplog.records]
    assert len(told) == 2, told
    assert "nowhere near" in told[0]
    assert "jumped" in told[1]


def test_a_boat_never_seen_is_left_out_and_one_once_seen_stays():
    tracker = tracker_with()
    assert tracker.assemble({"blue_1"}).names == ("blue_1",)
    tracker.update(100.1, {"blue_1": own(100.1)}, [contact()])
    tracker.update(300.0, {"blue_1": own(300.0)}, [])
    fleet = tracker.assemble({"blue_1"})
    assert fleet.names == ("blue_1", "red_1")
    assert fleet.age_s[1] == pytest.approx(5.0), "a ghost grows no further"
    assert tracker.assemble({"blue_1"}, without={"red_1"}).names == ("blue_1",)


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        (contact(x=math.nan, fixed_s=100.5), "not finite"),
        (contact(x=2e5, fixed_s=100.5), "nowhere near"),
        (contact(speed=30.0, fixed_s=100.5), "beyond"),
        (contact(x=60.0, fixed_s=100.1), "jumped"),
        (contact(error_m=math.nan, fixed_s=100.5), "no bound"),
        (contact(error_m=-1.0, fixed_s=100.5), "no bound"),
        (contact(fixed_s=105.0), "future"),
    ],
)
def test_impossible_contacts_are_refused_and_said(bad, said, caplog):
    tracker = tracker_with(contact())
    for _ in range(3):
        tracker.update(100.5, {}, [bad])
        assert said in tracker.faults["red_1"]
    assert [said in line for line in caplog.messages] == [True], "logged once in a while"
    assert tracker.contact_age_s("red_1") == pytest.approx(0.5)
    tracker.update(100.6, {}, [contact(fixed_s=100.6)])
    assert tracker.faults == {}
    assert tracker.contact_age_s("red_1") == 0.0


def test_a_late_contact_changes_nothing_and_a_stranger_is_said_and_left_out():
    tracker = tracker_with(contact(x=11.0))
    tracker.update(100.1, {}, [contact(fixed_s=99.0)])
    assert tracker.track("red_1").row[L.X] == 11.0
    for k in range(400):
        tracker.update(101.0 + k, {}, [contact(boat=f"nobody_{k}")])
    assert "not in the fleet file" in tracker.faults["nobody_399"]
    assert len(tracker._logged_s) <= 300, "names on the feed are anybody's: nothing may grow with them"


def test_an_own_boat_without_all_its_fields_is_unknown_and_known_from_the_feed_when_that_is_younger():
    tracker = tracker_with(reading=False)
    for reading in (own(heading=math.nan), BoatReading("blue_1", 100.0)):
        tracker.update(100.0, {"blue_1": reading}, [])
        assert tracker.navigation_age_s("blue_1") == math.inf
        assert tracker.track("blue_1") is None
    tracker.update(100.0, {"blue_1": own()}, [])
    tracker.update(104.0, {}, [contact(boat="blue_1", x=3.0, fixed_s=103.9)])
    assert tracker.track("blue_1").row[L.X] == 3.0
    assert tracker.navigation_age_s("blue_1") == pytest.approx(4.0)


def test_an_old_track_of_ours_has_a_growing_error():
    tracker, errors = tracker_with(more="shield: {track_error_mps: 0.5}"), []
    for k in range(1, 100):
        tracker.update(100.0 + 0.1 * k, {}, [])
        errors.append(tracker.assemble(set()).position_error_m[0])
    assert errors[9] == pytest.approx(0.5)
    assert max(errors) == pytest.approx(2.5)
    assert np.diff(errors).min() >= -1e-12


def test_what_policies_see_is_run_on_to_now():
    seen = tracker_with(contact(fixed_s=99.0, speed=2.0, heading=math.pi / 2)).seen_now()
    assert seen[1] == pytest.approx([12.0, 5.0, 90.0, 2.0])
    assert np.isnan(tracker_with(reading=False).seen_now()).all()


def fused(*contacts):
    fusion = ContactFusion(2.0, LIMIT.max_age_s, LIMIT.lost_after_s)
    for entry in contacts:
        assert fusion.take(entry, 100.0) == ""
    return fusion


@pytest.mark.parametrize("apart_m", [10.0, 30.0, 1000.0])
@pytest.mark.parametrize("fresher_s", [0.0, 0.19])
def test_who_contradicts_is_a_rival_at_once_however_fresh_and_exact(apart_m, fresher_s):
    view = fused(contact(fixed_s=99.8), contact("evil", 10.0 + apart_m, 99.8 + fresher_s, 0.0)).view(100.0)
    assert view.contact.source == "hub"
    assert [rival.position_m for rival in view.rivals] == [(10.0 + apart_m, 5.0)]
    assert "hub has it at one place, evil" in view.text


@pytest.mark.parametrize("apart_m", [0.5, 1.0, 2.0, 3.0])
def test_bounds_that_exclude_each_other_are_covered_both(apart_m):
    view = fused(contact(), contact("link", 10.0 + apart_m)).view(100.0)
    assert view.rivals == ()
    for x in (10.0, 10.0 + apart_m):
        assert abs(x - view.contact.position_m[0]) + 0.2 <= view.contact.error_m + 1e-9


@pytest.mark.parametrize("off_m", [0.0, 5.0, 40.0, 900.0])
def test_a_vague_word_moves_and_widens_no_sure_one(off_m):
    view = fused(contact("evil", 10.0 + off_m, error_m=off_m + 1.0), contact(fixed_s=99.9)).view(100.0)
    assert view.contact == contact(fixed_s=99.9)
    assert view.text == ""


def test_who_contradicts_with_a_vague_word_cannot_be_kept_clear_of():
    view = fused(contact(), contact("evil", 200.0, error_m=100.0)).view(100.0)
    assert (view.contact, view.rivals, view.crowded) == (contact(), (), True)
    assert "evil 190 m from there" in view.text


def test_who_falls_silent_is_kept_clear_of_until_it_would_be_lost():
    fusion = fused(contact(), contact("evil", 40.0))
    for now_s, rivals in ((101.0, ["evil"]), (104.9, ["evil"]), (106.0, [])):
        fusion.take(contact(fixed_s=now_s), now_s)
        assert [rival.source for rival in fusion.view(now_s).rivals] == rivals


def test_when_the_first_falls_silent_who_speaks_counts_and_the_first_is_still_kept_clear_of():
    fusion = fused(contact(), contact("evil", 40.0))
    fusion.take(contact("evil", 40.0, 103.0), 103.0)
    view = fusion.view(103.0)
    assert (view.contact.source, [rival.source for rival in view.rivals]) == ("evil", ["hub"])
    assert fusion.view(200.0).contact.source == "evil", "the last that was known"


@pytest.mark.parametrize("more", [0, 1])
def test_more_stories_than_can_be_kept_clear_of_are_too_many(more):
    view = fused(*(contact(f"s{k}", 30.0 * k) for k in range(MOST_GROUPS + more))).view(100.0)
    assert (view.crowded, len(view.rivals)) == (bool(more), MOST_GROUPS - 1)
    assert ("others elsewhere" in view.text) == bool(more)


def test_each_source_is_checked_against_itself_alone():
    fusion = fused(contact())
    assert "jumped" in fusion.take(contact("hub", 60.0, 100.1), 100.1)
    assert fusion.take(contact("other", 60.0, 100.1), 100.1) == ""
    assert fusion.take(contact("hub", 10.0, 100.2), 100.2) == ""


def test_the_shield_is_given_a_ghost_wherever_a_contradicted_boat_may_be():
    tracker = tracker_with(contact(), contact("evil", 40.0))
    fleet = tracker.assemble({"blue_1"})
    assert fleet.names == ("blue_1", "red_1", "red_1~2")
    assert fleet.state[1:, 0].tolist() == [10.0, 40.0]
    assert fleet.team.tolist() == [0, 1, 1]
    assert fleet.controlled.tolist() == [True, False, False]
    assert tracker.assemble({"blue_1"}, without={"red_1"}).names == ("blue_1",)
    assert len(tracker.seen_now()) == 2, "the policy is shown boats, not ghosts"


def judged(tracker, subject, **changes):
    """The verdict, and what is told of the contacts of a boat: response and text."""
    answer = Answer(Commands.absolute_rad(np.zeros((2, 2))), 0.0)
    seen = Seen(100.0, {"blue_1": own()}, answer, alarms=tracker.alarms(), **changes)
    verdict = Failsafe(tracker.fleet, tracker).judge(seen)
    ((response, text),) = [
        (a.response, a.text) for a in verdict.actions if (a.subject, a.condition) == (subject, "contact")
    ]
    return verdict, response, text


def test_a_contradiction_slows_boats_at_once_and_too_many_stories_are_as_a_lost_contact():
    verdict, response, text = judged(tracker_with(contact(), contact("evil", 40.0)), "red_1")
    assert (response, verdict.responses["blue_1"]) == ("slow", "slow")
    assert "hub has it at one place, evil 30 m from there" in text
    groups = (contact(f"s{k}", 30.0 * k) for k in range(MOST_GROUPS + 1))
    assert judged(tracker_with(*groups), "red_1")[1] == "stop"


def test_the_operator_may_switch_the_response_off_and_ghosts_stay():
    tracker = tracker_with(contact(), contact("evil", 40.0))
    verdict, response, _ = judged(tracker, "red_1", overrides=(Override("contact", "red_1", 200.0, "key"),))
    assert response == "none"
    assert "blue_1" not in verdict.responses
    assert "red_1~2" in tracker.assemble({"blue_1"}).names


def test_of_an_own_boat_its_own_link_tells_and_contradicting_witnesses_are_none():
    tracker = tracker_with(contact(boat="blue_1"), contact("evil", 40.0, boat="blue_1"), contact())
    assert tracker.assemble({"blue_1"}).names == ("blue_1", "red_1")
    _, response, text = judged(tracker, "blue_1")
    assert response == "none"
    assert "evil" in text
    tracker.update(103.0, {}, [contact("hub", 10.0, 103.0, boat="blue_1"), contact("evil", 40.0, 103.0, boat="blue_1")])
    assert tracker.known_age_s("blue_1") == pytest.approx(3.0), "nobody's word is taken for it"
