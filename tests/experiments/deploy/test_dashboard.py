"""The dashboard: what it shows of a tick, and that its keys work whatever else does."""

import contextlib
import dataclasses
import io
import logging
import math
import os
import pty
import termios
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from deploy_ticks import Stream
from made_ticks import made_tick
from rich.console import Console
from steerclear.experiments.deploy import dashboard as dashboard_module
from steerclear.experiments.deploy.controls import Controls, Keyboard
from steerclear.experiments.deploy.dashboard import Dashboard
from steerclear.experiments.deploy.dashboard_lines import WHY, dashboard_page
from steerclear.experiments.deploy.dashboard_map import Canvas, FieldMap
from steerclear.experiments.deploy.dashboard_view import Moment, View, approaches, boats_table
from steerclear.experiments.terminal import SafeConsole
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.failsafe_table import DISABLES
from steerclear.shield.bridge.messages import Action, BoatReading, Tick
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.decision import Reason
from steerclear.shield.exceptions import BridgeError, ConfigError
from steerclear.shield.fleet import Fleet
from steerclear.shield.surroundings import Surroundings

PATIENCE_S = 30.0


@pytest.fixture(scope="module")
def stream():
    """A game of three against three under way, rammers about."""
    from steerclear.experiments.sim_boats.demo import demo_fleet

    played = Stream(demo_fleet())
    for _ in range(80):
        played.tick()
    return played


@pytest.fixture(scope="module")
def fleet_of_the_demo():
    from steerclear.experiments.sim_boats.demo import demo_fleet

    return demo_fleet()


def shown(fleet, moment, columns=100, rows=40):
    """The screen as text lines."""
    console = Console(file=io.StringIO(), width=columns, height=rows, force_terminal=True, color_system=None)
    console.print(View(fleet).of(moment, columns, rows), height=rows)
    return console.file.getvalue().split("\n")[:rows]


def row_of(lines, name):
    return next(line for line in lines if line.startswith(name))


def wait_for(condition):
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.005)


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (100, 40), (170, 45), (40, 10), (10, 3)])
def test_the_screen_is_as_large_as_the_terminal(stream, columns, rows):
    console = Console(file=io.StringIO(), width=columns, height=rows, force_terminal=True, color_system=None)
    view = View(stream.fleet)
    for moment in (Moment(None, 0.0), Moment(stream.tick(5.0), 5.1, log=["a", "b"])):
        lines = console.render_lines(view.of(moment, columns, rows), console.options.update_dimensions(columns, rows))
        assert len(lines) == rows
        for line in lines:
            assert sum(segment.cell_length for segment in line) == columns


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (100, 40), (170, 45)])
def test_every_boat_is_on_the_map_and_in_the_table(stream, columns, rows):
    tick = stream.tick(5.0)
    lines = shown(stream.fleet, Moment(tick, 5.05), columns, rows)
    text = "\n".join(lines)
    for name in stream.names:
        assert text.count(name) >= 2
    assert "⚑" in text
    assert "SPACE or s STOP ALL" in lines[-1]
    assert "All within limits" in lines[1]


def test_the_circle_our_boats_keep_out_of_is_on_the_map(stream):
    tick = stream.tick(5.0)
    drawing = FieldMap(stream.fleet)

    def dots(tick):
        return sum(letter > "\u2800" for line in drawing.draw(tick, 100, 30) for letter in line.plain)

    home = Surroundings(tick.surroundings.field, stops=[(60.0, 30.0, 4.35)])
    assert dots(dataclasses.replace(tick, surroundings=home)) > dots(tick) + 8
    assert dots(dataclasses.replace(tick, surroundings=None)) == dots(tick)


