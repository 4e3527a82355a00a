"""Where jobs run: this process, processes of this machine, or a Ray cluster (extra ``[cluster]``)."""

from __future__ import annotations

import contextlib
import errno
import logging
import multiprocessing
import multiprocessing.connection
import os
import signal
import sys
import tempfile
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from importlib.util import find_spec
from multiprocessing.context import SpawnContext
from multiprocessing.synchronize import Semaphore
from typing import Any, NoReturn

from steerclear.shield.exceptions import ConfigError, SteerclearError
from steerclear.shield.extras import install_command

from .provenance import available_cores, code_digest, package_version

Job = Mapping[str, Any]
Row = dict[str, Any]
Function = Callable[[Any], Any]
ENGINES = ("pool", "ray")
MOST_JOBS = 1024
"""More processes than any machine has cores fill its memory before the first has begun."""
TRIES = 4
"""Times a job is begun anew on a cluster when its node or worker is lost."""
DIED = "its worker process died, also when it ran alone (out of memory?); mend that, then --resume"
_ELSEWHERE, _RIGHTS = "free some space, or write elsewhere", "give yourself the right to it, or name another place"
MACHINE = {
    errno.ENOSPC: _ELSEWHERE,
    errno.EDQUOT: _ELSEWHERE,
    errno.EROFS: "write elsewhere",
    errno.EACCES: _RIGHTS,
    errno.EPERM: _RIGHTS,
    errno.ENOENT: "name a place that is there",
    errno.ENOTDIR: "name another place",
    errno.EISDIR: "name a file",
    errno.ENAMETOOLONG: "give a shorter name",
    errno.EMFILE: "raise the limit on open files (ulimit -n)",
    errno.ENFILE: "close other programs",
    errno.EIO: "look after that disk",
}
"""What a machine may refuse, with what helps."""
_INTERRUPTED = threading.Event()
"""Set once a signal asks for the end: compiled code and callbacks may lose the KeyboardInterrupt that it raises."""
LOG, COMPILES = logging.getLogger("steerclear.shield.jit"), "compiles its machine code"
"""Who says that machine code is compiled, and words of that: of this process and its workers one says it."""
_FIRST = list[Semaphore]()
_ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}


class JobFault(Exception):
    """A job ended in what no one foresaw; the text says so, and where its traceback is."""


def end_failed(failed: Sequence[Mapping[str, Any]], what: str, remedy: str) -> NoReturn:
    """End a run of which jobs gave no answer, each with ``error`` and ``fault``.

    Raises:
        JobFault: one of them is a fault of steerclear.
        ConfigError: none is; its text is ``what`` ("3 games could not be played") and the ``remedy``.
    """
    for entry in failed:
        if entry["fault"]:
            raise JobFault(f"{what}: {entry['error']}")
    raise ConfigError(f"{what}{remedy}")


def machine_words(error: Exception) -> str:
    """Words for what the machine refused; empty when the error is none of its own."""
    if isinstance(error, MemoryError):
        return "there is not enough memory; do less at once (fewer --jobs, shorter games), or give it more"
    if isinstance(error, OSError) and error.errno in MACHINE:
        place = f" ({error.filename})" if error.filename else ""
        return f"{error.strerror}{place}; {MACHINE[error.errno]}"
    return ""


def fault_words(error: Exception) -> str:
    """One line that says this is a fault of steerclear, and where its traceback was written."""
    return _words_of_trace(_name_of(error), _trace_of(error))


def _name_of(error: Exception) -> str:
    """What an error says, on one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:200]


def _trace_of(error: Exception) -> str:
    """Its traceback as text, which goes from process to process."""
    return "".join(traceback.format_exception(error))


@lru_cache(maxsize=64)  # one file for all jobs that end in the same
def _words_of_trace(name: str, trace: str) -> str:
    lines = [trace, f"steerclear {package_version()}, Python {sys.version}", f"command: {sys.argv!r}"]
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="steerclear-fault-", suffix=".txt", delete=False, encoding="utf-8", errors="backslashreplace"
        ) as file:
            file.write("\n".join(lines))
        kept = f"its traceback is in {file.name}: please report it"
    except OSError as problem:
        kept = f"its traceback could not be written ({problem.strerror})"
    return f"this is a fault of steerclear, not of yours ({name}); {kept}"


@dataclass(frozen=True)
class Outcome:
    """What became of a job: an answer, or why there is none; ``trace``: of what no one foresaw, steerclear's fault."""

    job: Any
    answer: Any
    error: str | None = None
    trace: str | None = None

    @property
    def why(self) -> dict[str, Any]:
        """Why there is no answer, as results keep it and `end_failed` reads it."""
        return {"error": self.error, "fault": self.trace is not None}


