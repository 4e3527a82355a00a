"""What is kept on disk: by whom, of which code, and whole."""

import errno
import json
import os
import signal
import subprocess
import sys
import textwrap
import threading

import pytest
from steerclear.experiments.runs import provenance, store
from steerclear.experiments.runs.folder_lock import LOCK_FILE
from steerclear.experiments.runs.store import ResultStore, write_table
from steerclear.shield.exceptions import ConfigError

WRITER = """
import sys, time
from pathlib import Path
from steerclear.experiments.runs.store import ResultStore
from steerclear.shield.exceptions import ConfigError
try:
    kept = ResultStore(Path(sys.argv[1]), resume=True)
except ConfigError as error:
    sys.exit(str(error))
print("ready", flush=True)
sys.stdin.readline()
for k in range(50):
    kept.append(f"{sys.argv[2]}-{k}", {"value": k})
"""


@pytest.fixture
def writer(tmp_path):
    """Starts a process that writes into the folder when told; all are ended when the test is."""
    started = []

    def start(name):
        streams = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        command = [sys.executable, "-c", textwrap.dedent(WRITER), str(tmp_path), name]
        started.append(subprocess.Popen(command, text=True, **streams))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


def test_of_four_writers_one_writes_and_three_are_refused_by_name(tmp_path, writer):
    first = writer("0")
    assert first.stdout.readline() == "ready\n"
    others = [writer(f"{k}") for k in (1, 2, 3)]
    for other in others:
        assert f"is being written to by process {first.pid}; wait" in other.communicate(timeout=60)[1]
        assert other.returncode == 1
    with pytest.raises(ConfigError, match=f"process {first.pid}; wait until it is done or choose another --out"):
        ResultStore(tmp_path, resume=True)
    first.communicate("go\n", timeout=60)
    assert len(ResultStore(tmp_path, resume=True).load()) == 50


def test_the_lock_of_a_killed_process_is_none(tmp_path, writer):
    first = writer("0")
    first.stdout.readline()
    first.send_signal(signal.SIGKILL)
    first.wait()
    assert (tmp_path / LOCK_FILE).read_text() == f"{first.pid}\n"
    ResultStore(tmp_path, resume=True).append("a", {})


