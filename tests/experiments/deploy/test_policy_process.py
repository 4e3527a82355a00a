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
from made_ticks import wait_for
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.deploy import policy_process
from steerclear.experiments.deploy.player import Orders, cast_of, load_player
from steerclear.experiments.deploy.policy_process import PolicyProcess
from steerclear.shield.exceptions import PolicyError

PATIENCE_S = 180.0
"""A child imports the game, and compiles it when nobody has before."""
COUNTS = "self.calls = 0"


@pytest.fixture
def run(fleet_of):
    """Starts a policy's process for a fleet of 1 v 1; all are ended when the test is."""
    started = []

    def start(policy, deadline_s=1.0, wait=True, **options):
        started.append(PolicyProcess(fleet_of(1), policy, deadline_s, **options))
        if wait:
            started[-1].start()
        return started[-1]

    yield start
    for process in started:
        process.close()


@pytest.fixture
def ask(fleet_of, snapshot_of):
    """Shows snapshots at some rate until a condition on the answer holds; answers it, and how long calls took."""
    env = MctfEnv(cast_of(fleet_of(1)).config)

    def until(process, condition, number=1):
        end_s, spent_s = time.monotonic() + PATIENCE_S, []
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


def is_running(pid):
    try:
        os.kill(pid, 0)
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False


def wait_until(condition):
    wait_for(condition, PATIENCE_S)


def test_a_policy_answers_in_its_process_what_it_answers_here(run, ask, fleet_of, snapshot_of):
    process, fleet = run("medium", wait=False), fleet_of(1)
    answer = process.latest()
    assert (answer.commands, answer.age_s) == (None, np.inf)
    assert "loading" in process.latest().fault, "before the first answer it says why there is none"
    answer, _ = ask(process, answered)
    here = load_player(Orders(cast_of(fleet), "medium")).play(snapshot_of(MctfEnv(cast_of(fleet).config), fleet))
    np.testing.assert_array_equal(answer.commands.values, here.commands)
    assert not answer.commands.relative
    assert process.restarts == 0


def once(mark, after, act):
    """A submission that does something once, after so many calls."""
    return f"""
        import os, sys
        self.calls += 1
        if self.calls > {after} and not os.path.exists({str(mark)!r}):
            open({str(mark)!r}, "w").close()
            {act}
        return (1.0, 0.0)
    """


def test_a_policy_that_hangs_is_ended_and_started_again(run, ask, write_entry, tmp_path):
    process = run(write_entry(once(tmp_path / "hung", 8, "while True: pass"), start=COUNTS), deadline_s=0.6)
    ask(process, answered)
    answer, spent_s = ask(process, lambda answer: "has not answered for" in answer.fault)
    assert answer.commands is not None, "the last answer stays, and its age grows"
    answer, more_s = ask(process, lambda answer: "did not answer within 0.6 s" in answer.fault)
    ask(process, answered, number=10**6)
    assert process.restarts == 1
    assert np.median(spent_s + more_s) < 0.02
    assert max(spent_s + more_s) < 1.0, "no call waited for the policy or for its end"


@pytest.mark.parametrize(
    ("death", "words"),
    [
        (
            "print('the end is near'); sys.stdout.flush(); os._exit(7)",
            'ended itself with exit status 7, its last words: "the end is near"',
        ),
        ("os.kill(os.getpid(), 9)", "was ended by SIGKILL"),
        pytest.param("import ctypes; ctypes.string_at(0)", "was ended by SIGSEGV", marks=pytest.mark.study),
        pytest.param("os.closerange(3, 64); return 4", "; starting it again", marks=pytest.mark.study),
    ],
)
def test_a_policy_that_dies_is_started_again_and_its_end_is_told(run, ask, write_entry, tmp_path, death, words):
    process = run(write_entry(once(tmp_path / "died", 4, death), start=COUNTS))
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
    assert 0 < len(process._worker.output()) <= 4096
    assert np.median(spent_s + more_s) < 0.02


@pytest.mark.parametrize(
    ("policy", "words"), [("mediun", "did you mean medium"), ("missing/entry.zip", "missing/entry.zip")]
)
def test_a_policy_that_cannot_be_loaded_is_one_clear_error_at_the_start(run, policy, words):
    with pytest.raises(PolicyError, match=words):
        run(policy)


LEAVES = {
    "a child": "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\nsay(child.pid)",
    "what left its session": """
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        say(os.getpid())
        time.sleep(600)
    os._exit(0)
""",
}


@pytest.mark.parametrize("kind", LEAVES)
def test_what_it_started_ends_with_it(run, ask, write_entry, tmp_path, kind):
    note = tmp_path / "pid"
    say = f"import os, subprocess, sys, time\ndef say(pid):\n    open({str(note)!r}, 'w').write(str(pid))\n"
    process = run(write_entry("return (1.0, 0.0)", start=say + LEAVES[kind]))
    ask(process, answered)
    wait_until(lambda: note.exists() and note.read_text())  # it writes when it comes to it
    assert is_running(int(note.read_text()))
    process.close()
    process.close()
    wait_until(lambda: not is_running(int(note.read_text())))