@dataclass(frozen=True)
class Ray:
    """A Ray cluster at an address (``auto``, ``10.0.0.1:6379``); None starts Ray here, for so many jobs at once."""

    processes: int = 1
    address: str | None = None


Workers = int | Ray
"""So many processes of this machine, or a cluster."""


def workers_of(engine: str, address: str | None, jobs: int | None) -> Workers:
    """What ``--engine``, ``--address`` and ``--jobs`` ask for; ConfigError where they do not go together."""
    if engine not in ENGINES:
        raise ConfigError(f"unknown engine {engine!r}; choose one of {', '.join(ENGINES)}")
    processes = processes_of(jobs)
    if engine == "pool":
        if address is not None:
            raise ConfigError("--address is of a Ray cluster; add --engine ray")
        return processes
    if address is not None and jobs is not None:
        raise ConfigError("a cluster's nodes say how many jobs they run; leave out --jobs, or --address")
    _ray()
    return Ray(processes, address)


def processes_of(jobs: int | None) -> int:
    """How many processes ``--jobs`` asks for, all cores without it; ConfigError beyond 1 to `MOST_JOBS`."""
    if jobs is not None and not 1 <= jobs <= MOST_JOBS:
        raise ConfigError(
            f"--jobs must be at least 1 and at most {MOST_JOBS:,}; got {jobs:,}; leave it out to use all cores"
        )
    return jobs or available_cores()


def outcomes(
    function: Function, jobs: Sequence[Any], workers: Workers = 1, warm_up: Sequence[Callable[[], object]] = ()
) -> Iterator[Outcome]:
    """Run ``function`` on every job and yield the outcomes in the order they end.

    A job that raises does not stop the others; neither does a worker that dies: the jobs under way then are run again,
    each alone. Leaving the loop early or interrupting it drops the jobs that have not ended. Tracebacks of faults are
    written to a file here, one for all that are alike.

    Args:
        function: importable by name (workers are spawned, not forked), as is every job's data.
        jobs: what to run it on.
        workers: 1 runs everything in this process.
        warm_up: what compiles before several processes start; what goes wrong there is left to the jobs to report.
    """
    if isinstance(workers, Ray):
        found = _on_cluster(function, jobs, workers)
    elif min(workers, len(jobs)) <= 1:
        found = (attempt(function, job) for job in jobs)
    else:
        for _ in _in_pool(_call, warm_up, workers):
            pass
        found = _in_pool(function, jobs, workers)
    for outcome in found:
        if outcome.trace is not None:
            outcome = replace(outcome, error=_words_of_trace(outcome.error or "", outcome.trace))
        yield outcome
        if _INTERRUPTED.is_set():
            raise KeyboardInterrupt


def _call(function: Callable[[], object]) -> bool:
    function()
    return True


def attempt(function: Function, job: Any) -> Outcome:
    """Run one job; an error becomes the outcome's text instead of travelling on."""
    try:
        return Outcome(job, function(job))
    except SteerclearError as error:
        return Outcome(job, None, str(error))
    except Exception as error:
        words = machine_words(error)
        return Outcome(job, None, words or _name_of(error), None if words else _trace_of(error))


def _in_pool(function: Function, jobs: Sequence[Any], processes: int) -> Iterator[Outcome]:
    """Run in processes; a job whose process dies runs again alone, so that the one that kills it is known."""
    waiting, suspects, alone = deque(jobs), deque[Any](), deque[Any]()
    for left, lost, at_once in ((waiting, suspects, processes), (suspects, alone, 1)):
        while left:
            with _pool(min(at_once, len(left))) as pool:
                yield from _until_broken(pool, function, left, lost, at_once)
    yield from (Outcome(job, None, DIED) for job in alone)


def _until_broken(
    pool: ProcessPoolExecutor, function: Function, waiting: deque[Any], lost: deque[Any], at_once: int
) -> Iterator[Outcome]:
    """Run what waits, so many at once, until none is left or a worker died; then ``lost`` gets those under way."""
    running = dict[Future[Outcome], Any]()
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


