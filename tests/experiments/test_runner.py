"""The runner: what is kept on disk, by whom, of which code; where jobs run; how a run ends and is gone on with."""

import contextlib
import json
import os
import re
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from steerclear.experiments import provenance, result_files, runner, workers
from steerclear.experiments.result_files import told_settings, write_json, write_table
from steerclear.experiments.runner import Experiment, Interrupted, execute, job_id
from steerclear.experiments.workers import (
    JobFault,
    Ray,
    attempt,
    interrupted_by_signals,
    outcomes,
    processes_of,
    workers_of,
)
from steerclear.shield.exceptions import ConfigError, GameError


def work(job):
    """Importable by spawned workers; ``do`` says what a job does."""
    do = job["do"]
    if do == "bad":
        raise GameError("a game setting is wrong; change it")
    if do == "fault":
        raise RuntimeError("went wrong")
    if do == "die":
        os._exit(3)
    if do == "stop":
        raise KeyboardInterrupt
    if do == "wait":
        time.sleep(600.0)
    if do == "slow":
        time.sleep(0.3)
    return [{"number": job["number"], "square": job["number"] ** 2, "process": os.getpid(), "empty": None}]


def jobs(*does):
    return [{"do": do, "number": number} for number, do in enumerate(does)]


def experiment(*does, command="test"):
    return Experiment(command, {"does": list(does)}, jobs(*does), work)


def test_every_job_gives_its_rows_in_order_and_a_table(tmp_path):
    noticed = []
    run = execute(experiment("", "", ""), tmp_path / "deep" / "out", notice=lambda done, of: noticed.append((done, of)))
    assert [row["square"] for row in run.rows] == [0, 1, 4] == list(run.table["square"])
    assert noticed == [(0, 3), (1, 3), (2, 3), (3, 3)]
    assert (run.finished, run.resumed, run.failed, run.interrupted) == (3, 0, [], False)
    head = json.loads((run.folder / "experiment.json").read_text())
    assert (head["command"], head["settings"], head["jobs"]) == ("test", {"does": ["", "", ""]}, 3)
    assert (run.folder / result_files.table_name()).stat().st_size > 0
    assert run.head()["complete"]
    assert job_id({"a": 1, "b": [2]}) == job_id({"b": [2], "a": 1}) != job_id({"a": 1, "b": [3]})
    run.end()


@pytest.mark.parametrize("processes", [1, 2])
def test_a_job_that_fails_stops_no_other_and_ends_the_command(tmp_path, processes):
    run = execute(experiment("", "bad", "fault", ""), tmp_path, processes)
    assert [row["number"] for row in run.rows] == [0, 3]
    words = {failure["number"]: (failure["error"], failure["fault"]) for failure in run.failed}
    assert words[1] == ("a game setting is wrong; change it", False)
    assert "a fault of steerclear, not of yours (RuntimeError: went wrong)" in words[2][0]
    trace = Path(re.search(r"its traceback is in (.*): please report it", words[2][0])[1]).read_text()
    assert 'raise RuntimeError("went wrong")' in trace
    assert not run.head()["complete"]
    with pytest.raises(JobFault, match="2 games could not be played"):
        run.end()
    with pytest.raises(ConfigError, match=r"1 games could not be played.*put that right, then add --resume"):
        execute(experiment("bad"), tmp_path / "other").end()


def test_a_job_that_kills_its_worker_costs_no_other_job(tmp_path):
    run = execute(experiment("", "die", "slow", "slow", ""), tmp_path, 2)
    assert [row["number"] for row in run.rows] == [0, 2, 3, 4]
    assert os.getpid() not in {row["process"] for row in run.rows}
    assert [(failure["number"], failure["fault"]) for failure in run.failed] == [(1, False)]
    assert "--resume" in run.failed[0]["error"]


def test_an_interruption_right_after_a_job_is_written_counts_that_job(tmp_path, monkeypatch):
    append = runner.append_row

    def interrupted_once_written(*arguments):
        append(*arguments)
        raise KeyboardInterrupt

    monkeypatch.setattr(runner, "append_row", interrupted_once_written)
    run = execute(experiment("", ""), tmp_path / "out")
    lines = (tmp_path / "out" / "rows.jsonl").read_text().splitlines()
    assert (run.interrupted, run.finished, len(lines)) == (True, 1, 1)
    assert len(run.rows) == 1


