"""The dashboard: what it shows of a tick, and that its keys work whatever else does."""

import dataclasses
import io
import logging
import math
import os
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from made_ticks import Stream, made_tick, wait_for
from rich.console import Console
from steerclear.experiments.deploy import dashboard as dashboard_module
from steerclear.experiments.deploy.dashboard import Dashboard
from steerclear.experiments.deploy.dashboard_map import FieldMap
from steerclear.experiments.deploy.dashboard_view import WHY, Moment, View, approaches, boats_table, dashboard_page
from steerclear.experiments.sim_boats.demo import demo_fleet
from steerclear.experiments.terminal import SafeConsole
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.messages import Action, BoatReading, Tick
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.decision import Reason
from steerclear.shield.exceptions import BridgeError
from steerclear.shield.fleet import Fleet
from steerclear.shield.surroundings import Surroundings


@pytest.fixture(scope="module")
def stream():
    """A game of three against three under way, rammers about."""
    played = Stream(demo_fleet())
    for _ in range(80):
        played.tick()
    return played


def console_of(width, height=40, kind=Console):
    return kind(file=io.StringIO(), width=width, height=height, force_terminal=True, color_system=None)


def shown(fleet, moment, columns=100, rows=40):
    """The screen as text lines."""
    console = console_of(columns, rows)
    console.print(View(fleet).of(moment, columns, rows), height=rows)
    return console.file.getvalue().split("\n")[:rows]


def row_of(lines, name):
    return next(line for line in lines if line.startswith(name))


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (100, 40), (170, 45), (40, 10), (10, 3)])
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
    assert all(words in row_of(lines, "blue_2") for words in ("MANUAL", "never", "mode is MANUAL; switch it"))
    assert "not heard" in row_of(lines, "red_1")
    assert "undecided" in row_of(lines, "blue_1")


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
    places, headings = [(0.0, 0.0), (10.0, 0.0), (0.0, -20.0)], [0.0, -0.5 * math.pi, math.pi]

    def found(k, teams):
        return approaches(
            Fleet.of(
                position_m=places[:k], heading_rad=headings[:k], speed_mps=[1.0] * k, team=teams, platforms="heron"
            )
        )

    (near,) = found(3, [0, 1, 1]).values()
    assert (near.boat, near.other) == ("boat_0", "boat_1")
    assert (near.distance_m, near.in_s, near.closest_m) == pytest.approx((10.0, 5.0, math.sqrt(50.0)))
    assert found(1, [0]) == {}


def cell_of(lines, name, title):
    """What stands in a boat's row under a head; the table may stand beside the map."""
    heads = next(line for line in lines if "nominal" in line and "margin" in line)
    end = heads.index(title) + len(title)
    row = next(line for line in lines if line[heads.index("boat") :].startswith(name))
    return row[end - 9 : end].strip()


@pytest.mark.parametrize(("columns", "rows"), [(60, 24), (80, 24), (120, 40), (160, 45), (200, 30)])
def test_what_was_wanted_and_sent_is_shown_whole(columns, rows):
    lines = shown(demo_fleet(), Moment(made_tick(demo_fleet()), 5.0), columns, rows)
    cells = [[cell_of(lines, f"blue_{k}", title) for k in (1, 2, 3)] for title in ("nominal", "filtered")]
    assert cells == [["1.5 054°", "12.5 359°", "2.0 180°"], ["1.5 054°", "10.2 008°", "0.0 271°"]]


@pytest.mark.parametrize("width", [1, 10, 30, 45, 60, 80, 99, 160, 400])
def test_the_table_is_as_wide_as_it_may_be(width):
    console = Console(file=io.StringIO(), width=width, color_system=None)
    cells = {"boat": "b" * 32, "nominal": "12.5 359°", "filtered": "-2.5 007°", "closest": "c" * 90, "why": "best eff."}
    console.print(boats_table(width, [cells]))
    lines = console.file.getvalue().splitlines()
    assert all(len(line) <= width for line in lines)
    assert width < 30 or ("12.5 359°" in lines[1] and "-2.5 007°" in lines[1])


def test_names_from_outside_are_shown_and_not_obeyed():
    hostile, plain = ["\x1b[2Jblue", "[bold]b[/]", "\u202eeulb", "red\x07", "[/red]", "r\nd"], demo_fleet()
    boats = [boat.model_copy(update={"name": name}) for boat, name in zip(plain.boats, hostile, strict=True)]
    fleet, view = plain.model_copy(update={"boats": boats}), View(plain)
    view._fleet = fleet  # files with such names are refused; the view does not rely on that
    console = console_of(160, 45, SafeConsole)
    console.print(
        view.of(Moment(made_tick(fleet, names=hostile), 5.0, log=["\x1b]0;title\x07 said"]), 160, 45), height=45
    )
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
