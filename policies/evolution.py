"""Compiled rolling-horizon evolution of one boat's plan, by rollouts in the simulator; and playing plans in live games.

Plans are rolled out one after another. The rollout of a mutant starts at its first difference from its parent. The
other boats repeat their recorded motion as long as their state is as recorded (tagged or not, their flag taken or not):
their motion depends on nothing else. Little is therefore rolled out twice, and every result is bit for bit that of a
rollout of all boats from the start.
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
from steerclear.shield.jit import Array, BoolArray, IntArray, copy_row, kernel, lean_kernel
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import wrap_degrees
from steerclear.shield.shared import share

HEADINGS = 8
STOP = HEADINGS
N_MOVES = HEADINGS + 1
"""Macro-actions: full speed along one of eight absolute headings (45 deg apart, from north), and a stop."""
MUTATED = 3.0
"""Mean number of macro-actions that a mutation changes besides the first."""

# columns of a rollout's counts; blue's minus red's where both teams can have an event
CAPTURES, GRABS, TAGS, MATE_HITS_BLUE, MATE_HITS_RED, FOE_HITS, NEAR_BLUE, NEAR_RED = 0, 1, 2, 3, 4, 5, 6, 7
OUT_BLUE, OUT_RED = 8, 9
N_COUNTED = 10
PRICES = (10.0, 3.0, 2.0, 6.0, 0.05, 3.0, 4.0, 2.0)
"""Fitness weights of a plan: capture, grab and tag, minus hit of a teammate, near teammate, hit of an opponent and boat
out of bounds, plus a field width of progress. The paper's team played for captures, progress and contacts of
teammates.
"""
NEAR_MATES_M = 6.0
"""Teammates nearer than this are counted as near, in each decision."""
KEEP_OFF_M = 5.0
"""In live games a boat nearer than this to another one ahead of its beam turns away from it."""


class Scratch(NamedTuple):
    """Work space of a search: a game to play plans in, and the recorded rollout of the best plan.

    A plan has H macro-actions, each held for ``repeats`` decisions. A rollout has D decisions and S steps of motion.
    """

    repeats: int
    generations: int
    bench: Games  # one game
    marks: Games  # H games: that of the best plan at the start of each macro-action
    marked: Array  # (H, N_COUNTED) counts at that time
    state: Array  # (S, n, N_STATE) after each step of motion
    error_is_float32: BoolArray  # (S, n)
    on_side: BoolArray  # (S, n)
    is_tagged: BoolArray  # (D, n) at the start of each decision
    flag_taken: BoolArray  # (D, 2)
    as_recorded: BoolArray  # (n,) boats whose state is as recorded
    counted: Array  # (N_COUNTED,) counts of the present rollout
    wanted: Array  # (1, n, 2) scratch
    commands: Array  # (1, n, 2) scratch
    brood: IntArray  # (P, H) plans of a generation


def make_scratch(config: GameConfig, population: int, generations: int, horizon: int, move_s: float) -> Scratch:
    """Return the work space for games by these rules.

    Args:
        config: of the forward model's games.
        population: plans of a generation.
        generations: times that the best plan is mutated.
        horizon: macro-actions of a plan.
        move_s: time that a macro-action is held, s.
    """
    n, repeats = config.n_boats, max(round(move_s / config.decision_s), 1)
    decisions = horizon * repeats
    steps = decisions * config.decision_steps
    scratch = Scratch(
        repeats=repeats,
        generations=generations,
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
    return share(scratch)


@kernel
def evolve(
    rules: Rules,
    games: Games,
    b: int,
    plans: IntArray,
    boat: int,
    hints: IntArray,
    home: Array,
    rng: np.random.Generator,
    scratch: Scratch,
) -> float:
    """Improve one boat's plan while the others keep theirs; return the fitness of the best plan found.

    Args:
        rules: of the forward model.
        games: the live games.
        b: the game to search in.
        plans: (n, H) macro-actions of all boats, 0..8; the boat's row is replaced by the best found.
        boat: the boat whose plan is improved.
        hints: (k,) macro-actions to try for the whole plan, such as straight to the flag.
        home: (2,) where the boat takes the flag, m.
        rng: random numbers of mutations.
        scratch: work space.
    """
    copy_game(scratch.marks, 0, games, b)
    for k in range(N_COUNTED):
        scratch.marked[0, k] = 0.0
    own, brood = plans[boat], scratch.brood
    population, horizon = brood.shape
    roll_out(rules, scratch, plans, boat, 0, True)
    score = score_of(rules, scratch, boat, home)
    for generation in range(scratch.generations):
        _mutate(rng, own, brood)
        if generation == 0:
            for k in range(min(hints.size, population - 1)):
                brood[1 + k, :] = hints[k]
        best, first = 0, horizon
        for k in range(1, population):
            begin = _first_difference(brood[k], own)
            if begin == horizon:
                continue
            _copy_plan(own, brood[k])
            roll_out(rules, scratch, plans, boat, begin, False)
            _copy_plan(own, brood[0])
            found = score_of(rules, scratch, boat, home)
            if found > score:
                score, best, first = found, k, begin
        if best > 0:
            _copy_plan(own, brood[best])
            if generation + 1 < scratch.generations:
                roll_out(rules, scratch, plans, boat, first, True)
    return score


@kernel
def _mutate(rng: np.random.Generator, parent: IntArray, brood: IntArray) -> None:
    """Fill a brood (P, H) with the parent and its mutants, in which one macro-action replaces a stretch of the plan."""
    horizon = parent.size
    for k in range(brood.shape[0]):
        _copy_plan(brood[k], parent)
        if k > 0:
            begin = int(rng.integers(0, horizon))
            end = begin + 1 + int(rng.poisson(MUTATED))
            move = int(rng.integers(0, N_MOVES))
            for m in range(begin, min(end, horizon)):
                brood[k, m] = move


@lean_kernel
def _copy_plan(to: IntArray, source: IntArray) -> None:
    """Copy a plan's macro-actions."""
    for m in range(source.shape[0]):
        to[m] = source[m]


