"""What value tables and their sets look like: terminal, JSON, pages of docs, a picture."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from steerclear.shield.exceptions import TableError
from steerclear.shield.tables.areas import HEADINGS_DEG, SPEED_SHARES, unsafe
from steerclear.shield.tables.files import Card, ValueTable
from steerclear.shield.tables.make import COARSER

from ..markdown import MADE, goals_of, goals_table, line, table
from ..metrics import judged
from ..plots import text as plot_text
from ..provenance import head_of
from ..result_files import make_folder_of
from ..tables import titled
from .sets import BAND_M, BEYOND, LONGEST_S, MISSED_PERCENT_GOAL, RATIO_GOAL, PlayedSet, SetPair

COLOURS = ("#e3bfae", "#a5c5d1", "#c5cba0", "#c6a8d1")
SHOWN_DEG = (0.0, 90.0, 180.0)
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
SETS_WORDS = f"""Positions of an opponent from which the radius is not sure to be kept, by area: where the shield's
safety margin is negative, and where the worst-case value table is below the radius. Both boats at full thrust; the
heading is the opponent's relative to the own one, 180° is head-on. "Missed" is the area that the table calls lost and
the shield calls safe, also as a share of the table's set: of each such position one of the two is wrong. The shield's
pursuers are strategies, the table's opponent is the worst that its grid and horizon can tell
(see [tables.md](tables.md)).

A set much larger than the table's costs freedom, one that misses positions costs the promise. The goals are
{RATIO_GOAL:g} times the area and {MISSED_PERCENT_GOAL:g} % missed, in every row."""
LOOKED_UP = """The shield looks opponents up in this very table, so its set is the table's at a margin: the ratio is
what the margin costs, and that nothing is missed says nothing. `--shield-set opponent_model=turning_circle` compares
manoeuvres instead."""
PLAYED_WORDS = f"""Found by playing, to the radius, where [unsafe_sets.md](unsafe_sets.md) tells what the shield
*promises*. Every position of the opponent whose worst-case value is below the radius counts as lost, as nobody can
save the boat there. From all of a value up to {BAND_M:g} m above it games are played with the shield as it comes, and
one in {BEYOND} of those beyond, on all bearings, is tried. The boat's policy wants straight on at top speed, or
straight at the opponent; the opponent does what the table calls worst, steers for the meeting point, or at the boat.
A position is lost when the boats come within the radius in any of these six games, looked at every 0.1 s, which last
as long as the table looks ahead, at most {LONGEST_S:g} s. Both boats begin at full thrust; the heading is the
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
    """The comparison as JSON; `docs_keys.KEYS` describes it."""
    goals, head = sets_goals(pairs, looked_up), head_of("reach-compare", settings, started_s)
    rows = [asdict(pair) for pair in pairs]
    return {**head, "looked_up": looked_up, "pairs": rows, "goals": goals, "deprecated": {"bars": goals}}


def sets_page(contents: Sequence[Mapping[str, Any]]) -> str:
    """Write the page of the sets from contents of `sets_content`."""
    lines = ["# Sets the shield cannot promise to save", "", MADE, "", SETS_WORDS, ""]
    for content in contents:
        pairs, looked_up = [SetPair(**pair) for pair in content["pairs"]], content["looked_up"]
        lines += _section(content, pairs, SETS_COLUMNS, [LOOKED_UP, ""] if looked_up else [])
        met = sum(all(goal["met"] is not False for goal in sets_goals([pair], looked_up)) for pair in pairs)
        lines += [f"{met} of {len(pairs)} rows within the goals. {_version(content)}", ""]
    return "\n".join(lines)


