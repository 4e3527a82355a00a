"""The dashboard: what it shows of a tick, and that its keys work whatever else does."""

import dataclasses
import io
import logging
import math
import os
import termios
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from logged_runs import Encounter, header_of
from rich.console import Console
from steerclear.env.core import BatchedMctf
from steerclear.experiments.deploy import dashboard as dashboard_module
from steerclear.experiments.deploy.dashboard import Controls, Dashboard, Keyboard
from steerclear.experiments.deploy.dashboard_map import FieldMap
from steerclear.experiments.deploy.dashboard_view import WHY, Moment, View, approaches, dashboard_page
from steerclear.experiments.deploy.referee import game_config, player_names, state_of
from steerclear.experiments.sim_boats.demo import demo_fleet
from steerclear.experiments.terminal import SafeConsole
from steerclear.shield import Commands
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.failsafe_table import DISABLES
from steerclear.shield.bridge.messages import Action, BoatReading, Tick
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.decision import Reason
from steerclear.shield.exceptions import BridgeError
from steerclear.shield.fleet import Fleet
from steerclear.shield.surroundings import Surroundings
from waiting import wait_for


class Stream:
    """An encounter of two against two under way, as the loop would show it."""

    def __init__(self, fleet):
        self.fleet, self.names = fleet, player_names(fleet)
        self.box = Surroundings(field=fleet.geofence.box)
        core = BatchedMctf(game_config(fleet))
        self.game = state_of(core, self.names).as_dict()
        self.ticks = iter(Encounter(header_of(), 400))
        while not next(self.ticks).decisions.intervened[0]:
            pass  # until the shield changes a command

    def tick(self, now_s):
        """The next turn, begun then."""
        tick = next(self.ticks)
        times = {"due_s": now_s, "began_s": now_s + 0.0003, "sent_s": now_s + 0.004, "policy_age_s": 0.06}
        contacts = tuple(dataclasses.replace(one, fixed_s=now_s - 0.12) for one in tick.contacts)
        return dataclasses.replace(tick, **times, contacts=contacts, surroundings=self.box, game=self.game, actions=())


@pytest.fixture(scope="module")
def stream(fleet_of):
    return Stream(fleet_of(2))


def console_of(width, height=40, kind=Console):
    return kind(file=io.StringIO(), width=width, height=height, force_terminal=True, color_system=None)


def shown(fleet, moment, columns=100, rows=40):
    """The screen as text lines."""
    console = console_of(columns, rows)
    console.print(View(fleet).of(moment, columns, rows), height=rows)
    return console.file.getvalue().split("\n")[:rows]


def row_of(lines, name):
    return next(line for line in lines if line.startswith(name))


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (170, 45), (40, 10), (10, 3), (1, 1)])
def test_the_screen_is_as_large_as_the_terminal_and_has_every_boat_twice(stream, columns, rows):
    console, view = console_of(columns, rows), View(stream.fleet)
    for moment in (Moment(None, 0.0), Moment(stream.tick(5.0), 5.1, log=["a", "b"])):
        lines = console.render_lines(view.of(moment, columns, rows), console.options.update_dimensions(columns, rows))
        assert len(lines) == rows
        assert {sum(segment.cell_length for segment in line) for line in lines} == {columns}
    if columns >= 80:
        lines = shown(stream.fleet, Moment(stream.tick(5.0), 5.05), columns, rows)
        assert all("\n".join(lines).count(name) >= 2 for name in (*stream.names, "⚑"))
        assert "SPACE or s STOP ALL" in lines[-1]
        assert "All within limits" in lines[1]


def test_the_circle_our_boats_keep_out_of_is_on_the_map(stream):
    tick, drawing = stream.tick(5.0), FieldMap(stream.fleet)

    def dots(around):
        lines = drawing.draw(dataclasses.replace(tick, surroundings=around), 100, 30)
        return sum(letter > "\u2800" for line in lines for letter in line.plain)

    home = Surroundings(tick.surroundings.field, stops=[(60.0, 30.0, 4.35)])
    assert dots(home) > dots(tick.surroundings) + 8
    assert dots(None) == dots(tick.surroundings)


