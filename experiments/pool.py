"""Running many independent jobs on all cores, keeping what is finished whatever happens to the rest."""

from __future__ import annotations

import logging
import multiprocessing
import multiprocessing.process
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Generic, TypeVar

from steerclear.shield.exceptions import ConfigError, SteerclearError

Job = TypeVar("Job")
Answer = TypeVar("Answer")
logger = logging.getLogger(__name__)

_ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}


MOST_JOBS = 1024
"""More processes than any machine has cores fill its memory before the first has begun."""


@dataclass(frozen=True)
class Outcome(Generic[Job, Answer]):
    """What became of one job: an answer, or the one-line reason why there is none."""

    job: Job
    answer: Answer | None
    error: str | None = None


def available_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


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


def run_all(
    function: Callable[[Job], Answer], jobs: Sequence[Job], processes: int = 1
) -> Iterator[Outcome[Job, Answer]]:
    """Run ``function`` on every job and yield the outcomes as they come.

    A job that raises does not stop the others; neither does a worker that dies. Leaving the loop early or
    interrupting it (Ctrl-C) drops the jobs that have not ended.

    Args:
        function: importable by name (workers are spawned, not forked), as is every job's data.
        jobs: what to run it on.
        processes: 1 runs everything in this process.

    Yields:
        One `Outcome` per job, in the order they end.
    """
    processes = min(processes, len(jobs))
    if processes <= 1:
        yield from (attempt(function, job) for job in jobs)
        return
    with _pool(processes) as pool:
        waiting = {pool.submit(attempt, function, job): job for job in jobs}
        for future in as_completed(waiting):
            yield _outcome(future, waiting[future])


def attempt(function: Callable[[Job], Answer], job: Job) -> Outcome[Job, Answer]:
    """Run one job; an error becomes the outcome's text instead of travelling on."""
    try:
        return Outcome(job, function(job))
    except SteerclearError as error:
        return Outcome(job, None, str(error))
    except Exception as error:  # user policies may raise anything; the log keeps the traceback
        logger.exception("a job failed")
        return Outcome(job, None, f"{type(error).__name__}: {error}")


def _outcome(future: Future[Outcome[Job, Answer]], job: Job) -> Outcome[Job, Answer]:
    try:
        return future.result()
    except BrokenProcessPool:
        return Outcome(job, None, "a worker process died (out of memory?); try fewer --jobs, then --resume")


@contextmanager
def _pool(processes: int) -> Iterator[ProcessPoolExecutor]:
    others = set(multiprocessing.active_children())
    with _environment(_ONE_THREAD):
        pool = ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), _ignore_interrupts)
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


def _ignore_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; only the parent answers


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
