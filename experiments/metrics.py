"""Every figure of games: the one place where a metric is named, and what is asked of it.

A `Metric` chooses its interval (`statistics.figure`), labels tables, tiles and plots, and documents its JSON keys. To
add one: a line in `OWN` here, whose ``measure`` tells it from a game's record.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .statistics import Interval, count_interval, paired_ratio
from .words import count_text

if TYPE_CHECKING:
    import pandas as pd
    from steerclear.env.record import Record

RADII_M = (2.5, 4.0)
"""Radii at which separation violations are always counted: the shield's default and the `mctf2025` game's own."""


@dataclass(frozen=True)
class Metric:
    """A figure.

    Attributes:
        column: of the table it is made of.
        kind: ``count`` (events per row, Garwood), ``share`` (yes or no, Wilson), ``mean`` (bootstrap), ``percent``
            (of the totals of two columns, bootstrap), ``least`` (no interval).
        label: words of tables and plots, few.
        unit: of its values; empty: a number of things.
        meaning: what it is, in a sentence without a full stop.
        per: the whole that a ``percent`` is of.
        name: key in results; empty: the column.
        paired: whether a difference of pairs is meaningful.
        of_shield: it describes the shield, so that there is nothing to show without one.
        measure: from a game's record and a team, 0 blue or 1 red, to the column; None: it is counted elsewhere.
    """

    column: str
    kind: str
    label: str
    unit: str
    meaning: str
    per: str = ""
    name: str = ""
    paired: bool = True
    of_shield: bool = False
    measure: Callable[[Record, int], float | None] | None = None

    @property
    def key(self) -> str:
        """Key in results."""
        return self.name or self.column


def violation_column(kind: str, radius_m: float) -> str:
    """Name the column of a count: `violations_opponent_2.5m`."""
    return f"violations_{kind}_{float(radius_m)}m"


OWN: tuple[Metric, ...] = ()
"""Further figures of games: rows, tables, plots, comparisons and keys follow."""


def game_metrics_of(radii_m: Collection[float] = RADII_M) -> list[Metric]:
    """Every figure of games, in the order of the tables.

    Args:
        radii_m: at which separation violations were counted.
    """
    mates = "entries of two own boats into that distance, per pair"
    opponents = "entries of an own boat and an opponent into that distance, per pair"
    driven = "of both, those of an own boat that the game controlled (tagged, out of bounds), which obeys no policy"
    changed = "% of the shield's decisions that differ from the nominal command; the column of a game: a fraction"
    stuck = "pairs of own boats that want to move and stood still for over 10 s"
    reversals = "changes of the commanded side of turn (beyond 5 deg) per boat and minute"
    scored = "as the game counts them, once a decision: entries into the sum of radii, for each own boat in it"
    return [
        Metric("captures", "count", "captures", "", "flags captured"),
        Metric("captures_against", "count", "captures against", "", "flags captured by the other team"),
        Metric("net_captures", "mean", "net of captures", "", "captures - captures_against"),
        Metric("grabs", "count", "grabs", "", "flags grabbed"),
        Metric("tags", "count", "tags", "", "tags made"),
        Metric("tags_against", "count", "times tagged", "", "tags made by the other team: times tagged"),
        *(Metric(violation_column("teammate", r), "count", f"hits teammates {r:g} m", "", mates) for r in radii_m),
        *(Metric(violation_column("opponent", r), "count", f"hits opponents {r:g} m", "", opponents) for r in radii_m),
        *(Metric(violation_column("driven", r), "count", f"game-controlled {r:g} m", "", driven) for r in radii_m),
        Metric("clean_games", "share", "games without hit", "", "whether the game had no hit at all", paired=False),
        Metric("closest_m", "mean", "closest, mean m", "m", "closest distance of an own boat to any other, m"),
        Metric("closest_m", "least", "closest of all, m", "m", "smallest of all games", "", "closest_of_all_m", False),
        Metric(
            "changed_steps", "percent", "steps changed, %", "%", changed, "covered_steps", "changed_share", True, True
        ),
        *(
            Metric(column, "mean", label, unit, meaning, paired=False, of_shield=True)
            for column, label, unit, meaning in (
                (
                    "mean_heading_change_deg",
                    "mean change, deg",
                    "deg",
                    "mean |filtered - nominal| heading, changed steps",
                ),
                ("mean_speed_change_mps", "mean change, m/s", "m/s", "mean |filtered - nominal| speed, changed steps"),
                ("decision_p50_us", "decision p50, us", "us", "half of a team's decisions took no longer"),
                ("decision_p99_us", "decision p99, us", "us", "99 of 100 of them took no longer"),
            )
        ),
        Metric("deadlocks", "count", "deadlocks", "", stuck),
        Metric("reversals_per_boat_minute", "mean", "reversals/min", "", reversals),
        Metric("collisions", "count", "collisions scored", "", scored),
        Metric("primary", "mean", "primary score", "", "captures - captures_against - penalty * collisions"),
        Metric("secondary", "mean", "secondary score", "", "grabs + tags - grabs_against - tags_against"),
        *OWN,
    ]


REASONS = {
    "least_change": "the command nearest to the nominal one that leaves every boat what its backup keeps, by quadratic "
    "program or line search",
    "qp": "a least change by the quadratic program",
    "qp_relaxed": "the program's answer where not all could be kept, better than any backup",
    "backup": "no small change was safe: the boat carries out the turn and straight run that it kept ready",
    "escape": "another name of backup",
    "best_effort": "no manoeuvre keeps the separation: the one that keeps most of it",
    "held": "the policy asked for nothing usable (no number, or absurdly large): the boat is told to stop on course",
    "right_of_way": "two teammates kept each other from turning: one gives way, one stands on",
    "limited": "the nominal speed is beyond what the boat does: cut to that, and so it is safe",
    "stopped": "beyond the hard line, or about to touch an obstacle: the boat is told to stop, as the settings say",
}
"""Why a command was changed, by name of the reason, small letters."""


@dataclass(frozen=True)
class Goal:
    """What is asked of a run.

    Attributes:
        name: what is judged, in words.
        measure: from the table to the figure; None: there is nothing to judge, and no goal.
        sense: ``<=`` or ``>=``.
        limit: what is asked.
        beside: from the table to what is not judged, in words; empty: nothing.
    """

    name: str
    measure: Callable[[pd.DataFrame], Interval | None]
    sense: str
    limit: float
    beside: Callable[[pd.DataFrame], str] = lambda table: ""


def check(goals: Sequence[Goal], table: pd.DataFrame) -> list[dict[str, Any]]:
    """Judge a run: `judged` of every goal that there is something to judge by, with a ``note`` on what is beside it."""
    found = []
    for goal in goals:
        figure = goal.measure(table)
        if figure is not None:
            entry = judged(goal.name, figure.value, goal.sense, goal.limit, figure.low, figure.high)
            note = goal.beside(table)
            found.append({**entry, "note": note} if note else entry)
    return found


def judged(
    name: str,
    value: float | None,
    sense: str,
    limit: float,
    low: float | None = None,
    high: float | None = None,
    open_: bool = False,
) -> dict[str, Any]:
    """A goal with its figure; ``open_``: what was not judged leaves one that is met so far without a verdict."""
    met: bool | None = None
    if value is not None and value == value and value != float("inf"):
        met = bool(value <= limit if sense == "<=" else value >= limit)
    met = None if met and open_ else met
    return {"name": name, "value": value, "low": low, "high": high, "sense": sense, "limit": limit, "met": met}


def pairs_of(table: pd.DataFrame) -> pd.DataFrame:
    """Games that were played without the shield and with it: columns with ``_off`` and ``_on``, pairing by pairing."""
    if table.empty:
        return table
    order = {name: k for k, name in enumerate(dict.fromkeys(table["pairing"]))}
    off, on = table[~table["shielded"]], table[table["shielded"]]
    pairs = off.merge(on, on=["pairing", "game"], suffixes=("_off", "_on"))
    return pairs.sort_values(["pairing", "game"], key=lambda c: c.map(order) if c.name == "pairing" else c)


def game_goals(separation_m: float) -> list[Goal]:
    """What is asked of an ablation, all pairings together; hits of boats that the game drives obey nobody: no part."""

    def own_hits(pairs: pd.DataFrame, kind: str, state: str) -> Any:
        driven = pairs.get(f"{violation_column(f'driven_{kind}', separation_m)}_{state}", 0)
        return pairs[f"{violation_column(kind, separation_m)}_{state}"] - driven

    def paired(measure: Callable[[pd.DataFrame], Interval | None]) -> Callable[[pd.DataFrame], Interval | None]:
        return lambda table: measure(pairs) if len(pairs := pairs_of(table)) else None

    def counted(count: Callable[[pd.DataFrame, str], Any], more: Callable[[pd.DataFrame], str]) -> Any:
        """What a ratio rests on, in words, and what is beside it."""

        def words(table: pd.DataFrame) -> str:
            pairs = pairs_of(table)
            sums = [f"{int(count(pairs, state).sum()):,} {state}" for state in ("off", "on")] if len(pairs) else []
            return "; ".join(filter(None, (f"{', '.join(sums)} in {count_text(len(pairs), 'game')} each", more(table))))

        return words

    def captures(pairs: pd.DataFrame, state: str) -> Any:
        return pairs[f"captures_{state}"]

    def mates(pairs: pd.DataFrame) -> Interval:
        return Interval(float(own_hits(pairs, "teammate", "on").sum()), float("nan"), float("nan"))

    def driven(kind: str) -> Callable[[pd.DataFrame], str]:
        column = f"{violation_column(f'driven_{kind}', separation_m)}_on"
        return lambda table: _beside(pairs_of(table), column)

    at = f"at {separation_m:g} m, of boats the team commands"
    return [
        Goal(f"hits with teammates {at}, shielded, all games", paired(mates), "<=", 0.0, driven("teammate")),
        Goal(
            f"hits with opponents {at}, on / off",
            paired(lambda pairs: paired_ratio(*(own_hits(pairs, "opponent", state) for state in ("off", "on")))),
            "<=",
            0.1,
            counted(lambda pairs, state: own_hits(pairs, "opponent", state), driven("opponent")),
        ),
        Goal(
            "captures, on / off",
            paired(lambda pairs: paired_ratio(captures(pairs, "off"), captures(pairs, "on"))),
            ">=",
            0.9,
            counted(captures, lambda table: ""),
        ),
        Goal("deadlocks, shielded, per game", paired(lambda pairs: _rate(pairs, "deadlocks_on")), "<=", 0.0),
        Goal(
            f"avoidable hits {at}, shielded, per game",
            lambda table: _rate(table[table["shielded"]], "avoidable", "avoidable_driven") if len(table) else None,
            "<=",
            0.0,
            lambda table: _beside(table[table["shielded"]], "avoidable_driven"),
        ),
    ]


def _rate(games: pd.DataFrame, column: str, less: str = "") -> Interval | None:
    """Events per game, but for those of the column ``less``, of the games that tell."""
    games = games.dropna(subset=[column]) if column in games else games[:0]
    events = games[column].sum() - (games[less].sum() if less in games else 0) if len(games) else 0
    return count_interval(int(events), len(games)) if len(games) else None


def _beside(games: pd.DataFrame, column: str) -> str:
    count = int(games[column].sum()) if column in games else 0
    return f"beside {count} of boats that the game drives" if count else ""
