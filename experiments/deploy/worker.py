"""`Worker`: a process for the policy, its resources, and the messages to and from it."""

from __future__ import annotations

import contextlib
import json
import os
import select
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import asdict

from steerclear.shield.foreign import plain_text

from ..entries.sandbox import OVER, READY, Limits, end_group, end_marked, is_stopped

HEAD = struct.Struct("!i")  # header of a message, as `multiprocessing.connection`, used at the other end, writes it
MAX_BYTES = 1 << 20  # longest valid message
GONE = "the other end is gone"
SUPERVISE = """import sys
sys.path[:] = filter(None, sys.path)
from steerclear.experiments.entries.sandbox import main
sys.exit(main(sys.argv[1:]))
"""
"""Code of the supervisor process; modules in the working directory do not shadow others."""
PART = "steerclear.experiments.deploy.player"
DEPLOY_LIMITS = Limits(written_bytes=None, output_bytes=None, gives_way=True, network=True)
"""Limits of a policy; without totals, since it may play for days."""
TAIL_BYTES = 4096  # how much of the policy's printed output is stored
SUPERVISOR_S, GONE_S = 5.0, 10.0  # time a supervisor has to end its child, and any ended process has to disappear, s
SINGLE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class Broken(Exception):
    """The other end is gone, or sent something invalid."""