def test_a_row_says_wanted_sent_why_and_the_closest_approach(stream):
    tick = stream.tick(5.0)
    decision, near = tick.decisions[0], approaches(tick.fleet)["blue_1"]
    line = row_of(shown(stream.fleet, Moment(tick, 5.05)), "blue_1")
    heading = round(math.degrees(decision.nominal_heading_rad)) % 360
    for words in (f"{decision.nominal_speed_mps:.1f} {heading:03d}°", f"{decision.filtered_speed_mps:.1f} "):
        assert words in line
    assert f"{near.other} {near.closest_m:.1f} m" in line
    other = row_of(shown(stream.fleet, Moment(tick, 9.0), columns=120), "red_1")
    assert "by gps_hub, error 0.3 m" in other
    assert "4.12" in other, "the age grows with the clock, not with the ticks"


def test_what_is_wrong_is_said(stream):
    tick = stream.tick(5.0)
    action = Action("red_2", "contact", "slow", "red_2 not heard for 1.3 s: all boats slow")
    lines = shown(stream.fleet, Moment(dataclasses.replace(tick, actions=(action,)), 5.0))
    assert "1 response in effect" in lines[1]
    whole = " ".join(line.strip() for line in lines)
    assert "red_2 not heard for 1.3 s: all boats slow -> slow; control returns: by itself" in whole
    assert "red_2: red_2" not in whole
    assert "blue_1: told so -> stop" in " ".join(
        shown(
            stream.fleet,
            Moment(dataclasses.replace(tick, actions=(Action("blue_1", "override", "stop", "told so"),)), 5.0),
        )
    )
    unready = BoatReading("blue_2", 5.0, mode="MANUAL", why_not="mode is MANUAL; switch it to GUIDED")
    nothing = {"fleet": None, "decisions": None, "nominal": None, "sent": {}, "contacts": ()}
    lost = dataclasses.replace(tick, readings={**tick.readings, "blue_2": unready}, **nothing)
    lines = shown(stream.fleet, Moment(lost, 5.0), columns=110)
    assert "No boat's state is known" in lines[1]
    assert all(words in row_of(lines, "blue_2") for words in ("MANUAL", "never", "mode is MANUAL; switch it"))
    assert "not heard" in row_of(lines, "red_1")
    assert "undecided" in row_of(lines, "blue_1")


def test_a_speed_that_is_too_old_is_not_shown(stream):
    tick = stream.tick(5.0)

    def row(boat, age_s):
        reading = dataclasses.replace(tick.readings["blue_1"], speed_mps=1.23, velocity_age_s=age_s)
        contacts = tuple(dataclasses.replace(one, speed_mps=1.23, fixed_s=5.0 - age_s) for one in tick.contacts)
        aged = dataclasses.replace(tick, readings={**tick.readings, "blue_1": reading}, contacts=contacts)
        return row_of(shown(stream.fleet, Moment(aged, 5.0), columns=120), boat)

    for boat in ("blue_1", "red_1"):
        assert "1.23" in row(boat, 0.1)
        assert "1.23" not in row(boat, 6.0)


def test_the_banner_says_the_worst_that_is_so(stream):
    tick = stream.tick(5.0)
    for moment, words in (
        (Moment(tick, tick.began_s + 2.0), "stands still: no turn for 2.0 s"),
        (Moment(tick, 99.0, stopped="keyboard"), "STOP ALL by keyboard"),
        (Moment(tick, 99.0, stopped="keyboard", hard=True), "past the shield;"),
        (Moment(tick, 5.0, ended="SIGINT"), "The run ends (SIGINT)"),
        (Moment(None, 5.0), "Nothing yet"),
    ):
        assert words in shown(stream.fleet, moment)[1]


