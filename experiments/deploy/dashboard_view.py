"""What the dashboard shows of one moment: banner, table of boats, what is in effect; draws nothing by itself.

Banners, columns, reasons and keys are data with their meaning, of which the operator's page is made.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.layout import Layout
from rich.table import Table
from rich.text import Text
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import BoatReading, Contact, Tick
from steerclear.shield.decision import Decision
from steerclear.shield.fleet import Fleet
from steerclear.shield.jit import Array

from .dashboard_lines import BANNERS, COLUMNS, DROPPED, GROWING, KEYS, MARKS, WHY
from .dashboard_map import COLOURS, Drawing, FieldMap

LOOK_AHEAD_S = 60.0
"""Approaches later than this are not looked for."""


@dataclass(frozen=True)
class Approach:
    """Two boats and their closest approach.

    Attributes:
        boat, other: names.
        distance_m: now, m.
        closest_m: least distance within `LOOK_AHEAD_S`, m.
        in_s: time until then, s; 0 when they draw apart.
    """

    boat: str
    other: str
    distance_m: float
    closest_m: float
    in_s: float


def approaches(fleet: Fleet) -> dict[str, Approach]:
    """The closest approach of each controlled boat to any other, by its name; none without another boat."""
    velocity = fleet.speed_mps[:, None] * np.stack([np.sin(fleet.heading_rad), np.cos(fleet.heading_rad)], axis=1)
    found = {}
    for i in np.flatnonzero(fleet.controlled):
        pairs = [_approach(fleet, velocity, int(i), j) for j in range(len(fleet)) if j != i]
        if pairs:
            found[fleet.names[i]] = min(pairs, key=lambda pair: (pair.closest_m, pair.distance_m))
    return found


def _approach(fleet: Fleet, velocity: Array, i: int, j: int) -> Approach:
    apart = fleet.position_m[j] - fleet.position_m[i]
    closing = velocity[j] - velocity[i]
    square = float(closing @ closing)
    in_s = 0.0 if square < 1e-9 else min(LOOK_AHEAD_S, max(0.0, -float(apart @ closing) / square))
    closest = apart + in_s * closing
    distance_m = math.hypot(*apart.tolist())
    return Approach(fleet.names[i], fleet.names[j], distance_m, math.hypot(*closest.tolist()), in_s)


WIDE = 150
"""From this many columns on the table stands beside the map."""
MOST_ACTIONS = 6
SILENT_S = 1.0
"""A loop without a tick for so long is shown as standing still."""
GAP = 1
"""Between columns of the table, characters."""


BESIDE = sum(column.width + GAP for column in COLUMNS) + 12
"""Width with every column: what the table has beside the map. Below it ``bound by`` is left out."""
KEY_LINE = "   ".join(f"{key} {words}" for key, words, _ in KEYS)


def fitting(width: int) -> dict[str, int]:
    """Columns that a width has room for, with the width of each."""
    widths = {column.title: column.width for column in COLUMNS if width >= BESIDE or column.title != "bound by"}
    for title in DROPPED:
        if sum(widths.values()) + GAP * len(widths) > width:
            widths.pop(title, None)
    left = width - sum(widths.values()) - GAP * len(widths)
    for title, most in GROWING:
        more = max(0, min(left, most - widths.get(title, most)))
        if more:
            widths[title] += more
            left -= more
    widths["boat"] = max(1, widths["boat"] + min(left, 0))  # a terminal too narrow for the least: names go first
    return widths


def boats_table(width: int, rows: list[Mapping[str, Any]]) -> Table:
    """The table.

    Args:
        width: characters there are.
        rows: cells by title; those left out are empty.
    """
    table = Table(box=None, padding=(0, GAP, 0, 0), pad_edge=False, width=max(1, width), header_style="bold")
    widths = fitting(width)
    for title, wide in widths.items():
        table.add_column(
            title,
            width=wide,
            no_wrap=True,
            overflow="crop" if title in ("wanted", "sent") else "ellipsis",
            justify="left" if title in ("boat", "why", "closest", "bound by") else "right",
        )
    for row in rows:
        table.add_row(*(row.get(title, "") for title in widths))
    return table


@dataclass(frozen=True)
class Moment:
    """What is to be shown.

    Attributes:
        tick: the latest; None: none yet.
        now_s: on the loop's clock, s.
        stopped: why all boats are told to stop; empty: they are not.
        hard: whether past the shield.
        ended: why the run ends; empty: it goes on.
        late_s: mean and worst delay of ticks of late, s.
        menu: lines of an open menu.
        log: latest lines of the log.
    """

    tick: Tick | None
    now_s: float
    stopped: str = ""
    hard: bool = False
    ended: str = ""
    late_s: tuple[float, float] = (0.0, 0.0)
    menu: Sequence[str] = ()
    log: Sequence[str] = ()


class View:
    """Shows moments of one run.

    Args:
        fleet: the file.
    """

    def __init__(self, fleet: FleetFile) -> None:
        self._fleet = fleet
        self._map = FieldMap(fleet)

    def of(self, moment: Moment, columns: int, rows: int) -> RenderableType:
        """The whole screen, so many characters large."""
        lower = _lower(moment, columns)
        height = len(lower) + 1
        table_rows = len(self._fleet.boats) + 1
        screen, body = Layout(), Layout(name="body")
        drawing = Layout(Drawing(self._map, moment.tick), name="map", minimum_size=4)
        if columns >= WIDE:
            # the map takes what it can fill at this height, the table all the rest
            useful = self._map.columns_for(moment.tick, max(4, rows - 2 - height))
            drawing.size = min(useful, columns - BESIDE)
            body.split_row(drawing, Layout(self._boats(moment, columns - drawing.size), name="boats"))
        else:
            boats = Layout(self._boats(moment, columns), name="boats")
            boats.size = min(table_rows, max(4, rows - height - 8))
            body.split_column(drawing, boats)
        screen.split_column(
            Layout(self._head(moment), size=2),
            body,
            Layout(Group(*lower, Text(KEY_LINE, "reverse")), size=min(height, max(3, rows // 2))),
        )
        return screen

    def _head(self, moment: Moment) -> RenderableType:
        tick = moment.tick
        line = Text(f"steerclear, {self._fleet.team}", no_wrap=True, overflow="ellipsis")
        if tick is not None:
            line.append(f"   tick {tick.number}")
            line.append(f"   {_score(tick.game)}")
            line.append(f"   policy {_age(tick.policy_age_s)}")
            line.append(f"   late {1e3 * moment.late_s[0]:.1f} ms, at most {1e3 * moment.late_s[1]:.1f}")
        return Group(line, self._banner(moment))

    def _banner(self, moment: Moment) -> Text:
        name, values = _state(moment)
        banner = BANNERS[name]
        text = f" {banner.words.format(*values)}".ljust(500)
        return Text(text, banner.style, no_wrap=True, overflow="crop")

    def _boats(self, moment: Moment, width: int) -> Table:
        tick = moment.tick
        if tick is None:
            return boats_table(width, [])
        rows = []
        contacts = {contact.boat: contact for contact in reversed(tick.contacts)}  # of several the first counts
        decisions = {} if tick.decisions is None else {decision.boat: decision for decision in tick.decisions}
        near = {} if tick.fleet is None else approaches(tick.fleet)
        for boat in self._fleet.boats:
            name: dict[str, Any] = {"boat": self._name(boat.name, tick.game)}
            reading = tick.readings.get(boat.name)
            if reading is not None:
                rows.append(name | _own(reading, decisions.get(boat.name), tick, self._near(near.get(boat.name))))
            else:
                rows.append(name | _other(contacts.get(boat.name), moment.now_s, self._fleet.limits.contact.max_age_s))
        return boats_table(width, rows)

    def _name(self, name: str, game: Mapping[str, Any]) -> Text:
        status = (game.get("boats") or {}).get(name) or {}
        marks = "".join(mark for mark, key, _ in MARKS if status.get(key))
        text = Text(name, COLOURS[self._fleet.team_of.get(name, 2)])
        return text.append(f" {marks}", "bold yellow") if marks else text

    def _near(self, approach: Approach | None) -> Text:
        if approach is None:
            return Text("")
        limit = self._fleet.shield_config.separation_m
        style = "bold red" if approach.distance_m < limit else "yellow" if approach.closest_m < limit else ""
        when = f" in {approach.in_s:.0f} s" if approach.in_s > 0.5 else " now"
        return Text(f"{approach.other} {approach.closest_m:.1f} m{when}", style)


def _state(moment: Moment) -> tuple[str, tuple[Any, ...]]:
    """Which of `BANNERS` stands there, and what is filled in: the worst that is so."""
    tick = moment.tick
    if moment.stopped:
        return "hard" if moment.hard else "soft", (moment.stopped,)
    if moment.ended:
        return "ended", (moment.ended,)
    if tick is None:
        return "nothing", ()
    if moment.now_s - tick.began_s > SILENT_S:
        return "silent", (moment.now_s - tick.began_s,)
    if tick.fleet is None:
        return "unknown", ()
    count = len(tick.actions)
    return ("effect", (f"{count} response{'s' if count > 1 else ''}",)) if count else ("fine", ())


def _lower(moment: Moment, columns: int) -> list[Text]:
    """The open menu, or what is in effect and the end of the log; long lines are broken."""
    if moment.menu:
        return [line for text in moment.menu for line in _broken(text, "bold", columns)]
    actions = () if moment.tick is None else moment.tick.actions
    lines = [
        line
        for action in actions[:MOST_ACTIONS]
        for line in _broken(f"{action.subject}: {action.text}", "yellow", columns)
    ]
    if len(actions) > MOST_ACTIONS:
        lines.append(Text(f"and {len(actions) - MOST_ACTIONS} more", "yellow"))
    return lines + [Text(line, "dim", no_wrap=True, overflow="ellipsis") for line in moment.log]


def _broken(text: str, style: str, columns: int) -> list[Text]:
    pieces = textwrap.wrap(text, max(20, columns), subsequent_indent="   ") or [""]
    return [Text(piece, style, no_wrap=True, overflow="crop") for piece in pieces]


def _own(reading: BoatReading, decision: Decision | None, tick: Tick, near: Text) -> dict[str, Any]:
    """Cells of a boat of ours, by the column's title."""
    sent = tick.sent.get(reading.boat)
    seen = _seen(reading.heading_rad, reading.speed_mps, Text(_age(reading.age_s)))
    sent_text = Text("-") if sent is None else Text(_command(sent.speed_mps, sent.heading_rad))
    if sent is not None and not sent.delivered:
        sent_text = Text("not sent", "bold red")
    cells = {**seen, "wanted": "-", "sent": sent_text, "margin": "-", "closest": near}
    if not reading.ready:
        mode = Text(reading.mode or "not ready", "bold red")
        return {**cells, "why": mode, "closest": Text(reading.why_not, "red")}
    if decision is None:
        return {**cells, "why": Text("undecided", "red")}
    if decision.intervened:
        sent_text.stylize("bold cyan")
    wanted = _command(decision.nominal_speed_mps, decision.nominal_heading_rad)
    margin = Text("free" if decision.safety_margin_m == math.inf else f"{decision.safety_margin_m:.1f}")
    if decision.safety_margin_m < 0.0:
        margin.stylize("bold red")
    why = {"why": Text(*WHY[decision.reason][:2]), "bound by": ", ".join(decision.active_constraints)}
    return {**cells, "wanted": wanted, "margin": margin, **why}


