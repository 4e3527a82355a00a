"""The dashboard's map in text dots: field, flags, geofence, and boats with radii and headings."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.text import Text
from steerclear.env.field import FieldGeometry, field_geometry
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import Tick
from steerclear.shield.exceptions import ConfigError, GameError

from .referee import game_config

_BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], dtype=np.uint8)
_BLANK = 0x2800
COLOURS = ("bright_blue", "bright_red", "bright_white")  # colours of blue, red and boats outside the game
SYMBOLS = (
    ("small circle and line", "a boat in its team's colour, and the way it makes in 2 s"),
    ("large circle", "around a boat of ours: its separation, where nobody else should be"),
    ("yellow circle", "how wrong the boat's place may be, where that is more than 0.5 m"),
    ("grey circles", "obstacles, and the circle of our flag, that our boats keep out of"),
    ("solid box, dotted box", "the field, and the geofence"),
    ("⚑", "a flag, where it is now"),
)
"""Drawn symbols, for the operator's page."""
AHEAD_S = 2.0  # the line ahead of a boat is its way in this time, s
MARGIN_M, FAR_M = 4.0, 60.0  # margin around the map, m; boats further than `FAR_M` from the field are not fitted in


class Canvas:
    """A window of columns x rows characters that contains a box (xmin, ymin, xmax, ymax), m.

    Y points up and both axes have the same scale. Where things overlap, the later one sets the colour.
    """

    def __init__(self, columns: int, rows: int, box: Sequence[float]) -> None:
        self.columns, self.rows = max(1, columns), max(1, rows)
        low, high, dots = np.array(box[:2]), np.array(box[2:]), np.array([2 * self.columns - 1, 4 * self.rows - 1])
        self._per_m = float((dots / np.maximum(high - low, 1e-3)).min())
        self._corner = 0.5 * (low + high) + np.array([-0.5, 0.5]) * dots / self._per_m
        self._dots = np.zeros((self.rows, self.columns), dtype=np.uint8)
        self._styles = np.full((self.rows, self.columns), "", dtype=object)
        self._letters: dict[tuple[int, int], str] = {}

    def line(self, start: Any, end: Any, style: str, every: int = 1) -> None:
        """Draw a line between two points, m, with every ``every``-th dot."""
        n = max(2, math.ceil(math.dist(start, end) * self._per_m * (2.0 if every == 1 else 1.0)))
        share = np.linspace(0.0, 1.0, n)[::every, None]
        self._set(np.add(start, share * np.subtract(end, start)), style)

    def box(self, box: Sequence[float], style: str, every: int = 1) -> None:
        """Draw the outline of (xmin, ymin, xmax, ymax), m."""
        corners = [(box[0], box[1]), (box[2], box[1]), (box[2], box[3]), (box[0], box[3])]
        for k in range(4):
            self.line(corners[k - 1], corners[k], style, every)

    def circle(self, centre: Any, radius_m: float, style: str) -> None:
        """Draw the outline of a circle, m."""
        n = min(2000, max(8, math.ceil(2.0 * math.pi * radius_m * self._per_m)))
        angle = np.linspace(0.0, 2.0 * math.pi, n, endpoint=False)
        self._set(np.add(centre, radius_m * np.column_stack([np.sin(angle), np.cos(angle)])), style)

    def label(self, place: Any, text: str, style: str, above: int = 0) -> None:
        """Write a text from a point, m, ``above`` rows higher, or in a free row nearby."""
        cells = self._inside(np.array([place], dtype=float))
        if len(cells) == 0:
            return
        column, at = int(cells[0, 0]) // 2, int(cells[0, 1]) // 4
        column = min(column, max(0, self.columns - len(text)))
        text = text[: self.columns - column]
        rows = [min(self.rows - 1, max(0, at - above - off)) for off in (0, -2 * above, 1, -2 * above - 1)]
        taken = [any((row, column + k) in self._letters for k in range(len(text))) for row in rows]
        row = rows[taken.index(False) if False in taken else 0]
        self._letters.update({(row, column + k): letter for k, letter in enumerate(text)})
        self._styles[row, column : column + len(text)] = style

    def lines(self) -> list[Text]:
        """Return the drawing, a text per row."""
        found = []
        for row in range(self.rows):
            text = Text(no_wrap=True, end="")
            for column in range(self.columns):
                letter = self._letters.get((row, column), chr(_BLANK + int(self._dots[row, column])))
                text.append(letter, self._styles[row, column] or None)
            found.append(text)
        return found

    def _inside(self, points: Any) -> Any:
        """Return dots (k, 2), from the upper left corner, for the points (n, 2) in the window."""
        dots = np.rint((points - self._corner) * (self._per_m, -self._per_m))
        fits = (dots >= 0.0) & (dots < (2 * self.columns, 4 * self.rows))
        return dots[fits.all(axis=1)].astype(np.int64)

    def _set(self, points: Any, style: str) -> None:
        x, y = self._inside(points).T
        np.bitwise_or.at(self._dots, (y // 4, x // 2), _BITS[y % 4, x % 2])
        self._styles[y // 4, x // 2] = style


class FieldMap:
    """Draws ticks. Build one per run."""

    def __init__(self, fleet: FleetFile) -> None:
        self._fleet = fleet
        self._field = (0.0, 0.0, *map(float, fleet.field.size_m))
        self._separation_m = fleet.shield_config.separation_m
        self._lines: FieldGeometry | None = None
        with contextlib.suppress(ConfigError, GameError):  # without a game the field has no lines
            self._lines = field_geometry(game_config(fleet))

    def draw(self, tick: Tick | None, columns: int, rows: int) -> list[Text]:
        """Return the map as lines of text; ``tick`` is None before the first."""
        canvas = Canvas(columns, rows, self._window(tick))
        canvas.box(self._fleet.geofence.box, "grey50", every=3)
        canvas.box(self._field, "white")
        if self._lines is not None:
            start, end = self._lines.scrimmage
            canvas.line(start, end, "grey50", every=2)
            flags: Any = None if tick is None else tick.game.get("flags")
            homes: Any = self._lines.flag_home
            if isinstance(flags, list | tuple) and len(flags) == 2:
                homes = [(flag["x_m"], flag["y_m"]) for flag in flags]
            for place, colour in zip(homes, COLOURS, strict=False):
                canvas.label(place, "⚑", colour)
        if tick is not None:
            self._draw_boats(canvas, tick)
        return canvas.lines()

    def _draw_boats(self, canvas: Canvas, tick: Tick) -> None:
        around = () if tick.surroundings is None else (*tick.surroundings.circles, *tick.surroundings.stops)
        for x, y, radius_m in around:
            canvas.circle((x, y), radius_m, "grey50")
        errors = {}
        if tick.fleet is not None and tick.fleet.position_error_m is not None:
            errors = dict(zip(tick.fleet.names, tick.fleet.position_error_m.tolist(), strict=True))
        places = places_of(tick)
        for name, (x, y, heading, speed) in places.items():
            team = self._fleet.team_of.get(name, 2)
            ahead = self._separation_m * 0.6 + abs(speed) * AHEAD_S
            canvas.line((x, y), (x + ahead * math.sin(heading), y + ahead * math.cos(heading)), COLOURS[team])
            canvas.circle((x, y), 0.5, COLOURS[team])
            if team == self._fleet.team_number:
                canvas.circle((x, y), self._separation_m, COLOURS[team])
            if errors.get(name, 0.0) > 0.5:
                canvas.circle((x, y), errors[name], "yellow")
        for name, (x, y, *_) in places.items():
            short = name if len(name) <= 8 else f"{name[:7]}…"
            canvas.label((x, y), short, f"bold {COLOURS[self._fleet.team_of.get(name, 2)]}", above=1)

    def _window(self, tick: Tick | None) -> tuple[float, ...]:
        """Return the shown window (xmin, ymin, xmax, ymax), m: the field and all boats not far from it."""
        low, high = np.array(self._field[:2]), np.array(self._field[2:])
        places = np.array([row[:2] for row in places_of(tick).values()] if tick else []).reshape(-1, 2)
        near = places[((places >= low - FAR_M) & (places <= high + FAR_M)).all(axis=1)]
        shown = np.concatenate([near, [low, high]])
        return (*(shown.min(axis=0) - MARGIN_M).tolist(), *(shown.max(axis=0) + MARGIN_M).tolist())


def places_of(tick: Tick) -> dict[str, tuple[float, float, float, float]]:
    """Return x m, y m, heading rad and speed m/s by name: the shield's input if known, else as received."""
    known: list[Any] = [*reversed(tick.contacts), *tick.readings.values()]  # of a boat's contacts the first counts
    places = {one.boat: (*one.position_m, one.heading_rad, one.speed_mps) for one in known}
    if tick.fleet is not None:
        rows = np.column_stack([tick.fleet.position_m, tick.fleet.heading_rad, tick.fleet.speed_mps])
        places |= {name: tuple(row) for name, row in zip(tick.fleet.names, rows.tolist(), strict=True)}
    return {name: row for name, row in places.items() if all(map(math.isfinite, row))}
