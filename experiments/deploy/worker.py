"""`Worker`: one run of the policy's process, everything the system keeps for it, and the messages to and from it."""

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

HEAD = struct.Struct("!i")
"""Of a message, as `multiprocessing.connection` writes it, which is what the process has at its end."""
MAX_BYTES = 1 << 20
"""A longer message is nothing either side sends."""


GONE = "the other end is gone"


class Broken(Exception):
    """The other end is gone, or sent what is no message."""


class FrameReader:
    """Takes messages out of a pipe without waiting.

    Args:
        descriptor: the pipe's end, closed by `close`.
    """

    def __init__(self, descriptor: int) -> None:
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor
        self._buffer = bytearray()

    def read(self) -> list[bytes]:
        """Whole messages that have come.

        Raises:
            Broken: the other end is gone and all it sent was read, or what it sends is no message.
        """
        ended = self._fill()
        messages = []
        while len(self._buffer) >= HEAD.size:
            (length,) = HEAD.unpack_from(self._buffer)
            if not 0 <= length <= MAX_BYTES:
                raise Broken(f"a message of {length} bytes")
            if len(self._buffer) < HEAD.size + length:
                break
            messages.append(bytes(self._buffer[HEAD.size : HEAD.size + length]))
            del self._buffer[: HEAD.size + length]
        if ended and not messages:
            raise Broken(GONE)
        return messages

    @property
    def is_clear(self) -> bool:
        """Whether no part of a message is waiting for its rest."""
        return not self._buffer

    def close(self) -> None:
        """Give the pipe's end back."""
        os.close(self._descriptor)

    def _fill(self) -> bool:
        """Read what is there, no more than a message at most; whether the other end is gone."""
        while len(self._buffer) <= MAX_BYTES:
            try:
                data = os.read(self._descriptor, 1 << 16)
            except BlockingIOError:
                return False
            if not data:
                return True
            self._buffer += data
        return False


class FrameWriter:
    """Puts messages into a pipe without waiting.

    Args:
        descriptor: the pipe's end, closed by `close`.
    """

    def __init__(self, descriptor: int) -> None:
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor
        self._left = b""

    @property
    def is_clear(self) -> bool:
        """Whether everything written so far is in the pipe."""
        return not self._left

    def write(self, message: bytes) -> None:
        """Send a message after those before it.

        Raises:
            Broken: the other end is gone.
        """
        self._left += HEAD.pack(len(message)) + message
        self.flush()

    def flush(self) -> None:
        """Put into the pipe what did not fit before.

        Raises:
            Broken: the other end is gone.
        """
        with contextlib.suppress(BlockingIOError):
            while self._left:
                try:
                    sent = os.write(self._descriptor, self._left)
                except BrokenPipeError:
                    raise Broken(GONE) from None
                self._left = self._left[sent:]

    def close(self) -> None:
        """Give the pipe's end back."""
        os.close(self._descriptor)


