"""Every figure of games: the one place where a metric is named, and what is asked of it.

A `Metric` chooses its interval (`statistics.figure`), labels tables, tiles and plots, and documents its JSON keys. To
add one: a line in `OWN` here, whose ``measure`` tells it from a game's record.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .statistics import Interval, count_interval, paired_ratio

if TYPE_CHECKING:
    import pandas as pd
    from steerclear.env.record import Record

RADII_M = (2.5, 4.0)
"""Radii at which breaches are always counted: the shield's default and the `mctf2025` game's own."""


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

    @property
    def axis(self) -> str:
        """Text of an axis."""
        return f"{self.label}, {self.unit}" if self.unit else f"{self.label} per game"


def breach_column(kind: str, radius_m: float) -> str:
    """Name the column of a count: `breaches_opponent_2.5m`."""
    return f"breaches_{kind}_{float(radius_m)}m"


OWN: tuple[Metric, ...] = ()
"""Further figures of games: rows, tables, plots, comparisons and keys follow."""


def game_metrics_of(radii_m: Sequence[float] = RADII_M) -> list[Metric]:
    """Every figure of games, in the order of the tables.

    Args:
        radii_m: at which breaches were counted.
    """
    mates = "entries of two own boats into that radius, per pair"
    opponents = "entries of an own boat and an opponent into that radius, per pair"
    driven = "of both, those of an own boat that the game drove (tagged, out of bounds), which obeys no policy"
    return [
        Metric("captures", "count", "captures", "", "flags captured"),
        Metric("captures_against", "count", "captures against", "", "flags captured by the other team"),
        Metric("net_captures", "mean", "net of captures", "", "captures - captures_against"),
        Metric("grabs", "count", "grabs", "", "flags grabbed"),
        Metric("tags", "count", "tags", "", "tags made"),
        Metric("tags_against", "count", "times tagged", "", "tags made by the other team: times tagged"),
        *(Metric(breach_column("teammate", r), "count", f"hits mates {r:g} m", "", mates) for r in radii_m),
        *(Metric(breach_column("opponent", r), "count", f"hits opp. {r:g} m", "", opponents) for r in radii_m),
        *(Metric(breach_column("driven", r), "count", f"hits driven {r:g} m", "", driven) for r in radii_m),
        Metric("clean_games", "share", "games without hit", "", "whether the game had no hit at all", paired=False),
        Metric("closest_m", "mean", "closest, mean m", "m", "closest distance of an own boat to any other, m"),
        Metric("closest_m", "least", "closest of all, m", "m", "smallest of all games", "", "closest_of_all_m", False),
        Metric(
            "changed_steps",
            "percent",
            "steps changed, %",
            "%",
            "% of the shield's decisions that differ from what was wanted; the column of a game: a fraction",
            per="covered_steps",
            name="changed_share",
            of_shield=True,
        ),
        *(
            Metric(column, "mean", label, unit, meaning, paired=False, of_shield=True)
            for column, label, unit, meaning in (
                ("mean_heading_change_deg", "mean change, deg", "deg", "mean |sent - wanted| heading, changed steps"),
                ("mean_speed_change_mps", "mean change, m/s", "m/s", "mean |sent - wanted| speed, changed steps"),
                ("decision_p50_us", "decision p50, us", "us", "half of a team's decisions took no longer"),
                ("decision_p99_us", "decision p99, us", "us", "99 of 100 of them took no longer"),
            )
        ),
        Metric(
            "deadlocks", "count", "deadlocks", "", "pairs of own boats that want to move and stood still for over 10 s"
        ),
        Metric(
            "reversals_per_boat_minute",
            "mean",
            "reversals/min",
            "",
            "changes of the commanded side of turn (beyond 5 deg) per boat and minute",
        ),
        Metric(
            "collisions",
            "count",
            "collisions scored",
            "",
            "as the game counts them, once a decision: entries into the sum of radii, for each own boat in it",
        ),
        Metric("primary", "mean", "primary score", "", "captures - captures_against - penalty * collisions"),
        Metric("secondary", "mean", "secondary score", "", "grabs + tags - grabs_against - tags_against"),
        *OWN,
    ]


GAME_COLUMNS = {
    "pairing": "own policy vs opponent policy",
    "game": "number within the pairing; the same number off and on starts from the same seed",
    "shielded": "whether the own team had a shield",
    "covered": "whether that shield also decided for boats that the game drove",
    "preset": "rules of the game",
    "own": "policy whose results are counted",
    "opponent": "policy of the other team",
    "side": "colour of the own team",
    "seed": "of start places and policies",
    "penalty": "weight of a collision in the primary score",
    "own_files": "digest of the own policy's files; empty for a named policy",
    "opponent_files": "the same of the other team",
    "steps": "steps played",
    "duration_s": "game time played, s",
    "grabs_against": "flags grabbed by the other team",
    "closest_teammate_m": "closest distance of two own boats, m",
    "closest_opponent_m": "closest distance of an own boat to an opponent, m",
    "covered_steps": "boat-steps a shield decided on",
    "changed_steps": "boat-steps in which the sent command differs from the wanted one",
    "changed_share": "changed_steps / covered_steps: a fraction, 0 to 1",
    "decision_max_us": "longest of a team's decisions, us",
    "reason_*": "boat-steps decided for that reason",
    "policy_failures": "times the own policy raised or answered nonsense; its boats held",
    "opponent_policy_failures": "the same of the other team",
    "policy_usable_steps": "steps in which the own policy gave some boat a usable answer",
    "opponent_policy_usable_steps": "the same of the other team",
    "first_failure": "text of the first of them",
    "avoidable": "breaches that own commands could have avoided, of both kinds; null when not judged",
    "avoidable_driven": "of those, of boats that the game drove: no command could prevent them",
    "avoidable_*": "breaches of that kind and radius that own commands could have avoided; null when not judged",
    "unavoidable_*": "breaches that no own command of the last 30 s could have avoided",
    "started_inside_*": "breaches of a pair that was inside when the game began",
    "not_judged_*": "breaches beyond the 500 of a game that are judged",
    "wall_s": "time it took to play and judge, s",
}
"""Columns of a game's row that are no metrics."""

