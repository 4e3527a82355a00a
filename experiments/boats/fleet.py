"""`SimFleet`: simulated boats behind real MAVLink sockets, all in one thread."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from steerclear.env.config import GameConfig
from steerclear.env.record import Record
from steerclear.env.record_meta import DEFAULT_SEPARATION_M
from steerclear.shield.bridge.clock import Clock, MonotonicClock
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.compat import Self
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L

from .assembly import build_boats, build_world, check_boats
from .boat import Boat, Setting
from .from_file import Hulls, as_fleet, boats_of, settings_of
from .hub import PositionHub
from .hull import STEP_S
from .pace import Pace
from .places import game_of
from .ports import Ports, near
from .settings import AutopilotSettings, RadioSettings, SimBoat, Water
from .signing import check_key
from .truth import Approach, TruthRecord, record_of

TICK_S = 0.02
"""How often autopilots look at their clocks and send, s."""
_TICKS_PER_STEP = round(STEP_S / TICK_S)


class SimFleet:
    """Simulated boats. A context manager: entering it starts the thread, leaving it gives everything back.

    Their time begins with the start and is counted in s of ``clock``. Boats with a policy are driven by it
    from the moment on at which all other boats of the game have been commanded for 5 s (see ``waits`` and `play`).

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
        key: 32 bytes of MAVLink 2 signing, of the feed's seal too; None: neither.
        preset: rules of the game that the boats play when there are as many red ones as blue ones.
        rules: settings of the game that differ from the preset's.
        feed_to: HOST:PORT of each listener of the position feed.
        record: whether everything is recorded, see `truth_record`.
        separation_m: radius for breaches in the record.
        waits: whether policies wait for the other boats to be commanded.
        random_start: draw start places from ``seed`` instead of taking the game's fixed ones.
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
        preset: str | GameConfig = "aamas2024",
        rules: Mapping[str, Any] | None = None,
        feed_to: Sequence[str] = (),
        record: bool = False,
        separation_m: float = DEFAULT_SEPARATION_M,
        waits: bool = True,
        random_start: bool = False,
        allow_remote: bool = False,
    ) -> None:
        check_boats(boats, noise)
        self.frame = FieldFrame(*origin, y_axis_deg)
        self._lock = threading.RLock()
        self._ticks = 0
        self._hub: PositionHub | None = None
        self._ports = Ports(allow_remote)
        self._pace = Pace(MonotonicClock(speed) if clock is None else clock, TICK_S, self._tick, self._receive)
        warp = float(getattr(self._pace.clock, "speed", 1.0))
        parts = (autopilot or AutopilotSettings(), radio or RadioSettings())
        setting = Setting(self.frame, *parts, noise, check_key(key), warp)
        config = game_of(boats, preset, rules or {})
        try:
            self.boats = build_boats(boats, config, setting, self._ports, seed, random_start)
            listeners = [near(to, allow_remote) for to in feed_to]
            self._hub = PositionHub(listeners, self.frame, noise, key) if feed_to else None
            self._world = build_world(self.boats, config, (water or Water(), setting), self._hub, seed, waits)
        except BaseException:
            self.close()
            raise
        self._world.record_radius_m = separation_m if record else None

    @classmethod
    def from_file(
        cls, fleet: FleetFile | str | Path, *, opponents: str = "medium", hulls: Hulls | None = None, **settings: Any
    ) -> SimFleet:
        """The boats of a FLEET.yaml: those with a link obey it, the others are driven.

        Args:
            fleet: the file, read or to be read.
            opponents: scripted policy of the boats of the game that the file's runner does not command.
            hulls: what a boat, by its name and its platform of the file, really is; None: what the file says.
            **settings: of `SimFleet`, beside or instead of what the file says.

        Raises:
            FleetFileError: the file cannot be used.
            ConfigError: a setting cannot be used.
        """
        file = as_fleet(fleet)
        return cls(boats_of(file, opponents, hulls), **{**settings_of(file), **settings})

    @property
    def addresses(self) -> dict[str, str]:
        """Address to open for each boat with a link."""
        return self._ports.addresses

    @property
    def system_ids(self) -> dict[str, int]:
        """MAVLink system id of each boat."""
        return {name: boat.system_id for name, boat in self.boats.items()}

    @property
    def clock(self) -> Clock:
        """The clock it lives by."""
        return self._pace.clock

    @property
    def time_s(self) -> float:
        """Simulated time since the start, s."""
        return self._ticks * TICK_S

    @property
    def let_go_s(self) -> float:
        """Time that was not lived because the machine was too slow, s."""
        return self._pace.let_go_s

    @property
    def cpu_s(self) -> float:
        """Processor time of its thread, s."""
        return self._pace.cpu_s

    @property
    def is_playing(self) -> bool:
        """Whether policies drive their boats and the record runs."""
        return self._world.is_playing

    @property
    def is_running(self) -> bool:
        """Whether its thread is alive."""
        return self._pace.is_running

    @property
    def truth(self) -> TruthRecord | None:
        """The record so far, when one was asked for and the game has begun."""
        return self._world.truth

    def play(self) -> None:
        """Let the policies and the record begin now."""
        with self._lock:
            self._world.play()

    def states(self) -> dict[str, Array]:
        """True state row (N_STATE,) of each boat, all of the same moment."""
        with self._lock:
            return {name: boat.hull.state.copy() for name, boat in self.boats.items()}

    def place(self, boat: str, x_m: float, y_m: float, heading_deg: float, speed_mps: float = 0.0) -> None:
        """Put a boat somewhere, its controllers cleared.

        Raises:
            ConfigError: no such boat.
        """
        with self._lock:
            hull = self.boat(boat).hull
            hull.forget()
            hull.astern = False
            hull.state[[L.X, L.Y, L.HEADING, L.SPEED]] = x_m, y_m, heading_deg, speed_mps

    def fault(self, boat: str, kind: str, *, duration_s: float = float("inf"), **options: Any) -> None:
        """Begin a fault of a boat, see `faults.KINDS`; `clear` ends it.

        Raises:
            ConfigError: no such boat, fault or option.
        """
        with self._lock:
            self.boat(boat).faults.start(kind, self.time_s, duration_s, **options)

    def clear(self, boat: str, kind: str | None = None) -> None:
        """End a fault of a boat, or all of them.

        Raises:
            ConfigError: no such boat.
        """
        with self._lock:
            self.boat(boat).faults.stop(kind)

    def closest_approaches(self) -> list[Approach]:
        """Closest approach of each pair of boats since the start, closest first."""
        with self._lock:
            return self._world.closest.all()

    def truth_record(self) -> Record:
        """Everything since the game began, as a game's record; with the boats' full states as array ``state``.

        Raises:
            ConfigError: nothing was recorded.
        """
        with self._lock:
            return record_of(self._world.truth).record()

    def judge(self, team: int = 0) -> list[dict[str, Any]]:
        """Breaches of a team since the game began, with the oracle's verdicts (`experiments.pages.keys.BREACH`).

        Raises:
            ConfigError: nothing was recorded.
        """
        with self._lock:
            return record_of(self._world.truth).judge(team)

    def advance(self, seconds: float) -> None:
        """Live that much simulated time at once, without a thread and without waiting.

        Raises:
            ConfigError: the thread is running.
        """
        if self._pace.is_running:
            raise ConfigError("the fleet runs by itself; call advance only on one that was not started")
        for _ in range(round(seconds / TICK_S)):
            self._receive(0.0)
            self._tick()

    def start(self) -> None:
        """Start the thread.

        Raises:
            ConfigError: it runs already.
        """
        self._world.warm_up()
        self._pace.start(self._ports.sockets)

    def close(self) -> None:
        """Stop the thread and give the sockets back; may be called again."""
        self._pace.stop()
        self._ports.close()
        if self._hub is not None:
            self._hub.close()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def boat(self, name: str) -> Boat:
        """The boat of that name.

        Raises:
            ConfigError: there is none.
        """
        if name not in self.boats:
            raise ConfigError(f"no simulated boat is named {name!r}; there are {', '.join(self.boats)}")
        return self.boats[name]

    def _receive(self, since_tick_s: float) -> None:
        with self._lock:
            self._ports.receive(self.time_s + since_tick_s)

    def _tick(self) -> None:
        with self._lock:
            self._ticks += 1
            if self._ticks % _TICKS_PER_STEP == 0:
                self._world.step(self.time_s)
            for boat in self.boats.values():
                boat.tick(self.time_s)
                if boat.community is not None:
                    boat.community.report(
                        [(name, other.spec.team, other.seen) for name, other in self.boats.items()], self.time_s
                    )
