"""Decisions as they were recorded: whatever changes one of them shows here, in every part of the shield.

Where they are meant to change: ``python tests/shield/test_recorded_decisions.py`` records them anew (see tests/data).
"""

from pathlib import Path

import numpy as np
import pytest
from shield_loops import packed, scattered, step_all
from steerclear.shield import Commands, Fleet, Shield, Surroundings
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L

RECORDED = Path(__file__).parents[1] / "data" / "decisions.npz"
STEPS, MATES = 40, (0, 0, 0, 1, 1, 1)
HARBOUR = {
    "field": (-5.0, -5.0, 55.0, 55.0),
    "circles": [(15.0, 15.0, 3.0)],
    "polygons": [[(30.0, 30.0), (36.0, 30.0), (33.0, 38.0)]],
    "keep_out": [(40.0, 10.0, 5.0)],
    "stops": [(10.0, 40.0, 4.0)],
}
MIXED = ("heron", "surveyor", "ardurover_boat", "di", "otter", "blueboat")
CASES = {
    "herons": (("heron",) * 6, 16.0, {}),
    "surveyors": (("surveyor",) * 6, 40.0, {}),
    "mixed": (MIXED, 40.0, {"separation_m": 3.0}),
    "harbour": (("heron",) * 6, 45.0, {"around": HARBOUR}),
    "harbour of surveyors": (("surveyor",) * 6, 50.0, {"around": HARBOUR, "team": (0,) * 6}),
    "nothing exact": (("heron",) * 6, 18.0, {"delay_s": 0.2, "current_mps": 0.1, "position_error_m": 0.2}),
    "each for itself": (("heron",) * 6, 16.0, {"coordination": "per_boat"}),
    "rammers": (("surveyor",) * 6, 50.0, {"profile": "ramming"}),
    "pursuers": (("surveyor",) * 6, 50.0, {"opponent_model": "turning_circle"}),
    "tables": (("heron",) * 6, 18.0, {"opponent_model": "value_table"}),
    "straight on": (("heron",) * 6, 14.0, {"profile": "constant_velocity"}),
    "held commands": (("surveyor",) * 6, 50.0, {"dt_s": 1.0, "move_s": 0.1}),
    "hardly a search": (("heron",) * 6, 14.0, {"work_budget": 1000.0, "team": (0,) * 6}),
    "another solver": (("heron",) * 6, 14.0, {"solver": "daqp", "team": (0,) * 6}),
    "the last line": (
        ("heron",) * 6,
        50.0,
        {
            "around": HARBOUR | {"field": (5.0, 5.0, 40.0, 40.0)},
            "profile": "ramming",
            "beyond_m": 1.0,
            "beyond_then": "stop",
        },
    ),
}
TOLD = ("reason", "safety_margin_m", "slack_m", "active_constraint", "cut_short", "outside_m")


def begun(name):
    """The shield of a case, its fleet's platforms and teams."""
    platforms, _, settings = CASES[name]
    settings = {key: value for key, value in settings.items() if key not in ("around", "team")}
    around = Surroundings(**CASES[name][2].get("around", {}))
    return Shield(surroundings=around, **settings), platforms, np.array(CASES[name][2].get("team", MATES))


def decided(shield, state, platforms, team, nominal):
    """What is decided, one row per boat: command, reason and what else is told."""
    fleet = Fleet(state.copy(), team, platforms, team == 0, tuple(f"boat_{i}" for i in range(len(team))))
    decisions = shield.decide(fleet, Commands.relative_deg(nominal))
    return np.column_stack([decisions.filtered.values, *(np.asarray(getattr(decisions, one), float) for one in TOLD)])


@pytest.mark.parametrize("name", CASES)
def test_decisions_are_those_recorded(name):
    """Every step begins where the record has the boats; what the shield remembers is its own."""
    shield, platforms, team = begun(name)
    with np.load(RECORDED) as data:
        states, nominal, told = (data[f"{name}/{part}"] for part in ("states", "nominal", "told"))
    assert len(np.unique(told[..., 2])) > 1, "nothing to decide"
    for k in range(STEPS):
        found = decided(shield, states[k], platforms, team, nominal[k])
        np.testing.assert_array_equal(found[:, [2, 5]], told[k][:, [2, 5]], err_msg=f"reasons and bounds, step {k}")
        np.testing.assert_allclose(found, told[k], rtol=0.0, atol=1e-5, err_msg=f"step {k}")


def record():
    """Record every case: boats make for places of their own, opponents for a boat of ours."""
    arrays = {}
    for number, (name, (platforms, side_m, _)) in enumerate(CASES.items()):
        shield, _, team = begun(name)
        random, params = np.random.default_rng(number), packed(platforms)
        state = scattered(random, 1, platforms, side_m, gap_m=3.5, speed=(0.3, 1.0))[0]
        goal = side_m - state[:, :2]
        top = np.array([get_platform(kind).max_speed_mps for kind in platforms])
        rows = {"states": [], "nominal": [], "told": []}
        for _ in range(STEPS):
            aim = np.where((team == 0)[:, None], goal, state[[0, 1, 2, 0, 1, 2], :2]) - state[:, :2]
            turn = np.degrees(np.arctan2(aim[:, 0], aim[:, 1])) - state[:, L.HEADING]
            nominal = np.column_stack([top, (turn + 180.0) % 360.0 - 180.0])
            told = decided(shield, state, platforms, team, nominal)
            for key, value in (("states", state.copy()), ("nominal", nominal), ("told", told)):
                rows[key].append(value)
            step_all(params, state[None], told[None, :, :2].copy(), shield.config.dt_s)
        arrays |= {f"{name}/{key}": np.array(values) for key, values in rows.items()}
    np.savez_compressed(RECORDED, **arrays)


if __name__ == "__main__":
    record()