FLEET = """
version: 1
field: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, size_m: [80, 40]}
geofence: {xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}
team: blue
feed: {listen: "127.0.0.1:14700"}
boats:
  - {name: b, agent: agent_0, platform: heron, link: {kind: mavlink, address: "udpin:127.0.0.1:14550", system_id: 1}}
  - {name: r, agent: agent_1, platform: heron, contact: feed}
"""


def test_it_ends_when_the_runner_is_killed(write_entry, tmp_path):
    """Also while the policy never answers."""
    note, folder = tmp_path / "pid", tmp_path / "temporary"
    folder.mkdir()
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
        start=COUNTS,
    )
    script = f"""
        import time, numpy as np
        from steerclear.experiments.deploy.policy_process import PolicyProcess
        from steerclear.shield.bridge.fleet_file import parse_fleet
        from steerclear.shield.bridge.messages import Snapshot
        process = PolicyProcess(parse_fleet({FLEET!r}), {entry!r}, 1e6)
        process.start()
        while True:
            process.offer(Snapshot(0, 0.0, np.zeros((2, 4))))
            time.sleep(0.05)
    """
    environment = {**os.environ, "TMPDIR": str(folder)}
    with subprocess.Popen([sys.executable, "-c", textwrap.dedent(script)], env=environment) as runner:
        try:
            wait_until(lambda: note.exists() and note.read_text())
        finally:
            runner.send_signal(signal.SIGKILL)
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


class Liar:
    """A worker that is ready, and answers the first snapshot with something."""

    is_gone, message = True, b""

    def __init__(self, orders):
        self.said = [b'{"ready": true}']

    def messages(self):
        said, self.said = self.said, []
        return said

    def send(self, snapshot):
        self.said = [self.message]

    def epitaph(self, otherwise):
        return f"failed: {otherwise}"

    def flush(self, *_):
        pass

    end = wait = flush


@pytest.mark.parametrize(
    "message",
    [b"\xff", b"[]", b"{}", b'{"number": -1}', b'{"number": 1, "commands": [[1, 2]]}', b'{"number": 1, "commands": 3}'],
)
def test_an_answer_that_is_none_ends_the_process(fleet_of, monkeypatch, message):
    monkeypatch.setattr(policy_process, "Worker", type("Told", (Liar,), {"message": message}))
    with PolicyProcess(fleet_of(1), "medium") as process:
        process.start()
        process.offer(policy_process.Snapshot(1, 0.0, np.zeros((3, 4))))
        answer = process.latest()
        assert "failed: " in answer.fault
        assert answer.commands is None
        assert process.restarts == 1


def test_pauses_between_starts_grow_to_a_limit(fleet_of, monkeypatch):
    now, starts = [0.0], []

    def refuse(orders):
        starts.append(now[0])
        raise OSError("no more processes")

    monkeypatch.setattr(policy_process.time, "monotonic", lambda: now[0])
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


TURN_S = 0.05
POLICIES = {
    "answers": "return 4",
    "hangs": "self.n += 1\nwhile self.n > 60: pass\nreturn 4",
    "dies": "import os\nself.n += 1\nif self.n > 60: os._exit(1)\nreturn 4",
    "floods": "print('x' * 100_000)\nreturn 4",
    "not finite": "return (float('nan'), 1e9)",
}


@pytest.mark.study
@pytest.mark.parametrize("kind", POLICIES)
def test_a_turn_never_waits_for_the_policy(fleet_of, snapshot_of, write_entry, kind):
    """How long the loop's two calls take; needs a machine that has nothing else to do."""
    fleet = fleet_of()
    env = MctfEnv(cast_of(fleet).config)
    env.reset(seed=1)
    spent_s, ages_s = [], []
    with PolicyProcess(fleet, write_entry(POLICIES[kind], start="self.n = 0"), 0.5) as process:
        process.start()
        begun_s = due_s = time.monotonic()
        while due_s - begun_s < 15.0:
            snapshot = snapshot_of(env, fleet, len(spent_s), time.monotonic())
            began_s = time.perf_counter()
            process.offer(snapshot)
            answer = process.latest()
            spent_s.append(time.perf_counter() - began_s)
            ages_s.append(answer.age_s)
            due_s += TURN_S
            time.sleep(max(0.0, due_s - time.monotonic()))
        restarts = process.restarts
    p50, p99, longest = 1e3 * np.quantile(spent_s, [0.5, 0.99, 1.0])
    sys.stdout.write(
        f"\n{kind}: turn {p50:.2f} ms, 99 of 100 within {p99:.1f}, longest {longest:.1f}; age of the answer "
        f"{np.median(ages_s):.3f} s; started again {restarts} times\n"
    )
    assert p99 < 10.0
    assert longest < 50.0
    assert (restarts > 0) == (kind in ("hangs", "dies"))