def _section(
    content: Mapping[str, Any], sets: Sequence[Any], columns: Mapping[str, str], words: Sequence[str] = ()
) -> list[str]:
    """Lines of a page about one pair of boats: settings, table, goals."""
    settings = content["settings"]
    lines = [f"## {line(settings['own'])} meets {line(settings['other'])}, {settings['radius_m']:g} m", ""]
    if settings["shield"]:
        lines += [line(f"Shield settings: {', '.join(f'{k}={v}' for k, v in settings['shield'].items())}."), ""]
    rows = table([*columns], rows_of(sets, columns))
    return [*lines, *words, *rows, "", *goals_table(goals_of(content)), ""]


def _version(content: Mapping[str, Any]) -> str:
    return f"steerclear {line(content['versions']['steerclear'])}."


def played_goals(sets: Sequence[PlayedSet]) -> list[dict[str, Any]]:
    """The goals over all rows."""
    ratio, beyond = max(one.ratio for one in sets), sum(one.tried_lost for one in sets)
    return [
        judged("lost and reachability's set by the latter, largest", ratio, "<=", RATIO_GOAL),
        judged("positions beyond that were lost", float(beyond), "<=", 0.0),
    ]


def played_content(head: Mapping[str, Any], sets: Sequence[PlayedSet]) -> dict[str, Any]:
    """The sets as JSON, below a run's head; `docs_keys.PLAYED_SETS` describes it."""
    goals = played_goals(sets)
    rows = [{**asdict(one), "ratio": one.ratio, "player_ratio": one.player_ratio} for one in sets]
    told = {name: head[name] for name in ("command", "settings", "versions", "machine", "wall_s")}
    return {**told, "sets": rows, "goals": goals, "deprecated": {"bars": goals}}


def played_page(contents: Sequence[Mapping[str, Any]]) -> str:
    """Write the page of played sets from contents of `played_content`."""
    lines = ["# Sets from which the shield does not save a boat", "", MADE, "", PLAYED_WORDS, ""]
    for content in contents:
        names = PlayedSet.__dataclass_fields__
        sets = [PlayedSet(**{name: one[name] for name in names}) for one in content["sets"]]
        lines += [*_section(content, sets, PLAYED_COLUMNS), _version(content), ""]
    return "\n".join(lines)


def show_card(console: Console, card: Card) -> None:
    """Print a card: what was solved, how well, and the sets' areas."""
    console.print(f"{card.own} with {card.other}, {card.other_may}; solved by version {card.version}")
    console.print(f"{_made_how(card)} Values up to {card.make_grid().cap_m:g} m.")
    console.print("Valid for an own boat at full thrust; at most this far apart under optimal play:")
    for radius in _radii(card):
        title = f"Area, m², from which {radius} m cannot be kept, by relative heading"
        console.print("", titled(title, AREA_HEADS, _areas(card, radius)))
    heads = ["", *(f"{radius} m" for radius in _radii(card))]
    console.print("", titled("What the table is worth", heads, card_rows(card)))


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
        "of these breached": "{2[breaches]:,}",
        "deepest breach, m": "{2[depth_m]:.2f}",
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
    lines = ["# Value tables: figures", "", MADE, "", "What the words mean: [tables.md](tables.md).", ""]
    for card in map(Card.of_json, cards):
        errors = [
            f"{getattr(card, role)} {error['place_m_p99']:.3f} m, {error['speed_mps_p99']:.3f} m/s"
            for role, error in card.model_error.items()
        ]
        error = f"Error of the reduced model over one step, 99th percentile: {'; '.join(dict.fromkeys(errors))}."
        lines += [f"## {line(f'{card.own} with {card.other}, {card.other_may}')}", "", _made_how(card), ""]
        lines += [*table(["", *(f"{radius} m" for radius in _radii(card))], card_rows(card)), "", error, ""]
        for radius in _radii(card):
            lines += [f"Areas, m², from which {radius} m cannot be kept, by speeds and relative heading:", ""]
            lines += [*table(AREA_HEADS, _areas(card, radius)), ""]
    return "\n".join(lines)


def _areas(card: Card, radius: str) -> list[list[str]]:
    return [[name, *(f"{area:.1f}" for area in areas)] for name, areas in card.areas_m2[radius].items()]


