"""The stages of one decision set up by hand, to look between them."""

from typing import NamedTuple

import numpy as np
from steerclear.shield import Surroundings, plan
from steerclear.shield.backup.assign import assign_plans
from steerclear.shield.barriers.neighbours import find_neighbours
from steerclear.shield.filter import exact_check, flow, least_change, screening, switching
from steerclear.shield.filter.program import Program, solve
from steerclear.shield.kept_barriers import KeptBarriers
from steerclear.shield.memory import new_memory
from steerclear.shield.platforms import layout as L
from steerclear.shield.scene import Scene, path_samples
from steerclear.shield.setup import boats_of, tuning_of
from steerclear.shield.shared import share
from steerclear.shield.work import new_work


class Stages(NamedTuple):
    """Arrays of one decision: see `flow`."""

    state: np.ndarray
    ours: np.ndarray
    boats: object
    static: object
    registered: object
    tuning: object
    memory: object
    work: object
    plan: object

    @property
    def scene(self):
        """What the stages take."""
        return share(Scene(*self))


def stages_of(config, state, platforms, team, surroundings=None):
    """Fresh stages for a fleet's state rows; the boats of team 0 are ours."""
    n = len(state)
    boats = boats_of(config, tuple(platforms), tuple(team))
    work = new_work(n, path_samples(boats))
    work.fear_s[:] = config.feared_s
    return Stages(
        state.copy(),
        np.array(team) == 0,
        boats,
        (surroundings or Surroundings()).pack(config),
        KeptBarriers(config).arrays,
        tuning_of(config),
        new_memory(n),
        work,
        plan.new_plan(n, n * (n + 5) + 2),
    )


def screened(at, wanted):
    """Screen the wanted commands; True when they are safe."""
    at.work.wanted[:], at.work.error_m[:] = wanted, 0.0
    return screening.screen(at.scene)


def screened_with_all_pairs(at, wanted):
    """`screening.screen` again, with no pair left out."""
    n = len(wanted)
    at.work.wanted[:], at.work.error_m[:] = wanted, 0.0
    find_neighbours(at.scene)
    left_out = ~at.work.near & ~np.eye(n, dtype=bool)
    at.work.radius[left_out] = at.tuning.radius_m
    at.work.near[left_out] = True
    screening.set_targets(at.scene)
    for i in range(n):
        at.plan.commands[i] = wanted[i]
        at.plan.slack_m[i], at.plan.moving[i] = 0.0, False
        at.plan.reason[i] = plan.PASSED if at.ours[i] else plan.NOT_COVERED
        if at.ours[i]:
            exact_check.predict(i, at.plan.commands, at.scene)
            turn = at.work.next_state[i, L.HEADING] - at.state[i, L.HEADING]
            at.plan.wanted_turn[i] = (turn + 180.0) % 360.0 - 180.0
    at.plan.screened[:] = at.plan.commands
    safe = assign_plans(at.scene, 1, at.ours)
    return safe, int(left_out.sum()) // 2


def built(at):
    """Pick the movers and build their rows: number of movers, number of rows."""
    count = switching.pick_movers(at.scene)
    return count, least_change.linearise(count, at.scene)


def decided(at, solver="quadprog"):
    """The rest of a decision after screening: commands and reasons."""
    for group in range(flow.groups_left(at.scene)):
        count, found = flow.begin_group(group, at.scene), False
        for _ in range(least_change.ROUNDS if count > 0 else 0):
            z = _answer(at, count, least_change.linearise(count, at.scene), solver)
            if z is None:
                break
            found = least_change.accept(at.scene, z, count)
            if found:
                break
        flow.end_group(at.scene, found, count)
    flow.end(at.scene)
    return at.plan.commands.copy(), at.plan.reason.copy()


def _answer(at, count, rows, solver):
    n, plan = 2 * count, at.plan
    return solve(Program(plan.C[:rows, :n], plan.d[:rows], plan.z0[:n]), solver)