def test_the_game_is_shown_and_values_that_are_not_finite_are_dashes(stream):
    tick = stream.tick(5.0)
    game = {**tick.game, "captures": [2, 1], "over": True, "note": "well played"}
    game["boats"] = {**game["boats"], "blue_1": {**game["boats"]["blue_1"], "tagged": True, "has_flag": True}}
    lines = shown(stream.fleet, Moment(dataclasses.replace(tick, game=game), 5.0), columns=120)
    assert "blue 2 : 1 red, over (well played)" in lines[0]
    assert row_of(lines, "blue_1").split()[1] == "⚑T"
    blank = {name: BoatReading(name, 5.0) for name in tick.readings}
    unknown = dataclasses.replace(tick, game={}, readings=blank, policy_age_s=math.inf)
    lines = shown(stream.fleet, Moment(unknown, 5.0))
    assert "no referee" in lines[0]
    assert "policy never" in lines[0]
    assert row_of(lines, "blue_1").split()[1:4] == ["-", "-", "never"]


def test_the_operators_page_tells_every_line():
    page = (Path(__file__).parents[3] / "docs" / "boats.md").read_text()
    assert f"<!-- dashboard -->\n{dashboard_page()}\n<!-- /dashboard -->" in page
    assert set(WHY) == set(Reason)


def test_closest_approaches_of_crossing_and_parting_boats():
    three = Fleet.of(
        position_m=[(0.0, 0.0), (10.0, 0.0), (0.0, -20.0)], heading_rad=[0.0, -0.5 * math.pi, math.pi],
        speed_mps=[1.0] * 3, team=[0, 1, 1], platforms="heron",
    )  # fmt: skip
    (near,) = approaches(three).values()
    assert (near.boat, near.other) == ("boat_0", "boat_1")
    assert (near.distance_m, near.in_s, near.closest_m) == pytest.approx((10.0, 5.0, math.sqrt(50.0)))


def cell_of(lines, name, title):
    """What stands in a boat's row under a head; the table may stand beside the map."""
    heads = next(line for line in lines if "nominal" in line and "margin" in line)
    end = heads.index(title) + len(title)
    row = next(line for line in lines if line[heads.index("boat") :].startswith(name))
    return row[end - 9 : end].strip()


@pytest.mark.parametrize(("columns", "rows"), [(60, 24), (80, 24), (200, 30)])
def test_what_was_wanted_and_sent_is_shown_whole(stream, columns, rows):
    tick = stream.tick(5.0)
    wanted, sent = (
        Commands.absolute_rad([(speed, math.radians(deg)) for speed, deg in (*own, (0.0, 0.0), (0.0, 0.0))])
        for own in (((1.5, 54.0), (12.5, 359.0)), ((1.5, 54.0), (10.25, 8.0)))
    )
    rows_of = zip(tick.sent.items(), sent.values.tolist(), strict=False)
    told = {name: dataclasses.replace(one, speed_mps=row[0], heading_rad=row[1]) for (name, one), row in rows_of}
    changed = np.array([False, True, False, False])
    decisions = dataclasses.replace(tick.decisions, nominal=wanted, filtered=sent, intervened=changed)
    lines = shown(stream.fleet, Moment(dataclasses.replace(tick, decisions=decisions, sent=told), 5.0), columns, rows)
    cells = [[cell_of(lines, f"blue_{k}", title) for k in (1, 2)] for title in ("nominal", "filtered")]
    assert cells == [["1.5 054°", "12.5 359°"], ["1.5 054°", "10.2 008°"]]


