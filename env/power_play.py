"""Power plays: once in a game each team has a random boat disabled for a share of it.

A power play lasts a whole number of decisions, and the two teams' power plays never overlap. As in the reference, a
decision's number is the integer part of the game's accumulated time over the time of a decision. Rounding may repeat or
skip a number. A power play that begins at a repeated number begins twice, with another boat; one whose end is skipped
never ends.
"""

from __future__ import annotations

from steerclear.shield.jit import lean_kernel

from .arrays import Games, Rules
from .randomness import next_uniform

TRIES = 10
"""How often to draw a first slot until the second fits beside it."""


@lean_kernel
def _draw_below(games: Games, b: int, count: int) -> int:
    """Draw a random whole number from 0 to ``count - 1``."""
    return min(int(next_uniform(games.rng, b) * count), count - 1)


@lean_kernel
def _draw_slots(rules: Rules, games: Games, b: int) -> tuple[int, int]:
    """Draw two slots of ``power_length`` decisions: the first anywhere, the second in the rest.

    If no draw leaves room for the second, they are the first and the last decisions.
    """
    last, length = rules.max_cycles - rules.power_length, rules.power_length
    for _ in range(TRIES):
        first = _draw_below(games, b, last + 1)
        before, after = max(0, first - length), max(0, last - first - length)
        if before + after > 0:
            drawn = _draw_below(games, b, before + after)
            return first, drawn if drawn < before else first + length + drawn - before
    return 0, last


@lean_kernel
def plan_power_plays(rules: Rules, games: Games, b: int) -> None:
    """Draw when each team's power play of game ``b`` begins and which boats it disables, if there are power plays."""
    for team in range(2):
        games.power_start[b, team] = -1
        games.power_begun[b, team] = 0
    if rules.power_length == 0:
        return
    one, two = _draw_slots(rules, games, b)
    swap = next_uniform(games.rng, b) < 0.5
    games.power_start[b, 0] = two if swap else one
    games.power_start[b, 1] = one if swap else two
    for team in range(2):
        for k in range(2):
            games.power_boats[b, team, k] = team * rules.team_size + _draw_below(games, b, rules.team_size)


@lean_kernel
def toggle_power_plays(rules: Rules, games: Games) -> None:
    """Begin and end power plays. Call this before anything else in a decision."""
    if rules.power_length == 0:
        return
    for b in range(games.state.shape[0]):
        cycle = int(games.time_s[b] / rules.decision_s)
        for team in range(2):
            start = games.power_start[b, team]
            if start < 0:
                continue
            if cycle == start:
                games.is_disabled[b, games.power_boats[b, team, min(games.power_begun[b, team], 1)]] = True
                games.power_begun[b, team] += 1
            if cycle == start + rules.power_length:
                for i in range(team * rules.team_size, (team + 1) * rules.team_size):
                    games.is_disabled[b, i] = False
