"""A replay to scrub in a browser: one HTML file that holds the games, needs no server and loads nothing."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from steerclear.env.record import Record, read_meta
from steerclear.shield.exceptions import ConfigError

from .page import SCRIPT_SOURCES, as_json, render, write_page
from .replay_data import pack

SCRIPTS = tuple(f"replay_{part}.js" for part in ("data", "labels", "draw", "timeline", "pane", "app"))


def write_replay(
    records: Record | Sequence[Record],
    path: str | os.PathLike[str],
    title: str = "steerclear replay",
    compress: bool = True,
) -> Path:
    """Write a replay.

    Several games can be chosen from a list and shown side by side, scrubbed together; the first two are shown
    at the start. A link to ``replay.html#t=12.5`` opens it at that time.

    Args:
        records: One record or several.
        path: File to write.
        title: Heading of the page.
        compress: Deflate the games; without, the file is larger but opens in browsers older than 2023, too.

    Returns:
        The path written.

    Raises:
        TraceError: A record is incomplete.
        ConfigError: There is no record, or the file cannot be written.
    """
    games = [records] if isinstance(records, Mapping) else list(records)
    if not games:
        raise ConfigError("there is no record to replay; pass at least one.")
    metas = [read_meta(game) for game in games]
    own = {"own_team": own_team(metas)}
    packed = [pack(game, name, compress) | own for game, name in zip(games, _titles(metas), strict=True)]
    data = as_json({"games": packed})
    return write_page(path, render("replay.html", title=title, data=data, scripts=SCRIPTS, sources=SCRIPT_SOURCES))


def _titles(metas: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a name for each game; equal ones are numbered."""
    names = [game_title(meta) for meta in metas]
    return [name if names.count(name) == 1 else f"{k}. {name}" for k, name in enumerate(names, start=1)]


def own_team(metas: Sequence[Mapping[str, Any]]) -> int:
    """Return the team whose breaches count: that of the first shielded boat in any game, else blue."""
    for meta in metas:
        for name, team in zip(meta["agent_ids"], meta["team"], strict=True):
            if name in meta["shielded"]:
                return int(team)
    return 0


def game_title(meta: Mapping[str, Any]) -> str:
    """Return the game's own title or who plays whom, and whether a shield is on."""
    blue, red = (meta["policies"].get(side) or side for side in ("blue", "red"))
    return f"{meta.get('title') or f'{blue} – {red}'}, {'shield on' if meta['shielded'] else 'shield off'}"
