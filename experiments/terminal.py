"""Writing to a terminal: nothing from outside is obeyed by it, and nothing it cannot show stops the program."""

from __future__ import annotations

import codecs
import logging
import sys
import unicodedata
from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.text import Text
from steerclear.shield.foreign import visible

ERRORS = "steerclear-plain"
"""Name under which `plain` is known to Python's encoders."""

_PLAIN = {
    "°": " deg", "±": "+-", "×": "x", "·": "-", "…": "...", "–": "-", "—": "-", "−": "-", "→": "->", "←": "<-",
    "≤": "<=", "≥": ">=", "⚑": "F", "▶": ">", "²": "2", "µ": "u", "∞": "inf", "’": "'", "“": '"', "”": '"',
}  # fmt: skip
_LINES = {"HORIZONTAL": "-", "VERTICAL": "|"}


class SafeConsole(Console):
    """A console that takes no markup, and shows characters that would be obeyed as codes.

    What is styled is styled by ``Text``; brackets in a name are brackets.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"highlight": False, "markup": False, "emoji": False, **options})

    def render_str(self, text: str, **options: Any) -> Text:  # type: ignore[override]
        """Make text of a string, whose codes then have room where it stands; see rich."""
        return super().render_str(visible(text, keep="\n"), **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield the segments of what is drawn; see rich."""
        for segment in super().render(renderable, options):
            text, style, control = segment
            yield segment if control else Segment(visible(text, keep="\n"), style)


class SafeFormatter(logging.Formatter):
    """Writes a record of the log in one line that a terminal only shows."""

    def format(self, record: logging.LogRecord) -> str:
        """The record's line; lines of a traceback stay lines."""
        return visible(super().format(record), keep="\n")


def prepare() -> None:
    """Make this program's output fit for whatever it goes to: once, when the command starts."""
    codecs.register_error(ERRORS, _replace)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors=ERRORS)
    if logging.lastResort is not None:
        logging.lastResort.setFormatter(SafeFormatter("%(message)s"))


def plain(text: str) -> str:
    """Write a text in ASCII: signs by their meaning, lines of boxes as lines, the rest as question marks."""
    return "".join(letter if letter.isascii() else _plain_letter(letter) for letter in text)


def _replace(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return plain(error.object[error.start : error.end]), error.end


def _plain_letter(letter: str) -> str:
    if letter in _PLAIN:
        return _PLAIN[letter]
    if "\u2800" <= letter <= "\u28ff":  # dots of a drawing
        count = (ord(letter) - 0x2800).bit_count()
        return " " if count == 0 else "." if count < 4 else "#"
    if "\u2500" <= letter <= "\u259f":  # boxes and blocks
        name = unicodedata.name(letter, "")
        line = next((line for word, line in _LINES.items() if name.endswith(word) and " AND " not in name), "+")
        return "#" if "BLOCK" in name else line
    base = unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode()
    return base or "?"
