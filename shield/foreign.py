"""What comes from outside: other packages' entry points, and text made fit to be shown."""

from __future__ import annotations

import logging
import os
import traceback
import unicodedata
from collections.abc import Callable
from functools import cache
from importlib.metadata import entry_points
from types import ModuleType
from typing import Any

LOG = logging.getLogger(__name__)


@cache
def load_others(group: str, register: Callable[[Any], Any] | None = None) -> None:
    """Load what entry points of a group name, once in a process; a module registers what it has itself.

    Args:
        group: of the entry points; its last word names what they bring.
        register: takes what is no module; None: nothing is to be done with it.
    """
    for point in entry_points(group=group):
        try:
            found = point.load()
            if register is not None and not isinstance(found, ModuleType):
                register(found)
        except Exception as error:  # another package may raise anything
            what = group.rpartition(".")[2]
            LOG.warning("%s of %s cannot be loaded: %s: %s", what, point.value, type(error).__name__, error)


_HIDDEN = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")
"""Kinds of characters that draw nothing: control and format (which also turn the direction of what follows), halves of
pairs, private and unassigned ones, separators of lines and paragraphs."""


def visible(text: object, keep: str = "") -> str:
    """Write every character that would be obeyed rather than drawn as its code.

    A terminal obeys backup sequences; both it and a browser turn what follows a mark of direction round.

    Args:
        text: anything; its ``str`` is shown.
        keep: characters that stay, such as line ends.
    """
    words = str(text)
    if words.isascii() and words.isprintable():
        return words
    return "".join(letter if letter in keep or is_drawn(letter) else _code(ord(letter)) for letter in words)


def is_drawn(letter: str) -> bool:
    """Whether a character is drawn, a space among them."""
    return unicodedata.category(letter) not in _HIDDEN


def _code(number: int) -> str:
    return f"\\x{number:02x}" if number < 0x100 else f"\\u{number:04x}" if number < 0x10000 else f"\\U{number:08x}"


def plain_text(text: object, most: int = 300, lines: bool = False) -> str:
    """Text without what a terminal obeys: characters that cannot be printed become ``?``, white space one blank.

    Args:
        text: what is shown.
        most: characters of it at most.
        lines: keep line ends.
    """
    kept = str(text)[: 8 * most]
    if lines:
        return "\n".join(plain_text(line, most) for line in kept.split("\n"))[-most:]
    return "".join(c if c.isprintable() else "?" for c in " ".join(kept.split()))[:most]


_OURS = tuple(
    os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), folder, "")
    for folder in ("shield", "env", "policies", "experiments")
)
_LIBRARIES = (os.path.join("lib", "python"), f"{os.sep}site-packages{os.sep}", "<frozen ")


def describe_error(error: BaseException) -> str:
    """Type, text and place of an error raised by foreign code, in one line that a terminal can be shown.

    The place is the last line of theirs that was running; where a library or we raised, that is named after it.
    """
    try:
        text = plain_text(error)
    except Exception:  # its own __str__ may raise, too
        text = "(no text)"
    lines = [(frame.f_code.co_filename, line) for frame, line in traceback.walk_tb(error.__traceback__)]
    theirs = [place for place in lines if not place[0].startswith(_OURS) and not any(k in place[0] for k in _LIBRARIES)]
    places = [f"{file}:{line}" for file, line in dict.fromkeys([*theirs[-1:], *lines[-1:]])]
    return plain_text(f"{type(error).__name__}: {text}" + f" ({', raised in '.join(places)})" * bool(places), 900)
