"""The files of a long log: ``NAME.mcap``, ``NAME.part2.mcap``, ``NAME.part3.mcap``, ..., each with the log's header."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from .chain import ChainHead
from .header import LogHeader

_NAME = re.compile(r"(?P<stem>.+)\.part(?P<number>[1-9]\d*)(?P<ending>\.[^.]*)")
_NOTE = "part"


def part_path(first: Path, number: int) -> Path:
    """Path of a part, from 1 on, of the log whose first file is given."""
    return first if number == 1 else first.with_name(f"{first.stem}.part{number}{first.suffix}")


def part_header(header: LogHeader, number: int, chain: ChainHead | None) -> LogHeader:
    """The log's header, which part it is noted in it, and where its chain begins."""
    notes = header.notes if number == 1 else {**header.notes, _NOTE: str(number)}
    return replace(header, notes=notes, chain=chain)


def follows(before: LogHeader, header: LogHeader) -> bool:
    """Whether a header is of the same log."""
    return (before.unix_ns, before.clock_s, before.fleet_text) == (header.unix_ns, header.clock_s, header.fleet_text)


def number_of(path: Path) -> tuple[Path, int]:
    """First file of the log a file belongs to, and which part it is."""
    found = _NAME.fullmatch(path.name)
    return (path, 1) if found is None else (path.with_name(found["stem"] + found["ending"]), int(found["number"]))


def later_parts(path: Path) -> Iterator[tuple[int, Path]]:
    """Numbers and paths of the files that follow a file, in order; the first that is missing ends them.

    One that is missing while later ones are there is given too, so that the reader finds it missing.
    """
    first, number = number_of(path)
    there = {number_of(entry)[1] for entry in path.parent.glob(f"{_escaped(first.stem)}.part*{first.suffix}")}
    yield from ((k, part_path(first, k)) for k in range(number + 1, max(there, default=0) + 1))


def _escaped(text: str) -> str:
    return re.sub(r"([*?\[])", r"[\1]", text)
