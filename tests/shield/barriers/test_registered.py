"""Barriers of other people's: boats keep them as they keep off obstacles, and what is broken there fails closed."""

import copy
import functools
import json
import logging
import math
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from numba import njit
from shield_loops import sail
from steerclear.experiments.conformance import NotConforming, check_barrier
from steerclear.experiments.entries.wrap import game_spec
from steerclear.shield import Commands, Fleet, Reason, Shield, ShieldConfig, Surroundings, arrays
from steerclear.shield.backup.paths import SAG_M
from steerclear.shield.barriers import Barrier, register_barrier, registry
from steerclear.shield.exceptions import ConfigError, SteerclearError

FERRY = (0.0, 45.0, 0.0, -1.5, 10.0)
"""Place, m, velocity, m/s, and radius of its domain, m: it comes straight at a boat that runs north from the origin."""
NEAR = (0.0, 11.0, 0.0, 0.0, 10.0)
"""A domain that lies still, a metre before the boat."""


def ferrys(x_m, y_m, ahead_s, ferry):
    return math.hypot(x_m - ferry[0] - ahead_s * ferry[2], y_m - ferry[1] - ahead_s * ferry[3]) - ferry[4]


@pytest.fixture(autouse=True)
def nothing_stays_registered(monkeypatch):
    monkeypatch.setattr(registry, "BARRIERS", {})
    monkeypatch.setattr(arrays, "_said", set())


class Ferry:
    """A ferry under way, which moves by the step after each time it was looked at."""

    def __init__(self, dt_s=0.1, place=FERRY):
        self.seen, self.dt_s = np.array(place), dt_s

    def now(self):
        values = self.seen.copy()
        self.seen[:2] += self.dt_s * self.seen[2:4]
        return values


def lone(speed_mps=1.5, y_m=0.0):
    return Fleet.of(position_m=[[0.0, y_m]], heading_rad=[0.0], speed_mps=[speed_mps], team=[0], platforms="heron")


def north(step, state):
    """Everybody wants to go north at once."""
    return np.stack([np.full(state.shape[:-1], 1.5), -state[..., 2]], axis=-1)


def gaps(run, step=0.1):
    """Distance from the ferry's domain at every moment, m."""
    at = np.arange(len(run.position)) * step
    ferry = np.stack([FERRY[0] + at * FERRY[2], FERRY[1] + at * FERRY[3]], axis=-1)
    while ferry.ndim < run.position.ndim:
        ferry = ferry[:, None]
    return np.linalg.norm(run.position - ferry, axis=-1) - FERRY[4]


def test_a_boat_keeps_out_of_a_moving_domain():
    register_barrier(Barrier("ferry", ferrys, values=Ferry().now))
    free = gaps(sail(Shield(), lone(), north, 300)).min()
    run = sail(Shield(barriers=("ferry",)), lone(), north, 300)
    kept = gaps(run)
    assert free < -5.0
    assert kept.min() >= 0.0
    assert kept.min() < 4.0, "it does not stay farther off than it has to"
    assert (run.reason == Reason.PASSED).any()


def test_a_barrier_counts_as_an_obstacle_of_the_same_place_does():
    """A circle as an obstacle without a hull, and as a barrier: every command is the same, to rounding."""
    register_barrier(Barrier("rock", ferrys, values=(1.0, 20.0, 0.0, 0.0, 4.0)))
    round_it = sail(Shield(barriers=("rock",)), lone(), north, 250)
    stopped = sail(Shield(surroundings=Surroundings(stops=((1.0, 20.0, 4.0 + SAG_M),))), lone(), north, 250)
    assert (stopped.reason != Reason.PASSED).any()
    assert np.allclose(round_it.position, stopped.position, atol=1e-6)


