"""``steerclear bench``: speed and memory, in one run."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from rich.text import Text

from ..bench.report import bench_tables
from ..bench.run import BenchSettings, run_bench
from ..result_files import write_json
from ..tables import goals_table, titled
from . import options as o
from .console import command, err, finish, out


@command
def bench(
    preset: o.Preset = "aamas2024",
    seed: o.Seed = 0,
    quick: o.Quick = False,
    check: o.Check = False,
    json_file: o.JsonFile = None,
) -> None:
    """Measure decision times, solvers, batched games, memory and cost against the number of boats.

    Exit status: 0 done, 1 a bar is not met (with --check), 2 bad input, 130 interrupted.
    """
    settings = replace(BenchSettings(), preset=preset, seed=seed)
    content = _run(settings.small() if quick else settings)
    _show(content)
    if quick:
        out().print("This was the small version: its figures are rough. Leave out --quick for real ones.")
    if json_file is not None:
        write_json(json_file, content)
    finish(not check or all(goal["met"] for goal in content["goals"]))


def _run(settings: BenchSettings) -> dict[str, Any]:
    with err().status("measuring") as status:
        return run_bench(settings, lambda words: status.update(Text(f"measuring: {words}")))


def _show(content: dict[str, Any]) -> None:
    console = out()
    machine = content["machine"]
    console.print(f"{machine['processor']}, {machine['cores']} cores, {machine['system']}", soft_wrap=True)
    console.print()
    for table in bench_tables(content):
        console.print(titled(table.title, table.heads, table.rows, width=12 if len(table.heads) < 6 else 8))
        console.print()
    console.print(goals_table(content["goals"]))