REASONS = {
    "least_change": "the command nearest to the wanted one that leaves every boat what its backup keeps, by quadratic "
    "program or line search",
    "qp": "the least change of the quadratic program, as results of 0.8.0 and before name it",
    "qp_relaxed": "the program's answer where not all could be kept, better than any backup",
    "backup": "no small change was safe: the boat carries out the turn and straight run that it kept ready (in 0.8.0 "
    "and before also a part of it)",
    "escape": "the same, as results of 0.2.0 and before name it",
    "best_effort": "no manoeuvre keeps the radius: the one that keeps most of it",
    "held": "the policy asked for nothing usable (no number, or absurdly large): the boat is told to stop on course",
    "right_of_way": "two teammates kept each other from turning: one gives way, one stands on",
    "limited": "the wanted speed is beyond what the boat does: cut to that, and so it is safe",
    "stopped": "beyond the hard line, or about to touch an obstacle: the boat is told to stop, as the settings say",
}
"""Why a command was changed, by name of the reason, small letters."""


def columns_of(metrics: Sequence[Metric], more: Mapping[str, str]) -> dict[str, str]:
    """Meaning of every column of a table: of its metrics, and of the others."""
    return {**more, **{metric.column: metric.meaning for metric in metrics if metric.column not in more}}


def meanings_of(metrics: Sequence[Metric]) -> dict[str, str]:
    """Meaning of every figure, by its key."""
    return {metric.key: metric.meaning for metric in metrics}


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


_GOAL = {
    "name": "what is judged",
    "value": "measured",
    "low": "lower 95 % limit",
    "high": "upper 95 % limit",
    "sense": "<= or >=",
    "limit": "what is asked",
    "met": "whether it is met; null without data",
    "note": "what is beside it and not judged, such as hits of boats that the game drives; absent without any",
}
GOAL_KEYS = {
    **{f"goals[].{name}": words for name, words in _GOAL.items()},
    **{f"deprecated.bars[].{name}": "the same as goals[], under its name until 0.8.0" for name in _GOAL},
}
"""Keys of what `check` returns, in results; the old name is written for one more release."""


