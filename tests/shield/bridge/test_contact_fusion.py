"""Several who tell of one boat: who agrees is one story, who contradicts another, and none wins for being fresher."""

import math

import numpy as np
import pytest
from bridge_fakes import fleet_of
from steerclear.shield import Commands
from steerclear.shield.bridge.failsafe import Failsafe, Seen
from steerclear.shield.bridge.fleet_settings import ContactLimit
from steerclear.shield.bridge.messages import Answer, BoatReading, Contact
from steerclear.shield.bridge.operator import Override
from steerclear.shield.bridge.tracker import MOST_STORIES, ContactFusion, Tracker

LIMIT = ContactLimit()


def contact(source, x=10.0, fixed_s=100.0, error_m=0.2, speed=0.0, boat="red_1"):
    return Contact(boat, (x, 5.0), 0.0, speed, fixed_s, error_m, source)


def seen(*contacts, now_s=100.0):
    sightings = ContactFusion(2.0, LIMIT.max_age_s, LIMIT.lost_after_s)
    for entry in contacts:
        assert sightings.take(entry, now_s) == ""
    return sightings


@pytest.mark.parametrize("apart_m", [10.0, 30.0, 1000.0])
@pytest.mark.parametrize("fresher_s", [0.0, 0.1, 0.19])
def test_who_contradicts_is_a_rival_at_once_however_fresh_and_exact(apart_m, fresher_s):
    view = seen(contact("hub", fixed_s=99.8), contact("evil", 10.0 + apart_m, 99.8 + fresher_s, 0.0)).view(100.0)
    assert view.contact.source == "hub"
    assert [rival.position_m for rival in view.rivals] == [(10.0 + apart_m, 5.0)]
    assert "hub has it at one place, evil" in view.text


@pytest.mark.parametrize("apart_m", [0.5, 1.0, 2.0, 3.0])
def test_bounds_that_exclude_each_other_are_covered_both(apart_m):
    view = seen(contact("hub"), contact("link", 10.0 + apart_m, 100.0)).view(100.0)
    assert view.rivals == ()
    told = view.contact
    for x, error_m in ((10.0, 0.2), (10.0 + apart_m, 0.2)):
        assert abs(x - told.position_m[0]) + error_m <= told.error_m + 1e-9


@pytest.mark.parametrize("off_m", [0.0, 5.0, 40.0, 900.0])
def test_a_vague_word_moves_and_widens_no_sure_one(off_m):
    view = seen(contact("evil", 10.0 + off_m, error_m=off_m + 1.0), contact("hub", fixed_s=99.9)).view(100.0)
    assert view.contact == contact("hub", fixed_s=99.9)
    assert view.text == ""


def test_who_contradicts_with_a_vague_word_cannot_be_kept_clear_of():
    view = seen(contact("hub"), contact("evil", 200.0, error_m=100.0)).view(100.0)
    assert (view.contact, view.rivals, view.crowded) == (contact("hub"), (), True)
    assert "evil 190 m from there" in view.text


def test_who_falls_silent_is_kept_clear_of_until_it_would_be_lost():
    sightings = seen(contact("hub"), contact("evil", 40.0))
    for now_s in (101.0, 104.9):
        sightings.take(contact("hub", fixed_s=now_s), now_s)
        assert [rival.source for rival in sightings.view(now_s).rivals] == ["evil"]
    sightings.take(contact("hub", fixed_s=106.0), 106.0)
    assert sightings.view(106.0).rivals == ()


def test_when_the_first_falls_silent_who_speaks_counts_and_the_first_is_still_kept_clear_of():
    sightings = seen(contact("hub"), contact("evil", 40.0))
    sightings.take(contact("evil", 40.0, 103.0), 103.0)
    view = sightings.view(103.0)
    assert (view.contact.source, [rival.source for rival in view.rivals]) == ("evil", ["hub"])
    assert sightings.view(200.0).contact.source == "evil", "the last that was known"


