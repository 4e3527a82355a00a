"""STATUSTEXT: long texts come in pieces."""

from __future__ import annotations

from typing import Any

_PIECE = 50
_MOST = 20


class Texts:
    """Joins the pieces of an autopilot's texts."""

    def __init__(self) -> None:
        self._pieces: dict[int, list[str]] = {}

    def hear(self, message: Any) -> list[str]:
        """Whole texts this message completes; pieces of an older text that lost some are given as they are."""
        text = _printable(message.text)
        if message.id == 0:
            return [text] if text else []
        done = [self._finish(key) for key in list(self._pieces) if key != message.id]
        pieces = self._pieces.setdefault(message.id, [])
        pieces.append(text)
        if len(text) < _PIECE or len(pieces) >= _MOST:
            done.append(self._finish(message.id))
        return [entry for entry in done if entry]

    def _finish(self, key: int) -> str:
        return "".join(self._pieces.pop(key))


def _printable(text: str) -> str:
    """A boat's words go to a terminal and a log: no control characters."""
    return "".join(c if c.isprintable() else "?" for c in text)
