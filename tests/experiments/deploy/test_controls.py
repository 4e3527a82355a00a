"""Keys: what they do to the operator, and that they come one by one from a terminal that is left as it was."""

import os
import termios
import time

import pytest
from made_ticks import wait_for
from steerclear.experiments.deploy.dashboard import Controls, Keyboard
from steerclear.experiments.sim_boats.demo import demo_fleet
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.failsafe_table import DISABLES
from steerclear.shield.bridge.operator import Operator


@pytest.fixture
def controls():
    """Keys' meaning with an operator and a clock that both can be looked at."""
    operator = Operator()
    made = Controls(demo_fleet(), operator, ManualClock(7.0))

    def press(keys):
        for key in keys:
            made.press(key)

    return made, operator, press


@pytest.mark.parametrize("key", [" ", "s", "S"])
@pytest.mark.parametrize("before", ["", "o", "o1", "o12", "x\x1b\n"])
def test_the_stop_key_stops_whatever_is_open(controls, key, before):
    made, operator, press = controls
    press(before + key)
    assert (operator.stopped, operator.hard, made.menu()) == ("keyboard", False, [])


@pytest.mark.parametrize("taps", [" " * 50, "  ", "ss", " S", "s sS  "])
def test_no_number_of_presses_of_the_stop_key_goes_past_the_shield(controls, taps):
    made, operator, press = controls
    press(taps)
    assert operator.stopped
    assert not operator.hard
    assert "past the shield" in made.menu()[0]
    press("y")
    assert operator.hard
    assert made.menu() == []
    press(" ")
    assert operator.hard, "the stop key takes nothing back"


@pytest.mark.parametrize("other", ["n", "\x1b", "r", "q"])
def test_any_other_answer_stays_behind_the_shield(controls, other):
    made, operator, press = controls
    press("  " + other)
    assert (operator.stopped, operator.hard, operator.ended, made.menu()) == ("keyboard", False, "", [])
    press("y")
    assert not operator.hard


def test_resuming_asks_first_and_the_stop_key_then_stops_again(controls):
    made, operator, press = controls
    press("r")
    assert made.menu() == []
    press(" r")
    assert "Take STOP ALL back?" in made.menu()[0]
    press("n")
    assert operator.stopped
    press("ry")
    assert not operator.stopped
    press(" ")
    assert operator.stopped
    assert not operator.hard


def test_a_boat_is_taken_back_by_key_after_a_question(controls, caplog):
    made, operator, press = controls
    press("t")
    assert "Its pilot must have let go" in made.menu()[0]
    assert "red" not in made.menu()[1], "ours alone"
    press("2")
    assert "y: yes" in made.menu()[0]
    press("n")
    assert operator.take_requests() == ()
    press("t2y")
    ((boat, by),) = operator.take_requests()
    assert (boat.startswith("blue"), by) == (True, "keyboard")
    assert operator.take_requests() == ()
    assert f"{boat}: to be taken back, asked for by keyboard" in caplog.text


def test_an_override_says_what_it_disables_and_for_how_long(controls):
    made, operator, press = controls
    press("o")
    assert all(f"{name}: disables {disabled}" in "\n".join(made.menu()) for name, disabled in DISABLES.items())
    press(str(1 + list(DISABLES).index("contact")))
    assert "2 blue_1" in made.menu()[1]
    press("5")
    assert DISABLES["contact"] in made.menu()[0]
    press("2")
    assert made.menu() == []
    (entry,) = operator.active(7.0)
    assert (entry.condition, entry.subject, entry.until_s, entry.by) == ("contact", "red_1", 37.0, "keyboard")


def test_wrong_keys_leave_the_menu_and_change_nothing_and_q_ends_the_run(controls):
    made, operator, press = controls
    for keys in ("o\x1b", "o9", "o1z", "o11x", "zZ0\t"):
        press(keys)
        assert made.menu() == []
        assert operator.active(7.0) == ()
    assert not operator.ended
    press("q")
    assert operator.ended == "keyboard"


def test_keys_come_one_by_one_and_the_terminal_is_left_as_it_was(terminal):
    outer, inner = terminal
    before, came = termios.tcgetattr(inner), []

    def pressed(key):
        came.append(key)
        if key == "!":
            raise RuntimeError("no such key")

    keyboard = Keyboard(pressed, inner)
    wait_for(lambda: not termios.tcgetattr(inner)[3] & termios.ICANON)
    os.write(outer, b"\x1b[A")
    time.sleep(0.3)
    os.write(outer, b"!")
    wait_for(lambda: "!" in came)
    os.write(outer, b" q\xff")
    wait_for(lambda: len(came) == 4)
    assert came[:3] == ["!", " ", "q"]
    os.write(outer, b"\x1a\x13")
    wait_for(lambda: len(came) == 6)
    assert came[4:] == ["\x1a", "\x13"], "neither suspends the process nor freezes the picture"
    keyboard.close()
    keyboard.close()
    assert termios.tcgetattr(inner) == before


def test_without_a_terminal_there_are_no_keys_and_one_that_goes_away_ends_them_only(terminal):
    read, write = os.pipe()
    keyboard = Keyboard(pytest.fail, read)
    os.write(write, b"s")
    assert not keyboard.is_terminal
    keyboard.close()
    os.close(read)
    os.close(write)
    outer, inner = terminal
    pressed = []
    keyboard = Keyboard(pressed.append, inner)
    wait_for(lambda: not termios.tcgetattr(inner)[3] & termios.ICANON)
    os.close(outer)
    wait_for(lambda: not keyboard._thread.is_alive())
    keyboard.close()
    assert pressed == []
