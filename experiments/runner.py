"""One runner for every experiment: jobs in, one tidy table out, kept on disk job by job.

    experiment = Experiment("ablate", settings, jobs, play_game)      # jobs: plain dicts; play_game: job -> rows
    run = execute(experiment, folder, workers=4, resume=False)        # experiment.json, rows.jsonl, rows.csv
    table = run.table                                                 # pandas: one row per game, encounter, boat, ...
    figures = summarise(table, METRICS, by, versus, pair_on)          # `statistics`: value, low, high, n
    goals = check(GOALS, table)                                       # `metrics`
    run.end()                                                         # raises what ends the command otherwise than well

Contract:

* A job is a mapping of plain values (what JSON holds); `job_id` of it is its name on disk. Two equal jobs are one job.
* ``run`` is importable by name (workers are spawned) and gives a job's rows, mappings of plain values. An error in one
  job stops no other: it is listed in `Run.failed`.
* ``rows.jsonl`` grows by one line per finished job and survives Ctrl-C, SIGTERM, kill -9 and a full disk. A line counts
  when it is as it was written, by the code that runs now. With ``resume`` the jobs found there are not run again. Other
  settings are refused, unless they only add jobs.
* Ctrl-C ends `execute` with what is there: ``run.interrupted`` is true, so that the command still writes its results.
* One process writes into a folder at a time, as long as its `Run` lives.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from filelock import BaseFileLock
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.renamed import current_keys

from .provenance import code_digest, machine, versions
from .result_files import lock_folder, plain_value, read_json, told_settings, write_json, write_table, writing
from .workers import Job, Row, Workers, end_failed, outcomes

if TYPE_CHECKING:
    import pandas as pd

EXPERIMENT_FILE, ROWS_FILE, RESULTS_FILE = "experiment.json", "rows.jsonl", "results.json"
OLD_ROWS_FILE = "games.jsonl"
BESIDE = ("rows.csv", "rows.parquet", "report.html", "replay.html", "entry.html")
"""What commands write into a folder beside those."""
MOST_NAMED = 4
"""Settings that differ which a refusal names; more are counted."""
Notice = Callable[[int, int], None]
"""Told how many jobs are done and how many there are."""
logger = logging.getLogger(__name__)


class Interrupted(Exception):
    """The user pressed Ctrl-C, or SIGTERM came; the text says what is kept and how to go on."""


@dataclass(frozen=True)
class Experiment:
    """What is run: jobs (what ``unit`` calls them) by ``run``; ``warm_up`` compiles before many processes start.

    ``about`` is told before the first job, once nothing refuses them.
    """

    command: str
    settings: Mapping[str, Any]
    jobs: Sequence[Job]
    run: Callable[[Job], list[Row]]
    unit: str = "games"
    warm_up: Sequence[Callable[[], object]] = ()
    about: str = ""


@dataclass
class Run:
    """What an experiment gave.

    Attributes:
        experiment: which.
        folder: where it is kept.
        rows: of all finished jobs, in the order of the jobs.
        failed: jobs without rows, each with ``error`` and ``fault`` (whether steerclear is at fault).
        finished: how many jobs have rows.
        resumed: rows that an earlier run had left.
        interrupted: whether Ctrl-C or SIGTERM ended it.
        wall_s: how long it took, s.
    """

    experiment: Experiment
    folder: Path
    rows: list[Row]
    failed: list[Row]
    finished: int
    resumed: int
    interrupted: bool
    wall_s: float
    _lock: BaseFileLock = field(repr=False)

    @cached_property
    def table(self) -> pd.DataFrame:
        """One line per row."""
        import pandas as pd

        return pd.DataFrame(self.rows)

    def head(self) -> dict[str, Any]:
        """What every results.json begins with."""
        return {
            "command": self.experiment.command,
            "complete": self.finished == len(self.experiment.jobs),
            "settings": told_settings(self.experiment.settings),
            "versions": versions(),
            "machine": machine(),
            "wall_s": self.wall_s,
            "failed": self.failed,
        }

    def write(self, results: Mapping[str, Any]) -> None:
        """Write results.json; ConfigError where it cannot be written."""
        write_json(self.folder / RESULTS_FILE, results)

    def end(self) -> None:
        """End the command in words where not all jobs have rows; call it once everything is written and shown.

        Raises:
            Interrupted: by Ctrl-C or SIGTERM.
            JobFault: a job failed by a fault of steerclear.
            ConfigError: a job failed by bad input, or by the machine's doing.
        """
        unit, of = self.experiment.unit, len(self.experiment.jobs)
        if self.interrupted:
            raise Interrupted(
                f"interrupted: {self.finished} of {of} {unit} kept in {self.folder / ROWS_FILE}; "
                f"the same command with --out {self.folder} --resume goes on from there"
            )
        if self.failed:
            what = f"{len(self.failed)} {unit} could not be played"
            end_failed(self.failed, what, f" ({self.failed[0]['error']}); put that right, then add --resume")


def job_id(job: Mapping[str, Any]) -> str:
    """A short name: the same job always has the same, in any order of its entries."""
    text = json.dumps(job, sort_keys=True, default=plain_value)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def execute(
    experiment: Experiment,
    folder: Path,
    workers: Workers = 1,
    resume: bool = False,
    notice: Notice = lambda done, of: None,
    tell: Callable[[str], None] = logger.warning,
) -> Run:
    """Run the jobs that are missing in a folder.

    Args:
        experiment: what to run.
        folder: made when missing.
        workers: processes on this machine (1: this one), or a Ray cluster.
        resume: go on with what is there instead of refusing.
        notice: told how many jobs are done, first of those found there.
        tell: told in words, once each, what the experiment is about and what is gone on with.

    Raises:
        ConfigError: the folder holds results and ``resume`` is off, or another experiment's, or results of other
            settings that these jobs leave out; another process writes there; or it cannot be written to.
    """
    started = time.perf_counter()
    lock = open_folder(folder, experiment.command, resume)
    ids = [job_id(job) for job in experiment.jobs]
    before, there = _read(folder / ROWS_FILE)
    if there - set(ids) or (not there and (folder / RESULTS_FILE).exists()):
        check_settings(folder, experiment.settings)
    kept = {name: before[name] for name in ids if name in before}
    if experiment.about:
        tell(experiment.about)
    if resume:
        words = f"{len(kept)} of {len(ids)} {experiment.unit} are in {folder / ROWS_FILE} and are taken from there"
        if others := len(before) - len(kept):
            words += f"; {others} there are of a policy's files before they changed, and count for nothing here"
        tell(words)
    head = {"command": experiment.command, "settings": told_settings(experiment.settings), "jobs": len(experiment.jobs)}
    write_json(folder / EXPERIMENT_FILE, {**head, "versions": versions(), "code": code_digest()})
    failed, resumed = list[Row](), sum(len(rows) for rows in kept.values())
    missing = [job for name, job in dict(zip(ids, experiment.jobs, strict=True)).items() if name not in kept]
    interrupted = False
    try:
        notice(len(kept), len(ids))
        for outcome in outcomes(experiment.run, missing, workers, experiment.warm_up):
            if outcome.answer is None:
                failed.append({**outcome.job, **outcome.why})
            else:
                name = job_id(outcome.job)
                append_row(folder / ROWS_FILE, name, outcome.answer)
                kept[name] = outcome.answer
            notice(len(kept), len(ids))
    except KeyboardInterrupt:
        interrupted = True
        written = read_rows(folder / ROWS_FILE)  # what came between writing a job and counting it counts, too
        kept = {name: written[name] for name in ids if name in written}
    rows = [row for name in dict.fromkeys(ids) for row in kept.get(name, ())]
    wall_s = time.perf_counter() - started
    run = Run(experiment, folder, rows, failed, len(kept), resumed, interrupted, wall_s, lock)
    if rows:
        write_table(folder, [{k: v for k, v in row.items() if not isinstance(v, list | dict)} for row in rows])
    return run


def open_folder(folder: Path, command: str, resume: bool) -> BaseFileLock:
    """Make a folder this process's own; what refuses it (ConfigError, see `execute`) leaves it as it was."""
    with writing(f"to {folder}", "choose another --out"):
        folder.mkdir(parents=True, exist_ok=True)
        _check_folder(folder, command, resume)
        lock = lock_folder(folder)
        _check_folder(folder, command, resume)  # again: another may have been there a moment ago
        rows = folder / ROWS_FILE
        rows.touch()
        if (content := rows.read_bytes()) and not content.endswith(b"\n"):  # cut by a crash: its job runs again
            with rows.open("ab") as file:
                file.write(b"\n")
    return lock