@lean_kernel
def _first_difference(plan: IntArray, other: IntArray) -> int:
    """Return the first macro-action in which plans differ; their length if none does."""
    m = 0
    while m < plan.shape[0] and plan[m] == other[m]:
        m += 1
    return m


@lean_kernel
def score_of(rules: Rules, scratch: Scratch, boat: int, home: Array) -> float:
    """Return the fitness of the plans just rolled out for a boat's team, see `PRICES`.

    Progress is the boat's nearness to its goal, 1 at it. Its goal is the flag or, if it carries it or is tagged, its
    home.
    """
    c, team, games = scratch.counted, rules.team[boat], scratch.bench
    capture, grab, tag, mate_hit, near_mate, foe_hit, out, progress = PRICES
    sign = 1.0 if team == 0 else -1.0
    events = sign * (capture * c[CAPTURES] + grab * c[GRABS] + tag * c[TAGS])
    costs = mate_hit * c[MATE_HITS_BLUE + team] + near_mate * c[NEAR_BLUE + team]
    costs = costs + foe_hit * c[FOE_HITS] + out * c[OUT_BLUE + team]
    aim = home if games.has_flag[0, boat] or games.is_tagged[0, boat] else games.flag_position[0, 1 - team]
    dx, dy = games.state[0, boat, L.X] - aim[0], games.state[0, boat, L.Y] - aim[1]
    return events - costs + progress * (1.0 - math.sqrt(dx * dx + dy * dy) / rules.size[0])


@lean_kernel
def copy_game(to: Games, t: int, source: Games, b: int) -> None:
    """Copy all of game ``b`` of one batch that decides its course into game ``t`` of another."""
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
def roll_out(rules: Rules, scratch: Scratch, plans: IntArray, boat: int, begin: int, record: bool) -> None:
    """Play plans (n, H) in the work space's game from the start of macro-action ``begin`` to their end; count events.

    With ``record`` all boats are simulated and recorded. Otherwise boats other than ``boat`` repeat their recorded
    motion as long as possible. Later events count less than early ones.
    """
    games, horizon, c = scratch.bench, plans.shape[1], scratch.counted
    copy_game(games, 0, scratch.marks, begin)
    copy_row(c, scratch.marked[begin])
    for i in range(rules.n_boats):
        scratch.as_recorded[i] = not record and i != boat and rules.obstacles.bounds.shape[0] == 0
    for move in range(begin, horizon):
        if record and move > begin:
            copy_game(scratch.marks, move, games, 0)
            copy_row(scratch.marked[move], c)
        early = 1.0 - 0.5 * move / horizon
        for repeat in range(scratch.repeats):
            _play_decision(rules, scratch, plans, move, move * scratch.repeats + repeat, record)
            events = games.events[0]
            c[CAPTURES] += early * (events[0, CAPTURE] - events[1, CAPTURE])
            c[GRABS] += early * (events[0, GRAB] - events[1, GRAB])
            c[TAGS] += early * (events[0, TAG] - events[1, TAG])
            c[OUT_BLUE] += events[0, OUT]
            c[OUT_RED] += events[1, OUT]
            _count_pairs(rules, games.state[0], games.touching[0], c)


@lean_kernel
def _play_decision(rules: Rules, scratch: Scratch, plans: IntArray, move: int, number: int, record: bool) -> None:
    """Play decision ``number`` of a rollout; contacts are left to `_count_pairs`."""
    games, first = scratch.bench, number * rules.decision_steps
    if record:
        for team in range(2):
            scratch.flag_taken[number, team] = games.flag_taken[0, team]
    begin_decision(rules, games)
    for i in range(rules.n_boats):
        if record:
            scratch.is_tagged[number, i] = games.is_tagged[0, i]
        elif scratch.as_recorded[i]:
            _compare(rules, scratch, i, number)
        if scratch.as_recorded[i]:
            _put(rules, scratch, i, first + rules.decision_steps - 1)
        else:
            _sail(rules, scratch, plans[i, move], i, first, record)
    R.check_bounds(rules, games, 0, 1)
    R.check_grabs(rules, games, 0, 1)
    R.check_tags(rules, games, 0, 1)
    R.check_captures(rules, games, 0, 1)
    R.check_untags(rules, games, 0, 1)


