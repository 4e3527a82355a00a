"""Filters in closed loop: in the model they are made for, and on a boat that is not that model."""

import numpy as np
import pytest
from steerclear.experiments.baselines.textbook import BARRIERS, NAMES, TextbookGuard, sweep
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import Platform
from textbook_drill import FAMILIES, openings, run_drill

CONFIG = ShieldConfig(edge_m=None)
GAMES = 24

UNICYCLE = Platform(
    name="unicycle", kind="double_integrator", max_speed_mps=2.0, max_acc=1.0, max_turn_rate_dps=90.0,
    max_angular_acc_dps2=1e5,
)  # fmt: skip
POINT = Platform(name="point", kind="single_integrator", max_speed_mps=2.0, max_turn_rate_dps=3600.0)


def play(name, platform, family, games=GAMES, seed=3):
    guard = None if name is None else TextbookGuard(name, CONFIG, games, (platform, platform), (0, 1))
    return run_drill(guard, family, platform, games, seed, CONFIG)


def test_a_single_integrator_keeps_the_radius_from_straight_movers():
    for family in ("head_on", "crossing"):
        assert play(None, POINT, family).breached.all()
        outcome = play("velocity_cbf", POINT, family)
        assert outcome.closest_m.min() >= 2.5
        assert (outcome.changed > 0.0).all()
        assert (outcome.changed < 1.0).all()


@pytest.mark.parametrize(
    ("name", "gains"),
    [
        ("exponential_cbf", (0.5, 0.5)),
        ("collision_cone", (1.0,)),
        ("parabolic", (1.0, 2.0, 2.0)),
    ],
)
def test_a_unicycle_keeps_the_radius_while_its_program_has_an_answer(name, gains):
    """In its own model a filter fails only where it says so: reason 2, no answer within the limits of the inputs."""
    for family in ("head_on", "crossing"):
        guard = TextbookGuard(name, CONFIG, GAMES, (UNICYCLE, UNICYCLE), (0, 1), gains)
        outcome = run_drill(guard, family, UNICYCLE, GAMES, 3, CONFIG)
        assert (outcome.relaxed[outcome.breached] > 0.0).all()
        if family == "crossing" or name == "collision_cone":
            assert outcome.closest_m.min() >= 2.5
            assert (outcome.relaxed == 0.0).any()


@pytest.mark.parametrize("name", NAMES)
def test_heron_head_on_is_avoided_and_commands_pass_again(name):
    assert play(None, "heron", "head_on").breached.all()
    outcome = play(name, "heron", "head_on")
    assert not outcome.breached.any()
    assert (outcome.changed > 0.0).all()
    assert (outcome.changed < 1.0).all()


@pytest.mark.parametrize("family", FAMILIES)
def test_encounters_hang_on_their_seed_alone(family):
    one, two = openings(family, "heron", 5, 7), openings(family, "heron", 5, 7)
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(one, two, strict=True))
    assert not np.array_equal(one[0], openings(family, "heron", 5, 8)[0], equal_nan=True)


def test_unknown_encounters_are_refused():
    with pytest.raises(ConfigError, match="unknown family 'chase'; choose one of head_on"):
        openings("chase", "heron", 1, 0)


@pytest.mark.parametrize("name", NAMES)
def test_the_sweep_takes_the_safest_then_the_gentlest(name, monkeypatch):
    tried = list(BARRIERS[name].tried)
    assert len(set(tried)) > 5
    assert BARRIERS[name].tuned["heron"] in tried
    assert BARRIERS[name].tuned["surveyor"] in tried
    figures = {gains: {"head_on": {"breached": 1, "changed_percent": 0.0}} for gains in tried}
    figures[tried[3]] = {"head_on": {"breached": 0, "changed_percent": 40.0}}
    figures[tried[5]] = {"head_on": {"breached": 0, "changed_percent": 30.0}}
    monkeypatch.setattr(sweep, "try_out", lambda name, platform, gains: figures[gains])
    assert sweep.best(name, "heron") == tried[5]


def test_the_sweep_plays_encounters():
    figures = sweep.try_out("collision_cone", "heron", (3.0,), n=3, seed=1)
    assert list(figures) == list(sweep.FAMILIES)
    assert figures["head_on"]["encounters"] == 3
    assert 0.0 < sweep.cost(figures)[1] < 100.0 * len(figures)
    assert figures["crossing_left"]["unshielded_breached"] > 0