def test_an_interrupted_run_is_gone_on_with(tmp_path, caplog):
    stopped = execute(experiment("", "", "stop", ""), tmp_path)
    assert (stopped.interrupted, stopped.finished) == (True, 2)
    with pytest.raises(Interrupted, match=r"2 of 4 games kept in .*rows\.jsonl; the same command .* --resume"):
        stopped.end()
    with pytest.raises(ConfigError, match="already holds results; add --resume"):
        execute(experiment("", "", "", ""), tmp_path)
    whole = execute(experiment("", "", "", ""), tmp_path, resume=True)
    assert "2 of 4 games are in" in caplog.text
    assert (whole.resumed, whole.finished, whole.interrupted) == (2, 4, False)
    assert [row["number"] for row in whole.rows] == [0, 1, 2, 3]


def with_settings(settings, *numbers):
    return Experiment("test", settings, [{"do": "", "number": k, **settings["play"]} for k in numbers], work)


def test_other_settings_are_refused_by_name_and_more_of_the_same_go_on(tmp_path):
    begun = {"games": 2, "play": {"delay_s": 0.0, "shield": None}}
    run = execute(with_settings(begun, 0, 1), tmp_path)
    run.write({"command": "test"})
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    for other, words in (
        ({"games": 2, "play": {"delay_s": 0.3, "shield": None}}, r"play\.delay_s was 0\.0, is 0\.3\), which"),
        ({"games": 1, "play": {"delay_s": 0.0, "shield": None}}, r"games was 2, is 1\)"),
        ({"games": 2, "play": {"shield": "on", "long": "x" * 99}}, r"shield was not set, is on; .*long .*x…"),
    ):
        with pytest.raises(ConfigError, match=f"{words}.*give the same settings, or choose another --out"):
            execute(with_settings(other, *range(other["games"])), tmp_path, resume=True)
    assert before == {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    more = execute(with_settings({**begun, "games": 3}, 0, 1, 2), tmp_path, resume=True)
    assert (more.resumed, len(more.rows)) == (2, 3)
    (tmp_path / "rows.jsonl").write_text("")  # results.json alone is worth as much
    with pytest.raises(ConfigError, match="games was 3, is 2"):
        execute(with_settings(begun, 0, 1), tmp_path, resume=True)


def test_settings_of_an_earlier_version_are_compared_under_their_present_names(tmp_path):
    execute(Experiment("test", {"filters": ["shield"], "games": 2}, jobs("", ""), work), tmp_path)
    path = tmp_path / "experiment.json"
    path.write_text(path.read_text().replace("filters", "guards"))
    with pytest.raises(ConfigError, match=r"\(games was 2, is 1\)"):
        execute(Experiment("test", {"filters": ["shield"], "games": 1}, jobs("slow"), work), tmp_path, resume=True)


def test_rows_without_their_settings_are_not_replaced(tmp_path):
    settings = {f"s{k}": k for k in range(6)}
    execute(Experiment("test", settings, jobs("", ""), work), tmp_path)
    (tmp_path / "experiment.json").unlink()
    with pytest.raises(ConfigError, match=r"s0 was not set, is 0; .*; and 2 more\)"):
        execute(Experiment("test", settings, jobs("slow"), work), tmp_path, resume=True)


def test_rows_of_a_policy_whose_files_changed_stay_and_count_for_nothing(tmp_path, caplog):
    settings = {"own": "mine.py"}
    execute(Experiment("test", settings, jobs("", ""), work), tmp_path)
    changed = execute(Experiment("test", settings, jobs("slow"), work), tmp_path, resume=True)
    assert (changed.resumed, len(changed.rows)) == (0, 1)
    assert "2 there are of a policy's files before they changed" in caplog.text


def lines_of(folder):
    return folder / "rows.jsonl"


@pytest.mark.parametrize(
    "line", ["3", "{}", '{"job": 3}', '{"job": "a", "rows": []}', "[" * 100_000, "9" * 5000, "NaN"]
)
def test_a_line_of_a_wrong_form_is_left_out_by_name_and_nothing_is_lost(tmp_path, caplog, line):
    execute(experiment(""), tmp_path)
    with lines_of(tmp_path).open("a") as file:
        file.write(line + "\n")
    assert len(runner.read_rows(lines_of(tmp_path))) == 1
    assert "line 2 is not complete, or not as it was written" in caplog.text


def test_a_line_that_was_altered_does_not_count_and_a_last_one_without_its_end_does(tmp_path):
    execute(experiment("", ""), tmp_path)
    text = lines_of(tmp_path).read_text().replace('"square": 1', '"square": 2')
    lines_of(tmp_path).write_text(text)
    assert [rows[0]["number"] for rows in runner.read_rows(lines_of(tmp_path)).values()] == [0]
    lines_of(tmp_path).write_text(text.splitlines()[0])
    again = execute(experiment("", ""), tmp_path, resume=True)
    assert (again.resumed, len(runner.read_rows(lines_of(tmp_path)))) == (1, 2)


def test_rows_of_other_code_are_left_out_told_and_kept(tmp_path, monkeypatch, caplog):
    execute(experiment("", ""), tmp_path)
    monkeypatch.setattr(runner, "code_digest", lambda: "newer")
    again = execute(experiment("", ""), tmp_path, resume=True)
    assert again.resumed == 0
    assert "2 results are of other code or versions" in caplog.text
    assert len(lines_of(tmp_path).read_text().splitlines()) == 4


def test_a_folder_of_something_else_is_refused_and_left_as_it_was(tmp_path):
    (tmp_path / "results.json").write_text('{"my": "results"}')
    for resume, words in ((False, "already holds results"), (True, "holds results of 'unknown', not of 'test'")):
        with pytest.raises(ConfigError, match=words):
            execute(experiment(""), tmp_path, resume=resume)
    (tmp_path / "results.json").write_text('{"command": "ablate"}')
    with pytest.raises(ConfigError, match="holds results of 'ablate', not of 'test'; choose another --out"):
        execute(experiment(""), tmp_path, resume=True)
    assert os.listdir(tmp_path) == ["results.json"]
    (tmp_path / "results.json").unlink()
    (tmp_path / "report.html").touch()
    with pytest.raises(ConfigError, match=r"report\.html would be written over"):
        execute(experiment(""), tmp_path)


def test_a_folder_that_cannot_be_written_to_is_one_clear_error(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match="choose another --out"):
        execute(experiment(""), tmp_path / "file" / "out")
    os.mkfifo(tmp_path / "rows.jsonl")  # nobody waits for what it says
    with pytest.raises(ConfigError, match="is no plain file; move it away or choose another --out"):
        execute(experiment(""), tmp_path, resume=True)
    (tmp_path / "rows.jsonl").unlink()
    (tmp_path / "rows.jsonl").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"cannot read .*rows.jsonl .*is no text.*move it away"):
        execute(experiment(""), tmp_path, resume=True)