def test_a_row_says_wanted_sent_why_and_the_closest_approach(stream):
    tick = stream.tick(5.0)
    decision = tick.decisions[0]
    line = row_of(shown(stream.fleet, Moment(tick, 5.05)), "blue_1")
    heading = round(math.degrees(decision.nominal_heading_rad)) % 360
    assert f"{decision.nominal_speed_mps:.1f} {heading:03d}°" in line
    assert f"{decision.filtered_speed_mps:.1f} " in line
    near = approaches(tick.fleet)["blue_1"]
    assert f"{near.other} {near.closest_m:.1f} m" in line
    other = row_of(shown(stream.fleet, Moment(tick, 9.0)), "red_1")
    assert "by hub, error 0.3 m" in other
    assert "4.12" in other, "the age grows with the clock, not with the ticks"


def test_what_is_wrong_is_said(stream):
    tick = stream.tick(5.0)
    action = Action("red_2", "contact", "slow", "red_2 not heard for 1.3 s: all boats slow")
    lines = shown(stream.fleet, Moment(dataclasses.replace(tick, actions=(action,)), 5.0))
    assert "1 response in effect" in lines[1]
    assert any(action.text in line for line in lines)
    unready = BoatReading("blue_2", 5.0, mode="MANUAL", why_not="mode is MANUAL; switch it to GUIDED")
    nothing = {"fleet": None, "decisions": None, "wanted": None, "sent": {}, "contacts": ()}
    lost = dataclasses.replace(tick, readings={**tick.readings, "blue_2": unready}, **nothing)
    lines = shown(stream.fleet, Moment(lost, 5.0), columns=110)
    assert "No boat's state is known" in lines[1]
    assert "MANUAL" in row_of(lines, "blue_2")
    assert "never" in row_of(lines, "blue_2")
    assert "mode is MANUAL; switch it" in row_of(lines, "blue_2")
    assert "not heard" in row_of(lines, "red_1")
    assert "undecided" in row_of(lines, "blue_1")
    assert "stands still: no tick for 2.0 s" in shown(stream.fleet, Moment(tick, tick.began_s + 2.0))[1]
    assert "STOP ALL by keyboard" in shown(stream.fleet, Moment(tick, 99.0, stopped="keyboard"))[1]
    assert "past the shield;" in shown(stream.fleet, Moment(tick, 99.0, stopped="keyboard", hard=True))[1]
    assert "The run ends (SIGINT)" in shown(stream.fleet, Moment(tick, 5.0, ended="SIGINT"))[1]
    assert "Nothing yet" in shown(stream.fleet, Moment(None, 5.0))[1]


def test_the_game_is_shown(stream):
    tick = stream.tick(5.0)
    game = {**tick.game, "captures": [2, 1], "over": True, "note": "well played"}
    game["boats"] = {**game["boats"], "blue_1": {**game["boats"]["blue_1"], "tagged": True, "has_flag": True}}
    lines = shown(stream.fleet, Moment(dataclasses.replace(tick, game=game), 5.0), columns=120)
    assert "blue 2 : 1 red, over (well played)" in lines[0]
    assert row_of(lines, "blue_1").split()[1] == "⚑T"
    assert "no referee" in shown(stream.fleet, Moment(dataclasses.replace(tick, game={}), 5.0))[0]


def test_values_that_are_not_finite_are_dashes(stream):
    tick = stream.tick(5.0)
    blank = {name: BoatReading(name, 5.0) for name in tick.readings}
    lines = shown(stream.fleet, Moment(dataclasses.replace(tick, readings=blank, policy_age_s=math.inf), 5.0))
    assert "policy never" in lines[0]
    assert row_of(lines, "blue_1").split()[1:4] == ["-", "-", "never"]


def test_the_operators_page_tells_every_line():
    page = (Path(__file__).parents[3] / "docs" / "boats.md").read_text()
    assert f"<!-- dashboard -->\n{dashboard_page()}\n<!-- /dashboard -->" in page
    assert set(WHY) == set(Reason)


def test_closest_approaches_of_crossing_and_parting_boats():
    fleet = Fleet.of(
        position_m=[(0.0, 0.0), (10.0, 0.0), (0.0, -20.0)],
        heading_rad=[0.0, -0.5 * math.pi, math.pi],
        speed_mps=[1.0, 1.0, 1.0],
        team=[0, 1, 1],
        platforms="heron",
    )
    (found,) = approaches(fleet).values()
    assert (found.boat, found.other) == ("boat_0", "boat_1")
    assert found.distance_m == pytest.approx(10.0)
    assert found.in_s == pytest.approx(5.0)
    assert found.closest_m == pytest.approx(math.sqrt(50.0))
    alone = Fleet.of(position_m=[(0, 0)], heading_rad=[0], speed_mps=[1], team=[0], platforms="heron")
    assert approaches(alone) == {}


