"""Whom the shield fears for how long: by the settings, by where a boat is in a game, by what the caller says of it."""

from dataclasses import replace

import numpy as np
import pytest
from shield_scenes import fleet_of, relative
from steerclear.shield import Shield, ShieldConfig
from steerclear.shield.platforms import layout as L

STRAIGHT = relative((3.0, 0.0), (3.0, 0.0))


def near(**more):
    """A surveyor of ours and an opponent coming at it, both at full thrust."""
    fleet = fleet_of([(0.0, 0.0, 0.0, 3.0), (1.0, 22.0, 180.0, 3.0)], [0, 1], "surveyor")
    state = fleet.state.copy()
    state[:, L.THRUST] = 100.0
    return replace(fleet, state=state, **more)


def safety_margin_m(fleet, **settings):
    return Shield(**settings).decide(fleet, STRAIGHT)[0].safety_margin_m


@pytest.mark.parametrize(
    ("settings", "always_s", "visiting_s"),
    [
        ({}, 12.0, 7.0),
        ({"profile": "ramming"}, np.inf, np.inf),
        ({"profile": "constant_velocity"}, 0.0, 0.0),
        ({"adversary_horizon_s": 9.0}, 9.0, 9.0),
        ({"intruder_horizon_s": 3.0}, 12.0, 3.0),
        ({"adversary_horizon_s": 20.0, "intruder_horizon_s": 0.0}, 20.0, 0.0),
    ],
)
def test_a_profile_says_both_and_one_dial_turns_both(settings, always_s, visiting_s):
    config = ShieldConfig(**settings)
    assert (config.effective_adversary_horizon_s, config.effective_intruder_horizon_s) == (always_s, visiting_s)


def test_a_visitor_is_feared_as_if_all_were_for_its_time_and_a_mate_is_not():
    visiting = near(visiting=np.array([False, True]))
    assert safety_margin_m(visiting) == safety_margin_m(near(), adversary_horizon_s=7.0)
    assert safety_margin_m(visiting) > safety_margin_m(near()) + 0.1, "else the scene shows nothing"
    assert safety_margin_m(near(visiting=np.array([True, False]))) == safety_margin_m(near()), "of our own"


def test_what_the_caller_says_of_a_boat_comes_first():
    fleet = near(visiting=np.array([False, True]), adversary_horizon_s=np.array([np.nan, 20.0]))
    assert safety_margin_m(fleet) == safety_margin_m(near(), adversary_horizon_s=20.0)
    unsaid = near(adversary_horizon_s=np.array([np.nan, np.nan]))
    assert safety_margin_m(unsaid) == safety_margin_m(near())


def test_a_decision_says_how_long_it_feared_whom():
    told = Shield().decide(near(visiting=np.array([False, True])), STRAIGHT)
    assert [decision.adversary_horizon_s for decision in told] == [None, 7.0]
    assert [d.adversary_horizon_s for d in Shield(profile="ramming").decide(near(), STRAIGHT)] == [None, np.inf]
    told = Shield(profile="constant_velocity").decide(near(adversary_horizon_s=np.array([np.nan, 20.0])), STRAIGHT)
    assert [d.adversary_horizon_s for d in told] == [None, 0.0], (
        "with this profile nobody is feared, whatever is said of one"
    )
