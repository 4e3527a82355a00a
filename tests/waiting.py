"""Waiting for what threads and processes do, and doing something meanwhile."""

import contextlib
import threading
import time
from pathlib import Path


def is_running(pid):
    """Whether a process lives, zombies left out."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state not in ("Z", "X")


def until(condition, patience_s=10.0):
    """Wait until something holds; whether it does in time."""
    end_s = time.monotonic() + patience_s
    while not condition():
        if time.monotonic() > end_s:
            return False
        time.sleep(0.005)
    return True


def wait_for(condition, patience_s=30.0):
    """Wait until something holds; fail when it does not in time."""
    assert until(condition, patience_s)


@contextlib.contextmanager
def repeating(act, every_s=0.02):
    """Do something again and again in a thread of its own, until it is left."""
    done = threading.Event()

    def run():
        while not done.wait(every_s):
            act()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()