def test_the_canvas_keeps_shapes_and_scale():
    canvas = Canvas(10, 5, (0.0, 0.0, 19.0, 19.0))
    canvas.line((0.0, 0.0), (19.0, 19.0), "red")
    canvas.label((9.0, 9.0), "here it is", "bold")
    canvas.line((-50.0, 3.0), (50.0, math.pi), "dim")
    canvas.circle((1e6, 1e6), 3.0, "dim")
    lines = canvas.lines()
    assert [len(line.plain) for line in lines] == [10] * 5
    assert lines[0].plain[9] == "⠊", "one dot per metre up to the far corner"
    assert "here it is" in [line.plain for line in lines]
    assert all("⠀" <= letter <= "⣿" for letter in lines[0].plain)


@pytest.fixture
def controls(stream):
    """Keys' meaning with an operator and a clock that both can be looked at."""
    operator = Operator()
    made = Controls(stream.fleet, operator, ManualClock(7.0))

    def press(keys):
        for key in keys:
            made.press(key)

    return made, operator, press


@pytest.mark.parametrize("key", [" ", "s", "S"])
@pytest.mark.parametrize("before", ["", "o", "o1", "o12", "x\x1b\n"])
def test_the_stop_key_stops_whatever_is_open(controls, key, before):
    made, operator, press = controls
    press(before + key)
    assert operator.stopped == "keyboard"
    assert not operator.hard
    assert made.menu() == []


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
    assert operator.stopped
    assert not operator.hard
    assert not operator.ended
    assert made.menu() == []
    press("y")
    assert not operator.hard


def test_after_resuming_the_stop_key_stops_again(controls):
    _, operator, press = controls
    press(" ry ")
    assert operator.stopped
    assert not operator.hard


def test_resuming_asks_first(controls):
    made, operator, press = controls
    press("r")
    assert made.menu() == []
    press(" r")
    assert "Take STOP ALL back?" in made.menu()[0]
    press("n")
    assert operator.stopped
    press("ry")
    assert not operator.stopped


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


def test_q_ends_the_run(controls):
    _, operator, press = controls
    press("q")
    assert operator.ended == "keyboard"


def test_an_override_says_what_it_disables_and_for_how_long(controls):
    made, operator, press = controls
    press("o")
    lines = "\n".join(made.menu())
    for name, disabled in DISABLES.items():
        assert f"{name}: disables {disabled}" in lines
    press(str(1 + list(DISABLES).index("contact")))
    assert "2 blue_1" in made.menu()[1]
    press("5")
    assert DISABLES["contact"] in made.menu()[0]
    press("2")
    assert made.menu() == []
    (entry,) = operator.active(7.0)
    assert (entry.condition, entry.subject, entry.until_s, entry.by) == ("contact", "red_1", 37.0, "keyboard")


@pytest.mark.parametrize("key", ["t", " r", "o"])
def test_what_was_said_in_one_menu_is_not_said_in_the_next(controls, monkeypatch, key):
    made, operator, press = controls

    def refuse(*_):
        raise ConfigError("an override of nothing")

    monkeypatch.setattr(operator, "override", refuse)
    press("o111")
    assert made.menu()[-1] == "an override of nothing"
    press("\x1b" + key)
    assert made.menu()
    assert "an override of nothing" not in made.menu()


def test_wrong_keys_leave_the_menu_and_change_nothing(controls):
    made, operator, press = controls
    for keys in ("o\x1b", "o9", "o1z", "o11x", "zZ0\t"):
        press(keys)
        assert made.menu() == []
        assert operator.active(7.0) == ()
    assert not operator.ended


