"""The stages of one decision set up by hand, to look between them."""

import numpy as np
from steerclear.shield import Surroundings, decide, workspace
from steerclear.shield.filter import backup_switch, qp
from steerclear.shield.model import boats_of, tuning_of
from steerclear.shield.shield import barriers_of


class Stages:
    """A scene, whose fields are read as one's own."""

    def __init__(self, scene):
        self.scene = scene

    def __getattr__(self, name):
        return getattr(self.scene, name)


def stages_of(config, state, platforms, team, surroundings=None):
    """A fresh scene for a fleet's state rows; the boats of team 0 are ours."""
    boats = boats_of(config, tuple(platforms), tuple(team))
    static = (surroundings or Surroundings()).pack(config, barriers_of(config).arrays)
    scene = workspace.new_scene(1, boats, static, tuning_of(config), 0)
    scene.state[:], scene.ours[:] = state, np.array(team) == 0
    scene.adversary_horizon_s[:] = config.effective_adversary_horizon_s
    return Stages(scene)


def screened(at, wanted):
    """Check the nominal commands; True when they are safe."""
    at.nominal[:], at.error_m[:] = wanted, 0.0
    return decide.begin(at.scene) == 0


def built(at):
    """Pick the movers and build their rows: number of movers, number of rows."""
    count = backup_switch.pick_movers(at.scene)
    return count, qp.linearise(count, at.scene)
