"""Content of the dashboard at one time: banner, table of boats, active responses; it draws nothing itself.

Banners, columns, reasons and keys are data with their meaning; the operator's page is made from them.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console, ConsoleOptions, Group, RenderableType
from rich.layout import Layout
from rich.table import Table
from rich.text import Text
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import BoatReading, Contact, Tick
from steerclear.shield.decision import Decision, Reason
from steerclear.shield.fleet import Fleet

from ..words import count_text
from .dashboard_map import COLOURS, SYMBOLS, FieldMap
from .plain import LINES, effect_words

MOST_ACTIONS = 6  # most active responses shown as text
LOOK_AHEAD_S = 60.0  # later approaches are not shown, s
SILENT_S = 1.0  # time without a tick after which the loop is shown as standing still, s

COLUMNS = {
    "boat": (10, "its name in its team's colour, and its marks"),
    "hdg": (4, "heading, degrees clockwise from the field's y axis"),
    "m/s": (5, "speed"),
    "age": (5, "seconds since its position was true; red: older than the limit"),
    "nominal": (9, "what the policy, or a response, requests: speed m/s and heading; -: no decision"),
    "filtered": (
        9,
        "what the shield made of it, as it left; cyan: changed by the shield; *not sent*: it did not leave",
    ),
    "why": (
        9,
        "why it was sent, see below; *undecided*: stopped by its link; red: the mode that keeps it from obeying",
    ),
    "margin": (
        6,
        "room beyond the required that its manoeuvre keeps, m; red: less than required; *free*: nobody near",
    ),
    "closest": (14, "whom it meets closest when all hold course, how near and when; yellow: too near"),
    "constraint": (12, "what its command had to give way to"),
}
"""Columns of the table: characters that the longest cell needs, and meaning."""
GROWING = (("closest", 26), ("boat", 16), ("constraint", 24), ("closest", 400))
"""Columns that receive spare width, in this order, each up to a width."""
DROPPED = ("constraint", "hdg", "m/s", "age", "closest", "why", "margin")
"""Columns left out of a narrow terminal, in this order; nominal and filtered are always shown in full."""
WHY = {
    Reason.PASSED: ("passed", "green", "the nominal command leaves the boat a way out: sent as it is"),
    Reason.LEAST_CHANGE: ("least", "cyan", "changed as little as it takes to keep clear of everything"),
    Reason.QP_RELAXED: ("QP slack", "yellow", "the nearest command where not everything could be kept clear of"),
    Reason.BACKUP: ("backup", "yellow", "its backup manoeuvre, which keeps clear of all boats"),
    Reason.BEST_EFFORT: (
        "best eff.",
        "bold red",
        "no manoeuvre keeps the required distance, this one most of it: give it room, or SPACE",
    ),
    Reason.HELD: ("held", "magenta", "the nominal command is unusable: told to stop on its course"),
    Reason.NOT_COVERED: ("-", "dim", "this shield does not decide for the boat"),
    Reason.RIGHT_OF_WAY: ("way", "cyan", "two teammates kept each other from turning: one gives way, one stands on"),
    Reason.LIMITED: ("limit", "yellow", "more speed was asked than the boat can do"),
    Reason.STOPPED: (
        "stopped",
        "bold red",
        "its link's own stop: beyond the hard line bring it in by hand; off a shore it goes on once a command is clear",
    ),
}
MARKS = (("⚑", "has_flag", "carries the flag"), ("T", "tagged", "tagged"), ("O", "oob", "out of bounds"))
_RED = "bold white on red"
BANNERS = {
    "soft": (
        "STOP ALL by {0}: boats are told to stop through the shield (again, then y: past it); r resumes",
        _RED,
        "boats stop and the shield still keeps them clear; `r`, then `y`, lets the policy go on",
    ),
    "hard": (
        "STOP ALL by {0}: boats are told to stop by their links, past the shield; r resumes",
        _RED,
        "nothing keeps boats clear of each other: take them by hand, or `r` and `y`",
    ),
    "ended": (
        "The run ends ({0}): boats are left stopped",
        "bold black on yellow",
        "wait until each boat is told to be in HOLD; get others off the water",
    ),
    "nothing": ("Nothing yet", "black on yellow", "no turn of the loop yet: wait"),
    "silent": (
        "The loop stands still: no turn for {0:.1f} s",
        _RED,
        "the runner is stuck; boats stop by themselves (ArduPilot 3 s, MOOS 2 s after a command): take them by hand",
    ),
    "unknown": (
        "No boat's state is known: boats are told to stop",
        _RED,
        "telemetry of all our boats is gone: their links stop them; look at radios and feed",
    ),
    "effect": (
        "{0} in effect, see below",
        "black on yellow",
        "a fault was answered; the lines below say which boat, what is done, and how control returns",
    ),
    "fine": ("All within limits", "black on green", "nothing is declared: go on"),
}
"""Banner line: words, style, what it means and what to do."""
KEYS = (
    ("SPACE or s", "STOP ALL", "all boats stop behind the shield; again, then `y`: by their links, past it"),
    ("r", "resume", "take STOP ALL back, after a question"),
    ("o", "overrides", "switch one response off for a time, for one boat or all"),
    ("t", "take back", "take a boat back that its pilot let go of, after a question"),
    ("q", "end", "stop all boats and end the run"),
)
KEY_LINE = "   ".join(f"{key} {words}" for key, words, _ in KEYS)
HEAD = (
    ("turn N", "turns of the loop so far"),
    ("N s, blue A : B red", "the referee's clock and score; *no referee*: nobody keeps the game"),
    ("policy N", "seconds since the policy's answer was right; beyond `limits.policy` a response is due"),
    ("late N ms, at most M", "how much later than due the last 100 turns began, on average and at most"),
)


def dashboard_page() -> str:
    """Return the meaning of every line of the dashboard and of ``--plain``, for the operator's page, in Markdown."""
    parts = {
        "first line": HEAD,
        "banner": [
            (words.format("...") if "{0:" not in words else words.partition(":")[0], meaning)
            for words, _, meaning in BANNERS.values()
        ],
        "map": SYMBOLS,
        "table of boats": [(title, meaning) for title, (_, meaning) in COLUMNS.items()],
        "mark beside a name": [(mark, meaning) for mark, _, meaning in MARKS],
        "why": [(words, meaning) for words, _, meaning in WHY.values()],
        "key": [(key, f"{words}: {meaning}") for key, words, meaning in KEYS],
        "line of `--plain`": [
            (re.sub(r"{[^}]*}", "...", words).replace("  ", "(indented) "), meaning)
            for words, meaning in LINES.values()
        ],
    }
    rows = [f"| {part} | {what} | {meaning} |" for part, lines in parts.items() for what, meaning in lines]
    return "\n".join(["| where | it shows | what it means, and what to do |", "|---|---|---|", *rows])