@pytest.fixture
def terminal():
    """A pseudo terminal: (the end a person types at, the end the program reads)."""
    outer, inner = pty.openpty()
    yield outer, inner
    for descriptor in (outer, inner):
        with contextlib.suppress(OSError):
            os.close(descriptor)


def test_keys_come_one_by_one_and_the_terminal_is_left_as_it_was(terminal):
    outer, inner = terminal
    before = termios.tcgetattr(inner)
    came = []

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


def test_without_a_terminal_there_are_no_keys():
    read, write = os.pipe()
    keyboard = Keyboard(pytest.fail, read)
    os.write(write, b"s")
    assert not keyboard.is_terminal
    keyboard.close()
    os.close(read)
    os.close(write)


def test_a_terminal_that_goes_away_ends_the_keys_only(terminal):
    outer, inner = terminal
    pressed = []
    keyboard = Keyboard(pressed.append, inner)
    wait_for(lambda: not termios.tcgetattr(inner)[3] & termios.ICANON)
    os.close(outer)
    wait_for(lambda: not keyboard._thread.is_alive())
    keyboard.close()
    assert pressed == []


@pytest.fixture
def dash(stream, terminal):
    """A dashboard drawing into a text file, keys from a pseudo terminal."""
    made = []

    def build(**options):
        console = Console(file=io.StringIO(), width=100, height=40, force_terminal=True, color_system=None)
        operator, clock = Operator(), ManualClock(5.0)
        built = Dashboard(stream.fleet, operator, clock, console=console, keyboard=terminal[1], **options)
        made.append(built)
        return built, operator, console.file, terminal[0]

    yield build
    for built in made:
        built.close()


def test_the_stop_key_is_obeyed_and_shown_within_one_refresh(dash, stream):
    """Pictures are an hour apart: what is seen was drawn because of the key."""
    built, operator, drawn, outer = dash(refresh_hz=1.0 / 3600.0)
    built.take(stream.tick(5.0))
    wait_for(lambda: "Nothing yet" in drawn.getvalue() or "within limits" in drawn.getvalue())
    os.write(outer, b" ")
    wait_for(lambda: operator.stopped)
    wait_for(lambda: "STOP ALL by keyboard" in drawn.getvalue())
    assert operator.stopped


def test_keys_work_when_the_picture_fails(dash, stream, monkeypatch, caplog):
    def fail(*_):
        raise ZeroDivisionError("no picture")

    built, operator, _, outer = dash()
    monkeypatch.setattr(built._view, "of", fail)
    wait_for(lambda: not built._thread.is_alive())
    built.take(stream.tick(5.0))
    assert "cannot be drawn" in caplog.text
    assert not operator.stopped
    os.write(outer, b"s")
    wait_for(lambda: operator.stopped)
    assert operator.stopped


def test_a_keys_failure_is_logged_and_the_next_key_works(dash, monkeypatch, caplog):
    _, operator, _, outer = dash()

    def fail(*_):
        raise BridgeError("cannot end")

    monkeypatch.setattr(operator, "end", fail)
    os.write(outer, b"qs")
    wait_for(lambda: operator.stopped)
    assert "cannot end" in caplog.text


def test_the_log_is_shown_and_repeated_when_the_screen_is_given_back(dash):
    terminal_handler = logging.StreamHandler(io.StringIO())
    logging.getLogger().addHandler(terminal_handler)
    try:
        built, _, drawn, _ = dash(refresh_hz=50.0)
        wait_for(lambda: terminal_handler not in logging.getLogger().handlers)
        logging.getLogger("steerclear.test").warning("wind from\nthe west")
        wait_for(lambda: "wind from | the west" in drawn.getvalue())
        built.close()
        assert drawn.getvalue().rstrip().endswith("WARNING wind from | the west")
        assert terminal_handler.stream.getvalue() == "", "nothing is written over the picture"
        assert terminal_handler in logging.getLogger().handlers
    finally:
        logging.getLogger().removeHandler(terminal_handler)