def check(goals: Sequence[Goal], table: pd.DataFrame) -> list[dict[str, Any]]:
    """Judge a run.

    Returns:
        Per goal ``name``, ``value``, ``low``, ``high``, ``sense``, ``limit``, ``met`` (None without data); ``note``
        where something beside it is not judged.
    """
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


def commanded(pairs: pd.DataFrame, kind: str, radius_m: float, state: str) -> Any:
    """Breaches of boats that the team commands, per game of `pairs_of`: all but those of boats that the game drives."""
    driven = pairs.get(f"{breach_column(f'driven_{kind}', radius_m)}_{state}", 0)
    return pairs[f"{breach_column(kind, radius_m)}_{state}"] - driven


def _driven_words(kind: str, radius_m: float) -> Callable[[pd.DataFrame], str]:
    """How many shielded breaches are of boats that the game drives; they obey nobody, and are not judged."""

    def words(table: pd.DataFrame) -> str:
        return _beside(pairs_of(table).get(f"{breach_column(f'driven_{kind}', radius_m)}_on"))

    return words


def _beside(driven: pd.Series[Any] | None) -> str:
    count = 0 if driven is None else int(driven.sum())
    return f"beside {count} of boats that the game drives" if count else ""


def rate(column: str, less: str = "", paired: bool = True) -> Callable[[pd.DataFrame], Interval | None]:
    """Events per shielded game, but for those of the column ``less``: of games with a pair, or of all that tell."""

    def measure(table: pd.DataFrame) -> Interval | None:
        if column not in table or table.empty:
            return None
        games, end = (pairs_of(table), "_on") if paired else (table[table["shielded"]], "")
        games = games.dropna(subset=[column + end])
        events = games[column + end].sum() - (games[less].sum() if less in games else 0)
        return count_interval(int(events), len(games)) if len(games) else None

    return measure


def on_over_off(column: str) -> Callable[[pd.DataFrame], Interval | None]:
    """Events with the shield over those without, games paired."""
    return _paired(lambda pairs: paired_ratio(pairs[f"{column}_off"], pairs[f"{column}_on"]))


_NONE = (float("nan"), float("nan"))


def _paired(measure: Callable[[pd.DataFrame], Interval]) -> Callable[[pd.DataFrame], Interval | None]:
    """A figure of games with a pair; None without any."""

    def of(table: pd.DataFrame) -> Interval | None:
        pairs = pairs_of(table)
        return measure(pairs) if len(pairs) else None

    return of


def pairs_of(table: pd.DataFrame) -> pd.DataFrame:
    """Games that were played without the shield and with it: columns with ``_off`` and ``_on``, pairing by pairing."""
    if table.empty:
        return table
    order = {name: k for k, name in enumerate(dict.fromkeys(table["pairing"]))}
    off, on = table[~table["shielded"]], table[table["shielded"]]
    pairs = off.merge(on, on=["pairing", "game"], suffixes=("_off", "_on"))
    return pairs.sort_values(["pairing", "game"], key=lambda c: c.map(order) if c.name == "pairing" else c)


def game_goals(separation_m: float) -> list[Goal]:
    """What is asked of an ablation, all pairings together."""

    def mates(pairs: pd.DataFrame) -> Interval:
        return Interval(float(commanded(pairs, "teammate", separation_m, "on").sum()), *_NONE)

    def opponents(pairs: pd.DataFrame) -> Interval:
        return paired_ratio(*(commanded(pairs, "opponent", separation_m, state) for state in ("off", "on")))

    beside = {kind: _driven_words(kind, separation_m) for kind in ("teammate", "opponent")}
    at = f"at {separation_m:g} m, of boats the team commands"
    return [
        Goal(f"hits with teammates {at}, shielded, all games", _paired(mates), "<=", 0.0, beside["teammate"]),
        Goal(f"hits with opponents {at}, on / off", _paired(opponents), "<=", 0.1, beside["opponent"]),
        Goal("captures, on / off", on_over_off("captures"), ">=", 0.9),
        Goal("deadlocks, shielded, per game", rate("deadlocks"), "<=", 0.0),
        Goal(
            f"avoidable hits {at}, shielded, per game",
            rate("avoidable", "avoidable_driven", paired=False),
            "<=",
            0.0,
            lambda table: _beside(table[table["shielded"]].get("avoidable_driven")),
        ),
    ]