class Approach(NamedTuple):
    """Closest approach of a boat to another within `LOOK_AHEAD_S`: m now, m then, s until then (0: they part)."""

    boat: str
    other: str
    distance_m: float
    closest_m: float
    in_s: float


def approaches(fleet: Fleet) -> dict[str, Approach]:
    """Return each controlled boat's closest approach to any other, by name; empty without another boat."""
    velocity = fleet.speed_mps[:, None] * np.column_stack([np.sin(fleet.heading_rad), np.cos(fleet.heading_rad)])
    found = {}
    for i in np.flatnonzero(fleet.controlled) if len(fleet) > 1 else ():
        apart, closing = fleet.position_m - fleet.position_m[i], velocity - velocity[i]
        square = (closing**2).sum(axis=1)
        in_s = np.clip(-(apart * closing).sum(axis=1) / np.maximum(square, 1e-9), 0.0, LOOK_AHEAD_S)
        in_s[square < 1e-9] = 0.0
        now_m, then_m = np.hypot(*apart.T), np.hypot(*(apart + in_s[:, None] * closing).T)
        now_m[i] = then_m[i] = np.inf
        j = int(np.lexsort((now_m, then_m))[0])
        found[fleet.names[i]] = Approach(
            fleet.names[i], fleet.names[j], float(now_m[j]), float(then_m[j]), float(in_s[j])
        )
    return found


