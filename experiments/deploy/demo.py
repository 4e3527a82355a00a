"""Boats and a referee for a demonstration: `sim-boats` and `referee` as processes that end with the run."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import IO, BinaryIO

from steerclear.experiments.sim_boats.demo import MOOS_PORTS, demo_text
from steerclear.shield.bridge.blackbox import log_path
from steerclear.shield.bridge.messages import Closing
from steerclear.shield.compat import Self
from steerclear.shield.exceptions import BridgeError

GRACE_S, END_S = 3.0, 10.0
"""Time to end in order, s: for a program whose parent is gone, and for one of a demonstration."""


def end_with_parent(stream: BinaryIO | None = None) -> threading.Thread:
    """End this process (SIGTERM, and `GRACE_S` later at once) when the other end of ``stream`` is closed.

    The default is standard input. A parent that gave the process a pipe as standard input holds its only other end, and
    the system closes it even if the parent is killed. Return the waiting thread.
    """
    watched = sys.stdin.buffer if stream is None else stream

    def wait() -> None:
        while os.read(watched.fileno(), 4096):
            pass
        os.kill(os.getpid(), signal.SIGTERM)
        threading.Event().wait(GRACE_S)
        os._exit(1)

    thread = threading.Thread(target=wait, name="lifeline", daemon=True)
    thread.start()
    return thread


FOLDER = Path("steerclear_demo")
"""Folder for demonstrations in the current folder; each has its own subfolder with fleet file and logs."""

PORTS = (14550, 14700, 14701)  # ports in the packaged fleet file: links, feed, referee


def demo_file(folder: Path = FOLDER, link: str = "mavlink") -> Path:
    """Write the packaged fleet file, with free ports, to a new folder and return its path.

    The folder is named after the time, UTC; ``link`` is what the own boats run, mavlink or moos.

    Raises:
        BridgeError: it cannot be written.
    """
    try:
        text = demo_text(link)
        ports = PORTS if link == "mavlink" else (*PORTS, *MOOS_PORTS)
        for port, free in zip(ports, free_ports(len(ports)), strict=True):
            text = text.replace(f"127.0.0.1:{port}", f"127.0.0.1:{free}")
        path = _new_folder(folder) / "FLEET.yaml"
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise BridgeError(f"cannot write to {folder} ({error.strerror}); run it in a folder of your own") from None
    return path


def free_ports(count: int) -> list[int]:
    """Return different ports of this machine that are free for both UDP and TCP; `OSError` where there are none."""
    with contextlib.ExitStack() as stack:
        found: list[int] = []
        while len(found) < count:
            address = stack.enter_context(socket.create_server(("127.0.0.1", 0))).getsockname()
            with contextlib.suppress(OSError):
                stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)).bind(address)
                found.append(int(address[1]))
        return found


def _new_folder(folder: Path) -> Path:
    stamp = f"{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime())}_{os.getpid()}"
    for name in (stamp, *(f"{stamp}_{number}" for number in range(2, 1000))):
        with contextlib.suppress(FileExistsError):
            (folder / name).mkdir(parents=True)
            return folder / name
    raise BridgeError(f"{folder} is full of demonstrations; run it in another folder")


class Demo(Closing):
    """Simulated boats of a fleet file, opponents and a referee. A context manager.

    The processes end with this one, even if it is killed. Their output is stored beside the fleet file, whose links
    must be on this machine. ``opponents``: policy of the other team; ``more``: further options of ``sim-boats``.

    Raises:
        BridgeError: the processes cannot be started.
    """

    def __init__(
        self, fleet_file: Path, opponents: str = "medium", speed: float = 1.0, more: Sequence[str] = ()
    ) -> None:
        boats = ["sim-boats", str(fleet_file), "--opponents", opponents, "--boot", "5", "--noise", "1"]
        alike = ["--speed", f"{speed:g}", "--with-parent"]
        self._commands = {"boats": [*boats, *more, *alike], "referee": ["referee", str(fleet_file), *alike]}
        self._folder = fleet_file.resolve().parent
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._files: dict[str, IO[bytes]] = {}

    def fault(self) -> str:
        """Return which process ended and its last output line; empty if all run."""
        for name, process in self._processes.items():
            if process.poll() is not None:
                said = self._said(name)
                return f"the demonstration's {name} ended: {said.splitlines()[-1] if said else 'without a word'}"
        return ""

    def wait(self, timeout_s: float) -> None:
        """Wait until the boats are simulated; `BridgeError` where a process ended, or they did not start in time."""
        end = time.monotonic() + timeout_s
        while "Simulated boats" not in self._said("boats"):
            if self.fault():
                raise BridgeError(self.fault())
            if time.monotonic() > end:
                raise BridgeError(f"the demonstration's boats did not come in {timeout_s:g} s; see {self._folder}")
            time.sleep(0.1)

    def _said(self, name: str) -> str:
        return Path(self._files[name].name).read_text(encoding="utf-8", errors="replace").strip()

    def close(self, patience_s: float = END_S) -> None:
        """End the processes, and kill those that take longer than ``patience_s``; may be called again."""
        for process in self._processes.values():
            with contextlib.suppress(OSError):
                process.terminate()
        for process in self._processes.values():
            try:
                process.wait(patience_s)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            if process.stdin is not None:
                process.stdin.close()
        for file in self._files.values():
            file.close()
        self._processes, self._files = {}, {}

    def __enter__(self) -> Self:
        try:
            for name, arguments in self._commands.items():
                file = self._files[name] = log_path(self._folder, ".txt", name=name).open("wb")
                command = [sys.executable, "-m", "steerclear.experiments.cli", *arguments]
                self._processes[name] = subprocess.Popen(
                    command, stdin=subprocess.PIPE, stdout=file, stderr=subprocess.STDOUT, start_new_session=True
                )
        except OSError as error:
            self.close()
            what = f"the demonstration cannot be started ({error}); run sim-boats and referee by hand"
            raise BridgeError(what) from None
        return self
