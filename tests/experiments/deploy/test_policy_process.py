"""Whatever a policy does in its process, the loop's calls return at once and say what is the matter."""

import os
import signal
import subprocess
import sys
import tempfile
import textwrap
import time

import numpy as np
import pytest
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.deploy import policy_process
from steerclear.experiments.deploy.player import Orders, cast_of, load_player
from steerclear.experiments.deploy.policy_process import PolicyProcess
from steerclear.shield.exceptions import PolicyError

PATIENCE_S = 180.0
"""A child imports the game, and compiles it when nobody has before."""


@pytest.fixture
def run(fleet_of, snapshot_of):
    """Starts a policy's process for a fleet of 1 v 1; all are ended when the test is."""
    started = []

    def start(policy, deadline_s=1.0, wait=True, **options):
        process = PolicyProcess(fleet_of(1), policy, deadline_s, **options)
        started.append(process)
        if wait:
            process.start()
        return process

    yield start
    for process in started:
        process.close()


@pytest.fixture
def ask(fleet_of, snapshot_of):
    """Shows snapshots at some rate until a condition on the answer holds; answers it, and how long calls took."""
    env = MctfEnv(cast_of(fleet_of(1)).config)

    def until(process, condition, number=1, limit_s=PATIENCE_S):
        end_s = time.monotonic() + limit_s
        spent_s = []
        while time.monotonic() < end_s:
            began_s = time.perf_counter()
            process.offer(snapshot_of(env, fleet_of(1), number, process._clock.now_s()))
            answer = process.latest()
            spent_s.append(time.perf_counter() - began_s)
            if condition(answer):
                return answer, spent_s
            number += 1
            time.sleep(0.01)
        pytest.fail(f"no such answer; the last one was {process.latest()}")

    return until


def answered(answer):
    return answer.commands is not None and answer.age_s < 5.0 and not answer.fault


def test_a_policy_answers_in_its_process_what_it_answers_here(run, ask, fleet_of, snapshot_of):
    process = run("medium")
    answer, _ = ask(process, answered)
    fleet = fleet_of(1)
    snapshot = snapshot_of(MctfEnv(cast_of(fleet).config), fleet)
    here = load_player(Orders(cast_of(fleet), "medium")).play(snapshot)
    np.testing.assert_array_equal(answer.commands.values, here.commands)
    assert not answer.commands.relative
    assert process.restarts == 0


def test_before_the_first_answer_there_is_none_and_it_says_why(run):
    process = run("medium", wait=False)
    answer = process.latest()
    assert answer.commands is None
    assert answer.age_s == np.inf
    assert "loading" in process.latest().fault


def test_a_policy_that_hangs_is_ended_and_started_again(run, ask, write_entry, tmp_path):
    mark = tmp_path / "hung"
    entry = write_entry(
        f"""
        import os
        self.calls += 1
        if self.calls > 8 and not os.path.exists({str(mark)!r}):
            open({str(mark)!r}, "w").close()
            while True:
                pass
        return (1.0, 0.0)
        """,
        start="self.calls = 0",
    )
    process = run(entry, deadline_s=0.6)
    ask(process, answered)
    answer, spent_s = ask(process, lambda answer: "has not answered for" in answer.fault)
    assert answer.commands is not None, "the last answer stays, and its age grows"
    answer, more_s = ask(process, lambda answer: "did not answer within 0.6 s" in answer.fault)
    ask(process, answered, number=10**6)
    assert process.restarts == 1
    spent_s = np.array(spent_s + more_s)
    assert np.median(spent_s) < 0.02
    assert spent_s.max() < 1.0, "no call waited for the policy or for its end"