def test_a_function_without_values_is_a_barrier_too():
    """Of the place alone: every command is that of the same function with an argument it does not use."""
    runs = []
    for margin in (lambda x, y, ahead: 20.0 - y, lambda x, y, ahead, values: 20.0 - y):
        registry.BARRIERS.clear()
        register_barrier(Barrier("shore", margin, lambda x, y, ahead: (0.0, -1.0)))
        check_barrier("shore")
        runs.append(sail(Shield(barriers=("shore",)), lone(), north, 150).position)
    assert runs[0].tobytes() == runs[1].tobytes()
    assert 15.0 < runs[0][..., 1].max() <= 20.0


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"margin": lambda x, y: y}, r"takes \(x, y\); define it with \(x_m, y_m, ahead_s\), or"),
        (
            {"margin": ferrys, "values": [5.0]},
            r"are a list, and later changes to it would count for nothing; give a",
        ),
        ({"margin": ferrys, "values": np.ones(5)}, "are a ndarray, and later changes"),
        ({"margin": lambda x, y, ahead: y, "values": (1.0,)}, "has values that no function takes"),
        ({"values": (1.0,)}, "Barrier was called without margin; it takes name, margin, slope, values"),
        ({"margin": ferrys, "value": (1.0,)}, "Barrier has no value=; did you mean values=?"),
        ({"margin": ferrys}, "ferrys of barrier 'mine' reads values, and there are none; give values="),
        ({"margin": lambda x, y, ahead, radius: y - radius[0]}, "<lambda> of barrier 'mine' reads values, and there"),
        ({"margin": njit(ferrys)}, "ferrys of barrier 'mine' reads values, and there are none"),
        ({"margin": lambda x, y, ahead: y, "slope": lambda x, y, ahead, of: (0.0, of[0])}, "reads values, and there"),
    ],
)
def test_a_barrier_that_cannot_be_asked_is_refused_with_the_remedy(given, words):
    with pytest.raises(SteerclearError, match=words):
        Barrier("mine", **given)


@pytest.mark.parametrize("settings", [{}, {"current_mps": 0.2, "delay_s": 0.2}])
def test_where_nothing_is_kept_a_margin_may_be_infinite(settings):
    """Also beside it, where the slope of an infinite margin would be none."""
    register_barrier(Barrier("chart", lambda x, y, ahead, values: math.inf if y > 0.03 else 60.0 - y))
    decision = Shield(barriers=("chart",), **settings).decide(lone(), Commands.relative_deg([[1.5, 0.0]]))[0]
    assert decision.reason is Reason.PASSED


def test_its_own_slope_is_taken(caplog):
    """By the program, which is asked where teammates are in the way; one that is none costs no distance."""
    register_barrier(
        Barrier("shore", lambda x, y, ahead, values: 12.0 - y, lambda x, y, ahead, values: (0.0, math.nan))
    )
    fleet = Fleet.of(
        position_m=[[0.0, 8.0], [8.0, 8.0]],
        heading_rad=[0.5 * math.pi, -0.5 * math.pi],
        speed_mps=[2.0, 2.0],
        team=[0, 0],
        platforms="heron",
    )
    ahead = lambda step, state: np.array([[2.0, 0.0], [2.0, 0.0]])  # noqa: E731
    with caplog.at_level(logging.WARNING):
        run = sail(Shield(barriers=("shore",)), fleet, ahead, 60)
    assert "'shore' gave no usable margin" in caplog.text
    assert (run.reason == Reason.LEAST_CHANGE).any()
    assert run.position[..., 1].max() < 12.01


def wrong_value(x, y, ahead, values):
    return math.nan


def raises(x, y, ahead, values):
    if y > -1e9:
        raise ValueError("no chart")
    return 0.0


def beyond_its_values(x, y, ahead, values):
    return values[3]


@pytest.mark.parametrize("margin", [wrong_value, raises, beyond_its_values])
def test_where_a_barrier_gives_no_margin_the_boat_stops_and_the_log_says_so(margin, caplog):
    register_barrier(Barrier("chart", margin, values=(1.0,)))
    with caplog.at_level(logging.WARNING):
        decision = Shield(barriers=("chart",)).decide(lone(y_m=4.0), Commands.relative_deg([[1.5, 0.0]]))[0]
    assert (decision.reason, decision.filtered_speed_mps) == (Reason.HELD, 0.0)
    assert decision.active_constraints == ("chart",)
    assert "'chart' gave no usable margin" in caplog.text


