"""Where the jobs of a command run: processes of this machine, or a Ray cluster (extra ``[cluster]``)."""

from __future__ import annotations

import contextlib
import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, TypeVar

from steerclear.shield.exceptions import ConfigError
from steerclear.shield.extras import install_command

from .pool import DIED, Outcome, attempt, check_jobs
from .provenance import code_digest

Job = TypeVar("Job")
Answer = TypeVar("Answer")
ENGINES = ("pool", "ray")
TRIES = 4
"""Times a job is begun anew on a cluster when its node or worker is lost."""


@dataclass(frozen=True)
class RayEngine:
    """Runs jobs on a Ray cluster; what a lost node had under way runs again elsewhere.

    Attributes:
        processes: jobs at once where Ray is started here.
        address: of a running cluster, such as ``auto`` or ``10.0.0.1:6379``; None starts Ray on this machine.
    """

    processes: int = 1
    address: str | None = None

    def run(self, function: Callable[[Job], Answer], jobs: Sequence[Job]) -> Iterator[Outcome[Job, Answer]]:
        """Yield one outcome per job in the order they end, as `pool.run_all` does.

        Raises:
            ConfigError: Ray is missing, no cluster answers, or a node runs other code than this machine.
        """
        ray = _ray()
        with self._connected(ray):
            work = ray.remote(num_cpus=1, max_retries=TRIES, scheduling_strategy="SPREAD")(_on_node)
            yield from _outcomes(ray, work, function, jobs)

    @contextlib.contextmanager
    def _connected(self, ray: Any) -> Iterator[None]:
        here = {"num_cpus": self.processes, "include_dashboard": False} if self.address is None else {}
        try:
            ray.init(address=self.address, log_to_driver=False, logging_level="ERROR", **here)
        except (ConnectionError, RuntimeError, ValueError, OSError) as error:
            where = f"no Ray cluster answers at {self.address}" if self.address else "Ray does not start here"
            why = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
            raise ConfigError(f"{where} ({why}); start one with: ray start --head, or leave out --engine") from None
        try:
            yield
        finally:
            ray.shutdown()


Workers = int | RayEngine
"""So many processes of this machine, or a cluster."""


def engine_of(name: str, address: str | None, jobs: int | None) -> Workers:
    """What ``--engine``, ``--address`` and ``--jobs`` ask for.

    Raises:
        ConfigError: an unknown engine, an address without Ray, Ray missing, or an unusable number of jobs.
    """
    if name not in ENGINES:
        raise ConfigError(f"unknown engine {name!r}; choose one of {', '.join(ENGINES)}")
    if name == "pool":
        if address is not None:
            raise ConfigError("--address is of a Ray cluster; add --engine ray")
        return check_jobs(jobs)
    if address is not None and jobs is not None:
        raise ConfigError("a cluster's nodes say how many jobs they run; leave out --jobs, or --address")
    _ray()
    return RayEngine(check_jobs(jobs), address)


def _ray() -> Any:
    if find_spec("ray") is None:
        raise ConfigError(f"Ray is not installed; {install_command('cluster')}, or leave out --engine ray")
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")  # else it warns about a default to come
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    import ray  # the extra [cluster]

    return ray


def _on_node(function: Callable[[Job], Answer], job: Job) -> tuple[str, Outcome[Job, Answer]]:
    """Run a job where Ray put it; say which code ran it."""
    return code_digest(), attempt(function, job)


def _outcomes(
    ray: Any, work: Any, function: Callable[[Job], Answer], jobs: Sequence[Job]
) -> Iterator[Outcome[Job, Answer]]:
    """Hand out jobs, a few more than the cluster has cores, and yield what comes back."""
    waiting, running = deque(jobs), {}
    own = code_digest()
    while waiting or running:
        most = 2 * max(int(ray.cluster_resources().get("CPU", 1)), 1)
        while waiting and len(running) < most:
            job = waiting.popleft()
            running[work.remote(function, job)] = job
        done, _ = ray.wait(list(running), num_returns=1)
        for reference in done:
            job = running.pop(reference)
            try:
                code, outcome = ray.get(reference)
            except ray.exceptions.RayTaskError as error:  # before the job began: its code or data cannot be read there
                yield Outcome(job, None, f"a node could not begin it: {_last_line(error)}")
                continue
            except ray.exceptions.RayError:
                yield Outcome(job, None, DIED)
                continue
            if code != own:
                raise ConfigError("a node of the cluster runs other code or packages; install the same on all nodes")
            yield outcome


def _last_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[-1].strip()[:300] if lines else type(error).__name__