@contextlib.contextmanager
def _pool(processes: int) -> Iterator[ProcessPoolExecutor]:
    others = set(multiprocessing.active_children())
    unset = [name for name in _ONE_THREAD if name not in os.environ]
    os.environ.update({name: _ONE_THREAD[name] for name in unset})
    pool = ProcessPoolExecutor(processes, _spawning(), _begin_worker, (_first_word(),))
    try:
        yield pool
        pool.shutdown(wait=True)
    except BaseException:  # interrupted, or the loop was left: what still runs is not wanted any more
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in set(multiprocessing.active_children()) - others:
            worker.terminate()
            worker.join()
        raise
    finally:
        for name in unset:
            del os.environ[name]


@cache
def _spawning() -> SpawnContext:
    return multiprocessing.get_context("spawn")


def _first_word() -> Semaphore:
    """What the process takes that says it."""
    if not _FIRST:
        _FIRST.append(_spawning().Semaphore(1))
    return _FIRST[0]


def _may_say(record: logging.LogRecord) -> bool:
    if COMPILES not in record.getMessage():
        return True
    try:
        return _first_word().acquire(block=False)
    except OSError:  # no semaphores here: better said twice than an error in whoever logs
        return True


LOG.addFilter(_may_say)


def _begin_worker(first: Semaphore) -> None:
    _FIRST[:] = [first]
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; only the parent answers
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if (parent := multiprocessing.parent_process()) is not None:

        def end_with_parent() -> None:
            multiprocessing.connection.wait([parent.sentinel])
            os._exit(1)

        threading.Thread(target=end_with_parent, name="parent", daemon=True).start()


@contextlib.contextmanager
def interrupted_by_signals() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM end what is inside: finished jobs are kept, and no worker is left."""

    def interrupt(*_: Any) -> None:
        _INTERRUPTED.set()
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():  # signals are the main thread's
        yield
        return
    _INTERRUPTED.clear()
    heeded = [number for number in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, interrupt) for number in heeded}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        _INTERRUPTED.clear()


def _ray() -> Any:
    if find_spec("ray") is None:
        raise ConfigError(f"Ray is not installed; {install_command('cluster')}, or leave out --engine ray")
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")  # else it warns about a default to come
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    import ray  # the extra [cluster]

    return ray


def _on_node(function: Function, job: Any) -> tuple[str, Outcome]:
    """Run a job where Ray put it; say which code ran it."""
    return code_digest(), attempt(function, job)


def _on_cluster(function: Function, jobs: Sequence[Any], cluster: Ray) -> Iterator[Outcome]:
    """Hand out jobs, a few more than the cluster has cores, and yield what comes back.

    Raises:
        ConfigError: Ray is missing, no cluster answers, or a node runs other code than this machine.
    """
    ray = _ray()
    here = {"num_cpus": cluster.processes, "include_dashboard": False} if cluster.address is None else {}
    try:
        ray.init(address=cluster.address, log_to_driver=False, logging_level="ERROR", **here)
    except (ConnectionError, RuntimeError, ValueError, OSError) as error:
        where = f"no Ray cluster answers at {cluster.address}" if cluster.address else "Ray does not start here"
        why = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
        raise ConfigError(f"{where} ({why}); start one with: ray start --head, or leave out --engine") from None
    try:
        work = ray.remote(num_cpus=1, max_retries=TRIES, scheduling_strategy="SPREAD")(_on_node)
        waiting, running = deque(jobs), dict[Any, Any]()
        while waiting or running:
            most = 2 * max(int(ray.cluster_resources().get("CPU", 1)), 1)
            while waiting and len(running) < most:
                job = waiting.popleft()
                running[work.remote(function, job)] = job
            for reference in ray.wait(list(running), num_returns=1)[0]:
                yield _from_node(ray, reference, running.pop(reference))
    finally:
        ray.shutdown()


def _from_node(ray: Any, reference: Any, job: Any) -> Outcome:
    try:
        code, outcome = ray.get(reference)
    except ray.exceptions.RayTaskError as error:  # before the job began: its code or data cannot be read there
        lines = str(error).strip().splitlines() or [type(error).__name__]
        return Outcome(job, None, f"a node could not begin it: {lines[-1].strip()[:300]}")
    except ray.exceptions.RayError:
        return Outcome(job, None, DIED)
    if code != code_digest():
        raise ConfigError("a node of the cluster runs other code or packages; install the same on all nodes")
    return outcome if isinstance(outcome, Outcome) else Outcome(job, None, DIED)
