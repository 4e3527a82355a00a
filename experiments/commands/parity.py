"""``steerclear parity``: recorded games of the reference simulator, replayed by ours."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Group
from rich.text import Text
from steerclear.env.parity import replay_trace
from steerclear.env.parity_report import ParityReport, Tolerances

from ..provenance import machine, versions
from ..result_files import write_json
from ..tables import titled
from ..workers import end_failed, outcomes, processes_of
from . import options as o
from .console import command, finish, out, progress

Traces = Annotated[list[Path], typer.Argument(help="Recorded games (.npz).")]
SHOWN = ("position_m", "heading_deg", "speed_mps", "observation_normalised")
MISMATCHES_SHOWN = 5


@command
def parity(traces: Traces, jobs: o.Jobs = 1, json_file: o.JsonFile = None) -> None:
    """Replay recorded Pyquaticus games and compare every value.

    Exit status: 0 all within the limits, 1 a deviation is over its limit or an event differs, 2 bad input.
    """
    started = time.perf_counter()
    reports = _replay(traces, processes_of(jobs))
    passed = all(report.passed for report in reports)
    _show(reports, passed)
    if json_file is not None:
        settings = {"traces": [str(path) for path in traces]}
        head = {"command": "parity", "settings": settings, "versions": versions(), "machine": machine()}
        rows = [_as_row(report) for report in reports]
        tail = {"passed": passed, "limits": asdict(Tolerances()), "traces": rows}
        write_json(json_file, {**head, "wall_s": time.perf_counter() - started, **tail})
    finish(passed)


def _replay(traces: Sequence[Path], processes: int) -> list[ParityReport]:
    reports: dict[Path, ParityReport] = {}
    with progress("traces", len(traces)) as notice:
        for outcome in outcomes(replay_trace, list(traces), processes):
            if outcome.answer is None:
                end_failed([outcome.why], f"{outcome.job} could not be replayed", f": {outcome.error}")
            reports[outcome.job] = outcome.answer
            notice(len(reports))
    return [reports[path] for path in traces]


def _show(reports: Sequence[ParityReport], passed: bool) -> None:
    limits = asdict(Tolerances())
    out().print(_table(reports))
    out().print()
    for report in reports:
        for name, value in report.over().items():
            out().print(f"{Path(report.path).stem}: {name} {value:.2g} is over {limits[name]:g}")
        for mismatch in report.mismatches[:MISMATCHES_SHOWN]:
            where = f"{Path(report.path).stem}: step {mismatch.step}, {mismatch.event} of {mismatch.who}"
            out().print(f"{where}: expected {mismatch.expected}, got {mismatch.got}")
    over = sum(not report.passed for report in reports)
    words = "all within the limits" if passed else f"{over} of {len(reports)} over the limits"
    out().print(f"{len(reports)} traces, {sum(report.steps for report in reports)} steps: {words}")


def _table(reports: Sequence[ParityReport]) -> Group:
    limits = asdict(Tolerances())
    rows = [_cells(report) for report in reports]
    rows.append(["limit", "", *(f"{limits[name]:.0e}" for name in SHOWN), "0", ""])
    heads = ["trace", "steps", "pos. m", "head. deg", "speed m/s", "obs.", "events", ""]
    return titled("Largest deviation from the recorded games", heads, rows)


def _cells(report: ParityReport) -> list[str | Text]:
    deviations = [f"{getattr(report, name):.1e}" for name in SHOWN]
    verdict = Text("ok", "green") if report.passed else Text("over", "red")
    return [Path(report.path).stem, str(report.steps), *deviations, str(len(report.mismatches)), verdict]


def _as_row(report: ParityReport) -> dict[str, Any]:
    row = report.to_dict()
    return {**row, "mismatches": len(report.mismatches), "first_mismatches": row["mismatches"][:MISMATCHES_SHOWN]}
