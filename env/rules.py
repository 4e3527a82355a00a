"""The rules applied after the boats have moved, in the order of the reference simulator.

Every kernel processes the games first..last-1.
"""

from __future__ import annotations

import math

from steerclear.shield.jit import Array, BoolArray, IntArray, lean_kernel
from steerclear.shield.platforms import layout as L

from .arrays import CAPTURE, GRAB, OUT, TAG, Games, Rules
from .motion import drop_flag, is_within
from .randomness import next_uniform


@lean_kernel
def recharge(rules: Rules, games: Games, first: int, last: int) -> None:
    """Advance the time since each boat's last tag, up to the cool-down."""
    for b in range(first, last):
        for i in range(rules.n_boats):
            elapsed = games.tagging_cooldown_s[b, i]
            if elapsed != rules.cooldown:
                games.tagging_cooldown_s[b, i] = min(elapsed + rules.decision_s, rules.cooldown)


@lean_kernel
def check_bounds(rules: Rules, games: Games, first: int, last: int) -> None:
    """Mark boats on or beyond an edge. They lose the flag and, if the rules say so, are tagged."""
    for b in range(first, last):
        for i in range(rules.n_boats):
            x, y = games.state[b, i, L.X], games.state[b, i, L.Y]
            inside = 0.0 < x < rules.size[0] and 0.0 < y < rules.size[1]
            if not inside:
                if not games.oob[b, i]:
                    games.events[b, rules.team[i], OUT] += 1
                if rules.tag_on_oob:
                    games.is_tagged[b, i] = True
                drop_flag(rules, games, b, i)
            games.oob[b, i] = not inside


@lean_kernel
def check_grabs(rules: Rules, games: Games, first: int, last: int) -> None:
    """Let untagged boats on the far side take a flag that is home and within reach, first boat first."""
    for b in range(first, last):
        for i in range(rules.n_boats):
            team = rules.team[i]
            flag = 1 - team
            if games.has_flag[b, i] or games.flag_taken[b, flag] or games.on_side[b, i] or games.is_tagged[b, i]:
                continue
            if is_within(games.state[b, i], games.flag_position[b, flag], rules.catch_radius):
                games.has_flag[b, i] = True
                games.flag_taken[b, flag] = True
                games.flag_position[b, flag, 0] = games.state[b, i, L.X]
                games.flag_position[b, flag, 1] = games.state[b, i, L.Y]
                games.grabs[b, team] += 1
                games.events[b, team, GRAB] += 1


