"""What value tables and their sets look like: terminal, JSON, pages of docs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from rich.console import Console
from steerclear.shield.tables.areas import HEADINGS_DEG
from steerclear.shield.tables.files import Card
from steerclear.shield.tables.make import COARSER

from ..markdown import GOAL_HEADS, goal_row
from ..metrics import judged
from ..provenance import head_of
from ..report import Report, Section
from ..tables import Table, titled
from .sets import BAND_M, BEYOND, LONGEST_S, MISSED_PERCENT_GOAL, RATIO_GOAL, PlayedSet, SetPair

CARD_WORDS = "What the words mean: [tables.md](tables.md)."
AREA_HEADS = ["own/other m/s", *(f"{heading:g}°" for heading in HEADINGS_DEG)]
_PLACE = {"own/other m/s": "{0.own_mps:g}/{0.other_mps:g}", "heading": "{0.heading_deg:g}°"}
SETS_COLUMNS = {
    **_PLACE,
    "shield, m²": "{0.shield_m2:.1f}",
    "reachability, m²": "{0.reach_m2:.1f}",
    "ratio": "{0.ratio:.2f}",
    "missed, m²": "{0.missed_m2:.2f}",
    "missed, %": "{0.missed_percent:.1f}",
}
PLAYED_COLUMNS = {
    "own/other": _PLACE["own/other m/s"],
    "heading": _PLACE["heading"],
    "reach, m²": "{0.reach_m2:.1f}",
    "lost, m²": "{0.lost_m2:.1f}",
    "ratio": "{0.ratio:.2f}",
    "by table": "{0.player_ratio:.2f}",
    "played": "{0.played:,}",
    "lost beyond": "{0.tried_lost} of {0.tried:,}",
}
SETS_WORDS = f"""Positions of an opponent from which the separation is not sure to be kept, by area: where the shield's
safety margin is negative, and where the worst-case value table is below the separation. Both boats at full thrust; the
heading is the opponent's relative to the own one, 180° is head-on. "Missed" is the area that the table calls lost and
the shield calls safe, also as a share of the table's set: of each such position one of the two is wrong. The shield's
pursuers are strategies, the table's opponent is the worst that its grid and horizon can tell
(see [tables.md](tables.md)).

A set much larger than the table's costs freedom, one that misses positions costs the promise. The goals are
{RATIO_GOAL:g} times the area and {MISSED_PERCENT_GOAL:g} % missed, in every row."""
LOOKED_UP = """The shield looks opponents up in this very table, so its set is the table's at a margin: the ratio is
what the margin costs, and that nothing is missed says nothing. --shield-set opponent_model=turning_circle compares
manoeuvres instead."""
PLAYED_WORDS = f"""Found by playing, to the separation, where [unsafe_sets.md](unsafe_sets.md) tells what the shield
*promises*. Every position of the opponent whose worst-case value is below the separation counts as lost, as nobody can
save the boat there. From all of a value up to {BAND_M:g} m above it games are played with the shield as it comes, and
one in {BEYOND} of those beyond, on all bearings, is tried. The boat's policy wants straight on at top speed, or
straight at the opponent; the opponent does what the table calls worst, steers for the meeting point, or at the boat.
A position is lost when the boats come within the separation in any of these six games, looked at every 0.1 s, which
last as long as the table looks ahead, at most {LONGEST_S:g} s. Both boats begin at full thrust; the heading is the
opponent's relative to the own one, 180° is head-on. *Reach* is the reachability set, *lost* what is lost of the
positions *played* beside it, *ratio* both by the former, *lost beyond* how many of those tried beyond are. *By table*
is the ratio of a boat that has no shield and no wants, but steers as the value table says is best, at top speed: what
is lost there the table promised and could not keep, since it is a grid. The goals: {RATIO_GOAL:g} times the
reachability set's area in every row, and none lost beyond."""


def rows_of(sets: Sequence[SetPair | PlayedSet], columns: Mapping[str, str]) -> list[list[str]]:
    """Rows of a table with these columns."""
    return [[text.format(one) for text in columns.values()] for one in sets]


def sets_goals(pairs: Sequence[SetPair], looked_up: bool = False) -> list[dict[str, Any]]:
    """Goals over all pairs: how much larger the shield's set is, and how much of the table's it misses.

    Where the shield reads the same table (``looked_up``), what it misses says nothing and is not judged.
    """
    ratio, missed = max(pair.ratio for pair in pairs), max(pair.missed_percent for pair in pairs)
    missed_goal = judged("set the shield misses, %, largest", missed, "<=", MISSED_PERCENT_GOAL)
    return [
        judged("shield's set by reachability's, largest", ratio, "<=", RATIO_GOAL),
        missed_goal | ({"met": None} if looked_up else {}),
    ]


def sets_content(
    settings: Mapping[str, Any], pairs: Sequence[SetPair], looked_up: bool, started_s: float
) -> dict[str, Any]:
    """The comparison as JSON; `docs.KEYS` describes it."""
    goals, head = sets_goals(pairs, looked_up), head_of("reach-compare", settings, started_s)
    rows = [asdict(pair) for pair in pairs]
    return {**head, "looked_up": looked_up, "pairs": rows, "goals": goals}


def sets_page(contents: Sequence[Mapping[str, Any]]) -> str:
    """Write the page of the sets from contents of `sets_content`."""
    parts = [(content, [SetPair(**pair) for pair in content["pairs"]]) for content in contents]
    return _page("Sets the shield cannot promise to save", SETS_WORDS, parts, SETS_COLUMNS)


