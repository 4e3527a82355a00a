"""Commands keep the frame they were given in, say the same thing in the other, and are within what a platform does."""

import logging
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shield_scenes import bits, fleet_of
from steerclear.shield import Commands, Fleet, Reason, Shield, arrays

quick = settings(max_examples=100, deadline=None, derandomize=True)
PAIRS = st.lists(st.tuples(st.floats(-20.0, 20.0), st.floats(-720.0, 720.0)), min_size=1, max_size=6)
ALONE = [(0, 0, 10.0, 1.0), (500, 0, -170.0, 2.0)]
TOP_MPS = {"heron": 2.0, "surveyor": 3.0, "si": 10.0}


def apart_rad(a, b):
    return abs(math.remainder(a - b, 2.0 * math.pi))


@quick
@given(PAIRS, st.data())
def test_absolute_and_relative_say_the_same(pairs, data):
    n = len(pairs)
    heading = np.array(data.draw(st.lists(st.floats(-180.0, 180.0), min_size=n, max_size=n)))
    relative = Commands.relative_deg(pairs)
    absolute = Commands.absolute_rad(
        [(speed, math.radians(heading[i] + turn)) for i, (speed, turn) in enumerate(pairs)]
    )
    assert bits(relative.as_relative_deg(heading)) == bits(np.array(pairs)), "handed on untouched"
    back = absolute.as_relative_deg(heading)
    assert back[:, 0].tolist() == [speed for speed, _ in pairs]
    assert ((back[:, 1] >= -180.0) & (back[:, 1] <= 180.0)).all()
    for i in range(n):
        assert apart_rad(math.radians(back[i, 1]), math.radians(pairs[i][1])) < 1e-9
        own, other = relative.absolute(i, math.radians(heading[i])), absolute.absolute(i, math.radians(heading[i]))
        assert own[0] == other[0] == pairs[i][0]
        assert apart_rad(own[1], other[1]) < 1e-9
        assert 0.0 <= own[1] <= 2.0 * math.pi


def test_commands_are_a_copy_of_what_was_given_and_degrees_are_kept_in_rad():
    given_values = np.ones((2, 2))
    commands = Commands.relative_deg(given_values)
    given_values[:] = 9.0
    assert (commands.values == 1.0).all()
    turns = Commands.absolute_deg([[1.5, 90.0], [1.0, -30.0], [0.5, 710.0]])
    assert not turns.relative
    np.testing.assert_allclose(turns.values[:, 1], [math.pi / 2, -math.pi / 6, math.radians(350.0)])
    assert np.isnan(Commands.absolute_deg([[1.0, math.inf]]).values[0, 1])
    assert math.isnan(Commands.relative_deg([[None, 2.0]]).values[0, 0])
    many = Commands.absolute_rad([[1.0, 0.9e6]])  # the direction that is told, whatever the turns
    assert apart_rad(math.radians(many.as_relative_deg(np.zeros(1))[0, 1]), many.absolute(0, 0.0)[1]) < 1e-8


def decide(rows, make, platform="heron", team=(0, 0)):
    return Shield().decide(fleet_of(ALONE, team, platform), make(rows))


@pytest.mark.parametrize("make", [Commands.absolute_rad, Commands.absolute_deg, Commands.relative_deg])
@pytest.mark.parametrize("platform", TOP_MPS)
@pytest.mark.parametrize("beyond", [1e-3, 88.0, 1e5])
def test_no_more_than_top_speed_is_sent_and_no_boat_is_sent_astern(make, platform, beyond):
    top = TOP_MPS[platform]
    decisions = decide([[top + beyond, 0.5], [1.0, 0.25]], make, platform)
    first, second = decisions
    assert (first.filtered_speed_mps, first.reason, first.intervened) == (top, Reason.LIMITED, True)
    assert first.nominal_speed_mps == top + beyond
    assert first.filtered_heading_rad == first.nominal_heading_rad
    assert first.active_constraints == ()
    assert (second.reason, second.intervened) == (Reason.PASSED, False)
    assert bits(decisions.filtered.values[1]) == bits(make([[1.0, 0.25]]).values[0])
    astern = decide([[-beyond, 0.5], [1.0, 0.25]], make, platform)[0]
    assert (astern.filtered_speed_mps, astern.reason, astern.intervened) == (0.0, Reason.LIMITED, True)


@pytest.mark.parametrize(("heading", "sent"), [(181.0, -179.0), (-181.0, 179.0), (1000.0, -80.0), (180.0, 180.0)])
def test_a_cut_command_turns_by_less_than_a_turn(heading, sent):
    decisions = decide([[9.0, heading], [1.0, 0.25]], Commands.relative_deg)
    assert decisions.filtered.values[0].tolist() == [2.0, sent]


