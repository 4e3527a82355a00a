"""Every figure of a cell of encounters: the one place where it is named, computed, labelled and documented."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import BoolArray

from ..baselines.registry import SHIELD, GuardMaker
from ..statistics import upper_bound
from .outcomes import SIDES, Columns, chunk_size, measure_chunk
from .scenarios import draw
from .scene import Conditions

QUANTILES = np.linspace(0.0, 1.0, 101)


Of = Callable[[Columns], Any]
Mask = Callable[[Columns], NDArray[Any]]


class Figure(NamedTuple):
    """A figure of a cell, named here and nowhere else.

    Attributes:
        key: in results; ``[]`` and ``.*`` tell of lists and mappings, as in the page of keys.
        label: words of the report's table; empty: it is not shown there.
        of: from the columns of the cell's encounters to the figure.
        meaning: what it is, in a sentence without a full stop.
    """

    key: str
    label: str
    of: Of
    meaning: str


def _all(c: Columns) -> BoolArray:
    return np.ones(len(c["closest_m"]), np.bool_)


def _breached(c: Columns) -> BoolArray:
    return (c["breaches_teammate"] + c["breaches_opponent"]) > 0


def _bare_breached(c: Columns) -> BoolArray:
    return (c["unshielded_breaches_teammate"] + c["unshielded_breaches_opponent"]) > 0


def _open(c: Columns) -> BoolArray:
    """Breached, nothing avoidable found, and not all judged."""
    return np.asarray(_breached(c) & (c["not_judged"] > 0) & ~(c["avoidable"] > 0))


def _settled(c: Columns) -> BoolArray:
    """Breached, all judged, nothing avoidable."""
    return np.asarray(_breached(c) & ~(c["avoidable"] > 0) & ~_open(c))


def _outside(c: Columns) -> BoolArray:
    return np.asarray(c["start_certificate_m"] >= 0.0)


def _count(mask: Mask) -> Of:
    return lambda c: int(mask(c).sum())


def _upper(mask: Mask, of: Mask = _all) -> Of:
    """Upper limit of a probability, from how many of those there are."""
    return lambda c: upper_bound(int(mask(c).sum()), int(of(c).sum()))


def _mean(column: str, times: float = 1.0) -> Of:
    return lambda c: times * float(c[column].mean())


def _mean_change(column: str) -> Of:
    """Mean over the changed steps of all encounters; None without any."""

    def mean(c: Columns) -> float | None:
        chosen = c["changed_share"] > 0.0
        return float(np.average(c[column][chosen], weights=c["changed_share"][chosen])) if chosen.any() else None

    return mean


def _ratio(part: str, whole: str, times: float = 1.0) -> Of:
    """Of totals; None of nothing."""
    return lambda c: times * float(c[part].sum() / c[whole].sum()) if c[whole].sum() > 0.0 else None


def _quantiles(column: str) -> Of:
    return lambda c: [float(value) for value in np.quantile(c[column], QUANTILES)]


def _responsible(c: Columns) -> dict[str, int]:
    return {name: int((c["responsible"] == k).sum()) for k, name in enumerate(SIDES)}


_UPPER = "95 % upper limit of the probability of that"
_SAFE = "of sampled states that are safe by the value tables, how many commands pass, %"
_TIME = "time to the first goal over that without a guard; never there counts as the whole length"
_NEVER = "own boats that had not reached their first goal by the end but do without a guard, %"
_DEAD = "encounters in which two teammates that want to move stood still for over 10 s"
_OPEN = "encounters with breaches that the oracle was not asked about, and no avoidable one"
_WHO = "encounters by whose command let the last chance pass: own, opponent, both, neither, start"
_NEAR = "quantiles 0, 0.01, ..., 1 of the closest distance of an encounter, m"
_OUT = "encounters in which the shield's certificate at the first decision was at least 0"
_AVOID = "encounters with a breach that an own boat could have avoided, by the oracle"
FIGURES = tuple(
    Figure(*row)
    for row in (
        ("encounters", "n", _count(_all), "encounters played"),
        (
            "breached",
            "breached",
            _count(_breached),
            "encounters in which an own boat came within the radius of any boat",
        ),
        ("breached_upper", "", _upper(_breached), f"{_UPPER} (Clopper-Pearson, one-sided)"),
        ("unshielded_breached", "", _count(_bare_breached), "the same scenes without a guard: how many were breached"),
        ("avoidable", "avoidable", _count(lambda c: c["avoidable"] > 0), _AVOID),
        (
            "avoidable_upper",
            "≤ at 95 %, %",
            _upper(lambda c: (c["avoidable"] > 0) | _open(c)),
            f"{_UPPER}; what was not judged counts as avoidable",
        ),
        (
            "unavoidable",
            "unavoidable",
            _count(lambda c: _settled(c) & (c["unavoidable"] > 0)),
            "encounters with breaches of which none was avoidable",
        ),
        (
            "started_inside",
            "",
            _count(lambda c: _settled(c) & ~(c["unavoidable"] > 0)),
            "encounters whose breaches were under way at the start",
        ),
        ("not_judged", "", _count(_open), _OPEN),
        ("responsible.*", "", _responsible, _WHO),
        ("started_outside", "", _count(_outside), _OUT),
        (
            "breaches_outside",
            "breached, started outside",
            _count(lambda c: _breached(c) & _outside(c)),
            "of those, how many were breached",
        ),
        ("breaches_outside_upper", "", _upper(lambda c: _breached(c) & _outside(c), _outside), _UPPER),
        (
            "breaches_teammate",
            "",
            _count(lambda c: c["breaches_teammate"]),
            "entries of two own boats into the radius, all encounters",
        ),
        (
            "breaches_opponent",
            "",
            _count(lambda c: c["breaches_opponent"]),
            "entries of an own boat and another, all encounters",
        ),
        ("closest_m", "closest, m", lambda c: float(c["closest_m"].min()), "least distance of all encounters, m"),
        ("closest_quantiles_m[]", "", _quantiles("closest_m"), _NEAR),
        ("unshielded_closest_quantiles_m[]", "", _quantiles("unshielded_closest_m"), "the same without a guard, m"),
        (
            "changed_percent",
            "changed, %",
            _mean("changed_share", 100.0),
            "share of the own boats' steps whose command was changed, %",
        ),
        ("inactive_percent", "left alone when safe, %", _ratio("left_alone", "sampled_safe", 100.0), _SAFE),
        (
            "heading_change_deg",
            "changed by, deg",
            _mean_change("heading_change_deg"),
            "mean change of the commanded heading over changed steps, deg",
        ),
        (
            "speed_change_mps",
            "changed by, m/s",
            _mean_change("speed_change_mps"),
            "mean change of the commanded speed over changed steps, m/s",
        ),
        ("goal_time_ratio", "time to goal, ×", _ratio("goal_s", "unshielded_goal_s"), _TIME),
        ("reached_percent", "goal reached, %", _mean("reached", 100.0), "own boats that reached their first goal, %"),
        ("never_arrived_percent", "never arrived, %", _mean("never_arrived", 100.0), _NEVER),
        ("deadlocked", "deadlocked", _count(lambda c: c["deadlocks"] > 0), _DEAD),
        (
            "reversals_per_min",
            "reversals/min",
            _mean("reversals_per_min"),
            "flips of the commanded side per own boat and minute",
        ),
        ("unshielded_reversals_per_min", "", _mean("unshielded_reversals_per_min"), "the same without a guard"),
        ("outside_m", "", lambda c: float(c["outside_m"].max()), "how far an own boat left the field at most, m"),
        (
            "decision_us",
            "decision, µs",
            lambda c: float(np.median(c["decision_us"])),
            "median time of a decision per game and step, in batches, us",
        ),
        (
            "decision_p999_us",
            "",
            lambda c: float(c["decision_p999_us"].max()),
            "99.9th percentile of the same, worst chunk, us",
        ),
    )
)


def summarise(columns: Columns) -> dict[str, Any]:
    """Figures over encounters, JSON-ready."""
    return {one.key.removesuffix("[]").removesuffix(".*"): one.of(columns) for one in FIGURES}


@dataclass(frozen=True)
class Outcome:
    """What came of n encounters.

    Attributes:
        columns: arrays (n,) by name: see `outcomes.measure_chunk`.
        summary: `FIGURES` over all of them.
    """

    columns: Columns
    summary: dict[str, Any]


def measure(
    family: str,
    guard: str | GuardMaker = SHIELD,
    own: str = "heron",
    other: str = "heron",
    n: int = 200,
    seed: int = 0,
    conditions: Conditions | None = None,
    judge: bool = True,
    first: int = 0,
) -> Outcome:
    """Play encounters in this process.

    Args:
        family: name of the family.
        guard: a name (see `baselines.registry`) or what makes a guard from (config, games, platforms, team,
            surroundings).
        own: platform of the own boats.
        other: platform of the others.
        n: how many encounters.
        seed: of the scenes.
        conditions: radius, delay, noise, current.
        judge: ask the post-hoc analysis about breaches (seconds each); without, they count as not judged.
        first: number of the first encounter.

    Raises:
        SteerclearError: bad input.
    """
    if n < 1:
        raise ConfigError(f"the number of encounters is {n}; ask for at least 1")
    asked = conditions or Conditions()
    size = chunk_size(family, own, other, asked, seed, first)
    parts = [
        measure_chunk(draw(family, own, other, asked, seed, k, min(size, first + n - k)), guard, asked, judge)
        for k in range(first, first + n, size)
    ]
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return Outcome(columns, summarise(columns))


WORST = {
    "guard": ("guard", "guard"),
    "own": ("own", "platform of the own boats"),
    "other": ("other", "platform of the others"),
    "family": ("family", "family"),
    "number": ("number", "number of the encounter: with family, platforms and seed it gives the scene"),
    "variant": ("variant", "which of its variants (sudden turns) was the worst"),
    "closest_m": ("closest, m", "closest distance, m"),
    "breaches": ("breaches", "entries into the radius"),
    "avoidable": ("avoidable", "of those judged, how many were avoidable"),
    "last_preventable_s": (
        "until, s before",
        "how long before the breach an own boat could still avoid it, s; null when never",
    ),
    "responsible": ("last chance let pass by", "whose command let the last chance pass; null when not judged"),
    "start_certificate_m": (
        "certificate at the start, m",
        "the shield's certificate at the first decision, m; null when nobody was near",
    ),
}
"""Words of the report's table, and meaning, of every key of the worst encounters."""
KEYS = {
    "complete": "false when interrupted or something could not be played",
    "encounters_played": "encounters in the results, over all cells",
    "encounters_resumed": "of those, how many an earlier run had played",
    "failed[].*": "cell, first encounter and error of a chunk that could not be played",
    "cells[].guard": "what stood between policy and boats",
    "cells[].own": "platform of the own boats",
    "cells[].other": "platform of the others",
    "cells[].family": "kind of encounter",
    **{f"cells[].{one.key}": one.meaning for one in FIGURES},
    **{f"worst[].{name}": meaning for name, (_, meaning) in WORST.items()},
    "files.*": "what was written, relative to the folder",
}
"""Keys of the JSON that ``steerclear encounters`` writes, with meaning and unit."""