@dataclass(frozen=True)
class Moment:
    """State to show: the latest tick, if any, the time on the loop's clock, s, and mean and largest delay of ticks, s.

    ``stopped`` and ``ended`` say why boats must stop and why the run ends; empty: they need not, and it continues.
    """

    tick: Tick | None
    now_s: float
    stopped: str = ""
    hard: bool = False
    ended: str = ""
    late_s: tuple[float, float] = (0.0, 0.0)
    menu: Sequence[str] = ()
    log: Sequence[str] = ()

    def banner(self) -> tuple[str, tuple[Any, ...]]:
        """Return the name of the most severe banner that applies, and its values."""
        if self.stopped:
            return "hard" if self.hard else "soft", (self.stopped,)
        if self.ended:
            return "ended", (self.ended,)
        if self.tick is None:
            return "nothing", ()
        if (silent_s := self.now_s - self.tick.began_s) > SILENT_S:
            return "silent", (silent_s,)
        if self.tick.fleet is None:
            return "unknown", ()
        count = len(self.tick.actions)
        return ("effect", (count_text(count, "response"),)) if count else ("fine", ())


class View:
    """Shows the states of one run."""

    def __init__(self, fleet: FleetFile) -> None:
        self._fleet = fleet
        self._map = FieldMap(fleet)

    def of(self, moment: Moment, columns: int, rows: int) -> RenderableType:
        """Return the whole screen, of that size in characters."""
        lower, screen = _lower(moment, columns), Layout()
        screen.split_column(
            Layout(self._head(moment), size=2),
            Layout(_Drawing(self._map, moment.tick), minimum_size=4),
            Layout(self._boats(moment, columns), size=min(len(self._fleet.boats) + 1, max(4, rows - len(lower) - 9))),
            Layout(Group(*lower, Text(KEY_LINE, "reverse")), size=min(len(lower) + 1, max(3, rows // 2))),
        )
        return screen

    def _head(self, moment: Moment) -> RenderableType:
        tick, line = moment.tick, f"steerclear, {self._fleet.team}"
        if tick is not None:
            late = f"late {1e3 * moment.late_s[0]:.1f} ms, at most {1e3 * moment.late_s[1]:.1f}"
            line = "   ".join(
                [line, f"turn {tick.number}", _score(tick.game), f"policy {_age(tick.policy_age_s)}", late]
            )
        name, values = moment.banner()
        words, style, _ = BANNERS[name]
        banner = Text(f" {words.format(*values)}".ljust(500), style, no_wrap=True, overflow="crop")
        return Group(Text(line, no_wrap=True, overflow="ellipsis"), banner)

    def _boats(self, moment: Moment, width: int) -> Table:
        tick = moment.tick
        if tick is None:
            return boats_table(width, [])
        contacts = {contact.boat: contact for contact in reversed(tick.contacts)}  # a boat's first contact counts
        decisions = {} if tick.decisions is None else {decision.boat: decision for decision in tick.decisions}
        near = {} if tick.fleet is None else approaches(tick.fleet)
        rows = []
        for boat in self._fleet.boats:
            name, reading = boat.name, tick.readings.get(boat.name)
            if reading is not None:
                oldest_s = self._fleet.limits.navigation.max_age_s
                cells = _own(reading, decisions.get(name), tick, self._near(near.get(name)), oldest_s)
            else:
                cells = _other(contacts.get(name), moment.now_s, self._fleet.limits.contact.max_age_s)
            rows.append({"boat": self._name(name, tick.game), **cells})
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
        when = f"in {approach.in_s:.0f} s" if approach.in_s > 0.5 else "now"
        return Text(f"{approach.other} {approach.closest_m:.1f} m {when}", style)


class _Drawing:
    """A map that fills its space."""

    def __init__(self, field_map: FieldMap, tick: Tick | None) -> None:
        self._map, self._tick = field_map, tick

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Text]:
        yield Text("\n").join(self._map.draw(self._tick, options.max_width, options.height or 16))


def boats_table(width: int, rows: Sequence[Mapping[str, Any]]) -> Table:
    """Return the table of boats, ``width`` characters wide; ``rows``: cells by title, missing ones are empty."""
    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False, width=max(1, width), header_style="bold")
    widths = {title: needs for title, (needs, _) in COLUMNS.items()}
    for title in DROPPED:
        if sum(widths.values()) + len(widths) > width:
            widths.pop(title, None)
    left = width - sum(widths.values()) - len(widths)
    for title, most in GROWING:
        more = max(0, min(left, most - widths.get(title, most)))
        widths |= {title: widths[title] + more} if more else {}
        left -= more
    widths["boat"] = max(1, widths["boat"] + min(left, 0))  # if the terminal is still too narrow, names shrink first
    for title, wide in widths.items():
        table.add_column(
            title,
            width=wide,
            no_wrap=True,
            overflow="crop" if title in ("nominal", "filtered") else "ellipsis",
            justify="left" if title in ("boat", "why", "closest", "constraint") else "right",
        )
    for row in rows:
        table.add_row(*(row.get(title, "") for title in widths))
    return table


def _lower(moment: Moment, columns: int) -> list[Text]:
    """Return the open menu, or the active responses and the latest log lines; long lines are wrapped."""
    actions = () if moment.tick is None else moment.tick.actions
    texts = moment.menu or [effect_words(action) for action in actions[:MOST_ACTIONS]]
    style = "bold" if moment.menu else "yellow"
    pieces = [piece for text in texts for piece in textwrap.wrap(text, max(20, columns), subsequent_indent="   ")]
    lines = [Text(piece, style, no_wrap=True, overflow="crop") for piece in pieces]
    if moment.menu:
        return lines
    if len(actions) > MOST_ACTIONS:
        lines.append(Text(f"and {len(actions) - MOST_ACTIONS} more", "yellow"))
    return lines + [Text(line, "dim", no_wrap=True, overflow="ellipsis") for line in moment.log]


def _own(reading: BoatReading, decision: Decision | None, tick: Tick, near: Text, limit_s: float) -> dict[str, Any]:
    """Return the cells of an own boat by column title."""
    is_old = reading.velocity_age_s > limit_s
    sent = tick.sent.get(reading.boat)
    sent_text = Text("-") if sent is None else Text(_command(sent.speed_mps, sent.heading_rad))
    if sent is not None and not sent.delivered:
        sent_text = Text("not sent", "bold red")
    cells = {**_seen(reading, Text(_age(reading.age_s)), is_old), "nominal": "-", "filtered": sent_text, "margin": "-"}
    if not reading.ready:
        return {**cells, "why": Text(reading.mode or "not ready", "bold red"), "closest": Text(reading.why_not, "red")}
    if decision is None:
        return {**cells, "why": Text("undecided", "red"), "closest": near}
    if decision.intervened:
        sent_text.stylize("bold cyan")
    margin_m = decision.safety_margin_m
    return {
        **cells,
        "nominal": _command(decision.nominal_speed_mps, decision.nominal_heading_rad),
        "margin": Text("free" if margin_m == math.inf else f"{margin_m:.1f}", "bold red" if margin_m < 0.0 else ""),
        "why": Text(*WHY[decision.reason][:2]),
        "closest": near,
        "constraint": ", ".join(decision.active_constraints),
    }


def _other(contact: Contact | None, now_s: float, limit_s: float) -> dict[str, Any]:
    """Return the cells of another boat by column title."""
    if contact is None:
        return {"hdg": "-", "m/s": "-", "age": Text("never", "red"), "why": Text("not heard", "red")}
    age_s = now_s - contact.fixed_s
    source = Text(f"by {contact.source}, error {contact.error_m:.1f} m", "dim")
    age = Text(_age(age_s), "bold red" if age_s > limit_s else "")
    return {**_seen(contact, age, age_s > limit_s), "why": Text("contact", "dim"), "closest": source}


def _seen(boat: BoatReading | Contact, age: Text, is_old: bool) -> dict[str, Any]:
    """Return the cells of what was seen of a boat; a speed older than its limit says nothing."""
    speed = "-" if is_old or not math.isfinite(boat.speed_mps) else f"{boat.speed_mps:.2f}"
    return {"hdg": _heading(boat.heading_rad), "m/s": speed, "age": age}


def _score(game: Mapping[str, Any]) -> str:
    if not game:
        return "no referee"
    blue, red = game.get("captures") or (0, 0)
    text = f"{float(game.get('time_s') or 0.0):.0f} s, blue {blue} : {red} red{', over' if game.get('over') else ''}"
    return f"{text} ({game['note']})" if game.get("note") else text


def _age(age_s: float) -> str:
    if not math.isfinite(age_s):
        return "never"
    return f"{age_s:.2f}" if age_s < 10.0 else f"{min(age_s, 9999.0):.0f} s"


def _heading(heading_rad: float) -> str:
    return f"{round(math.degrees(heading_rad)) % 360:03d}°" if math.isfinite(heading_rad) else "-"


def _command(speed_mps: float, heading_rad: float) -> str:
    return f"{speed_mps:.1f} {_heading(heading_rad)}" if math.isfinite(speed_mps) else "none"
