"""What the shield, the games and the policies refuse, and in which words: each line of data/refused.txt."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig, as_config
from steerclear.env.core import BatchedMctf
from steerclear.env.field import field_geometry
from steerclear.env.mctf import MctfEnv
from steerclear.env.pyquaticus_config import from_pyquaticus
from steerclear.env.record import GameRecorder, find_violations
from steerclear.env.render import Renderer
from steerclear.shield import Commands, Fleet, Reason, Shield, ShieldConfig, Surroundings, exceptions
from steerclear.shield.barriers import Barrier
from steerclear.shield.batch import BatchedShield
from steerclear.shield.platforms import Gains, Platform, get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.files import parse_platform
from steerclear.shield.tables.grid import Grid
from steerclear.shield.tables.settings import OtherMay, Problem, problem_of
from steerclear.shield.wrappers import TeamBatch, games_shield

LINES = [
    line
    for line in (Path(__file__).parent / "data" / "refused.txt").read_text(encoding="utf-8").splitlines()
    if "  ->  " in line
]
RATE = (
    "name: tub\nkind: rate\nmax_speed_mps: 2\nmax_acc: 1\nmax_turn_rate_dps: 40\nmax_angular_acc_dps2: 60\n"
    "turn_rate_per_mps: 30\nheading_pid: {kp: 1.5}\n"
)
UNICYCLE = {"max_speed_mps": 3.0, "max_turn_rate_dps": 30.0, "max_acc": 1.0, "max_angular_acc_dps2": 60.0}
TRIANGLE = [(0.0, 0.0), (4.0, 0.0), (2.0, 3.0)]
AHEAD = Commands.relative_deg([(2.0, 0.0), (2.0, 0.0)])
GRID = Grid(12.0, n_rho=9, n_psi=8, n_beta=7, n_own=3, n_other=2, own_top_mps=2.0, other_top_mps=2.0)
BATCHED = np.zeros((1, 2, L.N_STATE)), np.zeros((1, 2, 2)), np.ones((1, 2), bool)
ISLAND = GameConfig.preset("aamas2024", team_size=2, obstacles={"circle": [(2.0, (30.0, 10.0))]})


def fleet(**changes):
    good = {"position_m": [[0.0, 0.0], [0.0, 9.0]], "speed_mps": [2.0, 2.0], "team": [0, 1], "platforms": "heron"}
    headings = {} if {"heading_rad", "heading_deg"} & set(changes) else {"heading_rad": [0.0, math.pi]}
    return Fleet.of(**{**good, **headings, **changes})


def redecided(**changes):
    """A second decision, about a fleet with changed fields; the shield works on after refusing it."""
    shield = Shield()
    shield.decide(fleet(), AHEAD)
    try:
        shield.decide(replace(fleet(), **changes), AHEAD)
    finally:
        assert shield.decide(fleet(), AHEAD)[0].reason in Reason


def integrator(kind, lacking):
    Platform(name="mine", kind=kind, **UNICYCLE)
    return Platform(name="mine", kind=kind, **UNICYCLE | {lacking: 0.0})


def file(was, becomes):
    """A platform file with something replaced, or added at its end."""
    return parse_platform(RATE.replace(was, becomes) if was else RATE + becomes)


def problem(**changes):
    heron = get_platform("heron")
    return replace(Problem(heron, heron, OtherMay.WORST_CASE, GRID, 0.3, 6.0), **changes)


def start(init=None, **more):
    """A game begun from a partial state; where that is refused nothing has changed."""
    core = BatchedMctf(ISLAND, seed=0)
    core.step(np.ones((1, 4, 2)))
    before = core.state.copy(), core.time_s.copy()
    try:
        core.reset_game(0, more if init is None else init)
    except exceptions.GameError:
        np.testing.assert_array_equal(core.state, before[0])
        np.testing.assert_array_equal(core.time_s, before[1])
        raise


def followed(seen, dt_s):
    """A referee that is shown boats; where that is refused nothing has changed."""
    referee = BatchedMctf(ISLAND, seed=0)
    before = referee.state.copy()
    try:
        referee.follow(seen, dt_s)
    finally:
        np.testing.assert_array_equal(referee.state, before)


class Decisions:
    """Decisions about two boats, made when they are asked for."""

    def __getitem__(self, index):
        return Shield().decide(fleet(), AHEAD)[index]


HELPERS = (fleet, redecided, followed, integrator, file, problem, start)
CALLED = (
    *(Barrier, BatchedMctf, BatchedShield, Commands, Gains, GameConfig, GameRecorder, MctfEnv, Shield, ShieldConfig),
    *(
        Surroundings,
        TeamBatch,
        as_config,
        find_violations,
        games_shield,
        get_platform,
        parse_platform,
        problem_of,
        replace,
    ),
)
KNOWN = {
    "boat": lambda **changes: replace(get_platform("heron"), **changes),
    "rover": lambda **changes: replace(get_platform("ardurover_boat"), **changes),
    "grid": lambda **changes: replace(GRID, **changes),
    "game": lambda **settings: GameConfig.preset("aamas2024", **settings),
    "field": lambda **settings: field_geometry(GameConfig.preset("aamas2024", **settings)),
    "quaticus": lambda settings=None, **more: from_pyquaticus(more if settings is None else settings, team_size=1),
    "renderer": lambda **settings: Renderer(GameConfig.preset("aamas2024"), **settings),
    "batch": lambda **settings: TeamBatch(BatchedMctf("aamas2024"), **settings),
    "decisions": Decisions(),
    **{"np": np, "math": math, "L": L, "policies": policies},
    **{"TRIANGLE": TRIANGLE, "ISLAND": ISLAND, "BATCHED": BATCHED},
    **{one.__name__: one for one in (*HELPERS, *CALLED)},
}


@pytest.mark.parametrize("line", LINES)
def test_it_is_refused_in_these_words(line):
    expression, _, told = line.partition("  ->  ")
    error, _, words = told.partition(": ")
    with pytest.raises(getattr(exceptions, error), match=words):
        eval(expression, KNOWN)