@lean_kernel
def _compare(rules: Rules, scratch: Scratch, i: int, number: int) -> None:
    """Check whether a boat's state is as recorded at the start of a decision; if not, restore its full state."""
    games = scratch.bench
    as_tagged = games.is_tagged[0, i] == scratch.is_tagged[number, i]
    if as_tagged and games.flag_taken[0, rules.team[i]] == scratch.flag_taken[number, rules.team[i]]:
        return
    scratch.as_recorded[i] = False
    step = number * rules.decision_steps - 1
    if step >= 0:
        copy_row(games.state[0, i], scratch.state[step, i])
        games.error_is_float32[0, i] = scratch.error_is_float32[step, i]


@lean_kernel
def _put(rules: Rules, scratch: Scratch, i: int, step: int) -> None:
    """Put a boat where it was after a recorded step, with the flag that it carries; nothing else of it is read."""
    games, x, y = scratch.bench, scratch.state[step, i, L.X], scratch.state[step, i, L.Y]
    games.state[0, i, L.X], games.state[0, i, L.Y] = x, y
    games.on_side[0, i] = scratch.on_side[step, i]
    if games.has_flag[0, i]:
        games.flag_position[0, 1 - rules.team[i], 0] = x
        games.flag_position[0, 1 - rules.team[i], 1] = y


@lean_kernel
def _sail(rules: Rules, scratch: Scratch, action: int, i: int, first: int, record: bool) -> None:
    """Simulate a boat through the steps of a decision under a macro-action."""
    games = scratch.bench
    heading = games.state[0, i, L.HEADING]
    scratch.wanted[0, i, 0] = 0.0 if action == STOP else rules.max_speed[i]
    scratch.wanted[0, i, 1] = wrap_bearing((45.0 * action if action != STOP else heading) - heading)
    for step in range(first, first + rules.decision_steps):
        decide_boat(rules, games, scratch.wanted, scratch.commands, 0, i)
        move_boat(rules, games, scratch.commands, 0, i)
        if record:
            copy_row(scratch.state[step, i], games.state[0, i])
            scratch.error_is_float32[step, i] = games.error_is_float32[0, i]
            scratch.on_side[step, i] = games.on_side[0, i]


@lean_kernel
def _count_pairs(rules: Rules, state: Array, touching: BoolArray, counted: Array) -> None:
    """Count new contacts and near teammates; update ``touching`` (n, n)."""
    for i in range(rules.n_boats):
        for j in range(i + 1, rules.n_boats):
            dx, dy = state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y]
            gap = math.sqrt(dx * dx + dy * dy)
            contact = gap <= rules.agent_radius[i] + rules.agent_radius[j]
            fresh, touching[i, j] = contact and not touching[i, j], contact
            if rules.team[i] != rules.team[j]:
                counted[FOE_HITS] += fresh
                continue
            counted[MATE_HITS_BLUE + rules.team[i]] += fresh
            if gap < NEAR_MATES_M:
                counted[NEAR_BLUE + rules.team[i]] += (NEAR_MATES_M - gap) / NEAR_MATES_M


@lean_kernel
def follow_plans(rules: Rules, games: Games, plans: IntArray, own: IntArray, out: Array) -> None:
    """Write commands of a team's boats for this step of live games; a boat too near to another turns away from it.

    Args:
        rules: of the games.
        games: B games.
        plans: (B, n, H) macro-actions of all boats; the first one is played.
        own: (k,) numbers of the team's boats.
        out: (B, k, 2), written: speed m/s, relative heading deg.
    """
    for b in range(plans.shape[0]):
        state = games.state[b]
        for k in range(own.size):
            i = own[k]
            near = _too_near(state, i)
            action = plans[b, i, 0]
            heading = 45.0 * action
            if near >= 0:
                away_x, away_y = state[i, L.X] - state[near, L.X], state[i, L.Y] - state[near, L.Y]
                heading = math.degrees(math.atan2(away_x, away_y))
            stops = near < 0 and action == STOP
            out[b, k, 0] = 0.0 if stops else rules.max_speed[i]
            out[b, k, 1] = 0.0 if stops else wrap_degrees(heading - state[i, L.HEADING])


@lean_kernel
def _too_near(state: Array, i: int) -> int:
    """Return the boat nearest to boat ``i`` if it is within `KEEP_OFF_M` and ahead of the beam; otherwise -1."""
    near, least = -1, math.inf
    for j in range(state.shape[0]):
        gap = math.hypot(state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y])
        if j != i and gap < least:
            near, least = j, gap
    if near < 0 or least > KEEP_OFF_M:
        return -1
    bearing = math.degrees(math.atan2(state[near, L.X] - state[i, L.X], state[near, L.Y] - state[i, L.Y]))
    return near if abs(wrap_degrees(bearing - state[i, L.HEADING])) < 90.0 else -1