def deaf(job):
    """A job in which the interruption is lost, as in a callback of compiled code."""
    with contextlib.suppress(KeyboardInterrupt):
        os.kill(os.getpid(), job["signal"])
        time.sleep(1.0)
    return [{"number": job["number"]}]


def test_what_an_experiment_is_about_is_told_once_nothing_refuses_it(tmp_path):
    told = []
    about = Experiment("test", {}, jobs("slow"), work, about="one game in all")
    execute(about, tmp_path, tell=told.append)
    assert told == ["one game in all"]
    with pytest.raises(ConfigError, match="already holds results"):
        execute(about, tmp_path, tell=told.append)
    assert told == ["one game in all"]


def say_that_it_compiles(job):
    """A job whose process would say what the compiler says."""
    workers.LOG.warning("steerclear %s, once", workers.COMPILES)
    workers.LOG.warning("%s is its own", job)
    time.sleep(0.3)  # so that the other process has its share
    return []


def test_of_many_processes_one_says_that_code_is_compiled(capfd, monkeypatch):
    monkeypatch.setattr(workers, "_FIRST", [])
    for _ in range(2):
        assert len(list(outcomes(say_that_it_compiles, ["a", "b", "c", "d"], 2))) == 4
    said = capfd.readouterr().err
    assert said.count(workers.COMPILES) == 1
    assert said.count("is its own") == 8


def test_where_there_are_no_semaphores_who_says_that_code_is_compiled_gets_no_error(monkeypatch, caplog):
    def none():
        raise OSError("no semaphores")

    monkeypatch.setattr(workers, "_first_word", none)
    workers.LOG.warning("steerclear %s, once", workers.COMPILES)
    assert workers.COMPILES in caplog.text


