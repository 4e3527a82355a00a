"""One process compiles, others that share the cache wait for it."""

import subprocess
import sys
import textwrap
import time
from contextlib import contextmanager

from steerclear.shield.compiled import compile_turns
from steerclear.shield.compiled.compile_turns import Turns

HOLD = """
import sys, time
from steerclear.shield.compiled.compile_turns import Turns
turns = Turns(sys.argv[1])
turns.take("sig")
print("held", flush=True)
time.sleep(float(sys.argv[2]))
turns.give("sig")
"""


@contextmanager
def holder(path, seconds=60.0):
    """A process that holds the turn of a signature; it is ended on leaving."""
    pipes = {"stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", HOLD, str(path), str(seconds)], **pipes) as process:
        assert process.stdout.readline().strip() == "held"
        try:
            yield process
        finally:
            process.kill()


def taken_within_s(path, sig="sig"):
    """Time until the turn was taken, s; it is given back."""
    turns, started = Turns(str(path)), time.monotonic()
    turns.take(sig)
    turns.give(sig)
    return time.monotonic() - started


def test_a_turn_is_waited_for_and_leaves_nothing_behind(tmp_path):
    with holder(tmp_path / "f", 0.5) as other:
        assert taken_within_s(tmp_path / "f") > 0.2
        assert other.wait(timeout=10) == 0
    assert not list(tmp_path.iterdir())


def test_another_signature_is_not_waited_for(tmp_path):
    with holder(tmp_path / "f"):
        assert taken_within_s(tmp_path / "f", "another") < 5.0


def test_the_dead_hold_no_turns(tmp_path):
    with holder(tmp_path / "f") as other:
        other.kill()
        other.wait(timeout=10)
        assert taken_within_s(tmp_path / "f") < 5.0


def test_a_long_wait_ends(tmp_path, monkeypatch):
    monkeypatch.setattr(compile_turns, "LONGEST_WAIT_S", 0.1)
    with holder(tmp_path / "f"):
        assert taken_within_s(tmp_path / "f") < 5.0


def test_a_turn_held_already_is_kept_and_places_without_files_are_none(tmp_path):
    turns = Turns(str(tmp_path / "f"))
    turns.take("sig")
    turns.take("sig")
    assert len(list(tmp_path.iterdir())) == 1
    turns.give("sig")
    turns.give("sig")
    assert not list(tmp_path.iterdir()), "nothing is left behind"
    for nowhere in (Turns(None), Turns(str(tmp_path / "missing" / "f"))):
        nowhere.take("sig")
        nowhere.give("sig")
    assert not list(tmp_path.iterdir())


def test_two_processes_compile_a_function_once(tmp_path):
    source = tmp_path / "slow.py"
    source.write_text("def slow(x):\n    return " + " + ".join(["x * x"] * 200) + "\n")
    code = textwrap.dedent(
        """
        import sys
        sys.path.insert(0, sys.argv[1])
        from slow import slow
        from steerclear.shield.compiled.compiling import COMPILING
        from steerclear.shield.jit import kernel
        compiled = kernel(slow)
        sys.stdin.readline()
        compiled(1.5)
        print(COMPILING.compiled)
        """
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    run = [sys.executable, "-c", code, str(tmp_path)]
    with subprocess.Popen(run, **pipes) as one, subprocess.Popen(run, **pipes) as two:
        for process in (one, two):
            process.stdin.write("go\n")
            process.stdin.flush()
        assert sum(int(process.communicate(timeout=60)[0]) for process in (one, two)) == 1