class Worker:
    """A running process in a session of its own, so the runner's keys do not reach it. Only documented methods wait.

    `entries.sandbox` forks, watches and limits what runs in it, and ends it with all it started. A folder of its own
    holds its temporary files, such as an unpacked submission, and is removed with it. Printed output is read a little
    each turn, so a policy that prints too much slows only itself.

    Args:
        orders: first message; empty: none yet.
        part: module whose ``serve`` runs there.
        limits: of what runs there.
        preload: modules to import beforehand.

    Raises:
        OSError: the system cannot start it.
    """

    def __init__(
        self, orders: bytes, part: str = PART, limits: Limits = DEPLOY_LIMITS, preload: Sequence[str] = ()
    ) -> None:
        self.limits, self.preload = limits, tuple(preload)
        self._folder = tempfile.mkdtemp(prefix="steerclear-policy-")
        self._answers, theirs_w = os.pipe()
        theirs_r, self._orders = os.pipe()
        self._notes, notes_w = os.pipe()
        self._unread, self._unsent, self._tail = bytearray(), b"", b""
        self._printed = 0
        self._cleaner: threading.Thread | None = None
        theirs = (theirs_r, theirs_w, notes_w)
        what = (*map(str, theirs), self._folder, json.dumps(asdict(limits)), part, *preload)
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-c", SUPERVISE, *what],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=theirs,
                start_new_session=True,
                env={**SINGLE_THREAD, **os.environ, "TMPDIR": self._folder},
            )
        except OSError:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._close_pipes()
            raise
        finally:
            for descriptor in theirs:
                os.close(descriptor)
        assert self._process.stdout is not None
        self._output = self._process.stdout
        for descriptor in (self._answers, self._orders, self._notes, self._output.fileno()):
            os.set_blocking(descriptor, False)
        if orders:
            self.send(orders)

    @property
    def is_gone(self) -> bool:
        """Whether the process has ended."""
        return self._process.poll() is not None

    @property
    def prints_too_much(self) -> bool:
        """Whether it printed more than the limits allow."""
        return self.limits.output_bytes is not None and self._printed > self.limits.output_bytes

    def messages(self) -> list[bytes]:
        """Return the complete messages received; also read printed output.

        Raises:
            Broken: the process is gone and all its messages were read, it stopped its supervisor, or it sent
                something invalid.
        """
        self._read_output()
        if is_stopped(self._process.pid):
            raise Broken("it stopped the process that watches it; its process was ended")
        gone = self.is_gone  # before reading: a process it started may hold the pipe open
        messages = self._read()
        if gone and not messages:
            raise Broken(GONE)
        return messages

    def send(self, message: bytes) -> None:
        """Queue a message and send what fits, or raise `Broken` if the process is gone."""
        self._unsent += HEAD.pack(len(message)) + message
        self.flush()

    def flush(self) -> None:
        """Send queued data that did not fit into the pipe before, or raise `Broken` if the process is gone."""
        try:
            while self._unsent:
                self._unsent = self._unsent[os.write(self._orders, self._unsent) :]
        except BlockingIOError:
            pass
        except BrokenPipeError:
            raise Broken(GONE) from None

    def await_turn(self, timeout_s: float) -> None:
        """Wait until there is something to read, at most ``timeout_s``."""
        _poll(timeout_s, self._answers, *([] if self._output.closed else [self._output.fileno()]))

    def is_fresh(self, patience_s: float) -> bool:
        """Wait until what ran there is gone and the process is ready for the next; return False if it is unusable."""
        end_s = time.monotonic() + patience_s
        while not _poll(0.02, self._notes) and time.monotonic() < end_s:
            self._read_output()  # pending output must not block it
        self._read_output()
        self._tail, self._printed = b"", 0
        with contextlib.suppress(Broken):
            return self._note() == READY and not self._read() and not self._unread
        return False

    def output(self) -> str:
        """Return the end of the printed output."""
        return plain_text(self._tail.decode(errors="replace"), TAIL_BYTES, lines=True)

    def epitaph(self, otherwise: str) -> str:
        """Return how the process ended, with its last output line; ``otherwise`` if it has not ended."""
        for _ in range(200 if otherwise == GONE else 3):  # its pipes close a moment before it ends
            if self.is_gone:
                break
            time.sleep(0.001)
        self._read_output()
        status = self._process.poll()
        if status is None or otherwise != GONE:
            return f"failed: {'it gave its pipes away' if otherwise == GONE else otherwise}"
        how = f"ended itself with exit status {status}"
        if status < 0:
            names = {number.value: number.name for number in signal.Signals}
            how = f"was ended by {names.get(-status, f'signal {-status}')}"
        if status == OVER and (limit := plain_text(self._note(), 200)):
            how = f"was ended: {limit}"
        last = self.output().strip().splitlines()[-1:]
        return how + (f', its last words: "{last[0][:160]}"' if last else "")

    def end(self) -> None:
        """End the process and all it started, and release everything. May be called again.

        Closed pipes tell the supervisor to end its child; if it does not, a thread ends all after a while.
        """
        if self._cleaner is None:
            self._close_pipes()
            self._output.close()
            self._cleaner = threading.Thread(target=self._clean, name="policy's folder", daemon=True)
            self._cleaner.start()

    def wait(self, timeout_s: float) -> None:
        """Wait until the process has ended and its files are removed."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=timeout_s)
        if self._cleaner is not None and self._cleaner is not threading.current_thread():
            self._cleaner.join(timeout_s)

    def _clean(self) -> None:
        """Wait for the end and remove the folder; in a thread, because it may take long."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=SUPERVISOR_S)
        end_group(self._process.pid)
        end_marked(self._folder)  # processes whose supervisor was killed have nobody else to end them
        self.wait(GONE_S)
        shutil.rmtree(self._folder, ignore_errors=True)

    def _close_pipes(self) -> None:
        for descriptor in (self._answers, self._orders, self._notes):
            os.close(descriptor)

    def _note(self) -> str:
        with contextlib.suppress(OSError):
            return os.read(self._notes, 4096).decode(errors="replace")
        return ""

    def _read(self) -> list[bytes]:
        """Return complete messages, reading at most about one message's size at a time."""
        ended, unread, messages = False, self._unread, []
        with contextlib.suppress(BlockingIOError):
            while len(unread) <= MAX_BYTES and not ended:
                data = os.read(self._answers, 1 << 16)
                unread += data
                ended = not data
        while len(unread) >= HEAD.size:
            (length,) = HEAD.unpack_from(unread)
            if not 0 <= length <= MAX_BYTES:
                raise Broken(f"a message of {length} bytes")
            if len(unread) < HEAD.size + length:
                break
            messages.append(bytes(unread[HEAD.size : HEAD.size + length]))
            del unread[: HEAD.size + length]
        if ended and not messages:
            raise Broken(GONE)
        return messages

    def _read_output(self) -> None:
        with contextlib.suppress(BlockingIOError):
            data = b"" if self._output.closed else os.read(self._output.fileno(), 1 << 16)
            self._tail = (self._tail + data)[-TAIL_BYTES:]
            self._printed += len(data)


def _poll(timeout_s: float, *descriptors: int) -> bool:
    """Wait for something to read; return whether there is."""
    poll = select.poll()
    for descriptor in descriptors:
        poll.register(descriptor, select.POLLIN)
    return bool(poll.poll(max(1000.0 * timeout_s, 0.0)))