def test_threads_of_one_process_write_whole_lines(tmp_path):
    stores = [ResultStore(tmp_path, resume=True) for _ in range(4)]

    def write(number):
        for k in range(25):
            stores[number].append(f"{number}-{k}", {"value": "x" * 200})

    threads = [threading.Thread(target=write, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(ResultStore(tmp_path, resume=True).load()) == 100


def test_a_refused_folder_is_left_as_it_was(tmp_path):
    (tmp_path / "results.json").write_text("{}")
    with pytest.raises(ConfigError, match="already holds results"):
        ResultStore(tmp_path)
    assert os.listdir(tmp_path) == ["results.json"]


def test_rows_of_other_code_are_left_out_told_and_kept(tmp_path, monkeypatch, caplog):
    kept = ResultStore(tmp_path)
    monkeypatch.setattr(store, "code_digest", lambda: "older")
    kept.append("a", {"value": 1})
    kept.append("b", {"value": 1})
    monkeypatch.setattr(store, "code_digest", provenance.code_digest)
    assert kept.load() == {}
    kept.append("a", {"value": 2})
    assert [kept.load(), kept.load()] == [{"a": {"value": 2}}] * 2
    assert caplog.text.count("2 results are of other code or versions") == 1
    assert len(kept.lines.read_text().splitlines()) == 3


def test_the_digest_of_the_code_changes_with_sources_tables_and_versions(tmp_path, monkeypatch):
    for name in ("shield/a.py", "env/b.py", "policies/c.py", "experiments/runs/provenance.py", "shield/tables/d.npz"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("1")
    monkeypatch.setattr(provenance, "__file__", str(tmp_path / "experiments" / "runs" / "provenance.py"))
    digest = provenance.code_digest.__wrapped__
    seen = [digest()]
    for name in ("shield/a.py", "env/b.py", "policies/c.py", "shield/tables/d.npz"):
        (tmp_path / name).write_text("2")
        seen.append(digest())
    monkeypatch.setattr(provenance, "versions", lambda: {"numpy": "0"})
    seen.append(digest())
    assert len(set(seen)) == 6
    for name in ("experiments/commands/words.py", "experiments/report/page.py", "shield/bridge/loop.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("1")
        assert digest() == seen[-1], "what only shows results changes none"
    for name in ("shield/platforms/shipped/heron.yaml", "experiments/deploy/worker.py", "experiments/report_of.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("1")
        seen.append(digest())
    assert len(set(seen)) == 9


def test_a_whole_last_line_without_its_end_is_counted_and_stays(tmp_path):
    kept = ResultStore(tmp_path)
    kept.append("a", {"value": 1})
    kept.append("b", {"value": 2})
    kept.lines.write_bytes(kept.lines.read_bytes()[:-1])
    assert set(kept.load()) == {"a", "b"}
    kept.append("c", {"value": 3})
    assert kept.load() == {"a": {"value": 1}, "b": {"value": 2}, "c": {"value": 3}}


@pytest.mark.parametrize(
    "line",
    [
        "3", "null", "[]", '"key"', "{}", '{"key": 3}', '{"key": ["a"]}', '{"key": {"a": 1}}',
        '{"key": "a", "value": 9}', '{"key": "a", "code": 3, "sum": []}', "[" * 100_000, "9" * 5000,
        '{"key": null, "sum": "x"}', "\u2028", "NaN",
    ],
)  # fmt: skip
def test_valid_json_of_a_wrong_form_is_left_out_by_name_and_nothing_is_lost(tmp_path, caplog, line):
    kept = ResultStore(tmp_path)
    kept.append("a", {"value": 1})
    with kept.lines.open("a") as file:
        file.write(line + "\n")
    kept.append("b", {"value": 2})
    assert kept.load() == {"a": {"value": 1}, "b": {"value": 2}}
    assert "line 2 is not complete, or not as it was written" in caplog.text


def test_a_line_that_was_altered_does_not_count(tmp_path):
    kept = ResultStore(tmp_path)
    kept.append("a", {"hits": 12, "steps": "many"})
    kept.lines.write_text(kept.lines.read_text().replace("12", "11"))
    assert kept.load() == {}


def test_a_full_disk_is_one_clear_error_and_what_was_there_stays(tmp_path, monkeypatch):
    kept = ResultStore(tmp_path)
    kept.append("a", {"value": 1})
    before = kept.lines.read_bytes()

    def full(descriptor):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(store.os, "fsync", full)
    with pytest.raises(ConfigError, match=r"cannot write .*games.jsonl \(No space left on device\).*make room, then"):
        kept.append("b", {"value": 2})
    assert kept.lines.read_bytes() == before
    monkeypatch.undo()
    with pytest.raises(ConfigError, match=r"cannot write .*nowhere.*choose another place"):
        write_table(tmp_path / "nowhere", [{"a": 1}])


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is always full")
def test_a_device_that_is_full_is_told_so(tmp_path):
    kept = ResultStore(tmp_path)
    kept.lines.unlink()
    kept.lines.symlink_to("/dev/full")
    with pytest.raises(ConfigError, match="No space left on device"):
        kept.append("a", {"value": 1})


def test_results_of_too_deep_a_form_are_not_ours(tmp_path):
    (tmp_path / "results.json").write_text("[" * 100_000)
    with pytest.raises(ConfigError, match="that are not ours"):
        ResultStore(tmp_path, True, "ablate")


def test_lines_say_what_they_are(tmp_path):
    kept = ResultStore(tmp_path)
    kept.append("a", {"value": float("nan")})
    entry = json.loads(kept.lines.read_text())
    assert list(entry) == ["key", "code", "value", "sum"]
    assert entry["code"] == provenance.code_digest()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes in folders are Unix'")
@pytest.mark.parametrize("name", [store.LINES_FILE, store.RESULTS_FILE])
@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: os.symlink("/dev/zero", path)])
def test_what_is_no_plain_file_is_refused_at_once(tmp_path, name, make):
    make(tmp_path / name)
    with pytest.raises(ConfigError, match=r"is no plain file; move it away or choose another --out"):
        ResultStore(tmp_path, resume=True, command="ablate")