def test_taking_a_tick_is_quick_and_waits_for_nothing(dash, stream, monkeypatch):
    built, *_ = dash()
    gate = threading.Event()
    monkeypatch.setattr(built._view, "of", lambda *_: gate.wait(PATIENCE_S) and "")
    tick = stream.tick(5.0)
    spent = []
    for _ in range(1000):
        began = time.perf_counter()
        built.take(tick)
        spent.append(time.perf_counter() - began)
    gate.set()
    assert np.median(spent) < 1e-4
    assert isinstance(built.moment().tick, Tick)
    assert built.moment().late_s == pytest.approx((3e-4, 3e-4))


def test_the_refresh_is_often_enough():
    assert dashboard_module.REFRESH_HZ >= 2.0


def cell_of(lines, name, title):
    """What stands in a boat's row under a head; the table may stand beside the map."""
    heads = next(line for line in lines if "wanted" in line and "margin" in line)
    end = heads.index(title) + len(title)
    row = next(line for line in lines if line[heads.index("boat") :].startswith(name))
    return row[end - 9 : end].strip()


@pytest.mark.parametrize(("columns", "rows"), [(60, 24), (80, 24), (120, 40), (160, 45), (200, 30)])
def test_what_was_wanted_and_sent_is_shown_whole(fleet_of_the_demo, columns, rows):
    lines = shown(fleet_of_the_demo, Moment(made_tick(fleet_of_the_demo), 5.0), columns, rows)
    assert [cell_of(lines, f"blue_{k}", "wanted") for k in (1, 2, 3)] == ["1.5 054°", "12.5 359°", "2.0 180°"]
    assert [cell_of(lines, f"blue_{k}", "sent") for k in (1, 2, 3)] == ["1.5 054°", "10.2 008°", "0.0 271°"]


def test_a_wide_terminal_shows_more(fleet_of_the_demo):
    tick = made_tick(fleet_of_the_demo)
    narrow, wide = (shown(fleet_of_the_demo, Moment(tick, 5.0), *size) for size in ((80, 24), (160, 45)))
    assert "bound by" not in "".join(narrow)
    heads = next(line for line in wide if "bound by" in line)
    assert len(heads.rstrip()) > 150, "to the right edge"
    row = next(line for line in wide if "12.5 359°" in line)
    assert row.rstrip().endswith("red_3"), "what binds"
    assert "…" not in row[heads.index("boat") :]
    assert any("error 0.3 m" in line for line in wide)


@pytest.mark.parametrize("width", [1, 10, 30, 45, 60, 80, 99, 160, 400])
def test_the_table_is_as_wide_as_it_may_be(width):
    console = Console(file=io.StringIO(), width=width, color_system=None)
    cells = {"boat": "b" * 32, "wanted": "12.5 359°", "sent": "-2.5 007°", "closest": "c" * 90, "why": "best eff."}
    console.print(boats_table(width, [cells]))
    lines = console.file.getvalue().splitlines()
    assert all(len(line) <= width for line in lines)
    assert width < 30 or ("12.5 359°" in lines[1] and "-2.5 007°" in lines[1])


def test_names_from_outside_are_shown_and_not_obeyed(fleet_of_the_demo):
    hostile = ["\x1b[2Jblue", "[bold]b[/]", "\u202eeulb", "red\x07", "[/red]", "r\nd"]
    named = zip(fleet_of_the_demo.boats, hostile, strict=True)
    boats = [boat.model_copy(update={"name": name}) for boat, name in named]
    fleet = fleet_of_the_demo.model_copy(update={"boats": boats})
    console = SafeConsole(file=io.StringIO(), width=160, height=45, force_terminal=True, color_system=None)
    moment = Moment(made_tick(fleet, names=hostile), 5.0, log=["\x1b]0;title\x07 said"])
    view = View(fleet_of_the_demo)
    view._fleet = fleet  # files with such names are refused; the view does not rely on that
    console.print(view.of(moment, 160, 45), height=45)
    drawn = console.file.getvalue()
    assert not {"\x1b", "\x07", "\u202e"} & set(drawn)
    assert "[bold]b[/]" in drawn
    assert "[/red]" in drawn
