"""Whatever a policy does in its process, the loop's calls return at once and say what is the matter."""

import itertools
import os
import pickle
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
from waiting import is_running, wait_for

PATIENCE_S = 180.0
"""A child imports the game, and compiles it when nobody has before."""


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
    env, numbers = MctfEnv(cast_of(fleet_of(1)).config), itertools.count(1)

    def until(process, condition):
        end_s, spent_s = time.monotonic() + PATIENCE_S, []
        while time.monotonic() < end_s:
            began_s = time.perf_counter()
            process.offer(snapshot_of(env, fleet_of(1), next(numbers), process._clock.now_s()))
            answer = process.latest()
            spent_s.append(time.perf_counter() - began_s)
            if condition(answer):
                return answer, spent_s
            time.sleep(0.01)
        pytest.fail(f"no such answer; the last one was {process.latest()}")

    return until


def answered(answer):
    return answer.commands is not None and answer.age_s < 5.0 and not answer.fault


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


LIFE = """
import os, sys
stage = len(os.listdir(NOTES))
if stage == 0:
    return (1e9, float("nan"))
if stage == 1:
    try:
        input("command? ")
    except EOFError:
        pass
    print("x" * 200_000)
    sys.stderr.write("y" * 100_000 + "\\n")
    sys.stderr.flush()
if stage in (2, 4, 6):
    open(os.path.join(NOTES, str(stage)), "w").close()
if stage == 2:
    print("the end is near")
    sys.stdout.flush()
    os._exit(7)
if stage == 4:
    os.kill(os.getpid(), 9)
while stage == 6:
    pass
return (1.0, 0.0)
"""
"""A submission that does one thing after the other; how many files there are in a folder says what."""


def test_whatever_a_policy_does_calls_return_at_once_and_say_what_is_the_matter(run, ask, write_entry, tmp_path):
    """It answers nonsense, reads and floods, ends itself, is killed and hangs; it is started again each time."""
    notes, spent_s = tmp_path / "notes", []
    notes.mkdir()
    process = run(write_entry(LIFE.replace("NOTES", repr(str(notes)))), deadline_s=1.0)

    def until(condition):
        answer, more_s = ask(process, condition)
        spent_s.extend(more_s)
        return answer

    def go_on():
        (notes / f"{len(list(notes.iterdir()))}_").touch()

    answer = until(lambda answer: answer.commands is not None)
    assert np.isnan(answer.commands.values).all()
    assert "blue_1: not finite" in answer.fault
    go_on()
    until(answered)
    first_s = process._taken_s
    until(lambda answer: answered(answer) and process._taken_s > first_s)
    assert process.restarts == 0, "one that floods and reads only slows itself"
    assert 0 < len(process._worker.output()) <= 4096
    for number, words in enumerate(
        (
            'ended itself with exit status 7, its last words: "the end is near"; starting it again',
            "was ended by SIGKILL; starting it again",
            "did not answer within 1 s; starting it again",
        ),
        1,
    ):
        go_on()
        if number == 3:
            answer = until(lambda answer: "has not answered for" in answer.fault)
            assert answer.commands is not None, "the last answer stays, and its age grows"
        until(lambda answer: words in answer.fault)  # noqa: B023
        until(answered)
        assert process.restarts == number
    assert np.median(spent_s) < 0.05
    assert max(spent_s) < 1.0, "no call waited for the policy or for its end"


LEAVES = """
import os, subprocess, sys, tempfile, time
kept = tempfile.mkdtemp()
def say(name, pid):
    open(os.path.join(NOTES, name), "w").write(str(pid))
say("child", subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"]).pid)
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        say("grandchild", os.getpid())
        time.sleep(600)
    os._exit(0)
"""


@pytest.mark.parametrize("watched", [True, False])
def test_what_it_started_and_wrote_ends_with_it(run, ask, write_entry, tmp_path, monkeypatch, watched):
    """Also what left its session, and where the process that watches it was killed."""
    notes, temporary = tmp_path / "notes", tmp_path / "temporary"
    for folder in (notes, temporary):
        folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    process = run(write_entry("return (1.0, 0.0)", start=LEAVES.replace("NOTES", repr(str(notes)))))
    ask(process, answered)
    (folder,) = temporary.iterdir()
    assert len(list(folder.iterdir())) >= 2, "its stage, and what it made itself"
    wait_until(lambda: len([note for note in notes.iterdir() if note.read_text()]) == 2)
    pids = [int(note.read_text()) for note in notes.iterdir()]
    assert all(map(is_running, pids))
    if not watched:
        os.kill(process._worker._process.pid, signal.SIGKILL)
    process.close()
    process.close()
    wait_until(lambda: not any(map(is_running, pids)) and not list(temporary.iterdir()))


def test_it_ends_when_the_runner_is_killed(fleet_of, write_entry, tmp_path):
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
        start="self.calls = 0",
    )
    script = f"""
        import pickle, time, numpy as np
        from steerclear.experiments.deploy.policy_process import PolicyProcess
        from steerclear.shield.bridge.messages import Snapshot
        process = PolicyProcess(pickle.loads({pickle.dumps(fleet_of(1))!r}), {entry!r}, 1e6)
        process.start()
        while True:
            process.offer(Snapshot(0, 0.0, np.zeros((3, 4))))
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
