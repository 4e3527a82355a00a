"""Putting together what results.json of a tournament holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..play.spec import SIDES
from ..provenance import machine, versions
from ..result_files import told_settings
from .agreement import agreement
from .price import prices
from .settings import ALL, FINAL, OFF, QUALIFYING, TournamentSettings, label
from .standings import Totals, standings
from .winning import STRENGTHS, alpha_rank, cycles, win_matrix

Row = Mapping[str, Any]
SPEARMAN = 0.9
NEVER_GRAB = ("ohto", "alamer")


def results_of(
    settings: TournamentSettings,
    rows: Sequence[Row],
    expected: int,
    failed: Sequence[Mapping[str, Any]],
    wall_s: float,
    resumed: int = 0,
) -> dict[str, Any]:
    """The content of results.json; `keys.TOURNAMENT` describes it.

    Args:
        settings: of the tournament.
        rows: its games; fewer than expected when it was interrupted.
        expected: games there were to play.
        failed: games that could not be played.
        wall_s: how long it took, s.
        resumed: games an earlier run had played.
    """
    teams = [label(team) for team in settings.teams]
    final = [row for row in rows if row["phase"] == FINAL]
    return {
        "command": "tournament",
        "complete": len(rows) == expected,
        "settings": told_settings(settings.as_dict()),
        "versions": versions(),
        "machine": machine(),
        "wall_s": wall_s,
        "games_played": len(rows),
        "games_resumed": resumed,
        "failed": list(failed),
        "warnings": warnings_of(rows),
        "qualifying": _qualifying(rows, settings),
        "states": [state_results(final, state, teams, settings) for state in settings.states],
        "prices": _prices(final, teams, settings),
        "goals": bars_of(final, teams, settings),
        "deprecated": {"bars": bars_of(final, teams, settings)},
    }


def state_results(
    rows: Sequence[Row], state: str, teams: Sequence[str], settings: TournamentSettings
) -> dict[str, Any]:
    """Tables of one state."""
    mine = [row for row in rows if row["state"] == state]
    playing = [team for team in teams if any(team in (row["blue"], row["red"]) for row in mine)]
    totals = Totals.of(mine, playing)
    wins = win_matrix(totals, settings.penalty)
    shares = {f"{strength:g}": alpha_rank(wins, strength).tolist() for strength in STRENGTHS} if playing else {}
    return {
        "state": state,
        "games": len(mine),
        "repetitions": totals.repetitions,
        "standings": standings(totals, settings.penalty, settings.seed) if playing else [],
        "teams": playing,
        "wins": wins.tolist(),
        "alpha_rank": shares,
        "cycles": cycles(wins, playing),
        "table_3": agreement(totals, settings.penalty, False, settings.seed),
        "table_4": agreement(totals, 0.0, True, settings.seed),
    }


def warnings_of(rows: Sequence[Row]) -> list[str]:
    """A sentence per team whose code failed, forfeited moves or missed a deadline."""
    found = []
    for team in dict.fromkeys(row[side] for row in rows for side in SIDES):
        seats = [(row, side) for row in rows for side in SIDES if row[side] == team]
        failures = sum(int(row[f"{side}_failures"]) for row, side in seats)
        if failures:
            games = sum(row[f"{side}_failures"] > 0 for row, side in seats)
            text = next(t for row, side in seats if (t := row[f"{side}_first_failure"]))
            found.append(
                f"{team} failed {failures:,} times, in {games} of {len(seats)} games; its boats held for those moves. "
                f"First: {text}"
            )
        missed = sum(int(row[f"{side}_missed_deadlines"]) for row, side in seats)
        if missed:
            found.append(f"{team} missed {missed:,} deadlines; its games may come out otherwise on another machine.")
    return found


def silent_teams(rows: Sequence[Row]) -> list[str]:
    """Teams that gave nothing usable throughout some game."""
    quiet = {row[side] for row in rows for side in SIDES if row["steps"] and row[f"{side}_usable_steps"] == 0}
    return sorted(quiet)


def _qualifying(rows: Sequence[Row], settings: TournamentSettings) -> list[dict[str, Any]]:
    """Mean primary score per game of each team in each state, best first; each is scored by its own games alone."""
    table = []
    for state in settings.states:
        for team in (label(name) for name in settings.teams):
            seats = [
                (row, side)
                for row in rows
                for side in SIDES
                if row["phase"] == QUALIFYING and row["state"] == state
                if row["examined"] == side and row[side] == team
            ]
            if seats:
                scores = [_primary(row, side, settings.penalty) for row, side in seats]
                line = {"team": team, "state": state, "games": len(seats), "score": sum(scores) / len(scores)}
                table.append(line | {"captures": sum(int(row[f"{side}_captures"]) for row, side in seats)})
    return sorted(table, key=lambda line: (settings.states.index(line["state"]), -line["score"]))


def finalists(rows: Sequence[Row], settings: TournamentSettings) -> tuple[str, ...]:
    """The teams that go on, as given on the command line: the best of the qualifying in the first state."""
    if settings.finalists is None:
        return settings.teams
    order = [line["team"] for line in _qualifying(rows, settings) if line["state"] == settings.states[0]]
    best = set(order[: settings.finalists])
    return tuple(team for team in settings.teams if label(team) in best)


def _primary(row: Row, side: str, penalty: float) -> float:
    other = SIDES[1 - SIDES.index(side)]
    return float(row[f"{side}_captures"] - row[f"{other}_captures"] - penalty * row[f"{side}_collisions"])


def _prices(rows: Sequence[Row], teams: Sequence[str], settings: TournamentSettings) -> list[dict[str, Any]]:
    compared = compared_states(settings)
    playing = [team for team in teams if any(team in (row["blue"], row["red"]) for row in rows)]
    return [] if compared is None else prices(rows, playing, *compared, settings.seed)


def compared_states(settings: TournamentSettings) -> tuple[str, str] | None:
    """The states that are set beside each other: off, and all or the first other; None without both."""
    others = [state for state in settings.states if state != OFF]
    if OFF not in settings.states or not others:
        return None
    return OFF, ALL if ALL in others else others[0]


def bars_of(rows: Sequence[Row], teams: Sequence[str], settings: TournamentSettings) -> list[dict[str, Any]]:
    """What is asked of the tournament; no bar where its games were not played."""
    bars = []
    for state in settings.states:
        table = state_results(rows, state, teams, settings)
        if state == OFF and table["table_3"] is not None:
            bars.append(_spearman_bar(table["table_3"]["scripted"]))
    never = [row[f"{side}_grabs"] for row in rows for side in SIDES if row[side] in NEVER_GRAB]
    if never:
        bars.append(_bar("grabs of Ohto and Alamer, all games", float(sum(never)), "<=", 0.0, sum(never) == 0))
    judged = [(row, side) for row in rows for side in SIDES if row[f"{side}_avoidable_opponent"] is not None]
    shielded = [(row, side) for row, side in judged if row[f"{side}_shielded"]]
    if shielded:
        found = sum(int(row[f"{s}_avoidable_{kind}"]) for row, s in shielded for kind in ("teammate", "opponent"))
        bars.append(_bar("avoidable hits of shielded teams, all games", float(found), "<=", 0.0, found == 0))
    lines = _prices(rows, teams, settings)
    kept = [line["kept"] for line in lines if line["kept"] is not None]
    if kept:
        name = "teams that keep 95 % of their net captures, of those shielded"
        bars.append(_bar(name, float(sum(kept)), ">=", float(len(kept)), all(kept)))
    return bars


def _spearman_bar(scripted: Mapping[str, Any] | None) -> dict[str, Any]:
    found = {"value": None, "low": None, "high": None} if scripted is None else scripted["all_games"]["spearman"]
    met = None if found["value"] is None else found["value"] >= SPEARMAN
    bar = _bar("Spearman's rho of unshielded ranks and Table 3, scripted teams", found["value"], ">=", SPEARMAN, met)
    return bar | {"low": found["low"], "high": found["high"]}


def _bar(name: str, value: float | None, sense: str, limit: float, met: bool | None) -> dict[str, Any]:
    return {"name": name, "value": value, "low": None, "high": None, "sense": sense, "limit": limit, "met": met}