SUPERVISE = """import sys
sys.path[:] = filter(None, sys.path)
from steerclear.experiments.entries.sandbox import main
sys.exit(main(sys.argv[1:]))
"""
"""What the process runs: the supervisor, without the working directory's own modules in its way."""
PART = "steerclear.experiments.deploy.policy_child"
DEPLOY_LIMITS = Limits(written_bytes=None, output_bytes=None, gives_way=True, network=True)
"""Limits of a policy that may play for days."""
TAIL_BYTES = 4096
"""How much of what the policy prints is kept."""
FOLDER = "steerclear-policy-"
"""First part of the name of a process's folder for temporary files."""
SUPERVISOR_S, GONE_S = 5.0, 10.0
"""How long a supervisor may take to end what it watches, and any process to be gone once it was ended."""
SINGLE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class Worker:
    """A started process, in a session of its own: keys for the runner do not reach it.

    What runs in it is forked, watched and limited by `entries.sandbox`, and ends with all it started. Its temporary
    files, such as an unpacked submission, have a folder of their own that goes with it. What the policy prints is read
    a little at each turn, so that one that floods only slows itself.

    Args:
        orders: its first message; empty: none yet.
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
        self._folder = tempfile.mkdtemp(prefix=FOLDER)
        ours_r, theirs_w = os.pipe()
        theirs_r, ours_w = os.pipe()
        self._notes, notes_w = os.pipe()
        os.set_blocking(self._notes, False)
        self._reader, self._writer = FrameReader(ours_r), FrameWriter(ours_w)
        self._answers = ours_r
        self._tail = b""
        self._printed = 0
        self._ended = False
        self._cleaner: threading.Thread | None = None
        try:
            fds = (theirs_r, theirs_w, notes_w)
            what = (*map(str, fds), self._folder, json.dumps(asdict(limits)), part, *preload)
            self._process = subprocess.Popen(
                [sys.executable, "-c", SUPERVISE, *what],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=fds,
                start_new_session=True,
                env={**dict.fromkeys(SINGLE_THREAD, "1"), **os.environ, "TMPDIR": self._folder},
            )
        except OSError:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._close_pipes()
            raise
        finally:
            os.close(theirs_r)
            os.close(theirs_w)
            os.close(notes_w)
        if self._process.stdout is not None:
            os.set_blocking(self._process.stdout.fileno(), False)
        if orders:
            self._writer.write(orders)

    @property
    def pid(self) -> int:
        """Number of the supervisor's process."""
        return self._process.pid

    def messages(self) -> list[bytes]:
        """Whole messages that have come; also reads what the process printed.

        Raises:
            Broken: the process is gone, or stopped the one that watches it.
        """
        self._read_output()
        if is_stopped(self._process.pid):
            raise Broken("it stopped the process that watches it; its process was ended")
        gone = self.is_gone  # asked first: a process it started may hold the pipe open
        messages = self._reader.read()
        if gone and not messages:
            raise Broken(GONE)
        return messages

    def send(self, message: bytes) -> None:
        """Send a message.

        Raises:
            Broken: the process is gone.
        """
        self._writer.write(message)

    def flush(self) -> None:
        """Go on sending what did not fit into the pipe before.

        Raises:
            Broken: the process is gone.
        """
        self._writer.flush()

    def await_turn(self, timeout_s: float) -> None:
        """Wait until there is something to read, or the time is over."""
        printed = self._process.stdout
        sources = [self._answers] if printed is None or printed.closed else [self._answers, printed.fileno()]
        poll = select.poll()
        for descriptor in sources:
            poll.register(descriptor, select.POLLIN)
        poll.poll(max(1000.0 * timeout_s, 0.0))

    def is_fresh(self, patience_s: float) -> bool:
        """Wait until what ran there is gone and the process is ready for the next; False: it is of no more use."""
        end_s = time.monotonic() + patience_s
        poll = select.poll()
        poll.register(self._notes, select.POLLIN)
        while not poll.poll(20) and time.monotonic() < end_s:
            self._read_output()  # what it printed last must not keep it
        self._read_output()
        self._tail, self._printed = b"", 0
        with contextlib.suppress(Broken):
            return self._note() == READY and not self._reader.read() and self._reader.is_clear
        return False

    def output(self) -> str:
        """The end of what the process printed."""
        return plain_text(self._tail.decode(errors="replace"), TAIL_BYTES, lines=True)

    def epitaph(self, otherwise: str) -> str:
        """How the process ended, with its last words; ``otherwise`` when it has not."""
        for _ in range(200 if otherwise == GONE else 3):  # its pipes close a moment before it is gone
            if self.is_gone:
                break
            time.sleep(0.001)
        self._read_output()
        status = self._process.poll()
        if status is None or otherwise != GONE:
            return f"failed: {'it gave its pipes away' if otherwise == GONE else otherwise}"
        how = f"was ended by {_signal_name(-status)}" if status < 0 else f"ended itself with exit status {status}"
        if status == OVER and (limit := plain_text(self._note(), 200)):
            how = f"was ended: {limit}"
        last = self.output().strip().splitlines()[-1:]
        return how + (f', its last words: "{last[0][:160]}"' if last else "")

    def end(self) -> None:
        """End the process and all it started; give everything back. May be called again.

        The closed pipes tell the supervisor to end what it watches; one that does not is ended after a while.
        """
        if self._ended:
            return
        self._ended = True
        self._close_pipes()
        if self._process.stdout is not None:
            self._process.stdout.close()
        self._cleaner = threading.Thread(target=self._clean, name="policy's folder", daemon=True)
        self._cleaner.start()

    def _close_pipes(self) -> None:
        self._reader.close()
        self._writer.close()
        os.close(self._notes)

    def _clean(self) -> None:
        """Remove its folder once it is gone; that may take long, and the loop must not."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=SUPERVISOR_S)
        end_group(self._process.pid)
        end_marked(self._folder)  # where code ended its supervisor, what it started has nobody else to end it
        self.wait(GONE_S)
        shutil.rmtree(self._folder, ignore_errors=True)

    def _note(self) -> str:
        with contextlib.suppress(OSError):
            return os.read(self._notes, 4096).decode(errors="replace")
        return ""

    @property
    def is_gone(self) -> bool:
        """Whether the system has taken the process."""
        return self._process.poll() is not None

    def wait(self, timeout_s: float) -> None:
        """Wait until it has, and its files are gone."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=timeout_s)
        if self._cleaner is not None and self._cleaner is not threading.current_thread():
            self._cleaner.join(timeout_s)

    def _read_output(self) -> None:
        if self._process.stdout is None or self._process.stdout.closed:
            return
        with contextlib.suppress(BlockingIOError):
            data = os.read(self._process.stdout.fileno(), 1 << 16)
            self._tail = (self._tail + data)[-TAIL_BYTES:]
            self._printed += len(data)

    @property
    def prints_too_much(self) -> bool:
        """Whether more was printed than the limits allow."""
        return self.limits.output_bytes is not None and self._printed > self.limits.output_bytes


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
