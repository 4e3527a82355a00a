"""`Worker`: one run of the policy's process, and everything the system keeps for it."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

from .frames import GONE, Broken, FrameReader, FrameWriter

MODULE = "steerclear.experiments.deploy.policy_child"
TAIL_BYTES = 4096
"""How much of what the policy prints is kept."""
FOLDER = "steerclear-policy-"
"""First part of the name of a process's folder for temporary files."""
GONE_S = 10.0
SINGLE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class Worker:
    """A started process, in a session of its own: keys for the runner do not reach it, and its children end with it.

    Its temporary files, such as an unpacked submission, have a folder of their own that goes with it.
    What the policy prints is read a little at each turn, so that one that floods only slows itself.

    Args:
        orders: its first message.

    Raises:
        OSError: the system cannot start it.
    """

    def __init__(self, orders: bytes) -> None:
        self._folder = tempfile.mkdtemp(prefix=FOLDER)
        ours_r, theirs_w = os.pipe()
        theirs_r, ours_w = os.pipe()
        self._reader, self._writer = FrameReader(ours_r), FrameWriter(ours_w)
        self._tail = b""
        self._ended = False
        self._cleaner: threading.Thread | None = None
        try:
            command = [sys.executable, "-P", "-m", MODULE, str(theirs_r), str(theirs_w), self._folder]
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=(theirs_r, theirs_w),
                start_new_session=True,
                env={**dict.fromkeys(SINGLE_THREAD, "1"), **os.environ, "TMPDIR": self._folder},
            )
        except OSError:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._reader.close()
            self._writer.close()
            raise
        finally:
            os.close(theirs_r)
            os.close(theirs_w)
        if self._process.stdout is not None:
            os.set_blocking(self._process.stdout.fileno(), False)
        self._writer.write(orders)

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def messages(self) -> list[bytes]:
        """Whole messages that have come; also reads what the process printed.

        Raises:
            Broken: the process is gone.
        """
        self._read_output()
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

    def output(self) -> str:
        """The end of what the process printed."""
        return self._tail.decode(errors="replace")

    def epitaph(self, otherwise: str) -> str:
        """How the process ended, with its last words; ``otherwise`` when it has not."""
        for _ in range(3):  # its pipes close a moment before it is gone
            if self.is_gone:
                break
            time.sleep(0.001)
        self._read_output()
        status = self._process.poll()
        if status is None or otherwise != GONE:
            return f"failed: {'it gave its pipes away' if otherwise == GONE else otherwise}"
        how = f"was ended by {_signal_name(-status)}" if status < 0 else f"ended itself with exit status {status}"
        last = self.output().strip().splitlines()[-1:]
        return how + (f', its last words: "{last[0][:160]}"' if last else "")

    def end(self) -> None:
        """End the process and all it started, at once; give everything back. May be called again."""
        if self._ended:
            return
        self._ended = True
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._reader.close()
        self._writer.close()
        if self._process.stdout is not None:
            self._process.stdout.close()
        self._cleaner = threading.Thread(target=self._clean, name="policy's folder", daemon=True)
        self._cleaner.start()

    def _clean(self) -> None:
        """Remove its folder once it is gone; that may take long, and the loop must not."""
        self.wait(GONE_S)
        shutil.rmtree(self._folder, ignore_errors=True)

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


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
