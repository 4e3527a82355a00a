"""The comparison of the two sets as table, JSON and page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from ..markdown import MADE, goals_of, goals_table, line, table
from ..metrics import judged
from ..provenance import machine, versions
from .unsafe_sets import MISSED_PERCENT_BAR, RATIO_BAR, SetPair

HEADS = ("own/other m/s", "heading", "shield, m²", "reachability, m²", "ratio", "missed, m²", "missed, %")
TITLE = "# Sets the shield cannot promise to save"
WORDS = f"""Positions of an opponent from which the radius is not sure to be kept, by area: where the shield's
certificate is negative, and where the worst-case value table is below the radius. Both boats at full thrust; the
heading is the opponent's relative to the own one, 180° is head-on. "Missed" is the area that the table calls lost and
the shield calls safe, also as a share of the table's set: of each such position one of the two is wrong. The shield's
pursuers are strategies, the table's opponent is the worst that its grid and horizon can tell
(see [tables.md](tables.md)).

A set much larger than the table's costs freedom, one that misses positions costs the promise. The goals are
{RATIO_BAR:g} times the area and {MISSED_PERCENT_BAR:g} % missed, in every row."""


LOOKED_UP = """The shield looks opponents up in this very table, so its set is the table's at a margin: the ratio is
what the margin costs, and that nothing is missed says nothing. `--shield-set certificate=turning_circle` compares
manoeuvres instead."""


def rows_of(pairs: Sequence[SetPair]) -> list[list[str]]:
    """Rows under `HEADS`."""
    return [
        [
            f"{pair.own_mps:g}/{pair.other_mps:g}",
            f"{pair.heading_deg:g}°",
            f"{pair.shield_m2:.1f}",
            f"{pair.reach_m2:.1f}",
            f"{pair.ratio:.2f}",
            f"{pair.missed_m2:.2f}",
            f"{pair.missed_percent:.1f}",
        ]
        for pair in pairs
    ]


def sets_goals(pairs: Sequence[SetPair], looked_up: bool = False) -> list[dict[str, Any]]:
    """Goals over all pairs: how much larger the shield's set is, and how much of the table's it misses.

    Args:
        pairs: the comparison.
        looked_up: whether the shield reads the same table; what it misses then says nothing and is not judged.
    """
    ratio, missed = max(pair.ratio for pair in pairs), max(pair.missed_percent for pair in pairs)
    missed_goal = judged("set the shield misses, %, largest", missed, "<=", MISSED_PERCENT_BAR)
    return [
        judged("shield's set by reachability's, largest", ratio, "<=", RATIO_BAR),
        missed_goal | ({"met": None} if looked_up else {}),
    ]


def content_of(settings: Mapping[str, Any], pairs: Sequence[SetPair], looked_up: bool, wall_s: float) -> dict[str, Any]:
    """The comparison as JSON; `keys.SETS` describes it."""
    return {
        "command": "reach-compare",
        "settings": dict(settings),
        "versions": versions(),
        "machine": machine(),
        "wall_s": wall_s,
        "looked_up": looked_up,
        "pairs": [asdict(pair) for pair in pairs],
        "goals": sets_goals(pairs, looked_up),
        "deprecated": {"bars": sets_goals(pairs, looked_up)},
    }


def sets_page(contents: Sequence[Mapping[str, Any]]) -> str:
    """Write the page of the sets from contents of `content_of`."""
    lines = [TITLE, "", MADE, "", WORDS, ""]
    for content in contents:
        pairs, settings = [SetPair(**pair) for pair in content["pairs"]], content["settings"]
        lines += [f"## {line(settings['own'])} meets {line(settings['other'])}, {settings['radius_m']:g} m", ""]
        if settings["shield"]:
            lines += [line(f"Shield settings: {', '.join(f'{k}={v}' for k, v in settings['shield'].items())}."), ""]
        if content["looked_up"]:
            lines += [LOOKED_UP, ""]
        lines += [
            *table(HEADS, rows_of(pairs)),
            "",
            *goals_table(goals_of(content)),
            "",
        ]
        met = sum(all(goal["met"] is not False for goal in sets_goals([pair], content["looked_up"])) for pair in pairs)
        lines += [
            f"{met} of {len(pairs)} rows within the goals. steerclear {line(content['versions']['steerclear'])}.",
            "",
        ]
    return "\n".join(lines)