@pytest.mark.parametrize("broken", ["raises", "nan"])
def test_without_its_values_the_boat_stops(broken, caplog):
    answers = [[1.0]]

    def now():
        if not answers:
            raise OSError("no AIS") if broken == "raises" else ValueError
        return answers.pop() if broken == "raises" or answers else [math.nan]

    register_barrier(Barrier("ais", lambda x, y, ahead, values: 1e3 + values[0], values=now))
    shield, wanted = Shield(barriers=("ais",)), Commands.relative_deg([[1.5, 0.0]])
    assert shield.decide(lone(), wanted)[0].reason is Reason.PASSED
    with caplog.at_level(logging.WARNING):
        decision = shield.decide(lone(), wanted)[0]
    assert decision.active_constraints == ("ais",)
    assert (decision.reason, decision.filtered_speed_mps) == (Reason.HELD, 0.0)
    assert "no values now" in caplog.text


@pytest.mark.parametrize("again", [copy.deepcopy, lambda shield: pickle.loads(pickle.dumps(shield))])
def test_copies_of_a_shield_find_their_barriers(again):
    register_barrier(Barrier("ferry", ferrys, values=NEAR))
    shield, wanted = Shield(barriers=("ferry",)), Commands.relative_deg([[1.5, 0.0]])
    shield.decide(lone(y_m=-9.0), wanted)
    other = again(shield)
    other._barriers.arrays.address[:] = 0  # as in another process
    assert other.decide(lone(), wanted)[0] == shield.decide(lone(), wanted)[0]


def test_names_are_checked_when_a_shield_is_built():
    register_barrier(Barrier("a", ferrys, values=FERRY))
    register_barrier(Barrier("b", ferrys, values=FERRY))
    assert ShieldConfig(barriers="a+b").barriers == ("a", "b") == ShieldConfig(barriers=["a", "b", "a"]).barriers
    assert ShieldConfig(barriers="").barriers == ()
    assert hash(ShieldConfig(barriers="a")) == hash(ShieldConfig(barriers=("a",)))
    with pytest.raises(ConfigError, match="another's"):
        register_barrier(Barrier("a", lambda x, y, ahead: y))
    with pytest.raises(ConfigError, match="is no barrier"):
        register_barrier(3)


def test_a_zip_refuses_them_by_name():
    register_barrier(Barrier("ferry", ferrys, values=FERRY))
    with pytest.raises(ConfigError, match="cannot carry registered barriers \\(ferry\\)"):
        game_spec("mctf2026", {"barriers": ("ferry",)})
    assert json.dumps(game_spec("mctf2026", {})["shield"]["barriers"]) == "[]"


def test_a_good_barrier_conforms_and_others_are_told_why():
    register_barrier(Barrier("ferry", ferrys, values=FERRY))
    check_barrier("ferry")
    for name, margin, why in [
        ("steep", lambda x, y, ahead, values: 3.0 * y, "falls by 3 m"),
        ("raising", raises, "raises"),
        ("unknown", wrong_value, "no number"),
        ("moody", lambda x, y, ahead, values: np.random.default_rng().random(), "another margin|falls by"),
    ]:
        register_barrier(Barrier(name, margin))
        with pytest.raises(NotConforming, match=why):
            check_barrier(name)
    register_barrier(Barrier("sloping", ferrys, lambda x, y, ahead, values: (0.0, 0.0), FERRY))
    with pytest.raises(NotConforming, match="slope"):
        check_barrier("sloping")
    register_barrier(Barrier("free", lambda x, y, ahead, values: math.inf))
    check_barrier("free")


def squared(value):
    return value * value


def calling(x_m, y_m, ahead_s, ferry):
    return squared(x_m) - 25.0


def of_no_type(x, y, ahead, values):
    return "deep"


@pytest.mark.parametrize("odd", [calling, of_no_type, functools.partial(ferrys)])
def test_what_the_compiler_does_not_take_is_refused_in_words(odd):
    register_barrier(Barrier("odd", odd, values=NEAR))
    with pytest.raises(ConfigError, match="does not take barrier 'odd'") as refused:
        Shield(barriers=("odd",))
    assert str(refused.value).isprintable()
    assert len(str(refused.value)) < 600


