"""Engines: the same outcomes wherever jobs run; a cluster that loses a node loses nothing."""

import os
import time
from pathlib import Path

import pytest
from steerclear.experiments.runs import engines
from steerclear.experiments.runs.engines import RayEngine, engine_of
from steerclear.experiments.runs.pool import Outcome, run_all
from steerclear.shield.exceptions import ConfigError


def double(number):
    if number == 3:
        raise ValueError("three")
    return 2 * number


def slow(number):
    time.sleep(0.5)
    return os.getpid()


def test_an_engine_takes_the_place_of_processes():
    class Backwards:
        def run(self, function, jobs):
            return (Outcome(job, function(job)) for job in reversed(jobs))

    assert [outcome.answer for outcome in run_all(double, [1, 2], Backwards())] == [4, 2]


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (("slurm", None, None), "unknown engine 'slurm'; choose one of pool, ray"),
        (("pool", "auto", None), "--address is of a Ray cluster; add --engine ray"),
        (("ray", "auto", 3), "leave out --jobs, or --address"),
        (("pool", None, 0), "--jobs must be at least 1"),
    ],
)
def test_what_does_not_go_together_is_refused(given, text):
    with pytest.raises(ConfigError, match=text):
        engine_of(*given)


def test_the_extra_is_named_where_ray_is_missing(monkeypatch):
    monkeypatch.setattr(engines, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"pip install \"steerclear\[cluster\]\""):
        engine_of("ray", None, 2)


@pytest.fixture
def jobs_of_this_file(monkeypatch):
    """Ray's workers import what a job calls, as they do with our own code; this file lies on no path of theirs."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))


@pytest.mark.study
@pytest.mark.filterwarnings("default")
@pytest.mark.usefixtures("jobs_of_this_file")
def test_ray_here_gives_what_the_pool_gives():
    pytest.importorskip("ray")
    found = {outcome.job: (outcome.answer, outcome.error) for outcome in RayEngine(2).run(double, range(6))}
    assert found == {outcome.job: (outcome.answer, outcome.error) for outcome in run_all(double, range(6), 2)}


@pytest.mark.study
@pytest.mark.filterwarnings("default")
def test_a_job_that_no_node_can_read_says_why():
    pytest.importorskip("ray")
    outcome = next(RayEngine(1).run(double, [1]))
    assert outcome.error == f"a node could not begin it: ModuleNotFoundError: No module named {__name__!r}"


@pytest.mark.study
@pytest.mark.filterwarnings("default")
@pytest.mark.usefixtures("jobs_of_this_file")
def test_a_node_killed_in_the_middle_costs_no_job():
    pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    other = cluster.add_node(num_cpus=1)
    try:
        answers = []
        for outcome in RayEngine(address=cluster.address).run(slow, range(12)):
            answers.append(outcome)
            if len(answers) == 3:
                cluster.remove_node(other, allow_graceful=False)
        assert sorted(outcome.job for outcome in answers) == list(range(12))
        assert all(outcome.error is None for outcome in answers)
    finally:
        cluster.shutdown()