def _check_folder(folder: Path, command: str, resume: bool) -> None:
    """Refuse a folder that is not ours to write into."""
    for name in (EXPERIMENT_FILE, ROWS_FILE, RESULTS_FILE):
        if (folder / name).exists() and not (folder / name).is_file():  # a pipe would be read for ever
            raise ConfigError(f"{folder / name} is no plain file; move it away or choose another --out")
    check_version(folder)
    found, _ = _whose(folder)
    rows = folder / ROWS_FILE
    held = (rows.exists() and rows.stat().st_size > 0) or (folder / RESULTS_FILE).exists()
    if held and not resume:
        raise ConfigError(f"{folder} already holds results; add --resume to continue or choose another --out")
    if resume and found not in (None, command):
        raise ConfigError(f"{folder} holds results of {found!r}, not of {command!r}; choose another --out")
    for name in () if resume else BESIDE:
        if (folder / name).exists():
            raise ConfigError(f"{folder / name} would be written over; choose another --out, or move it")


def check_settings(folder: Path, settings: Mapping[str, Any]) -> None:
    """Refuse (ConfigError) to go on in a folder that was begun with others of these settings: it names them."""
    path = folder / EXPERIMENT_FILE
    content = read_json(path, "settings", "choose another --out") if path.exists() else {}
    kept = current_keys(content.get("settings") or {}) if isinstance(content, dict) else {}
    here = json.loads(json.dumps(told_settings(settings), default=plain_value))
    before, now = _flat({name: kept[name] for name in here if name in kept}), _flat(here)
    others = [name for name in {**now, **before} if before.get(name) != now.get(name)]
    if others:
        told = [f"{name} was {_short(before.get(name))}, is {_short(now.get(name))}" for name in others[:MOST_NAMED]]
        more = f"; and {len(others) - MOST_NAMED} more" if len(others) > MOST_NAMED else ""
        raise ConfigError(
            f"{folder} holds results of other settings ({'; '.join(told)}{more}), which this would replace; "
            "give the same settings, or choose another --out"
        )


