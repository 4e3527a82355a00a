import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from steerclear.experiments.runs.pool import attempt, check_jobs, run_all
from steerclear.experiments.runs.provenance import available_cores
from steerclear.shield.exceptions import ConfigError, GameError


def work(job):
    """Importable by spawned workers: negatives go wrong, 99 kills the worker, 50 takes for ever, 20 and 21 a while."""
    if job == -1:
        raise GameError("a game setting is wrong; change it")
    if job < 0:
        raise RuntimeError("went wrong")
    if job == 99:
        os._exit(3)
    if job in (20, 21):
        time.sleep(0.3)
    if job == 50:
        time.sleep(600.0)
    return job * job, os.getpid()


def test_one_process_answers_in_order_and_errors_do_not_stop_the_rest():
    outcomes = list(run_all(work, [3, -1, -2, 4]))
    assert [outcome.job for outcome in outcomes] == [3, -1, -2, 4]
    assert [outcome.answer and outcome.answer[0] for outcome in outcomes] == [9, None, None, 16]
    assert outcomes[1].error == "a game setting is wrong; change it"
    assert "a fault of steerclear, not of yours (RuntimeError: went wrong)" in outcomes[2].error
    assert [outcome.why["fault"] for outcome in outcomes] == [False, False, True, False]


def test_several_processes_answer_every_job():
    outcomes = list(run_all(work, [1, 2, -2, 3, 4], processes=2))
    assert sorted(outcome.job for outcome in outcomes) == [-2, 1, 2, 3, 4]
    assert {outcome.job: outcome.answer[0] for outcome in outcomes if outcome.answer} == {1: 1, 2: 4, 3: 9, 4: 16}
    assert os.getpid() not in {outcome.answer[1] for outcome in outcomes if outcome.answer}


def test_a_dead_worker_is_reported_with_a_remedy():
    outcomes = list(run_all(work, [99, 99], processes=2))
    assert len(outcomes) == 2
    assert all("--resume" in outcome.error for outcome in outcomes)


def test_a_job_that_kills_its_worker_costs_no_other_job():
    jobs = [1, 99, 20, 21, 4, 5]
    outcomes = list(run_all(work, jobs, processes=2))
    assert sorted(outcome.job for outcome in outcomes) == sorted(jobs)
    assert [outcome.job for outcome in outcomes if outcome.answer is None] == [99]


SCRIPT = """
import os, sys
from steerclear.experiments.runs.pool import interrupted_by_sigterm, run_all
from test_pool import work
if __name__ == "__main__":
    try:
        with interrupted_by_sigterm():
            for outcome in run_all(work, [20, 50, 50], processes=2):
                print(outcome.answer[1], flush=True)
    except KeyboardInterrupt:
        sys.exit(130)
"""


@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 130), (signal.SIGKILL, -9)])
def test_no_worker_outlives_the_run_however_it_ends(tmp_path, number, status):
    script = tmp_path / "run.py"
    script.write_text(SCRIPT)
    here = os.path.dirname(os.path.abspath(__file__))
    run = subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": here}, text=True
    )
    try:
        worker = int(run.stdout.readline())
        run.send_signal(number)
        assert run.wait(60) == status
        end_s = time.monotonic() + 30.0
        while is_running(worker):
            assert time.monotonic() < end_s
            time.sleep(0.05)
    finally:
        run.kill()
        run.communicate()


def is_running(pid):
    try:
        os.kill(pid, 0)
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_an_interrupt_keeps_what_is_finished_and_ends_the_workers():
    finished = []
    timer = threading.Timer(30.0, os.kill, (os.getpid(), signal.SIGTERM))  # a hang fails the run, not the machine
    timer.start()
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012 - the loop is what is interrupted
        for outcome in run_all(work, [1, 50, 50], processes=2):
            finished.append(outcome.job)
            raise KeyboardInterrupt
    timer.cancel()
    assert finished == [1]


def lack(job):
    raise OSError(28, "No space left on device", "/a") if job else MemoryError


@pytest.mark.parametrize("processes", [1, 2])
def test_faults_that_are_alike_keep_their_traceback_in_one_file(processes):
    faults = list(run_all(work, [-5, -6, -5], processes))
    assert len({outcome.error for outcome in faults}) == 1
    text = Path(re.search(r"its traceback is in (.*): please report it", faults[0].error)[1]).read_text()
    assert 'raise RuntimeError("went wrong")' in text


@pytest.mark.parametrize(("job", "words"), [(0, "not enough memory"), (1, "free some space")])
def test_what_the_machine_refuses_a_job_is_no_fault(job, words):
    outcome = attempt(lack, job)
    assert words in outcome.error
    assert outcome.why == {"error": outcome.error, "fault": False}


def test_number_of_processes():
    assert check_jobs(None) == available_cores() >= 1
    assert check_jobs(3) == 3
    with pytest.raises(ConfigError, match="at least 1"):
        check_jobs(0)