def test_names_from_outside_are_shown_and_not_obeyed(stream):
    hostile, tick = ["\x1b[2Jblue", "[bold]b[/]", "\u202eeulb", "red\x07", "[/red]"], stream.tick(5.0)
    boats = [boat.model_copy(update={"name": name}) for boat, name in zip(stream.fleet.boats, hostile, strict=True)]
    own, others = zip(hostile, tick.readings.values(), strict=False), zip(hostile[3:], tick.contacts, strict=True)
    view = View(stream.fleet)
    view._fleet = stream.fleet.model_copy(update={"boats": boats})  # files with such names are refused before
    parts = {
        "fleet": dataclasses.replace(tick.fleet, names=(*hostile[:2], *hostile[3:])),
        "readings": {name: dataclasses.replace(reading, boat=name) for name, reading in own},
        "contacts": tuple(dataclasses.replace(contact, boat=name) for name, contact in others),
    }
    console = console_of(160, 45, SafeConsole)
    moment = Moment(dataclasses.replace(tick, **parts), 5.0, log=["\x1b]0;title\x07 said"])
    console.print(view.of(moment, 160, 45), height=45)
    drawn = console.file.getvalue()
    assert not {"\x1b", "\x07", "\u202e"} & set(drawn)
    assert all(name in drawn for name in ("[bold]b[/]", "[/red]"))


@pytest.fixture
def dash(stream, terminal):
    """A dashboard drawing into a text file, keys from a pseudo terminal."""
    made = []

    def build(**options):
        console, operator = console_of(100), Operator()
        built = Dashboard(stream.fleet, operator, ManualClock(5.0), console=console, keyboard=terminal[1], **options)
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
    assert dashboard_module.REFRESH_HZ >= 2.0


def test_keys_work_when_the_picture_or_another_key_fails(dash, stream, monkeypatch, caplog):
    def fail(*_):
        raise BridgeError("cannot be done")

    built, operator, _, outer = dash()
    monkeypatch.setattr(built._view, "of", fail)
    monkeypatch.setattr(operator, "end", fail)
    wait_for(lambda: not built._thread.is_alive())
    built.take(stream.tick(5.0))
    assert "cannot be drawn" in caplog.text
    assert not operator.stopped
    os.write(outer, b"qs")
    wait_for(lambda: operator.stopped)
    assert "key 'q' failed" in caplog.text


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
    monkeypatch.setattr(built._view, "of", lambda *_: gate.wait(30.0) and "")
    tick, spent = stream.tick(5.0), []
    for _ in range(1000):
        began = time.perf_counter()
        built.take(tick)
        spent.append(time.perf_counter() - began)
    gate.set()
    assert np.median(spent) < 1e-4
    assert isinstance(built.moment().tick, Tick)
    assert built.moment().late_s == pytest.approx((3e-4, 3e-4))


@pytest.fixture
def controls():
    """Keys' meaning with an operator and a clock that both can be looked at."""
    operator = Operator()
    made = Controls(demo_fleet(), operator, ManualClock(7.0))

    def press(keys):
        for key in keys:
            made.press(key)

    return made, operator, press


STOPPED, HARD, FREE = ("keyboard", False, ""), ("keyboard", True, ""), ("", False, "")
PRESSED = {
    **{before + key: STOPPED for before in ("", "o", "o1", "o12", "x\x1b\n") for key in " sS"},
    **dict.fromkeys((" " * 50, "  ", "ss", " S", "s sS  "), STOPPED),  # no number of presses goes past the shield
    "  y": HARD,
    "  y ": HARD,  # the stop key takes nothing back
    **dict.fromkeys(("  ny", "  \x1by", "  ry", "  qy"), STOPPED),  # any other answer stays behind the shield
    " r": STOPPED,
    " rn": STOPPED,
    " ry": FREE,
    " ry ": STOPPED,
    **dict.fromkeys(("o\x1b", "o9", "o1z", "o11x", "zZ0\t", "r", "y", "t\x1b"), FREE),
    "q": ("", False, "keyboard"),
}
"""Keys, and what boats and run are told then: stopped by, past the shield, run ended by."""


@pytest.mark.parametrize("keys", PRESSED)
def test_keys_mean_what_they_say(controls, keys):
    made, operator, press = controls
    press(keys)
    assert (operator.stopped, operator.hard, operator.ended) == PRESSED[keys]
    assert operator.active(7.0) == ()
    asks = {"hard": "past the shield", "resume": "Take STOP ALL back?"}.get(made._open, "")
    assert bool(made.menu()) == bool(asks)
    assert asks in "".join(made.menu())


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