@lean_kernel
def _first_in_reach(state: Array, on_side: BoolArray, is_tagged: BoolArray, i: int, first: int, reach_m: float) -> int:
    """Return the first untagged opponent of boat ``i``, from ``first`` on, on the wrong side within reach, or -1."""
    for j in range(first, first + state.shape[0] // 2):
        if not on_side[j] and not is_tagged[j] and is_within(state[j], state[i], reach_m):
            return j
    return -1


@lean_kernel
def check_tags(rules: Rules, games: Games, first: int, last: int) -> None:
    """Let boats tag one opponent each, in boat order.

    A boat can tag if it is on its side, in bounds, untagged, not disabled and recharged. An attempt that fails by
    chance costs the cool-down as well.
    """
    for b in range(first, last):
        for i in range(rules.n_boats):
            games.made_tag[b, i] = -1
            ready = games.tagging_cooldown_s[b, i] == rules.cooldown
            if not ready or not games.on_side[b, i] or games.oob[b, i] or games.is_tagged[b, i]:
                continue
            if games.is_disabled[b, i]:
                continue
            team = rules.team[i]
            foe = (1 - team) * rules.team_size
            j = _first_in_reach(games.state[b], games.on_side[b], games.is_tagged[b], i, foe, rules.catch_radius)
            if j < 0:
                continue
            games.tagging_cooldown_s[b, i] = 0.0
            if rules.tag_probability < 1.0 and next_uniform(games.rng, b) > rules.tag_probability:
                continue
            games.is_tagged[b, j] = True
            games.made_tag[b, i] = j
            games.tags[b, team] += 1
            games.events[b, team, TAG] += 1
            drop_flag(rules, games, b, j)


@lean_kernel
def is_at_corner(rules: Rules, games: Games, b: int, i: int) -> bool:
    """Return whether boat ``i`` is within the corner radius of a corner of its own side."""
    corners = rules.corners[rules.team[i]]
    near = is_within(games.state[b, i], corners[0], rules.corner_radius)
    return near or is_within(games.state[b, i], corners[1], rules.corner_radius)


@lean_kernel
def check_captures(rules: Rules, games: Games, first: int, last: int) -> None:
    """Score for carriers that reached their own side (or, by option, own base or corners); the flag goes home."""
    for b in range(first, last):
        for i in range(rules.n_boats):
            if not games.has_flag[b, i]:
                continue
            team = rules.team[i]
            arrived = games.on_side[b, i]
            if rules.capture_at_base:
                arrived = is_within(games.state[b, i], rules.flag_home[team], rules.catch_radius)
            elif rules.capture_at_corner:
                arrived = is_at_corner(rules, games, b, i)
            if arrived:
                drop_flag(rules, games, b, i)
                games.captures[b, team] += 1
                games.events[b, team, CAPTURE] += 1


@lean_kernel
def check_untags(rules: Rules, games: Games, first: int, last: int) -> None:
    """Free tagged boats within reach of their own flag's home, or in bounds at their corners."""
    for b in range(first, last):
        for i in range(rules.n_boats):
            if games.is_tagged[b, i] and rules.untag_at_corner:
                games.is_tagged[b, i] = games.oob[b, i] or not is_at_corner(rules, games, b, i)
            elif games.is_tagged[b, i]:
                home = rules.flag_home[rules.team[i]]
                games.is_tagged[b, i] = not is_within(games.state[b, i], home, rules.catch_radius)


@lean_kernel
def check_end(rules: Rules, games: Games, first: int, last: int) -> None:
    """End a game when a team has the top score or time is up (to the reference's tolerance)."""
    slack = 1e-8 + 1e-5 * rules.max_time_s
    for b in range(first, last):
        games.terminated[b] = max(games.captures[b, 0], games.captures[b, 1]) >= rules.max_score
        games.truncated[b] = not games.terminated[b] and games.time_s[b] >= rules.max_time_s - slack


@lean_kernel
def _new_in_game(state: Array, radius: Array, touching: BoolArray, new: IntArray) -> None:
    """Count each boat's entries in one game into ``new`` (n,) and update ``touching`` (n, n)."""
    n_boats = state.shape[0]
    for i in range(n_boats):
        new[i] = 0
    for i in range(n_boats):
        x, y = state[i, L.X], state[i, L.Y]
        for j in range(i + 1, n_boats):
            dx, dy = state[j, L.X] - x, state[j, L.Y] - y
            near = math.sqrt(dx * dx + dy * dy) <= radius[i] + radius[j]
            if near and not touching[i, j]:
                new[i] += 1
                new[j] += 1
            touching[i, j] = near
            touching[j, i] = near


@lean_kernel
def check_collisions(rules: Rules, games: Games, first: int, last: int) -> None:
    """Count the pairs of the games first..last-1 that have come in touch since the last check."""
    for b in range(first, last):
        _new_in_game(games.state[b], rules.agent_radius, games.touching[b], games.new_collisions[b])
        for i in range(rules.n_boats):
            games.collisions[b, i] += games.new_collisions[b, i]
            if rules.decision_steps == 1:  # every step has been checked
                games.contacts[b, i] += games.new_collisions[b, i]


@lean_kernel
def look_for_contacts(rules: Rules, games: Games, first: int, last: int) -> None:
    """Count the pairs that come in touch in one of several steps of a decision."""
    if rules.decision_steps == 1:
        return
    for b in range(first, last):
        _new_in_game(games.state[b], rules.agent_radius, games.contact[b], games.new_collisions[b])
        for i in range(rules.n_boats):
            games.contacts[b, i] += games.new_collisions[b, i]


@lean_kernel
def reward_games(rules: Rules, games: Games, out: Array) -> None:
    """Write rewards of the last decision into ``out`` (B, n).

    A reward is the weighted own events minus the opponents', minus the boat's own collisions.
    """
    for b in range(out.shape[0]):
        blue = 0.0
        for kind in range(4):
            blue += rules.reward[kind] * (games.events[b, 0, kind] - games.events[b, 1, kind])
        for i in range(rules.n_boats):
            team_reward = blue if rules.team[i] == 0 else -blue
            out[b, i] = team_reward + rules.reward[4] * games.new_collisions[b, i]