PLAIN = """
from steerclear.shield import Commands, Fleet, Shield
from steerclear.shield.barriers import Barrier, register_barrier
h = lambda x, y, ahead, values: (x * x + (y - values[0]) ** 2) ** 0.5 - 10.0
register_barrier(Barrier("pole", h, values=(11.0,)))
fleet = Fleet.of(position_m=[(0.0, 0.0)], heading_deg=[0.0], speed_mps=[1.5], team=[0], platforms="heron")
print(Shield(barriers=("pole",)).decide(fleet, Commands.relative_deg([[1.5, 0.0]]))[0].filtered_heading_rad)
"""


def test_plain_python_decides_as_compiled_code():
    told = []
    for plain in ("0", "1"):
        run = [sys.executable, "-c", PLAIN]
        done = subprocess.run(run, env=os.environ | {"NUMBA_DISABLE_JIT": plain}, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        told.append(float(done.stdout))
    assert told[0] == pytest.approx(told[1], abs=1e-9)
    assert abs(told[0]) > 0.01


def test_what_is_seen_too_late_or_raises_does_not_conform():
    def no_values():
        if answers:
            raise OSError("no AIS")
        answers.append(1)
        return FERRY

    answers = []
    register_barrier(Barrier("fast", ferrys, values=(0.0, 0.0, 15.0, 0.0, 5.0)))
    register_barrier(Barrier("ais", ferrys, values=no_values))
    register_barrier(Barrier("triple", ferrys, lambda x, y, ahead, values: (0.0, 0.0, 0.0), FERRY))
    for name, why in (("fast", "in a second"), ("ais", "OSError: no AIS"), ("triple", "no pair of numbers")):
        with pytest.raises(NotConforming, match=why):
            check_barrier(name)


def wall_of_nothing(x, y, ahead, values):
    return math.nan


def edge_and_rammer(step, state):
    """Boat 0 wants east, over the edge; boat 1 steers at it."""
    dx, dy = state[0, :2] - state[1, :2]
    bearing = np.degrees(np.arctan2(dx, dy))
    return np.array([[1.5, 90.0 - state[0, 2]], [2.0, (bearing - state[1, 2] + 180.0) % 360.0 - 180.0]])


@pytest.mark.parametrize("barriers", [(), ("far",), ("nothing",)])
def test_a_barrier_hides_neither_pursuers_nor_edges_nor_obstacles(barriers):
    """One that is kept with no slope, and one of which nothing is known: then the boat stops, but for a backup."""
    register_barrier(Barrier("far", lambda x, y, ahead, values: 30.0, lambda x, y, ahead, values: (math.nan, 0.0)))
    register_barrier(Barrier("nothing", wall_of_nothing))
    around = Surroundings(field=(-60.0, -60.0, 12.0, 60.0), circles=((6.0, 0.0, 1.0),))
    fleet = Fleet.of(
        position_m=[[0.0, 0.0], [-10.0, 14.0]],
        heading_rad=[0.5 * math.pi, math.pi],
        speed_mps=[1.5, 2.0],
        team=[0, 1],
        platforms="heron",
        controlled=[True, False],
    )
    run = sail(Shield(barriers=barriers), fleet, edge_and_rammer, 100, around)
    gap_m = np.linalg.norm(run.position[:, 0] - run.position[:, 1], axis=1)
    assert gap_m.min() > 2.5
    assert run.position[:, 0, 0].max() < 12.0
    assert np.linalg.norm(run.position[:, 0] - (6.0, 0.0), axis=1).min() > 1.0


def uncharted(x, y, ahead, values):
    return 30.0 if y < 6.0 else math.nan


def test_a_boat_stays_out_of_where_nothing_is_known():
    register_barrier(Barrier("chart", uncharted))
    run = sail(Shield(barriers=("chart",)), lone(), north, 200)
    assert 4.0 < run.position[:, 0, 1].max() < 6.01