def test_more_stories_than_can_be_kept_clear_of_are_too_many():
    few = seen(*(contact(f"s{k}", 30.0 * k) for k in range(MOST_STORIES))).view(100.0)
    many = seen(*(contact(f"s{k}", 30.0 * k) for k in range(MOST_STORIES + 1))).view(100.0)
    assert not few.crowded
    assert many.crowded
    assert len(many.rivals) == MOST_STORIES - 1
    assert "others elsewhere" in many.text


def test_each_source_is_checked_against_itself_alone():
    sightings = seen(contact("hub"))
    assert "jumped" in sightings.take(contact("hub", 60.0, 100.1), 100.1)
    assert sightings.take(contact("other", 60.0, 100.1), 100.1) == ""
    assert sightings.take(contact("hub", 10.0, 100.2), 100.2) == ""
    assert "no bound" in sightings.take(contact("x", error_m=math.inf), 100.0)
    assert "in the future" in sightings.take(contact("x", fixed_s=101.0), 100.0)


def reading(now_s=100.0):
    return BoatReading("blue_1", now_s, (0.0, 0.0), 0.0, 0.0, 0.0, 0.0, velocity_age_s=0.0)


def roster_with(*contacts):
    roster = Tracker(fleet_of(blue=1, red=1), ["blue_1"])
    roster.update(100.0, {"blue_1": reading()}, contacts)
    return roster


def test_the_shield_is_given_a_ghost_wherever_a_contradicted_boat_may_be():
    roster = roster_with(contact("hub"), contact("evil", 40.0))
    fleet = roster.assemble({"blue_1"})
    assert fleet.names == ("blue_1", "red_1", "red_1~2")
    assert fleet.state[1:, 0].tolist() == [10.0, 40.0]
    assert fleet.team.tolist() == [0, 1, 1]
    assert fleet.controlled.tolist() == [True, False, False]
    assert roster.assemble({"blue_1"}, without={"red_1"}).names == ("blue_1",)
    assert len(roster.seen_now()) == 2, "the policy is shown boats, not ghosts"
    assert np.isfinite(roster.seen_now()).all()


def verdict_of(roster, **changes):
    answer = Answer(Commands.absolute_rad(np.zeros((2, 2))), 0.0)
    seen = Seen(100.0, {"blue_1": reading()}, answer, alarms=roster.alarms(), **changes)
    return Failsafe(roster.fleet, roster).judge(seen)


def actions_of(verdict, subject):
    return [(a.response, a.text) for a in verdict.actions if (a.subject, a.condition) == (subject, "contact")]


def test_a_contradiction_is_declared_at_once_and_boats_go_slow():
    verdict = verdict_of(roster_with(contact("hub"), contact("evil", 40.0)))
    ((response, text),) = actions_of(verdict, "red_1")
    assert response == "slow"
    assert "hub has it at one place, evil 30 m from there" in text
    assert verdict.responses["blue_1"] == "slow"


def test_too_many_stories_are_as_a_lost_contact():
    roster = roster_with(*(contact(f"s{k}", 30.0 * k) for k in range(MOST_STORIES + 1)))
    assert actions_of(verdict_of(roster), "red_1")[0][0] == "stop"


def test_the_operator_may_switch_the_response_off_and_ghosts_stay():
    roster = roster_with(contact("hub"), contact("evil", 40.0))
    verdict = verdict_of(roster, overrides=(Override("contact", "red_1", 200.0, "key"),))
    assert [response for response, _ in actions_of(verdict, "red_1")] == ["none"]
    assert "blue_1" not in verdict.responses
    assert "red_1~2" in roster.assemble({"blue_1"}).names


def test_of_an_own_boat_its_own_link_tells_and_contradicting_witnesses_are_none():
    roster = roster_with(contact("hub", boat="blue_1"), contact("evil", 40.0, boat="blue_1"), contact("hub"))
    assert roster.assemble({"blue_1"}).names == ("blue_1", "red_1")
    ((response, text),) = actions_of(verdict_of(roster), "blue_1")
    assert response == "none"
    assert "evil" in text
    roster.update(103.0, {}, [contact("hub", 10.0, 103.0, boat="blue_1"), contact("evil", 40.0, 103.0, boat="blue_1")])
    assert roster.known_age_s("blue_1") == pytest.approx(3.0), "nobody's word is taken for it"
