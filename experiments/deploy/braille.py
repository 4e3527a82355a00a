"""A drawing of dots in text: each character holds 2 x 4 of them."""

from __future__ import annotations

import math

import numpy as np
from rich.text import Text
from steerclear.shield.jit import Array

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
