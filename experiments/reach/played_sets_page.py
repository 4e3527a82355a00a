"""Played sets as table, JSON and page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from ..markdown import MADE, goals_of, goals_table, line, table
from ..metrics import judged
from ..provenance import machine, versions
from .played_sets import BAND_M, BEYOND, LONGEST_S, PlayedSet
from .unsafe_sets import RATIO_BAR

HEADS = ("own/other", "heading", "reach, m²", "lost, m²", "ratio", "by table", "played", "lost beyond")
TITLE = "# Sets from which the shield does not save a boat"
WORDS = f"""Found by playing, to the radius, where [unsafe_sets.md](unsafe_sets.md) tells what the shield *promises*.
Every position of the opponent whose worst-case value is below the radius counts as lost, as nobody can save the boat
there. From all of a value up to {BAND_M:g} m above it games are played with the shield as it comes, and one in {BEYOND}
of those beyond, on all bearings, is tried. The boat's policy wants straight on at top speed, or straight at the
opponent; the opponent does what the table calls worst, steers for the meeting point, or at the boat. A position is lost
when the boats come within the radius in any of these six games, looked at every 0.1 s, which last as long as the table
looks ahead, at most {LONGEST_S:g} s. Both boats begin at full thrust; the heading is the opponent's relative to the own
one, 180° is head-on. *Reach* is the reachability set, *lost* what is lost of the positions *played* beside it, *ratio*
both by the former, *lost beyond* how many of those tried beyond are. *By table* is the ratio of a boat that has no
shield and no wants, but steers as the value table says is best, at top speed: what is lost there the table promised and
could not keep, since it is a grid. The goals: {RATIO_BAR:g} times the reachability set's area in every row, and none
lost beyond."""


def rows_of(sets: Sequence[PlayedSet]) -> list[list[str]]:
    """Rows under `HEADS`."""
    return [
        [
            f"{one.own_mps:g}/{one.other_mps:g}",
            f"{one.heading_deg:g}°",
            f"{one.reach_m2:.1f}",
            f"{one.lost_m2:.1f}",
            f"{one.ratio:.2f}",
            f"{one.player_ratio:.2f}",
            f"{one.played:,}",
            f"{one.tried_lost} of {one.tried:,}",
        ]
        for one in sets
    ]


def goals_of_sets(sets: Sequence[PlayedSet]) -> list[dict[str, Any]]:
    """The goals over all rows."""
    ratio, beyond = max(one.ratio for one in sets), sum(one.tried_lost for one in sets)
    return [
        judged("lost and reachability's set by the latter, largest", ratio, "<=", RATIO_BAR),
        judged("positions beyond that were lost", float(beyond), "<=", 0.0),
    ]


def content_of(settings: Mapping[str, Any], sets: Sequence[PlayedSet], wall_s: float) -> dict[str, Any]:
    """The sets as JSON; `keys.PLAYED_SETS` describes it."""
    return {
        "command": "reach-play",
        "settings": dict(settings),
        "versions": versions(),
        "machine": machine(),
        "wall_s": wall_s,
        "sets": [{**asdict(one), "ratio": one.ratio, "player_ratio": one.player_ratio} for one in sets],
        "goals": goals_of_sets(sets),
        "deprecated": {"bars": goals_of_sets(sets)},
    }


def played_page(contents: Sequence[Mapping[str, Any]]) -> str:
    """Write the page of played sets from contents of `content_of`."""
    lines = [TITLE, "", MADE, "", WORDS, ""]
    for content in contents:
        settings = content["settings"]
        sets = [
            PlayedSet(**{name: one[name] for name in one if name not in ("ratio", "player_ratio")})
            for one in content["sets"]
        ]
        lines += [f"## {line(settings['own'])} meets {line(settings['other'])}, {settings['radius_m']:g} m", ""]
        if settings["shield"]:
            lines += [line(f"Shield settings: {', '.join(f'{k}={v}' for k, v in settings['shield'].items())}."), ""]
        lines += [
            *table(HEADS, rows_of(sets)),
            "",
            *goals_table(goals_of(content)),
            "",
        ]
        lines += [f"steerclear {line(content['versions']['steerclear'])}.", ""]
    return "\n".join(lines)
