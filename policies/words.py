"""Words of foreign code, made safe to show."""

from __future__ import annotations


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
