"""Backups of some boats must not be bought with those of others, who were let pass."""

import json
from pathlib import Path

import numpy as np
from shield_loops import packed, step_all
from shield_scenes import distances
from steerclear.shield import ShieldConfig, Surroundings
from steerclear.shield import workspace as W
from steerclear.shield.batch import BatchedShield

DOORWAY = Path(__file__).parents[2] / "data" / "doorway.json"
"""Twelve herons of ours in a doorway, one of them inside a circle kept by rule: states, the shield's memory, wishes."""
COLUMNS = {
    "has_backup": W.HAS_BACKUP,
    "side": W.BACKUP_SIDE,
    "target_deg": W.BACKUP_HEADING,
    "speed_mps": W.BACKUP_SPEED,
    "margin_m": W.BACKUP_MARGIN,
    "threat_m": slice(W.N_MEMORY, None),
    "static_m": W.STATIC_MARGIN,
    "backing_up": W.BACKING_UP,
}


def test_a_boat_that_passed_goes_back_to_its_backup_when_another_needs_the_room():
    """Its backup after the nominal command lies where the other's has to go; 2.34 m apart without, in half a second."""
    scene = json.loads(DOORWAY.read_text())
    state = np.array(scene["state"])[None]
    n = state.shape[1]
    around = Surroundings(keep_out=[(0.0, 34.0, 30.0), (0.0, -34.0, 30.0)])
    shield = BatchedShield(ShieldConfig(), 1, ("heron",) * n, (0,) * n, around)
    for name, values in scene["memory"].items():
        shield.remembered["memory"][0, :, COLUMNS[name]] = np.transpose(values)
    for wanted in scene["wanted"]:
        commands = shield.decide(state, np.array(wanted)[None], np.ones((1, n), bool))
        step_all(packed(["heron"] * n), state, commands, shield.config.dt_s)
        assert distances(state[..., :2]).min() >= 2.5
