"""What an entry written by steerclear states: the game it is for, and the shield in it."""

from __future__ import annotations

import json
import math
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

from steerclear.env.config import GameConfig
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.foreign import plain_text
from steerclear.shield.platforms import get_platform
from steerclear.shield.renamed import current_settings

from ..actions import SeenGame

ABOUT_FILE = "steerclear_entry.json"
"""File beside ``solution.py``."""
MAX_BYTES = 1 << 20


class MadeFor(NamedTuple):
    """The game an entry is for, and its shield.

    Attributes:
        preset: rules of the game.
        decision_s: time from decision to decision in that game, s.
        platforms: names of the boats in that game, in order; empty: not stated.
        separation_m: separation of its shield, m; NaN: it has no shield.
        shield: all settings of that shield, empty without one.
    """

    preset: str
    decision_s: float
    platforms: tuple[str, ...] = ()
    separation_m: float = math.nan
    shield: Mapping[str, Any] = {}

    @property
    def shielded(self) -> bool:
        """Whether the entry contains a shield."""
        return not math.isnan(self.separation_m)

    def to_bytes(self) -> bytes:
        """Return the content of `ABOUT_FILE`."""
        told = {**self._asdict(), "separation_m": self.separation_m if self.shielded else None}
        return json.dumps(told, indent=1).encode()


def made_for(source: str | Path) -> MadeFor | None:
    """Return what the entry at a path states; None if it states nothing readable, as entries of others.

    Args:
        source: folder, zip or ``solution.py`` of an entry.
    """
    try:
        told = json.loads(_content(Path(source).expanduser()))
        separation_m = math.nan if told["separation_m"] is None else float(told["separation_m"])
        platforms = tuple(plain_text(name, 40) for name in told["platforms"])
        preset, decision_s = plain_text(told["preset"], 40), float(told["decision_s"])
        return MadeFor(preset, decision_s, platforms, separation_m, current_settings(told["shield"]))
    except (OSError, ValueError, KeyError, TypeError, RuntimeError, EOFError, zipfile.BadZipFile, zlib.error):
        return None


def _content(source: Path) -> bytes:
    """Return the content of the file, empty if there is none of acceptable size; pipes are not read."""
    if source.is_dir() or source.suffix == ".py":
        path = (source if source.is_dir() else source.parent) / ABOUT_FILE
        return path.read_bytes() if path.is_file() and path.stat().st_size <= MAX_BYTES else b""
    if not source.is_file():
        return b""
    with zipfile.ZipFile(source) as packed:
        for info in packed.infolist():
            if PurePosixPath(info.filename).name == ABOUT_FILE and info.file_size <= MAX_BYTES:
                return packed.read(info)
    return b""


def check_game(made: MadeFor, game: GameConfig | SeenGame, source: object) -> None:
    """Refuse a game that the shield in an entry cannot predict: other decision times or other boats."""
    if not made.shielded:
        return
    names, other = platform_names(game), ""
    if not math.isclose(made.decision_s, game.decision_s, rel_tol=1e-9):
        other = f"for a decision every {made.decision_s:g} s, but this game decides every {game.decision_s:g} s"
    elif made.platforms and made.platforms != names:
        other = f"for boats {', '.join(made.platforms)}, but this game has {', '.join(names)}"
    if other:
        raise PolicyError(
            f"the shield in {source} is {other}; play it by preset {made.preset}, or the bare entry with --shield"
        )


def platform_names(game: GameConfig | SeenGame) -> tuple[str, ...]:
    """Return the names of a game's boats, in order."""
    return tuple(get_platform(boat).name for boat in game.platforms)  # type: ignore[union-attr]  # a tuple once built


def words_of_less(made: MadeFor, game: GameConfig | SeenGame, source: object) -> str:
    """Return a warning if the shield's separation is less than the game's collision distance, otherwise no text."""
    counted_m = 2.0 * max(game.agent_radius_m)  # type: ignore[arg-type]  # a tuple once built
    if not made.shielded or made.separation_m >= counted_m - 1e-9:
        return ""
    return (
        f"the shield in {source} keeps {made.separation_m:g} m (separation_m), but this game counts collisions at "
        f"{counted_m:g} m: such hits it does not prevent; wrap the bare entry with --separation {counted_m:g}"
    )
