"""Running many independent jobs on all cores, keeping what is finished whatever happens to the rest."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import multiprocessing.process
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, TypeVar

from steerclear.shield.exceptions import ConfigError, SteerclearError

from .faults import machine_words, name_of, trace_of, words_of_trace
from .provenance import available_cores

Job = TypeVar("Job")
Answer = TypeVar("Answer")

DIED = "its worker process died, also when it ran alone (out of memory?); mend that, then --resume"
_ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}


MOST_JOBS = 1024
"""More processes than any machine has cores fill its memory before the first has begun."""


@dataclass(frozen=True)
class Outcome(Generic[Job, Answer]):
    """What became of one job.

    Attributes:
        job: which.
        answer: its answer; None: it has none.
        error: why, on one line.
        trace: traceback of what no one foresaw, a fault of steerclear; None for bad input and the machine's doing.
    """

    job: Job
    answer: Answer | None
    error: str | None = None
    trace: str | None = None

    @property
    def why(self) -> dict[str, Any]:
        """Why there is no answer, as results keep it and `failed_jobs.end_failed` reads it."""
        return {"error": self.error, "fault": self.trace is not None}


def check_jobs(jobs: int | None) -> int:
    """Return the number of processes to use; all cores when not given.

    Raises:
        ConfigError: less than one, or more than `MOST_JOBS`.
    """
    if jobs is not None and not 1 <= jobs <= MOST_JOBS:
        raise ConfigError(
            f"--jobs must be at least 1 and at most {MOST_JOBS:,}; got {jobs:,}; leave it out to use all cores"
        )
    return jobs or available_cores()


class Engine(Protocol):
    """Runs jobs elsewhere, see `engines`."""

    def run(self, function: Callable[[Job], Answer], jobs: Sequence[Job]) -> Iterator[Outcome[Job, Answer]]:
        """Yield one outcome per job in the order they end."""


def run_all(
    function: Callable[[Job], Answer], jobs: Sequence[Job], processes: int | Engine = 1
) -> Iterator[Outcome[Job, Answer]]:
    """Run ``function`` on every job and yield the outcomes as they come.

    A job that raises does not stop the others; neither does a worker that dies: the jobs under way then are run again,
    each alone. Leaving the loop early or interrupting it (Ctrl-C) drops the jobs that have not ended. Tracebacks of
    faults are written to a file here, one for all that are alike.

    Args:
        function: importable by name (workers are spawned, not forked), as is every job's data.
        jobs: what to run it on.
        processes: 1 runs everything in this process; an engine runs it elsewhere.

    Yields:
        One `Outcome` per job, in the order they end.
    """
    for outcome in _run(function, jobs, processes):
        if outcome.trace is not None:
            outcome = replace(outcome, error=words_of_trace(outcome.error or "", outcome.trace))
        yield outcome


def _run(
    function: Callable[[Job], Answer], jobs: Sequence[Job], processes: int | Engine
) -> Iterator[Outcome[Job, Answer]]:
    if not isinstance(processes, int):
        yield from processes.run(function, jobs)
        return
    processes = min(processes, len(jobs))
    if processes <= 1:
        yield from (attempt(function, job) for job in jobs)
        return
    waiting, suspects = deque(jobs), deque[Job]()
    while waiting:
        with _pool(processes) as pool:
            yield from _until_broken(pool, function, waiting, suspects, processes)
    while suspects:  # each alone, so that the one that kills its worker is known from those beside it
        alone: deque[Job] = deque()
        with _pool(1) as pool:
            yield from _until_broken(pool, function, suspects, alone, 1)
        yield from (Outcome(job, None, DIED) for job in alone)


def _until_broken(
    pool: ProcessPoolExecutor, function: Callable[[Job], Answer], waiting: deque[Job], lost: deque[Job], at_once: int
) -> Iterator[Outcome[Job, Answer]]:
    """Run what waits, so many at once, until none is left or a worker died; then ``lost`` gets those under way."""
    running: dict[Future[Outcome[Job, Answer]], Job] = {}
    broken = False
    while (waiting and not broken) or running:
        while waiting and not broken and len(running) < at_once:
            try:
                running[pool.submit(attempt, function, waiting[0])] = waiting[0]
                waiting.popleft()
            except BrokenProcessPool:
                broken = True
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            job = running.pop(future)
            try:
                outcome = future.result()
            except BrokenProcessPool:
                broken = True
                lost.append(job)
            else:
                yield outcome


def attempt(function: Callable[[Job], Answer], job: Job) -> Outcome[Job, Answer]:
    """Run one job; an error becomes the outcome's text instead of travelling on."""
    try:
        return Outcome(job, function(job))
    except SteerclearError as error:
        return Outcome(job, None, str(error))
    except Exception as error:
        words = machine_words(error)
        return Outcome(job, None, words or name_of(error), None if words else trace_of(error))


@contextmanager
def _pool(processes: int) -> Iterator[ProcessPoolExecutor]:
    others = set(multiprocessing.active_children())
    with _environment(_ONE_THREAD):
        pool = ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), _begin_worker)
        try:
            yield pool
        except BaseException:  # interrupted, or the loop was left: what still runs is not wanted any more
            pool.shutdown(wait=False, cancel_futures=True)
            _end(set(multiprocessing.active_children()) - others)
            raise
        pool.shutdown(wait=True)


def _end(workers: set[multiprocessing.process.BaseProcess]) -> None:
    for worker in workers:
        worker.terminate()
    for worker in workers:
        worker.join()


def _begin_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; only the parent answers
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, name="parent", daemon=True).start()


def _end_with_parent() -> None:
    """End this worker when the process that started it is gone, however it ended."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)


@contextmanager
def interrupted_by_sigterm() -> Iterator[None]:
    """Let SIGTERM end what is inside as Ctrl-C does: what is finished is kept, and no worker is left."""

    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():  # signals are the main thread's
        yield
        return
    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL if before is None else before)


@contextmanager
def _environment(settings: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in settings}
    os.environ.update({name: value for name, value in settings.items() if before[name] is None})
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
