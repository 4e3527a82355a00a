"""The stages of one decision set up by hand, to look between them."""

import numpy as np
from steerclear.shield import Surroundings, decide, workspace
from steerclear.shield.backup.assign import assign_plans
from steerclear.shield.barriers.neighbours import find_neighbours
from steerclear.shield.filter import backup_switch, nominal, qp
from steerclear.shield.model import boats_of, tuning_of
from steerclear.shield.platforms import layout as L
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
    scene.fear_s[:] = config.effective_adversary_horizon_s
    return Stages(scene)


def screened(at, wanted):
    """Check the nominal commands; True when they are safe."""
    at.nominal[:], at.error_m[:] = wanted, 0.0
    return nominal.screen(at.scene)


def screened_with_all_pairs(at, wanted):
    """`nominal.screen` again, with no pair left out."""
    n = len(wanted)
    at.nominal[:], at.error_m[:] = wanted, 0.0
    find_neighbours(at.scene)
    left_out = ~at.near & ~np.eye(n, dtype=bool)
    at.radius[left_out] = at.tuning.radius_m
    at.near[left_out] = True
    nominal.set_targets(at.scene)
    for i in range(n):
        at.command[i] = wanted[i]
        at.slack_m[i], at.moving[i] = 0.0, False
        at.reason[i] = workspace.PASSED if at.ours[i] else workspace.NOT_COVERED
        if at.ours[i]:
            nominal.predict(i, at.command, at.scene)
            turn = at.next_state[i, L.HEADING] - at.state[i, L.HEADING]
            at.checked_turn[i] = (turn + 180.0) % 360.0 - 180.0
    at.checked[:] = at.command
    safe = assign_plans(at.scene, 1, at.ours)
    return safe, int(left_out.sum()) // 2


def built(at):
    """Pick the movers and build their rows: number of movers, number of rows."""
    count = backup_switch.pick_movers(at.scene)
    return count, qp.linearise(count, at.scene)


def decided(at):
    """The rest of a decision after the check: commands and reasons."""
    for group in range(decide.groups_left(at.scene)):
        count, found = decide.begin_group(group, at.scene), False
        for _ in range(qp.ROUNDS if count > 0 else 0):
            rows = qp.linearise(count, at.scene)
            found = rows >= 0 and qp.solve(count, rows, at.scene) and qp.accept(at.scene, at.z, count)
            if found:
                break
        decide.end_group(at.scene, found, count)
    decide.end(at.scene)
    return at.command.copy(), at.reason.copy()
