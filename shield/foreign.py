"""Things from outside: other packages' entry points, and text made safe to display."""

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
    """Load what the entry points of a group name, once per process; a module registers its contents itself.

    Args:
        group: of the entry points; its last word names what they provide.
        register: called with what is not a module; None: it is ignored.
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
"""Unicode categories that draw nothing: control and format (which can reverse the text that follows), surrogates,
private and unassigned ones, separators of lines and paragraphs."""


def visible(text: object, keep: str = "") -> str:
    """Write every character that would act rather than be drawn as its code.

    A terminal obeys escape sequences; terminals and browsers reverse the text after a direction mark.

    Args:
        text: anything; its ``str`` is shown.
        keep: characters that stay, such as line ends.
    """
    words = str(text)
    if words.isascii() and words.isprintable():
        return words
    return "".join(letter if letter in keep or is_drawn(letter) else _code(ord(letter)) for letter in words)


def is_drawn(letter: str) -> bool:
    """Return whether a character is drawn, including a space."""
    return unicodedata.category(letter) not in _HIDDEN


def _code(number: int) -> str:
    return f"\\x{number:02x}" if number < 0x100 else f"\\u{number:04x}" if number < 0x10000 else f"\\U{number:08x}"


def plain_text(text: object, most: int = 300, lines: bool = False) -> str:
    """Return text that is safe on a terminal: unprintable characters become ``?``, white space one blank.

    Args:
        text: what is shown.
        most: largest number of characters.
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
    """Return type, text and place of an error raised by foreign code, in one line that is safe on a terminal.

    The place is the last line of foreign code that ran. If a library or this package raised, that place follows.
    """
    try:
        text = plain_text(error.msg if isinstance(error, SyntaxError) else error)
    except Exception:  # its own __str__ may raise, too
        text = "(no text)"
    lines = [(frame.f_code.co_filename, line) for frame, line in traceback.walk_tb(error.__traceback__)]
    if isinstance(error, SyntaxError) and error.filename:  # not the line that ran, but the one that does not
        lines = [(error.filename, error.lineno or 1)]
    theirs = [place for place in lines if not place[0].startswith(_OURS) and not any(k in place[0] for k in _LIBRARIES)]
    places = [f"{file}:{line}" for file, line in dict.fromkeys([*theirs[-1:], *lines[-1:]])]
    return plain_text(f"{type(error).__name__}: {text}" + f" ({', raised in '.join(places)})" * bool(places), 900)