def _flat(settings: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Nested settings as one mapping, names joined by dots."""
    flat: dict[str, Any] = {}
    for name, value in settings.items():
        flat |= _flat(value, f"{before}{name}.") if isinstance(value, dict) else {before + name: value}
    return flat


def _short(value: Any) -> str:
    """A setting as a user writes it, cut where it is long."""
    text = "not set" if value is None else ",".join(map(str, value)) if isinstance(value, list) else str(value)
    return text if len(text) <= 60 else f"{text[:59]}…"


def check_version(folder: Path) -> None:
    """Refuse (ConfigError) a folder of results of an earlier version, of which only ``docs`` reads results.json."""
    if (folder / OLD_ROWS_FILE).exists():
        version = _whose(folder)[1] or "0.8.0 or earlier"
        words = "whose games this version does not read; make them again, or choose another folder"
        raise ConfigError(f"{folder} holds results of steerclear {version}, {words}")


def _whose(folder: Path) -> tuple[str | None, str | None]:
    """Command and version of the results in a folder; None: there are none, "unknown": of nobody we know."""
    for name in (RESULTS_FILE, EXPERIMENT_FILE):
        if not (folder / name).exists():
            continue
        try:
            content = json.loads((folder / name).read_text(encoding="utf-8"))
            return str(content["command"]), content.get("versions", {}).get("steerclear")
        except (OSError, ValueError, KeyError, AttributeError, TypeError, RecursionError):
            return "unknown", None
    return None, None


def append_row(path: Path, name: str, rows: Sequence[Row]) -> None:
    """Add a finished job; it is on disk when this returns.

    Raises:
        ConfigError: it cannot be written (the disk is full); what was there before stays as it was.
    """
    entry = json.loads(json.dumps({"job": name, "code": code_digest(), "rows": list(rows)}, default=plain_value))
    left = memoryview((json.dumps({**entry, "sum": job_id(entry)}) + "\n").encode())
    with (
        writing(f"{path}", "what it holds is kept: make room, then --resume"),
        path.open("ab", buffering=0) as file,
    ):
        begin = file.tell()
        try:
            while left:
                left = left[file.write(left) :]
            os.fsync(file.fileno())
        except OSError:
            with contextlib.suppress(OSError):
                os.ftruncate(file.fileno(), begin)
            raise


def read_rows(path: Path) -> dict[str, list[Row]]:
    """Rows of every job in a file, by `job_id`; the last line of a job counts. ConfigError where it is no text."""
    return _read(path)[0]


def _read(path: Path) -> tuple[dict[str, list[Row]], set[str]]:
    """`read_rows` of the code that runs now, and the names of all jobs there, of whatever code."""
    try:
        lines = path.read_bytes().decode().split("\n")
    except (OSError, UnicodeDecodeError) as error:
        why = "is no text" if isinstance(error, UnicodeDecodeError) else error.strerror
        raise ConfigError(f"cannot read {path} ({why}); move it away or choose another --out") from error
    found, names, others = dict[str, list[Row]](), set[str](), 0
    for number, line in enumerate(lines, start=1):
        entry = read_line(line) if line else None
        names |= {entry["job"]} if entry is not None else set()
        if line and entry is None:
            logger.warning("%s line %d is not complete, or not as it was written; it is left out", path, number)
        elif entry is not None and entry["code"] == code_digest():
            found[entry["job"]] = entry["rows"]
        elif entry is not None:
            others += 1
    if others:
        logger.warning("%s: %d results are of other code or versions, count for nothing here", path, others)
    return found, names


def read_line(line: str) -> dict[str, Any] | None:
    """A line that is as it was written, without its sum; None for any other."""
    try:
        entry = json.loads(line)
        if isinstance(entry, dict) and entry.pop("sum", None) == job_id(entry) and "code" in entry:
            return entry
    except (ValueError, RecursionError):
        pass
    return None