@pytest.mark.parametrize(
    ("death", "words"),
    [
        ("print('the end is near'); os._exit(7)", 'ended itself with exit status 7, its last words: "the end is near"'),
        ("os.kill(os.getpid(), 9)", "was ended by SIGKILL"),
        pytest.param("import ctypes; ctypes.string_at(0)", "was ended by SIGSEGV", marks=pytest.mark.study),
        pytest.param("os.closerange(3, 64); return 4", "; starting it again", marks=pytest.mark.study),
    ],
)
def test_a_policy_that_dies_is_started_again_and_its_end_is_told(run, ask, write_entry, tmp_path, death, words):
    mark = tmp_path / "died"
    entry = write_entry(
        f"""
        import os, sys
        self.calls += 1
        if self.calls > 4 and not os.path.exists({str(mark)!r}):
            open({str(mark)!r}, "w").close()
            sys.stdout.flush()
            {death.replace("; ", "; sys.stdout.flush(); ", 1) if "print" in death else death}
        return (1.0, 0.0)
        """,
        start="self.calls = 0",
    )
    process = run(entry)
    answer, spent_s = ask(process, lambda answer: words in answer.fault)
    assert "starting it again" in answer.fault
    assert max(spent_s) < 1.0
    if words == "was ended by SIGKILL":
        ask(process, answered, number=10**6)
        assert process.restarts == 1


def test_unusable_answers_leave_the_boat_without_a_command(run, ask, write_entry):
    process = run(write_entry("return (1e9, float('nan'))"))
    answer, _ = ask(process, lambda answer: answer.commands is not None)
    assert np.isnan(answer.commands.values).all()
    assert "blue_1: not finite" in answer.fault


def test_a_policy_that_floods_and_reads_only_slows_itself(run, ask, write_entry):
    entry = write_entry(
        """
        import sys
        try:
            input("command? ")
        except EOFError:
            pass
        print("x" * 200_000)
        sys.stderr.write("y" * 100_000)
        sys.stderr.flush()
        return (1.0, 0.0)
        """
    )
    process = run(entry, deadline_s=20.0)
    _, spent_s = ask(process, answered)
    first_s = process._taken_s
    _, more_s = ask(process, lambda answer: answered(answer) and process._taken_s > first_s, number=10**6)
    assert process.restarts == 0
    assert 0 < len(process.output()) <= 4096
    assert np.median(spent_s + more_s) < 0.02


def test_a_policy_that_loads_slowly_is_waited_for_but_not_for_ever(run, write_entry):
    slow = write_entry("return 4", head="import time\ntime.sleep(0.3)")
    assert run(slow).latest().fault in ("", "policy has not been asked yet")
    with pytest.raises(PolicyError, match="does not start: not within 1 s"):
        run(write_entry("return 4", head="import time\ntime.sleep(600)"), start_within_s=1.0)


@pytest.mark.parametrize(
    ("policy", "words"), [("mediun", "did you mean medium"), ("missing/entry.zip", "missing/entry.zip")]
)
def test_a_policy_that_cannot_be_loaded_is_one_clear_error_at_the_start(run, policy, words):
    with pytest.raises(PolicyError, match=words):
        run(policy)


def test_what_it_started_ends_with_it(run, ask, write_entry, tmp_path):
    note = tmp_path / "pid"
    entry = write_entry(
        "return (1.0, 0.0)",
        start=f"""
        import subprocess, sys
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
        with open({str(note)!r}, "a") as file:
            file.write(f"{{child.pid}} ")
        """,
    )
    process = run(entry)
    ask(process, answered)
    children = [int(pid) for pid in note.read_text().split()]
    assert all(is_running(pid) for pid in children)
    process.close()
    process.close()
    wait_until(lambda: not any(is_running(pid) for pid in children))


def test_what_left_its_session_ends_with_it_too(run, ask, write_entry, tmp_path):
    note = tmp_path / "pid"
    entry = write_entry(
        "return (1.0, 0.0)",
        start=f"""
        import os, time
        if os.fork() == 0:
            os.setsid()
            if os.fork() == 0:
                open({str(note)!r}, "w").write(str(os.getpid()))
                time.sleep(600)
            os._exit(0)
        """,
    )
    process = run(entry)
    ask(process, answered)
    wait_until(lambda: note.exists() and note.read_text())  # it writes when it comes to it
    daemon = int(note.read_text())
    assert is_running(daemon)
    process.close()
    wait_until(lambda: not is_running(daemon))


def test_a_policy_that_takes_more_than_its_limits_is_ended_by_name(run, ask, write_entry):
    entry = write_entry(
        """
        import os, time
        self.calls += 1
        if self.calls > 4:
            for _ in range(20):
                if os.fork() == 0:
                    time.sleep(600)
            time.sleep(600)
        return (1.0, 0.0)
        """,
        start="self.calls = 0",
    )
    answer, _ = ask(run(entry, deadline_s=60.0), lambda answer: "was ended: it ran more than 16" in answer.fault)
    assert "starting it again" in answer.fault


