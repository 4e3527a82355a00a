"""A boat that somebody took from us is taken back when the operator asks, beside the loop, and never otherwise."""

import threading
import time

import pytest
from bridge_fakes import pair
from steerclear.shield.exceptions import LinkError, LinkRefused

TAKEN = {"ready": False, "why_not": "it is in MANUAL"}


def taken():
    """A run in which a pilot took a boat, and its link; ``prepare`` gives it back."""
    world = pair()
    world.run(1.0)
    link = world.links["blue_1"]
    link.changed, link.prepared = dict(TAKEN), 0

    def prepare(timeout_s, is_off):
        link.prepared += 1
        link.changed = {}

    link.prepare = prepare
    world.run(0.5)
    return world, link


def told(world):
    return [action.text for action in world.last.actions if action.condition == "take_back"]


def finish(world):
    """Wait for what is under way beside the loop, and let the loop see it."""
    for thread in list(world.loop._reacquisition._threads.values()):
        thread.join(20.0)
    world.run(0.2)


def test_nobody_takes_a_boat_back_by_itself():
    world, link = taken()
    sent = len(link.sent)
    world.run(5.0)
    assert (link.prepared, len(link.sent)) == (0, sent)
    assert told(world) == []


def test_the_operator_takes_it_back_and_it_is_in_the_record(caplog):
    world, link = taken()
    sent = len(link.sent)
    world.operator.take_back("blue_1", "keyboard")
    world.run(0.1)
    assert "asked for by keyboard" in told(world)[0] or "obeys" in told(world)[0]
    finish(world)
    assert link.prepared == 1
    assert "blue_1 is taken back and obeys" in told(world)[0]
    assert "asked for by keyboard" in caplog.text
    world.run(1.0)
    assert len(link.sent) > sent
    world.run(11.0)
    assert told(world) == []


def test_a_boat_that_refuses_is_told_and_the_loop_goes_on():
    world, link = taken()

    def refuse(timeout_s, is_off):
        raise LinkRefused("blue_1 refuses arming: safety switch; put that right, then start again")

    link.prepare = refuse
    world.operator.take_back("blue_1")
    world.run(0.1)
    finish(world)
    assert "not taken back: blue_1 refuses arming: safety switch" in told(world)[0]
    assert not world.last.sent["blue_1"].delivered


def test_the_loop_never_waits_for_it_and_a_second_press_asks_no_second_time():
    world, link = taken()
    goes_on, calls = threading.Event(), []

    def slow(timeout_s, is_off):
        calls.append(timeout_s)
        goes_on.wait(20.0)

    link.prepare = slow
    for _ in range(2):
        world.operator.take_back("blue_1")
        world.run(1.0)
    assert len(calls) == 1
    assert "is being taken back" in told(world)[0]
    goes_on.set()
    finish(world)


def until_called_off(link):
    """``prepare`` that lasts until it is called off; its calls, and how often it was."""
    calls = []

    def slow(timeout_s, is_off):
        end = time.monotonic() + 20.0
        while not is_off() and time.monotonic() < end:
            time.sleep(0.005)
        calls.append(is_off())
        raise LinkError("blue_1: called off")

    link.prepare = slow
    return calls


def test_stop_all_calls_it_off_and_nothing_is_taken_back_until_boats_go_on():
    world, link = taken()
    calls = until_called_off(link)
    world.operator.take_back("blue_1")
    world.run(0.1)
    world.operator.stop_all("key")
    world.run(0.1)
    finish(world)
    assert calls == [True]
    assert "called off" in told(world)[0]
    world.operator.take_back("blue_1")
    world.run(0.2)
    finish(world)
    assert calls == [True]
    assert "STOP ALL" in told(world)[0]


def test_the_end_of_the_run_calls_it_off():
    world, link = taken()
    calls = until_called_off(link)
    world.operator.take_back("blue_1")
    world.run(0.1)
    world.operator.end("key")
    world.loop.run()
    assert calls == [True]


@pytest.mark.parametrize(("boat", "text"), [("blue_2", "obeys"), ("red_9", "not commanded here")])
def test_a_boat_that_need_not_be_taken_is_not_asked(boat, text):
    world, link = taken()
    world.operator.take_back(boat)
    world.run(0.1)
    assert link.prepared == 0
    assert text in told(world)[0]
