"""Mistakes of units are told once, with the call that is right."""

import logging
import math
import re

import numpy as np
import pytest
from shield_scenes import bits
from steerclear.shield import Commands, Fleet, Shield, hints
from steerclear.shield.exceptions import FleetError

GOOD = {
    "position_m": [[0.0, 0.0], [30.0, 9.0]],
    "speed_mps": [1.0, 2.0],
    "team": [0, 1],
    "platforms": "heron",
}


@pytest.fixture(autouse=True)
def nothing_said(monkeypatch):
    """Each test is the first of its process."""
    monkeypatch.setattr(hints, "_said", set())


def fleet(**changes):
    headings = {} if {"heading_rad", "heading_deg"} & set(changes) else {"heading_rad": [0.0, 3.0]}
    return Fleet.of(**{**GOOD, **headings, **changes})


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: fleet(heading_rad=[0.0, 90.0]), "90 rad, 14.3 turns; if these are degrees give heading_deg"),
        (lambda: fleet(heading_rad=np.array([-170, 20])), "if these are degrees give heading_deg"),
        (lambda: Commands.absolute_rad([[1.0, 270.0]]), "if these are degrees give Commands.absolute_deg"),
        (lambda: Commands(np.array([[1, 45]]), False), "if these are degrees give Commands.absolute_deg"),
        (lambda: fleet(position_m=[[-71.05, 42.36], [-71.0501, 42.36]]), "if these are degrees, give metres east"),
        (
            lambda: Shield().decide(fleet(), Commands.absolute_rad([[math.pi, 1.0], [1.0, 0.0]])),
            r"3.14159 m/s is wanted of boat 'boat_0', whose platform does 0 to 2 m/s.* Rows are \(speed m/s, heading\)",
        ),
    ],
)
def test_what_looks_like_another_unit_is_told_once(make, words, caplog):
    with caplog.at_level(logging.WARNING, logger="steerclear"):
        make()
        make()
    assert len(caplog.messages) == 1
    caplog.clear()
    hints._said.clear()
    with caplog.at_level(logging.WARNING, logger="steerclear"):
        make()
    (message,) = caplog.messages
    assert re.search(words, message)


def test_what_is_right_needs_no_word(caplog):
    with caplog.at_level(logging.WARNING, logger="steerclear"):
        fleet(heading_rad=[-math.pi, 3.0 * math.pi])
        fleet(heading_deg=[-180.0, 350.0])
        fleet(position_m=[[5.0, 5.0], [5.0, 5.0]])  # on one point, as drawn scenes may be
        fleet(position_m=[[0.0, 0.0], [0.0, 0.5]])
        Commands.absolute_deg([[1.0, 350.0], [1.0, -90.0]])
        Commands.absolute_rad([[1.0, math.nan], [1.0, math.inf]])
        Shield().decide(fleet(), Commands.game_deg([[9.0, 90.0], [1.0, 0.0]]))
    assert caplog.messages == []


def test_degrees_are_taken_where_they_are_asked_for():
    by_deg, by_rad = fleet(heading_deg=[90.0, -30.0]), fleet(heading_rad=np.radians([90.0, -30.0]))
    np.testing.assert_allclose(by_deg.state, by_rad.state, atol=1e-12)
    given = [[1.5, 90.0], [1.0, -30.0], [0.5, 710.0]]
    np.testing.assert_allclose(
        Commands.absolute_deg(given).values, [[1.5, math.pi / 2], [1.0, -math.pi / 6], [0.5, math.radians(350.0)]]
    )
    assert not Commands.absolute_deg(given).relative
    assert np.isnan(Commands.absolute_deg([[1.0, math.inf]]).values[0, 1])
    assert bits(Commands.absolute_deg([[1.0, 0.0]]).values) == bits(Commands.absolute_rad([[1.0, 0.0]]).values)


@pytest.mark.parametrize("headings", [{"heading_rad": None}, {"heading_rad": [0.0, 0.0], "heading_deg": [0.0, 0.0]}])
def test_headings_come_in_one_unit(headings):
    with pytest.raises(FleetError, match="give either heading_rad or heading_deg"):
        fleet(**headings)
