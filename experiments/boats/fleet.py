"""`SimFleet`: simulated boats behind real MAVLink sockets, all in one thread."""

from __future__ import annotations

import logging
import selectors
import socket
import threading
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Any, Self

import numpy as np
from steerclear.shield.bridge.clock import Clock, MonotonicClock
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array

from .boat import Boat, Setting
from .frames import target_of
from .hull import STEP_S
from .places import start_places
from .settings import AutopilotSettings, RadioSettings, SimBoat, Water
from .signing import check_key
from .wires import Wire, open_wire

logger = logging.getLogger(__name__)

TICK_S = 0.02
"""How often autopilots look at their clocks and send."""
_TICKS_PER_STEP = round(STEP_S / TICK_S)
_LONGEST_LAG_S = 1.0
"""A fleet further behind its clock than this lets the time go, instead of living it in a rush."""


class SimFleet:
    """Simulated boats. A context manager: entering it starts the thread, leaving it gives everything back.

    Boats move from the moment of their start on; their time is counted from there, in s of ``clock``.

    Args:
        boats: who they are.
        origin: latitude and longitude of the field's corner, deg.
        y_axis_deg: true course of the field's y axis, deg.
        speed: times faster than real time; all rates and the autopilots' clocks go along.
        clock: the clock to live by, instead of ``speed``.
        autopilot: how autopilots behave; `AutopilotSettings(boot_s=0.0)` is ready at once.
        water: wind and current.
        radio: loss and delay.
        noise: of the sensors: 0 none, 1 as measured.
        seed: of everything random.
        key: 32 bytes of MAVLink 2 signing; None: unsigned.
        preset: rules of the game, for start places.
        allow_remote: whether links may leave this machine.

    Raises:
        ConfigError: boats that contradict each other, an address that cannot be used, or a setting out of range.
    """

    def __init__(
        self,
        boats: Sequence[SimBoat],
        *,
        origin: tuple[float, float] = (42.0, -71.0),
        y_axis_deg: float = 0.0,
        speed: float = 1.0,
        clock: Clock | None = None,
        autopilot: AutopilotSettings | None = None,
        water: Water | None = None,
        radio: RadioSettings | None = None,
        noise: float = 0.0,
        seed: int = 0,
        key: bytes | None = None,
        preset: str = "aamas2024",
        allow_remote: bool = False,
    ) -> None:
        if not boats or len({boat.name for boat in boats}) < len(boats):
            raise ConfigError("give at least one boat, each with a name of its own")
        self.frame = FieldFrame(*origin, y_axis_deg)
        self.clock: Clock = MonotonicClock(speed) if clock is None else clock
        self.water = water or Water()
        self._lock = threading.RLock()
        self._thread: threading.Thread | None = None
        self._ends = threading.Event()
        self._ticks = 0
        self._start_s = self.clock.now_s()
        self.let_go_s = 0.0
        setting = Setting(self.frame, autopilot or AutopilotSettings(), radio or RadioSettings(), noise, check_key(key))
        self._wires: dict[str, Wire] = {}
        self._aboard: dict[Wire, list[Boat]] = {}
        self.boats: dict[str, Boat] = {}
        seeds = np.random.SeedSequence(seed).spawn(len(boats))
        try:
            for i, (spec, place) in enumerate(zip(boats, start_places(boats, preset), strict=True)):
                self._add(spec, place, spec.system_id or i + 1, setting, seeds[i], allow_remote)
        except BaseException:
            self.close()
            raise

    @property
    def addresses(self) -> dict[str, str]:
        """Address to open for each boat with a link."""
        return {boat.spec.name: wire.address for wire, aboard in self._aboard.items() for boat in aboard}

    @property
    def system_ids(self) -> dict[str, int]:
        """MAVLink system id of each boat."""
        return {name: boat.system_id for name, boat in self.boats.items()}

    @property
    def time_s(self) -> float:
        """Simulated time since the start, s."""
        return self._ticks * TICK_S

    def states(self) -> dict[str, Array]:
        """True state row (N_STATE,) of each boat, all of the same moment."""
        with self._lock:
            return {name: boat.hull.state.copy() for name, boat in self.boats.items()}

    def fault(self, boat: str, kind: str, *, duration_s: float = float("inf"), **options: Any) -> None:
        """Begin a fault of a boat, see `faults.KINDS`; `clear` ends it.

        Raises:
            ConfigError: no such boat, fault or option.
        """
        with self._lock:
            self._boat(boat).faults.start(kind, self.time_s, duration_s, **options)

    def clear(self, boat: str, kind: str | None = None) -> None:
        """End a fault of a boat, or all of them.

        Raises:
            ConfigError: no such boat.
        """
        with self._lock:
            self._boat(boat).faults.stop(kind)

    def advance(self, seconds: float) -> None:
        """Live that much simulated time at once, without a thread and without waiting.

        Raises:
            ConfigError: the thread is running.
        """
        if self._thread is not None:
            raise ConfigError("the fleet runs by itself; call advance only on one that was not started")
        for _ in range(round(seconds / TICK_S)):
            self._receive()
            self._tick()

    def start(self) -> None:
        """Start the thread."""
        if self._thread is not None:
            raise ConfigError("the fleet runs already")
        next(iter(self.boats.values())).hull.warm_up()
        self._start_s = self.clock.now_s() - self.time_s
        self._ends.clear()
        self._thread = threading.Thread(target=self._run, name="sim-boats", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop the thread and give the sockets back; may be called again."""
        self._ends.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        for wire in self._aboard:
            wire.close()
        self._aboard.clear()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _add(
        self,
        spec: SimBoat,
        place: tuple[float, float, float],
        system_id: int,
        setting: Setting,
        seed: np.random.SeedSequence,
        allow_remote: bool,
    ) -> None:
        wire = None if spec.address is None else self._wire(spec.address, allow_remote)
        aboard = self._aboard.setdefault(wire, []) if wire is not None else []
        if any(other.system_id == system_id for other in aboard) or not 1 <= system_id <= 255:
            raise ConfigError(f"boat {spec.name!r} has system id {system_id}; give one of 1..255 of its own")
        write = wire.write if wire is not None else _nowhere
        boat = Boat(spec, place, system_id, setting, seed, write)
        aboard.append(boat)
        self.boats[spec.name] = boat

    def _wire(self, address: str, allow_remote: bool) -> Wire:
        """The wire of an address: boats share a port they listen at, and each have their own to call from."""
        if address in self._wires:
            return self._wires[address]
        wire = open_wire(address or "udpout:127.0.0.1:0", allow_remote)
        self._aboard[wire] = []
        if address and wire.address.startswith(("udpout", "tcp:")):
            self._wires[address] = wire
        return wire

    def _boat(self, name: str) -> Boat:
        if name not in self.boats:
            raise ConfigError(f"no simulated boat is named {name!r}; there are {', '.join(self.boats)}")
        return self.boats[name]

    def _run(self) -> None:
        while not self._ends.is_set():
            due = self._start_s + (self._ticks + 1) * TICK_S
            lag = self.clock.now_s() - due
            if lag < 0.0:
                self._wait(due)
                continue
            if lag > _LONGEST_LAG_S:
                logger.warning("simulated boats are %.1f s behind and let the time go", lag)
                self._start_s += lag
                self.let_go_s += lag
            self._receive()
            self._tick()

    def _wait(self, due_s: float) -> None:
        """Wait for packets until the next tick is due."""
        speed = getattr(self.clock, "speed", 1.0)
        patience = (due_s - self.clock.now_s()) / speed
        sockets = [entry for wire in self._aboard for entry in wire.sockets()]
        if patience <= 0.0:
            return
        if not sockets:
            time.sleep(patience)
        elif _readable(sockets, patience):
            self._receive()

    def _receive(self) -> None:
        """Hand what came in to the boats it is for."""
        with self._lock:
            for wire, aboard in self._aboard.items():
                for packet in wire.read():
                    target = target_of(packet)
                    for boat in aboard:
                        if target in (0, boat.system_id):
                            boat.hear(packet, self.time_s)

    def _tick(self) -> None:
        with self._lock:
            self._ticks += 1
            if self._ticks % _TICKS_PER_STEP == 0:
                self._step()
            for boat in self.boats.values():
                boat.tick(self.time_s)

    def _step(self) -> None:
        for boat in self.boats.values():
            boat.step(self.time_s)


def _nowhere(packet: bytes) -> None:
    """Where boats without a link send."""


def _readable(sockets: list[socket.socket], patience_s: float) -> bool:
    with selectors.DefaultSelector() as selector:
        for entry in sockets:
            selector.register(entry, selectors.EVENT_READ)
        return bool(selector.select(patience_s))
