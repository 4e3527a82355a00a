"""The rules of one game after the boats have moved, in the order of the reference simulator."""

from __future__ import annotations

import math

from steerclear.shield.jit import kernel
from steerclear.shield.platforms import layout as L

from .arrays import CAPTURE, GRAB, OUT, TAG, Games, Rules
from .motion import drop_flag


@kernel
def distance_to(games: Games, b: int, i: int, x: float, y: float) -> float:
    """Distance of boat ``i`` to a point, m."""
    return math.hypot(games.state[b, i, L.X] - x, games.state[b, i, L.Y] - y)


@kernel
def recharge(rules: Rules, games: Games, b: int) -> None:
    """Advance the time since each boat's last tag, up to the cool-down."""
    for i in range(rules.n_boats):
        elapsed = games.tagging_cooldown_s[b, i]
        if elapsed != rules.cooldown:
            games.tagging_cooldown_s[b, i] = min(elapsed + rules.dt_s, rules.cooldown)


@kernel
def check_bounds(rules: Rules, games: Games, b: int) -> None:
    """Mark boats on or beyond an edge; they are tagged (if the rules say so) and lose the flag."""
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


@kernel
def check_grabs(rules: Rules, games: Games, b: int) -> None:
    """Untagged boats on the far side within reach of a flag that is home take it, first boat first."""
    for i in range(rules.n_boats):
        team = rules.team[i]
        flag = 1 - team
        if games.has_flag[b, i] or games.flag_taken[b, flag] or games.on_side[b, i] or games.is_tagged[b, i]:
            continue
        place = games.flag_position[b, flag]
        if distance_to(games, b, i, place[0], place[1]) < rules.catch_radius:
            games.has_flag[b, i] = True
            games.flag_taken[b, flag] = True
            place[0], place[1] = games.state[b, i, L.X], games.state[b, i, L.Y]
            games.grabs[b, team] += 1
            games.events[b, team, GRAB] += 1


@kernel
def _tag_first_in_reach(rules: Rules, games: Games, b: int, i: int) -> None:
    """Boat ``i``, able to tag, tags the first untagged opponent on the wrong side within reach."""
    team = rules.team[i]
    x, y = games.state[b, i, L.X], games.state[b, i, L.Y]
    first = (1 - team) * rules.team_size
    for j in range(first, first + rules.team_size):
        if games.on_side[b, j] or games.is_tagged[b, j]:
            continue
        if distance_to(games, b, j, x, y) < rules.catch_radius:
            games.is_tagged[b, j] = True
            games.made_tag[b, i] = j
            games.tags[b, team] += 1
            games.events[b, team, TAG] += 1
            drop_flag(rules, games, b, j)
            games.tagging_cooldown_s[b, i] = 0.0
            return


@kernel
def check_tags(rules: Rules, games: Games, b: int) -> None:
    """Boats on their side, in bounds, untagged and recharged tag one opponent each, in boat order."""
    for i in range(rules.n_boats):
        games.made_tag[b, i] = -1
    for i in range(rules.n_boats):
        ready = games.tagging_cooldown_s[b, i] == rules.cooldown
        if ready and games.on_side[b, i] and not games.oob[b, i] and not games.is_tagged[b, i]:
            _tag_first_in_reach(rules, games, b, i)


@kernel
def check_captures(rules: Rules, games: Games, b: int) -> None:
    """Carriers that reached their own side (or, by option, their own base) score; the flag goes home."""
    for i in range(rules.n_boats):
        if not games.has_flag[b, i]:
            continue
        team = rules.team[i]
        if rules.capture_at_base:
            home = rules.flag_home[team]
            arrived = distance_to(games, b, i, home[0], home[1]) < rules.catch_radius
        else:
            arrived = games.on_side[b, i]
        if arrived:
            drop_flag(rules, games, b, i)
            games.captures[b, team] += 1
            games.events[b, team, CAPTURE] += 1


@kernel
def check_untags(rules: Rules, games: Games, b: int) -> None:
    """Tagged boats within reach of their own flag's home are free again."""
    for i in range(rules.n_boats):
        if games.is_tagged[b, i]:
            home = rules.flag_home[rules.team[i]]
            if distance_to(games, b, i, home[0], home[1]) < rules.catch_radius:
                games.is_tagged[b, i] = False


@kernel
def check_end(rules: Rules, games: Games, b: int) -> None:
    """End the game when a team has the top score, or when time is up (to the reference's tolerance)."""
    if games.captures[b, 0] == rules.max_score or games.captures[b, 1] == rules.max_score:
        games.terminated[b] = True
        return
    slack = 1e-8 + 1e-5 * rules.max_time_s
    if games.time_s[b] >= rules.max_time_s - slack:
        games.truncated[b] = True
