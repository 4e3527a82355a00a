"""The dashboard's map: field, flags, geofence, boats with their radii and headings, in dots of text."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from rich.console import Console, ConsoleOptions
from rich.text import Text
from steerclear.env.field import FieldGeometry, field_geometry
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import Tick
from steerclear.shield.exceptions import ConfigError, GameError
from steerclear.shield.jit import Array

from .rules import game_config

_BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], dtype=np.uint8)
_BLANK = 0x2800
_PER_M = 2.0
"""Dots are set at least this many times per dot's width along a line."""


class Canvas:
    """A window of the field, y upwards, both axes to one scale. Where things cross, the later one gives the colour.

    Args:
        columns: width, characters.
        rows: height, characters.
        box: (xmin, ymin, xmax, ymax) that must fit in, m.
    """

    def __init__(self, columns: int, rows: int, box: tuple[float, float, float, float]) -> None:
        self.columns, self.rows = max(1, columns), max(1, rows)
        width_m, height_m = max(box[2] - box[0], 1e-3), max(box[3] - box[1], 1e-3)
        wide, high = 2 * self.columns - 1, 4 * self.rows - 1
        self._dots_per_m = min(wide / width_m, high / height_m)
        self._left_m = 0.5 * (box[0] + box[2]) - 0.5 * wide / self._dots_per_m
        self._top_m = 0.5 * (box[1] + box[3]) + 0.5 * high / self._dots_per_m
        self._dots = np.zeros((self.rows, self.columns), dtype=np.uint8)
        self._styles = np.zeros((self.rows, self.columns), dtype=np.int64)
        self._letters: dict[tuple[int, int], str] = {}
        self._palette = [""]

    def line(self, start: tuple[float, float], end: tuple[float, float], style: str, every: int = 1) -> None:
        """A straight line between two points, m; of its dots only each ``every``-th is set."""
        length = math.hypot(end[0] - start[0], end[1] - start[1])
        n = max(2, math.ceil(length * self._dots_per_m * (_PER_M if every == 1 else 1.0)))
        share = np.linspace(0.0, 1.0, n)[::every]
        self._set(start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]), style)

    def box(self, box: tuple[float, float, float, float], style: str, every: int = 1) -> None:
        """The outline of (xmin, ymin, xmax, ymax), m."""
        corners = [(box[0], box[1]), (box[2], box[1]), (box[2], box[3]), (box[0], box[3])]
        for k in range(4):
            self.line(corners[k - 1], corners[k], style, every)

    def circle(self, centre: tuple[float, float], radius_m: float, style: str) -> None:
        """The outline of a circle, m."""
        n = min(2000, max(8, math.ceil(2.0 * math.pi * radius_m * self._dots_per_m)))
        angle = np.linspace(0.0, 2.0 * math.pi, n, endpoint=False)
        self._set(centre[0] + radius_m * np.sin(angle), centre[1] + radius_m * np.cos(angle), style)

    def label(self, place: tuple[float, float], text: str, style: str, above: int = 0) -> None:
        """A text whose first letter is at a point, m, so many rows above it, or near there where it is free."""
        column, at = self._cell(place)
        if column is None or at is None:
            return
        column = min(column, max(0, self.columns - len(text)))
        text = text[: self.columns - column]
        rows = [min(self.rows - 1, max(0, at - above - off)) for off in (0, -2 * above, 1, -2 * above - 1)]
        row = next((row for row in rows if self._is_free(row, column, len(text))), rows[0])
        for k, letter in enumerate(text):
            self._letters[row, column + k] = letter
            self._styles[row, column + k] = self._number(style)

    def lines(self) -> list[Text]:
        """The drawing, a text per row."""
        return [self._row(row) for row in range(self.rows)]

    def _is_free(self, row: int, column: int, length: int) -> bool:
        return not any((row, column + k) in self._letters for k in range(length))

    def _row(self, row: int) -> Text:
        letters = [chr(_BLANK + dots) for dots in self._dots[row].tolist()]
        for column in range(self.columns):
            letters[column] = self._letters.get((row, column), letters[column])
        text = Text("".join(letters), no_wrap=True, end="")
        ends = [*(np.flatnonzero(np.diff(self._styles[row])) + 1).tolist(), self.columns]
        for start, end in zip([0, *ends], ends, strict=False):
            text.stylize(self._palette[self._styles[row, start]], start, end)
        return text

    def _cell(self, place: tuple[float, float]) -> tuple[int | None, int | None]:
        x = np.rint((place[0] - self._left_m) * self._dots_per_m)
        y = np.rint((self._top_m - place[1]) * self._dots_per_m)
        if not (0.0 <= x < 2 * self.columns and 0.0 <= y < 4 * self.rows):
            return None, None
        return int(x) // 2, int(y) // 4

    def _set(self, x_m: Array, y_m: Array, style: str) -> None:
        x = np.rint((x_m - self._left_m) * self._dots_per_m)
        y = np.rint((self._top_m - y_m) * self._dots_per_m)
        inside = (x >= 0.0) & (x < 2 * self.columns) & (y >= 0.0) & (y < 4 * self.rows)
        columns, rows = x[inside].astype(np.int64), y[inside].astype(np.int64)
        np.bitwise_or.at(self._dots, (rows // 4, columns // 2), _BITS[rows % 4, columns % 2])
        self._styles[rows // 4, columns // 2] = self._number(style)

    def _number(self, style: str) -> int:
        if style not in self._palette:
            self._palette.append(style)
        return self._palette.index(style)


COLOURS = ("bright_blue", "bright_red", "bright_white")
"""Of blue, red and boats outside the game."""
SYMBOLS = (
    ("small circle and line", "a boat in its team's colour, and the way it makes in 2 s"),
    ("large circle", "around a boat of ours: its separation radius, where nobody else should be"),
    ("yellow circle", "how wrong the boat's place may be, where that is more than 0.5 m"),
    ("grey circles", "obstacles, and the circle of our flag, that our boats keep out of"),
    ("solid box, dotted box", "the field, and the geofence"),
    ("⚑", "a flag, where it is now"),
)
"""What is drawn, for the operator's page."""
AHEAD_S = 2.0
"""The line before a boat is the way it makes in this time, s."""
MARGIN_M = 4.0
FAR_M = 60.0
"""Boats further than this from the field are not fitted in."""


class FieldMap:
    """Draws ticks. Build one per run.

    Args:
        fleet: the file.
    """

    def __init__(self, fleet: FleetFile) -> None:
        self._fleet = fleet
        width, height = fleet.field.size_m
        self._field = (0.0, 0.0, float(width), float(height))
        self._lines = _geometry(fleet)
        self._separation_m = fleet.shield_config.separation_m

    def draw(self, tick: Tick | None, columns: int, rows: int) -> list[Text]:
        """The map as lines of text, for a tick or for none yet."""
        places = {} if tick is None else places_of(tick)
        canvas = Canvas(columns, rows, self._window(places))
        canvas.box(self._fleet.geofence.box, "grey50", every=3)
        canvas.box(self._field, "white")
        game = {} if tick is None else tick.game
        if self._lines is not None:
            self._draw_lines(canvas, self._lines, game)
        for x, y, radius in _circles(tick):
            canvas.circle((x, y), radius, "grey50")
        errors = {} if tick is None else _errors(tick)
        for name, (x, y, heading, speed) in places.items():
            self._draw_boat(canvas, name, (x, y), heading, speed, errors.get(name, 0.0))
        for name, (x, y, _, _) in places.items():
            canvas.label((x, y), _short(name), f"bold {self._colour(name)}", above=1)
        return canvas.lines()

    def columns_for(self, tick: Tick | None, rows: int) -> int:
        """Most columns that the map fills when it has so many rows: further ones stay empty."""
        low_x, low_y, high_x, high_y = self._window({} if tick is None else places_of(tick))
        return math.ceil(0.5 * (4 * rows - 1) * (high_x - low_x) / max(high_y - low_y, 1e-3)) + 1

    def _draw_lines(self, canvas: Canvas, lines: FieldGeometry, game: Mapping[str, object]) -> None:
        canvas.line(tuple(lines.scrimmage[0]), tuple(lines.scrimmage[1]), "grey50", every=2)
        flags = game.get("flags")
        for team, home in enumerate(lines.flag_home):
            place = (float(home[0]), float(home[1]))
            if isinstance(flags, (list, tuple)) and len(flags) == 2:
                place = (float(flags[team]["x_m"]), float(flags[team]["y_m"]))
            canvas.label(place, "⚑", COLOURS[team])

    def _draw_boat(
        self, canvas: Canvas, name: str, place: tuple[float, float], heading: float, speed: float, error_m: float
    ) -> None:
        colour = self._colour(name)
        ahead = self._separation_m * 0.6 + abs(speed) * AHEAD_S
        canvas.line(place, (place[0] + ahead * math.sin(heading), place[1] + ahead * math.cos(heading)), colour)
        canvas.circle(place, 0.5, colour)
        if self._fleet.team_of.get(name) == self._fleet.team_number:
            canvas.circle(place, self._separation_m, colour)
        if error_m > 0.5:
            canvas.circle(place, error_m, "yellow")

    def _window(self, places: Mapping[str, tuple[float, float, float, float]]) -> tuple[float, float, float, float]:
        near = np.array(
            [(x, y) for x, y, _, _ in places.values() if self._is_near(x, y)] + [self._field[:2], self._field[2:]]
        )
        low, high = near.min(axis=0) - MARGIN_M, near.max(axis=0) + MARGIN_M
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def _is_near(self, x: float, y: float) -> bool:
        return -FAR_M <= x <= self._field[2] + FAR_M and -FAR_M <= y <= self._field[3] + FAR_M

    def _colour(self, name: str) -> str:
        return COLOURS[self._fleet.team_of.get(name, 2)]


class Drawing:
    """A map as large as the place it is put in.

    Args:
        field_map: draws it.
        tick: what to draw.
    """

    def __init__(self, field_map: FieldMap, tick: Tick | None) -> None:
        self._map, self._tick = field_map, tick

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Text]:
        lines = self._map.draw(self._tick, options.max_width, options.height or 16)
        yield Text("\n").join(lines)


def places_of(tick: Tick) -> dict[str, tuple[float, float, float, float]]:
    """Where boats are: x m, y m, heading rad, speed m/s by name; as the shield was given it, else as heard."""
    heard = reversed(tick.contacts)  # of several contacts of a boat the first counts
    places = {contact.boat: (*contact.position_m, contact.heading_rad, contact.speed_mps) for contact in heard}
    for name, reading in tick.readings.items():
        places[name] = (*reading.position_m, reading.heading_rad, reading.speed_mps)
    if tick.fleet is not None:
        rows = zip(tick.fleet.names, tick.fleet.position_m, tick.fleet.heading_rad, tick.fleet.speed_mps, strict=True)
        for name, position, heading, speed in rows:
            places[name] = (float(position[0]), float(position[1]), float(heading), float(speed))
    return {name: row for name, row in places.items() if all(map(math.isfinite, row))}


def _circles(tick: Tick | None) -> tuple[tuple[float, float, float], ...]:
    """Round things the shield keeps boats of ours out of: obstacles, the own flag's circle; x m, y m, radius m."""
    around = None if tick is None else tick.surroundings
    return () if around is None else (*around.circles, *around.stops)


def _errors(tick: Tick) -> dict[str, float]:
    if tick.fleet is None or tick.fleet.position_error_m is None:
        return {}
    return dict(zip(tick.fleet.names, map(float, tick.fleet.position_error_m), strict=True))


def _geometry(fleet: FleetFile) -> FieldGeometry | None:
    try:
        return field_geometry(game_config(fleet))
    except (ConfigError, GameError):  # boats without a game have a field without lines
        return None


def _short(name: str) -> str:
    return name if len(name) <= 8 else f"{name[:7]}…"
