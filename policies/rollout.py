"""Rolling plans out in the simulator, compiled, for a search that changes one boat's plan at a time.

Plans are rolled out one after another. A mutant begins where it first differs from its parent, and boats other than its
own go as they did in the parent's rollout for as long as they stand as they did there (tagged or not, their flag taken
or not): their motion hangs on nothing else. So little is rolled out twice, and every rollout ends in the same bits as
one from the start with all boats.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from steerclear.env import rules as R
from steerclear.env.advance import begin_decision
from steerclear.env.angles import wrap_bearing
from steerclear.env.arrays import CAPTURE, GRAB, OUT, TAG, Games, Rules, make_games
from steerclear.env.config import GameConfig
from steerclear.env.drive_home import decide_boat
from steerclear.env.motion import move_boat
from steerclear.shield.jit import Array, BoolArray, IntArray, copy_row, lean_kernel
from steerclear.shield.platforms import layout as L
from steerclear.shield.shared import share

HEADINGS = 8
STOP = HEADINGS
N_MOVES = HEADINGS + 1
"""Macro-actions: full speed along one of eight absolute headings (45 deg apart, from north), and a stop."""

# columns of what a rollout counts, blue's minus red's where two teams can have it
CAPTURES, GRABS, TAGS, MATE_HITS_BLUE, MATE_HITS_RED, FOE_HITS, NEAR_BLUE, NEAR_RED = 0, 1, 2, 3, 4, 5, 6, 7
OUT_BLUE, OUT_RED = 8, 9
N_COUNTED = 10
NEAR_MATES_M = 6.0
"""Closer than this, teammates are counted as near, decision by decision."""
SLACK_M = 0.001
"""Pairs this much farther apart than what is looked for are not measured to the last bit."""


class Weights(NamedTuple):
    """What a plan is worth, to one team; distances count per field width.

    The paper's team played for captures, progress and contacts of teammates; its row has the fewest collisions.
    """

    capture: float = 10.0
    grab: float = 3.0
    tag: float = 2.0
    mate_hit: float = 6.0
    foe_hit: float = 3.0
    near_mate: float = 0.05
    out: float = 4.0
    progress: float = 2.0


class Desk(NamedTuple):
    """Where a search works: a game to play plans in, and how the rollout of the best plan went.

    A plan has H macro-actions, each held for ``repeats`` decisions; D is the decisions and S the steps of motion of a
    rollout.
    """

    repeats: int
    generations: int
    weights: Weights
    bench: Games  # one game
    marks: Games  # H games: the best plan's as each macro-action begins
    marked: Array  # (H, N_COUNTED) what had been counted by then
    state: Array  # (S, n, N_STATE) after each step of motion
    error_is_float32: BoolArray  # (S, n)
    on_side: BoolArray  # (S, n)
    is_tagged: BoolArray  # (D, n) as each decision begins
    flag_taken: BoolArray  # (D, 2)
    as_recorded: BoolArray  # (n,) boats that stand as recorded
    counted: Array  # (N_COUNTED,) of the rollout at hand
    wanted: Array  # (1, n, 2) scratch
    commands: Array  # (1, n, 2) scratch
    brood: IntArray  # (P, H) plans of a generation


def make_desk(config: GameConfig, population: int, generations: int, horizon: int, move_s: float) -> Desk:
    """A desk for games by these rules.

    Args:
        config: of the forward model's games.
        population: plans of a generation.
        generations: times that the best plan is mutated.
        horizon: macro-actions of a plan.
        move_s: time a macro-action is held, s.
    """
    n, repeats = config.n_boats, max(round(move_s / config.decision_s), 1)
    decisions = horizon * repeats
    steps = decisions * config.decision_steps
    return share(
        Desk(
            repeats=repeats,
            generations=generations,
            weights=Weights(),
            bench=make_games(config, 1),
            marks=make_games(config, horizon),
            marked=np.zeros((horizon, N_COUNTED)),
            state=np.zeros((steps, n, L.N_STATE)),
            error_is_float32=np.zeros((steps, n), np.bool_),
            on_side=np.zeros((steps, n), np.bool_),
            is_tagged=np.zeros((decisions, n), np.bool_),
            flag_taken=np.zeros((decisions, 2), np.bool_),
            as_recorded=np.zeros(n, np.bool_),
            counted=np.zeros(N_COUNTED),
            wanted=np.zeros((1, n, 2)),
            commands=np.zeros((1, n, 2)),
            brood=np.zeros((population, horizon), np.int64),
        )
    )


@lean_kernel
def copy_game(to: Games, t: int, source: Games, b: int) -> None:
    """Make game ``t`` of one batch stand as game ``b`` of another, in all that decides how it goes on."""
    to.rng[t] = source.rng[b]
    for team in range(2):
        to.flag_taken[t, team] = source.flag_taken[b, team]
        copy_row(to.flag_position[t, team], source.flag_position[b, team])
    for i in range(source.state.shape[1]):
        copy_row(to.state[t, i], source.state[b, i])
        copy_row(to.previous_position[t, i], source.previous_position[b, i])
        to.error_is_float32[t, i] = source.error_is_float32[b, i]
        to.is_tagged[t, i] = source.is_tagged[b, i]
        to.is_disabled[t, i] = source.is_disabled[b, i]
        to.has_flag[t, i] = source.has_flag[b, i]
        to.oob[t, i] = source.oob[b, i]
        to.on_side[t, i] = source.on_side[b, i]
        to.tagging_cooldown_s[t, i] = source.tagging_cooldown_s[b, i]
        for j in range(source.state.shape[1]):
            to.touching[t, i, j] = source.touching[b, i, j]


@lean_kernel
def roll_out(rules: Rules, desk: Desk, plans: IntArray, boat: int, begin: int, record: bool) -> None:
    """Play plans (n, H) on the bench from the mark of macro-action ``begin`` to their end, and count what happens.

    With ``record`` all boats are moved, and how it goes is kept. Else those but ``boat`` go as recorded while they can.
    """
    games, horizon = desk.bench, plans.shape[1]
    copy_game(games, 0, desk.marks, begin)
    copy_row(desk.counted, desk.marked[begin])
    for i in range(rules.n_boats):
        desk.as_recorded[i] = not record and i != boat and rules.obstacles.bounds.shape[0] == 0
    for move in range(begin, horizon):
        if record and move > begin:
            copy_game(desk.marks, move, games, 0)
            copy_row(desk.marked[move], desk.counted)
        early = 1.0 - 0.5 * move / horizon
        for repeat in range(desk.repeats):
            _play_decision(rules, desk, plans, move, move * desk.repeats + repeat, record)
            _count_events(games.events[0], early, desk.counted)
            _count_pairs(rules, games.state[0], games.touching[0], desk.counted)


@lean_kernel
def _play_decision(rules: Rules, desk: Desk, plans: IntArray, move: int, number: int, record: bool) -> None:
    """One decision on the bench, the ``number``-th of a rollout; contacts are left to `_count_pairs`."""
    games, first = desk.bench, number * rules.decision_steps
    if record:
        for team in range(2):
            desk.flag_taken[number, team] = games.flag_taken[0, team]
    begin_decision(rules, games)
    for i in range(rules.n_boats):
        if record:
            desk.is_tagged[number, i] = games.is_tagged[0, i]
        elif desk.as_recorded[i]:
            _compare(rules, desk, i, number)
        if desk.as_recorded[i]:
            _put(rules, desk, i, first + rules.decision_steps - 1)
        else:
            _sail(rules, desk, plans[i, move], i, first, record)
    R.check_bounds(rules, games, 0, 1)
    R.check_grabs(rules, games, 0, 1)
    R.check_tags(rules, games, 0, 1)
    R.check_captures(rules, games, 0, 1)
    R.check_untags(rules, games, 0, 1)


@lean_kernel
def _compare(rules: Rules, desk: Desk, i: int, number: int) -> None:
    """Find out whether a boat still stands as recorded as a decision begins; if not, make all of its state so."""
    games = desk.bench
    as_tagged = games.is_tagged[0, i] == desk.is_tagged[number, i]
    if as_tagged and games.flag_taken[0, rules.team[i]] == desk.flag_taken[number, rules.team[i]]:
        return
    desk.as_recorded[i] = False
    step = number * rules.decision_steps - 1
    if step >= 0:
        copy_row(games.state[0, i], desk.state[step, i])
        games.error_is_float32[0, i] = desk.error_is_float32[step, i]


@lean_kernel
def _put(rules: Rules, desk: Desk, i: int, step: int) -> None:
    """Put a boat where it was after a recorded step, and the flag that it carries; nothing else of it is looked at."""
    games, x, y = desk.bench, desk.state[step, i, L.X], desk.state[step, i, L.Y]
    games.state[0, i, L.X], games.state[0, i, L.Y] = x, y
    games.on_side[0, i] = desk.on_side[step, i]
    if games.has_flag[0, i]:
        games.flag_position[0, 1 - rules.team[i], 0] = x
        games.flag_position[0, 1 - rules.team[i], 1] = y


@lean_kernel
def _sail(rules: Rules, desk: Desk, action: int, i: int, first: int, record: bool) -> None:
    """Move a boat of the bench through the steps of a decision under a macro-action."""
    games = desk.bench
    heading = games.state[0, i, L.HEADING]
    desk.wanted[0, i, 0] = 0.0 if action == STOP else rules.max_speed[i]
    desk.wanted[0, i, 1] = wrap_bearing((45.0 * action if action != STOP else heading) - heading)
    for step in range(first, first + rules.decision_steps):
        decide_boat(rules, games, desk.wanted, desk.commands, 0, i)
        move_boat(rules, games, desk.commands, 0, i)
        if record:
            copy_row(desk.state[step, i], games.state[0, i])
            desk.error_is_float32[step, i] = games.error_is_float32[0, i]
            desk.on_side[step, i] = games.on_side[0, i]


@lean_kernel
def _count_events(events: IntArray, early: float, counted: Array) -> None:
    """Count a decision's events (2, 4), a later one less than an early one."""
    counted[CAPTURES] += early * (events[0, CAPTURE] - events[1, CAPTURE])
    counted[GRABS] += early * (events[0, GRAB] - events[1, GRAB])
    counted[TAGS] += early * (events[0, TAG] - events[1, TAG])
    counted[OUT_BLUE] += events[0, OUT]
    counted[OUT_RED] += events[1, OUT]


@lean_kernel
def _count_pairs(rules: Rules, state: Array, touching: BoolArray, counted: Array) -> None:
    """Count contacts that are new and teammates that are near; ``touching`` (n, n) is brought up to date."""
    for i in range(rules.n_boats):
        for j in range(i + 1, rules.n_boats):
            mates = rules.team[i] == rules.team[j]
            contact_m = rules.agent_radius[i] + rules.agent_radius[j]
            dx, dy = state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y]
            looked_for_m = (max(contact_m, NEAR_MATES_M) if mates else contact_m) + SLACK_M
            squared = dx * dx + dy * dy
            if squared > looked_for_m * looked_for_m:
                touching[i, j] = False
                continue
            gap = math.sqrt(squared)
            fresh = gap <= contact_m and not touching[i, j]
            touching[i, j] = gap <= contact_m
            if not mates:
                counted[FOE_HITS] += fresh
                continue
            counted[MATE_HITS_BLUE + rules.team[i]] += fresh
            if gap < NEAR_MATES_M:
                counted[NEAR_BLUE + rules.team[i]] += (NEAR_MATES_M - gap) / NEAR_MATES_M