def _page(title: str, words: str, parts: Sequence[tuple[Mapping[str, Any], Any]], columns: Mapping[str, str]) -> str:
    """A page about several pairs of boats: of each the settings, a table and the goals."""
    sections = []
    for content, sets in parts:
        settings, goals = content["settings"], [goal_row(goal) for goal in content["goals"]]
        given = ", ".join(f"{name}={value}" for name, value in settings["shield"].items())
        notes = [f"Shield settings: {given}."] if given else []
        notes += [LOOKED_UP] if content.get("looked_up") else []
        notes += [f"steerclear {content['versions']['steerclear']}."]
        about = f"{settings['own']} meets {settings['other']}, {settings['radius_m']:g} m"
        tables = [Table("", [*columns], rows_of(sets, columns)), Table("", GOAL_HEADS, goals)]
        sections.append(Section(about, tables, " ".join(notes)))
    return Report(title, "", notes=[words], sections=sections).page("")[1]


def played_content(head: Mapping[str, Any], sets: Sequence[PlayedSet]) -> dict[str, Any]:
    """The sets as JSON, below a run's head; `docs.KEYS` describes it."""
    ratio, beyond = max(one.ratio for one in sets), sum(one.tried_lost for one in sets)
    goals = [
        judged("lost and reachability's set by the latter, largest", ratio, "<=", RATIO_GOAL),
        judged("positions beyond that were lost", float(beyond), "<=", 0.0),
    ]
    rows = [{**asdict(one), "ratio": one.ratio, "player_ratio": one.player_ratio} for one in sets]
    told = {name: head[name] for name in ("command", "settings", "versions", "machine", "wall_s")}
    return {**told, "sets": rows, "goals": goals}


def played_page(contents: Sequence[Mapping[str, Any]]) -> str:
    """Write the page of played sets from contents of `played_content`."""
    names = PlayedSet.__dataclass_fields__
    parts = [(one, [PlayedSet(**{name: row[name] for name in names}) for row in one["sets"]]) for one in contents]
    return _page("Sets from which the shield does not save a boat", PLAYED_WORDS, parts, PLAYED_COLUMNS)


def show_card(console: Console, card: Card) -> None:
    """Print a card: what was solved, how well, and the sets' areas."""
    console.print(f"{card.own} with {card.other}, {card.other_may}; solved by version {card.version}")
    console.print(f"{_made_how(card)} Values up to {card.make_grid().cap_m:g} m.")
    console.print("Valid for an own boat at full thrust; at most this far apart under optimal play:")
    for radius in _radii(card):
        title = f"Area, m², from which {radius} m cannot be kept, by relative heading"
        console.print("", titled(title, AREA_HEADS, _areas(card, radius)))
    heads = ["", *(f"{radius} m" for radius in _radii(card))]
    console.print("", titled("How good the table is", heads, card_rows(card)))


def _radii(card: Card) -> list[str]:
    return [f"{radius:g}" for radius in card.checked_radii_m]


def card_rows(card: Card) -> list[list[str]]:
    """Rows of a card's figures: reach, convergence, margin by radius, then the error of the reduced model."""
    found = [(card.areas_m2["reach_ahead_m"][r], card.convergence[r], card.margin[r]) for r in _radii(card)]
    rows = {
        "reach ahead in a head-on, m": "{0:.1f}",
        f"change of areas on a grid {COARSER:g} times coarser, mean": "{1[mean]:.1%}",
        "the same, largest": "{1[largest]:.1%}",
        "runs of the full model": "{2[runs]:,}",
        "of these with violations": "{2[breaches]:,}",
        "deepest violation, m": "{2[depth_m]:.2f}",
        "margin on the value from which none did, m": "{2[margin_m]:.2f}",
    }
    texts = [[name, *(text.format(*one).replace("%", " %") for one in found)] for name, text in rows.items()]
    return texts if found else []


def tables_page(cards: Sequence[str]) -> str:
    """Write the page of value tables from their cards.

    Args:
        cards: as JSON.

    Raises:
        TableError: one is no card.
    """
    sections = []
    for card in map(Card.of_json, cards):
        errors = [
            f"{getattr(card, role)} {error['place_m_p99']:.3f} m, {error['speed_mps_p99']:.3f} m/s"
            for role, error in card.model_error.items()
        ]
        error = f"Error of the reduced model over one step, 99th percentile: {'; '.join(dict.fromkeys(errors))}."
        tables = [Table("", ["", *(f"{radius} m" for radius in _radii(card))], card_rows(card), error)]
        for radius in _radii(card):
            words = f"Areas, m², from which {radius} m cannot be kept, by speeds and relative heading:"
            tables.append(Table("", AREA_HEADS, _areas(card, radius), words))
        sections.append(Section(f"{card.own} with {card.other}, {card.other_may}", tables, _made_how(card)))
    return Report("Value tables: figures", "", notes=[CARD_WORDS], sections=sections).page("")[1]


def _areas(card: Card, radius: str) -> list[list[str]]:
    return [[name, *(f"{area:.1f}" for area in areas)] for name, areas in card.areas_m2[radius].items()]


def _made_how(card: Card) -> str:
    grid = card.make_grid()
    nodes = " x ".join(str(n) for n in grid.shape)
    return (
        f"Grid {nodes}, ranges {grid.rho_first_m:g} to {grid.rho_last_m:g} m, step {card.dt_s:g} s, "
        f"{card.iterations} steps of at most {card.horizon_s / card.dt_s:.0f}, last change {card.residual_m:.4f} m."
    )