@pytest.fixture
def heeded():
    """Signals are heeded, also where a shell started the tests in the background."""
    before = {number: signal.signal(number, signal.default_int_handler) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_that_a_job_loses_ends_the_run_after_that_job(tmp_path, number, heeded):
    work_left = [{"number": k, "signal": int(number)} for k in range(3)]
    with interrupted_by_signals():
        run = execute(Experiment("test", {}, work_left, deaf), tmp_path)
    assert (run.interrupted, run.finished) == (True, 1)
    assert signal.getsignal(number) is signal.default_int_handler


def lack(job):
    raise OSError(28, "No space left on device", "/a") if job else MemoryError


@pytest.mark.parametrize(("job", "words"), [(0, "not enough memory"), (1, "free some space")])
def test_what_the_machine_refuses_a_job_is_no_fault(job, words):
    outcome = attempt(lack, job)
    assert words in outcome.error
    assert outcome.why == {"error": outcome.error, "fault": False}


def test_json_has_no_numbers_that_other_readers_refuse(tmp_path):
    write_json(tmp_path / "sub" / "x.json", {"a": [float("nan"), np.int64(3), (1.0, -np.inf)], "p": tmp_path})
    assert json.loads((tmp_path / "sub" / "x.json").read_text()) == {"a": [None, 3, [1.0, None]], "p": str(tmp_path)}
    assert told_settings({"shield": {"adversary_horizon_s": np.inf}}) == {"shield": {"adversary_horizon_s": "inf"}}
    with pytest.raises(TypeError, match="set"):
        write_json(tmp_path / "x.json", {"a": {1}})
    with pytest.raises(ConfigError, match="choose another place"):
        write_json(tmp_path / "sub" / "x.json" / "y.json", {})


def test_rows_with_different_columns_make_one_table(tmp_path, monkeypatch):
    rows = [{"a": 1, "b": "x", "d": True}, {"a": 2, "c": 0.5}]
    monkeypatch.setattr(result_files, "find_spec", lambda name: None)
    assert write_table(tmp_path, rows).read_text().splitlines() == ["a,b,d,c", "1,x,True,", "2,,,0.5"]


def test_the_digest_of_the_code_changes_with_sources_tables_and_versions(tmp_path, monkeypatch):
    def write(name, text):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)

    made = ("shield/a.py", "env/b.py", "policies/c.py", "experiments/runner.py", "shield/tables/d.npz")
    for name in made:
        write(name, "1")
    monkeypatch.setattr(provenance, "__file__", str(tmp_path / "experiments" / "provenance.py"))
    digest = provenance.code_digest.__wrapped__
    seen = [digest()]
    for name in (*made, "shield/platforms/shipped/heron.yaml", "experiments/deploy/worker.py"):
        write(name, "2")
        seen.append(digest())
    assert len(set(seen)) == 8
    for name in ("experiments/cli_words.py", "experiments/report.py", "shield/bridge/loop.py"):
        write(name, "3")
        assert digest() == seen[-1], "what only shows results changes none"
    monkeypatch.setattr(provenance, "versions", lambda: {"numpy": "0"})
    assert digest() != seen[-1]


def test_number_of_processes_and_the_extra_of_clusters(monkeypatch):
    assert processes_of(None) == provenance.available_cores() >= 1
    assert processes_of(3) == workers_of("pool", None, 3) == 3
    monkeypatch.setattr(workers, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"steerclear\[cluster\]|\.\[cluster\]"):
        workers_of("ray", None, 2)


@pytest.mark.study
@pytest.mark.filterwarnings("default")
def test_ray_here_gives_what_the_pool_gives(monkeypatch):
    pytest.importorskip("ray")
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))  # its workers import what a job calls
    asked = jobs("", "bad", "", "")
    found = {o.job["number"]: (o.error, o.answer and o.answer[0]["square"]) for o in outcomes(work, asked, Ray(2))}
    here = {o.job["number"]: (o.error, o.answer and o.answer[0]["square"]) for o in outcomes(work, asked, 2)}
    assert found == here


@pytest.mark.study
@pytest.mark.filterwarnings("default")
def test_a_node_killed_in_the_middle_costs_no_job(monkeypatch):
    pytest.importorskip("ray")
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    other = cluster.add_node(num_cpus=1)
    try:
        answers = []
        for outcome in outcomes(work, jobs(*["slow"] * 12), Ray(address=cluster.address)):
            answers.append(outcome)
            if len(answers) == 3:
                cluster.remove_node(other, allow_graceful=False)
        assert sorted(outcome.job["number"] for outcome in answers) == list(range(12))
        assert all(outcome.error is None for outcome in answers)
    finally:
        cluster.shutdown()