def test_it_ends_when_the_runner_is_killed(write_entry, tmp_path, fleet_of):
    """Also while the policy never answers."""
    note = tmp_path / "pid"
    entry = write_entry(
        f"""
        import os
        self.calls += 1
        if self.calls > 1:
            open({str(note)!r}, "w").write(str(os.getpid()))
        while self.calls > 1:
            pass
        return 4
        """,
        start="self.calls = 0",
    )
    script = f"""
        import time, numpy as np
        from steerclear.experiments.deploy.policy_process import PolicyProcess
        from steerclear.shield.bridge.fleet_file import parse_fleet
        from steerclear.shield.bridge.messages import Snapshot
        process = PolicyProcess(parse_fleet({fleet_text()!r}), {entry!r}, 1e6)
        process.start()
        while True:
            process.offer(Snapshot(0, 0.0, np.zeros((2, 4))))
            time.sleep(0.05)
    """
    folder = tmp_path / "temporary"
    folder.mkdir()
    runner = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(script)], env={**os.environ, "TMPDIR": str(folder)}
    )
    try:
        wait_until(lambda: note.exists() and note.read_text())
    finally:
        runner.send_signal(signal.SIGKILL)
        runner.wait()
    wait_until(lambda: not is_running(int(note.read_text())))
    assert list(folder.iterdir()) == []


def test_what_a_submission_leaves_in_temporary_files_goes_with_its_process(run, write_entry, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    process = run(write_entry("return 4", start="import tempfile; self.kept = tempfile.mkdtemp()"))
    (folder,) = (tmp_path / "temporary").iterdir()
    assert len(list(folder.iterdir())) >= 2, "its stage, and what it made itself"
    process.close()
    assert list((tmp_path / "temporary").iterdir()) == []


def fleet_text():
    return """
version: 1
field: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, size_m: [80, 40]}
geofence: {xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}
team: blue
feed: {listen: "127.0.0.1:14700"}
boats:
  - {name: b, agent: agent_0, platform: heron, link: {kind: mavlink, address: "udpin:127.0.0.1:14550", system_id: 1}}
  - {name: r, agent: agent_1, platform: heron, contact: feed}
"""


@pytest.mark.parametrize(
    "message",
    [b"\xff", b"[]", b"{}", b'{"number": -1}', b'{"number": 1, "commands": [[1, 2]]}', b'{"number": 1, "commands": 3}'],
)
def test_an_answer_that_is_none_ends_the_process(fleet_of, message):
    class Liar:
        is_gone = True

        def __init__(self, orders):
            self.said = [b'{"ready": true}']

        def messages(self):
            said, self.said = self.said, []
            return said

        def send(self, snapshot):
            self.said = [message]

        def flush(self):
            pass

        def epitaph(self, otherwise):
            return f"failed: {otherwise}"

        def end(self):
            pass

        def wait(self, timeout_s):
            pass

    worker, policy_process.Worker = policy_process.Worker, Liar
    try:
        with PolicyProcess(fleet_of(1), "medium") as process:
            process.start()
            process.offer(snapshot(1))
            answer = process.latest()
            assert "failed: " in answer.fault
            assert answer.commands is None
            assert process.restarts == 1
    finally:
        policy_process.Worker = worker


def snapshot(number):
    return policy_process.Snapshot(number, 0.0, np.zeros((3, 4)))


def test_pauses_between_starts_grow_to_a_limit(fleet_of, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(policy_process.time, "monotonic", lambda: now[0])

    def refuse(orders):
        starts.append(now[0])
        raise OSError("no more processes")

    starts = []
    monkeypatch.setattr(policy_process, "Worker", refuse)
    process = PolicyProcess(fleet_of(1), "medium")
    while now[0] < 60.0:
        answer = process.latest()
        now[0] += 0.05
    gaps = np.diff(starts)
    assert gaps[0] < 0.4
    assert (np.diff(gaps) > -0.06).all()
    assert gaps.max() == pytest.approx(10.0, abs=0.1)
    assert "cannot be started (no more processes)" in answer.fault
    process.close()


def is_running(pid):
    try:
        os.kill(pid, 0)
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False


def wait_until(condition):
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.02)
