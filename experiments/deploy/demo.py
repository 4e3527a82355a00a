"""Boats and a referee for a demonstration: `sim-boats` and `referee` as processes of their own, ended with the run."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from steerclear.experiments.boats.demo import demo_text
from steerclear.shield.exceptions import BridgeError

FOLDER = Path("steerclear_demo")
"""Where the demonstration keeps its fleet file and logs, in the present folder."""

END_S = 10.0

LONGEST_S = 4.0 * 3600.0
"""Left behind by a runner that was killed, the processes end after this, s."""


def demo_file(folder: Path = FOLDER) -> Path:
    """The fleet file that comes with the package, written where it can be looked at; one that is there is kept.

    Raises:
        BridgeError: it cannot be written.
    """
    path = folder / "FLEET.yaml"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            path.write_text(demo_text(), encoding="utf-8")
    except OSError as error:
        raise BridgeError(f"cannot write {path} ({error.strerror}); run it in a folder of your own") from None
    return path


class Demo:
    """Simulated boats of a fleet file, opponents and a referee. A context manager.

    Args:
        fleet_file: the file; its links must be on this machine.
        opponents: policy of the other team.
        speed: times faster than real time.
        more: further options of ``sim-boats``.

    Raises:
        BridgeError: the processes cannot be started.
    """

    def __init__(
        self, fleet_file: Path, opponents: str = "medium", speed: float = 1.0, more: Sequence[str] = ()
    ) -> None:
        boats = ["sim-boats", str(fleet_file), "--opponents", opponents, "--boot", "5", "--noise", "1"]
        boats += ["--duration", f"{LONGEST_S:g}", *more]
        self._commands = {
            "boats": [*boats, "--speed", f"{speed:g}"],
            "referee": ["referee", str(fleet_file), "--speed", f"{speed:g}", "--minutes", f"{LONGEST_S / 60.0:g}"],
        }
        self._folder = fleet_file.resolve().parent
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._files: list[IO[bytes]] = []

    def fault(self) -> str:
        """Which process ended and what it said last; empty: all run."""
        for name, process in self._processes.items():
            if process.poll() is not None:
                said = self._said(name)
                return f"the demonstration's {name} ended: {said.splitlines()[-1] if said else 'without a word'}"
        return ""

    def wait(self, timeout_s: float) -> None:
        """Wait until the boats live; the first time all of it is compiled.

        Raises:
            BridgeError: a process ended, or the boats do not come.
        """
        end = time.monotonic() + timeout_s
        while "Simulated boats" not in self._said("boats"):
            if self.fault():
                raise BridgeError(self.fault())
            if time.monotonic() > end:
                raise BridgeError(f"the demonstration's boats did not come in {timeout_s:g} s; see {self._folder}")
            time.sleep(0.1)

    def _said(self, name: str) -> str:
        return (self._folder / f"{name}.txt").read_text(encoding="utf-8", errors="replace").strip()

    def close(self) -> None:
        """End the processes; may be called again."""
        for process in self._processes.values():
            with contextlib.suppress(OSError):
                process.terminate()
        for process in self._processes.values():
            try:
                process.wait(END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        for file in self._files:
            file.close()
        self._processes, self._files = {}, []

    def __enter__(self) -> Self:
        try:
            for name, arguments in self._commands.items():
                file = (self._folder / f"{name}.txt").open("wb")
                self._files.append(file)
                command = [sys.executable, "-m", "steerclear.experiments.cli", *arguments]
                self._processes[name] = subprocess.Popen(
                    command, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT, start_new_session=True
                )
        except OSError as error:
            self.close()
            raise BridgeError(
                f"the demonstration cannot be started ({error}); run sim-boats and referee by hand"
            ) from None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