def _other(contact: Contact | None, now_s: float, limit_s: float) -> dict[str, Any]:
    """Cells of another boat, by the column's title."""
    if contact is None:
        return {**_seen(math.nan, math.nan, Text("never", "red")), "why": Text("not heard", "red")}
    age_s = now_s - contact.fixed_s
    age = Text(_age(age_s), "bold red" if age_s > limit_s else "")
    told = Text(f"by {contact.source}, error {contact.error_m:.1f} m", "dim")
    return {**_seen(contact.heading_rad, contact.speed_mps, age), "why": Text("contact", "dim"), "closest": told}


def _seen(heading_rad: float, speed_mps: float, age: Text) -> dict[str, Any]:
    return {"hdg": _heading(heading_rad), "m/s": _speed(speed_mps), "age": age}


def _score(game: Mapping[str, Any]) -> str:
    if not game:
        return "no referee"
    blue, red = game.get("captures") or (0, 0)
    text = f"{float(game.get('time_s') or 0.0):.0f} s, blue {blue} : {red} red"
    if game.get("over"):
        text += ", over"
    return f"{text} ({game['note']})" if game.get("note") else text


def _age(age_s: float) -> str:
    if not math.isfinite(age_s):
        return "never"
    return f"{age_s:.2f}" if age_s < 10.0 else f"{min(age_s, 9999.0):.0f} s"


def _heading(heading_rad: float) -> str:
    return f"{round(math.degrees(heading_rad)) % 360:03d}°" if math.isfinite(heading_rad) else "-"


def _speed(speed_mps: float) -> str:
    return f"{speed_mps:.2f}" if math.isfinite(speed_mps) else "-"


def _command(speed_mps: float, heading_rad: float) -> str:
    return f"{speed_mps:.1f} {_heading(heading_rad)}" if math.isfinite(speed_mps) else "none"
