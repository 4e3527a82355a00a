"""The organisers' opponents give the very actions recorded by running Pyquaticus (commit c0a3691)."""

import json
from pathlib import Path

import numpy as np
import pytest
from steerclear.policies.scripted import layout as S
from steerclear.policies.scripted.batch import command_team
from steerclear.policies.scripted.layout import Behaviour, Game
from steerclear.shield.platforms import layout as L

DATA = Path(__file__).parent / "data" / "organisers.npz"
BOATS = {
    "surveyor_game_medium": ["MEDIUM_ATTACK", "MEDIUM_ATTACK", "MEDIUM_DEFEND"] * 2,
    "heron_game_hard": ["HARD"] * 6,
    "heron_game_mixed_2025": [
        "EASY_ATTACK",
        "EASY_ATTACK",
        "EASY_DEFEND",
        "MEDIUM_DEFEND",
        "HARD_DEFEND",
        "HARD_ATTACK",
    ],
}


def replay(name, codes):
    """Our commands (T, 6, 2) in the recorded situations, and the recorded ones."""
    with np.load(DATA) as data:
        run = {key.partition("/")[2]: data[key] for key in data.files if key.startswith(f"{name}/")}
    meta = json.loads(str(run["meta"]))
    field = np.zeros(S.N_FIELD)
    field[:4] = [*meta["env_bounds"], meta["flag_keepout"], meta["dt"]]
    field[S.MEDIUM_REACH] = 60.0
    limits = np.column_stack([meta["max_speeds"], meta["agent_radius"]])
    memory, streams, given = np.zeros((6, S.N_MEMORY)), np.zeros(6, np.uint64), np.zeros((6, 0, 2))
    team, boats, homes = np.repeat([0, 1], 3), np.arange(6), np.array(meta["flag_home"])
    ours = np.zeros_like(run["action"])
    for t in range(len(ours)):
        state = np.zeros((6, L.N_STATE))
        state[:, [L.X, L.Y]], state[:, L.HEADING] = run["position"][t], run["heading"][t]
        state[:, L.SPEED] = run["speed"][t]
        seen = [run[name][t] for name in ("is_tagged", "has_flag", "on_side")]
        game = Game(state, limits, team, *seen, homes, run["flag_position"][t], field)
        command_team(codes, boats, memory, given, streams, game, ours[t])
    return ours, run["action"]


def differences(name, codes):
    """Largest difference per boat of speed m/s and heading deg; the heading of a stopped boat does not count."""
    ours, recorded = replay(name, codes)
    speed = np.abs(ours[..., 0] - recorded[..., 0])
    heading = np.abs((ours[..., 1] - recorded[..., 1] + 180.0) % 360.0 - 180.0)
    heading[(ours[..., 0] == 0.0) & (recorded[..., 0] == 0.0)] = 0.0
    return speed.max(axis=0), heading.max(axis=0)


@pytest.mark.parametrize("name", BOATS)
def test_every_recorded_action_is_reproduced(name):
    speed, heading = differences(name, np.array([Behaviour[code] for code in BOATS[name]], dtype=np.int64))
    assert speed.max() <= 1e-9
    assert heading.max() <= 1e-9


def test_another_behaviour_would_be_noticed():
    """The comparison can fail: medium boats are not taken for hard ones."""
    _, heading = differences("surveyor_game_medium", np.full(6, int(Behaviour.HARD_ATTACK), dtype=np.int64))
    assert (heading > 1.0).all()