@pytest.mark.parametrize("speed", [2.0, 2.0 + 1e-9, math.nextafter(2.0, 3.0), 0.0, -0.0, -1e-12])
def test_the_limits_themselves_pass_bit_for_bit(speed):
    wanted = Commands.absolute_rad([[speed, 0.5], [1.0, 0.25]])
    decisions = Shield().decide(fleet_of(ALONE, (0, 0)), wanted)
    assert bits(decisions.filtered.values) == bits(wanted.values)
    assert decisions.reason.tolist() == [Reason.PASSED] * 2


def seen(**changes):
    headings = {} if "heading_deg" in changes else {"heading_rad": [0.0, 3.0]}
    good = {"position_m": [[0.0, 0.0], [30.0, 9.0]], "speed_mps": [1.0, 2.0], "team": [0, 1], "platforms": "heron"}
    return Fleet.of(**{**good, **headings, **changes})


AT = [[0.0, 0.0], [30.0, 9.0]]
FAR = [[0.0, 500.0], [30.0, 9.0]]


def paused(*, resets=False, places=(AT, FAR), **shield):
    """A shield that sees its boat here, then there."""
    shield = Shield(**shield)
    for place in places:
        shield.decide(seen(position_m=place), Commands.relative_deg([[1.0, 0.0], [1.0, 0.0]]))
        if resets:
            shield.reset()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: seen(heading_rad=[0.0, 90.0]), "90 rad, 14.3 turns; if these are degrees give heading_deg"),
        (lambda: seen(heading_rad=np.array([-170, 20])), "if these are degrees give heading_deg"),
        (lambda: Commands.absolute_rad([[1.0, 270.0]]), "if these are degrees give Commands.absolute_deg"),
        (lambda: Commands(np.array([[1, 45]]), False), "if these are degrees give Commands.absolute_deg"),
        (lambda: seen(position_m=[[-71.05, 42.36], [-71.0501, 42.36]]), "if these are degrees, give metres east"),
        (
            lambda: Shield().decide(seen(), Commands.absolute_rad([[math.pi, 1.0], [1.0, 0.0]])),
            r"3.14159 m/s is requested of boat 'boat_0', whose .* does 0 to 2 m/s.* Rows are \(speed m/s, heading\)",
        ),
        (
            lambda: Shield().decide(seen(), Commands.absolute_deg([[0.0, 2.0], [180.0, 2.0]])),
            r"180 m/s is given for boat 'boat_1'; rows are \(speed m/s, heading\), in this order",
        ),
        (
            lambda: Shield().decide(seen(), Commands.relative_deg([[0.0, 2.0], [-90.0, 2.0]])),
            "-90 m/s is given for boat 'boat_1'; rows are",
        ),
        (
            lambda: seen(team=[1, 2]),
            r"no boat is controlled: .* teams here are \[1, 2\]; give team 0 to the own boats, or controlled=",
        ),
        (
            lambda: paused(),
            r"boat 'boat_0' is more than 25 m from where it was a decision ago, 0\.1 s; call reset\(\) after a pause",
        ),
    ],
)
def test_what_looks_like_another_unit_is_told_once_with_the_call_that_is_right(make, words, caplog, monkeypatch):
    monkeypatch.setattr(arrays, "_said", set())
    with caplog.at_level(logging.WARNING, logger="steerclear"):
        make()
        make()
    (message,) = caplog.messages
    assert re.search(words, message)


def test_what_is_right_needs_no_word(caplog, monkeypatch):
    monkeypatch.setattr(arrays, "_said", set())
    with caplog.at_level(logging.WARNING, logger="steerclear"):
        seen(heading_rad=[-math.pi, 3.0 * math.pi])
        seen(heading_deg=[-180.0, 350.0])
        seen(position_m=[[5.0, 5.0], [5.0, 5.0]])  # on one point, as drawn scenes may be
        seen(position_m=[[0.0, 0.0], [0.0, 0.5]])
        Commands.absolute_deg([[1.0, 350.0], [1.0, -90.0]])
        Commands.absolute_rad([[1.0, math.nan], [1.0, math.inf]])
        Shield().decide(seen(), Commands.game_deg([[9.0, 90.0], [1.0, 0.0]]))
        Shield().decide(seen(), Commands.absolute_deg([[1.0, 90.0], [math.nan, 0.0]]))
        seen(team=[1, 2], controlled=[False, False])
        Fleet.of(position_m=np.zeros((0, 2)), heading_deg=[], speed_mps=[], team=[], platforms=[])
        paused(resets=True)
        paused(places=(FAR, FAR))
        paused(places=(AT, [[20.0, 0.0], [30.0, 500.0]]))  # another's boat may turn up elsewhere
        paused(places=(AT, [[60.0, 0.0], [30.0, 9.0]]), dt_s=1.0)
    assert caplog.messages == []
