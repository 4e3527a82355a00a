"""``steerclear replay``: run the shield again on a black-box log."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer
from steerclear.env.record import save
from steerclear.shield.bridge.blackbox import LogReader, mend
from steerclear.shield.bridge.mavlink.signing import read_key

from ..deploy.replay import Replay, as_content, compare, draw, replay_log, show
from ..provenance import machine, versions
from ..replay_html import write_replay
from ..result_files import NEW, write_json
from . import options as o
from .console import ExitCode, command, finish, out
from .files import check_ending

Log = Annotated[Path, typer.Argument(help="Black-box log (.mcap) that deploy wrote.")]
WithoutShield = Annotated[
    bool, typer.Option("--without-shield", help="Also show what would have happened without the shield.")
]
Judge = Annotated[bool, typer.Option(help="Ask the oracle about breaches that happened (with --without-shield).")]
Html = Annotated[Path | None, typer.Option(help="Write a replay to scrub in a browser; a new file."), NEW]
RecordFile = Annotated[Path | None, typer.Option("--record", help="Write the game's record (.npz) for render."), NEW]
Mend = Annotated[
    Path | None, typer.Option("--mend", help="Write what can be read of a cut-off log as a whole one (.mcap)."), NEW
]

Key = Annotated[Path | None, typer.Option(help="Key file of the boats: check the codes of a log written with signing.")]


@command
def replay(
    log: Log,
    without_shield: WithoutShield = False,
    judge: Judge = True,
    html: Html = None,
    record: RecordFile = None,
    mended: Mend = None,
    key: Key = None,
    json_file: o.JsonFile = None,
) -> None:
    """Run the shield again on a recorded log and prove that it decides the same, bit for bit.

    Exit status: 0 all decisions are proved the same, 1 a decision differs or something else was sent, 2 bad input, 3
    not all is proved: turns are missing, no decisions, or the log is not as it was written, 130 interrupted.
    """
    started = time.perf_counter()
    check_ending(html, "--html", (".html", ".htm"))
    check_ending(record, "--record", (".npz",))
    check_ending(mended, "--mend", (".mcap",))
    with LogReader(log, None if key is None else read_key(key)) as reader:
        found = replay_log(reader, keep_tracks=without_shield or html is not None or record is not None)
    draw(found)
    if without_shield:
        compare(found, judge)
    files = _write(found, log, html, record, mended)
    show(out(), found)
    for path in files:
        out().print(f"{path}", soft_wrap=True)
    if json_file is not None:
        settings = {"log": str(log), "without_shield": without_shield, "judge": judge}
        content = {"command": "replay", "settings": settings, "versions": versions(), "machine": machine()}
        wall_s = time.perf_counter() - started
        write_json(json_file, {**content, "wall_s": wall_s, "log": str(log), **as_content(found), "files": files})
    finish(found.proof.holds)
    if not found.proved:
        raise typer.Exit(int(ExitCode.NOT_PROVED))


def _write(found: Replay, log: Path, html: Path | None, record: Path | None, mended: Path | None) -> list[Any]:
    files = []
    if mended is not None:
        mend(log, mended)
        files.append(str(mended))
    if html is not None:
        files.append(str(write_replay(found.records, html, f"steerclear replay of {log.name}")))
    if record is not None:
        files.append(str(save(found.records[0], record)))
    return files
