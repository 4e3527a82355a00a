"""``steerclear render``: a recorded game as a replay, film or picture."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer
from steerclear.env.record import load
from steerclear.shield.exceptions import ConfigError

from ..provenance import machine, versions
from ..replay_html import write_replay
from ..result_files import NEW, check_new, write_json
from . import options as o
from .console import command, out
from .saving import check_endings, save_record

Records = Annotated[list[Path], typer.Argument(help="Recorded games (.npz); several only for .html.")]
To = Annotated[
    Path | None,
    typer.Option(
        "--to",
        metavar="FILE",
        help="What to write, a new file: .html, .mp4, .gif, .png or .npz.",
        show_default="a replay beside the record",
    ),
    NEW,
]
At = Annotated[
    float | None, typer.Option(metavar="S", help="Moment a picture shows, s.", show_default="the closest approach")
]
Speed = Annotated[float, typer.Option(metavar="X", help="Times faster than the game, for films.")]


@command
def render(records: Records, to: To = None, at: At = None, speed: Speed = 4.0, json_file: o.JsonFile = None) -> None:
    """Turn recorded games into a replay to scrub in a browser, a film or a picture.

    Exit status: 0 done, 2 bad input, 130 interrupted.
    """
    started = time.perf_counter()
    check_endings([to] if to else [])
    games = [load(path) for path in records]
    to = to or records[0].with_suffix(".html")
    check_new(to, "--to")
    if len(games) > 1 and to.suffix.lower() != ".html":
        raise ConfigError(f"only a replay (.html) takes several games; give one record for {to.suffix}")
    path = write_replay(games, to) if to.suffix.lower() == ".html" else save_record(games[0], to, at, speed)
    out().print(f"{path}", soft_wrap=True)
    if json_file is not None:
        settings = {"records": [str(record) for record in records], "to": str(to), "at": at, "speed": speed}
        content = {"command": "render", "settings": settings, "versions": versions(), "machine": machine()}
        write_json(json_file, {**content, "wall_s": time.perf_counter() - started, "files": [str(path)]})
