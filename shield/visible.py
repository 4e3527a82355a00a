"""Text from outside, made fit to be shown: names of boats, teams, policies and files, what logs and peers say."""

from __future__ import annotations

import unicodedata

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
    return "".join(letter if letter in keep or is_drawn(letter) else _code(letter) for letter in words)


def is_drawn(letter: str) -> bool:
    """Whether a character is drawn, a space among them."""
    return unicodedata.category(letter) not in _HIDDEN


def _code(letter: str) -> str:
    number = ord(letter)
    return f"\\x{number:02x}" if number < 0x100 else f"\\u{number:04x}" if number < 0x10000 else f"\\U{number:08x}"
