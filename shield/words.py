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


def describe_error(error: BaseException) -> str:
    """Type, text and place of an error raised by foreign code, in one line that a terminal can be shown."""
    try:
        text = plain_text(error)
    except Exception:  # its own __str__ may raise, too
        text = "(no text)"
    where = error.__traceback__
    while where is not None and where.tb_next is not None:
        where = where.tb_next
    place = "" if where is None else f" ({where.tb_frame.f_code.co_filename}:{where.tb_lineno})"
    return plain_text(f"{type(error).__name__}: {text}{place}", 900)