def _made_how(card: Card) -> str:
    grid = card.make_grid()
    nodes = " x ".join(str(n) for n in grid.shape)
    return (
        f"Grid {nodes}, ranges {grid.rho_first_m:g} to {grid.rho_last_m:g} m, step {card.dt_s:g} s, "
        f"{card.iterations} steps of at most {card.horizon_s / card.dt_s:.0f}, last change {card.residual_m:.4f} m."
    )


def draw_sets(values: ValueTable, radii_m: tuple[float, ...], path: Path) -> Path:
    """Draw where each radius, m, cannot be kept, in the own boat's frame, bow up; one panel a heading and speed pair.

    Raises:
        TableError: the file cannot be written.
    """
    from matplotlib.figure import Figure  # without pyplot: no window system is touched

    grid = values.card.make_grid()
    canvas = Figure(figsize=(3.4 * len(SHOWN_DEG), 3.4 * len(SPEED_SHARES)), layout="constrained", dpi=120)
    panels = canvas.subplots(len(SPEED_SHARES), len(SHOWN_DEG), squeeze=False)
    farthest = max(radii_m)
    for row, (own, other) in zip(panels, SPEED_SHARES, strict=True):
        for axis, heading in zip(row, SHOWN_DEG, strict=True):
            speeds = own * grid.own_top_mps, other * grid.other_top_mps
            farthest = max(farthest, _draw_panel(axis, values, radii_m, heading, speeds))
    for axis in panels.flat:
        axis.set(xlim=(-1.1 * farthest, 1.1 * farthest), ylim=(-1.1 * farthest, 1.1 * farthest))
    panels.flat[0].legend(fontsize=6, loc="upper left")
    title = f"{values.card.own} (bow up) with {values.card.other}, {values.card.other_may}"
    canvas.suptitle(f"{plot_text(title)}: where the other boat must not be, m")
    try:
        make_folder_of(path)
        canvas.savefig(path)
    except (OSError, ValueError) as error:
        raise TableError(f"picture {path} cannot be written ({error}); give a .png or .svg file") from error
    return path


def check_picture(path: Path | None) -> None:
    """Refuse a picture of a kind that cannot be drawn, before anything is.

    Raises:
        TableError: its ending is another than .png or .svg.
    """
    if path is not None and path.suffix.lower() not in (".png", ".svg"):
        raise TableError(f"--picture {path} does not end in .png or .svg; give a name that does")


def _draw_panel(
    axis: Any, values: ValueTable, radii_m: tuple[float, ...], heading_deg: float, speeds: tuple[float, float]
) -> float:
    """Draw one panel; returns how far its sets reach, m."""
    ring, farthest = np.linspace(0.0, 2.0 * np.pi, 181), 0.0
    for colour, radius in zip(itertools.cycle(COLOURS), sorted(radii_m, reverse=True)):
        ranges, bearings, inside = unsafe(values, radius, heading_deg, *speeds)
        x, y = ranges[:, None] * np.sin(bearings), ranges[:, None] * np.cos(bearings)
        axis.contourf(x, y, inside.astype(float), [0.5, 1.5], colors=[colour])
        axis.plot(radius * np.sin(ring), radius * np.cos(ring), color="black", lw=0.8, ls=":")
        farthest = max(farthest, float(ranges[inside.any(axis=1)].max(initial=0.0)))
        axis.fill([], [], color=colour, label=f"{radius:g} m cannot be kept")
    axis.plot(0.0, 0.0, marker=(3, 0, 0.0), color="black", ms=7)
    axis.plot(0.9, 0.1, marker=(3, 0, -heading_deg), color="black", mfc="white", ms=7, transform=axis.transAxes)
    axis.set_aspect("equal")
    axis.set_title(f"other heads {heading_deg:g}°, {speeds[0]:g} / {speeds[1]:g} m/s", fontsize=9)
    axis.tick_params(labelsize=7)
    return farthest
