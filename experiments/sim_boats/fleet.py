"""`SimFleet`: simulated boats behind real MAVLink sockets, in one thread."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.env.config import GameConfig
from steerclear.env.record import DEFAULT_SEPARATION_M, Record
from steerclear.experiments.deploy.referee import game_config
from steerclear.shield.bridge.clock import Clock, MonotonicClock
from steerclear.shield.bridge.fleet_file import FleetFile, load_fleet
from steerclear.shield.bridge.fleet_settings import MoosLinkSettings
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.messages import Closing
from steerclear.shield.bridge.session import key_of
from steerclear.shield.compat import Self
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import Platform

from .boat import Boat, Setting
from .game import Game, game_of, playing, start_places
from .hull import STEP_S, Weather
from .settings import AutopilotSettings, RadioSettings, SimBoat, Water, check_bounds
from .wires import Ports, near
from .world import Approach, PositionHub, TruthRecord, World, record_of

LOG = logging.getLogger(__name__)

TICK_S = 0.02  # interval at which autopilots check their clocks and send telemetry, s
_TICKS_PER_STEP = round(STEP_S / TICK_S)
_APART_M, _ROOM_M = 6.0, 3.0
_LONGEST_LAG_S = 1.0  # largest lag behind the clock, s. Beyond it the fleet skips the lost time instead of catching up
_LONGEST_WAIT_S = 0.1
"""Longest wait for packets, in wall-clock seconds; bounds the time until `SimFleet.close` is noticed."""

Hulls = Callable[[str, Platform], Platform]
"""Return a boat's true platform, given its name and its platform in the file."""


def boats_of(fleet: FleetFile, opponents: str, hulls: Hulls | None = None) -> list[SimBoat]:
    """Return the boats of a fleet file; ``opponents`` steers players that the file's runner does not command.

    Such a boat that has a link sends its position there and obeys the link once it is commanded. Boats outside the
    game start along the lower edge of the geofence.
    """
    config = fleet.shield_config
    apart_m = max(_APART_M, config.separation_m + 2.0 * config.position_error_m + _ROOM_M)
    boats = []
    for i, boat in enumerate(fleet.boats):
        name, link, platform, plays = boat.name, boat.link, fleet.platform_of[boat.name], boat.agent is not None
        ours = link is not None and boat.commanded and fleet.team_of[name] == fleet.team_number
        row, column = divmod(i, max(1, int((fleet.geofence.xmax_m - fleet.geofence.xmin_m - 4.0) // apart_m) + 1))
        beside = (
            fleet.geofence.xmin_m + 2.0 + apart_m * column,
            fleet.geofence.ymin_m + 2.0 + apart_m * row,
            90.0,
        )
        boats.append(
            SimBoat(
                name=name,
                platform=platform if hulls is None else hulls(name, platform),
                team=fleet.team_of[name],
                system_id=0 if link is None else link.system_id,
                address=None if link is None else link.address,
                policy=opponents if plays and not ours else "",
                start=None if plays else beside,
                gate=link.gate if isinstance(link, MoosLinkSettings) else "helm",
            )
        )
    return boats


@dataclass(frozen=True)
class SimSettings:
    """Settings of a simulated fleet; `ConfigError` where the noise is out of range."""

    origin: tuple[float, float] = (42.0, -71.0)  # latitude and longitude of the field's corner, deg
    y_axis_deg: float = 0.0  # true course of the field's y axis, deg
    speed: float = 1.0  # factor of real time, for all rates and the autopilots' clocks
    clock: Clock | None = None  # replaces the clock made from ``speed``
    # behaviour of the autopilots; `AutopilotSettings(boot_s=0.0)` is ready at once
    autopilot: AutopilotSettings = field(default_factory=AutopilotSettings)
    water: Water = field(default_factory=Water)  # wind and current
    radio: RadioSettings = field(default_factory=RadioSettings)  # loss and delay
    noise: float = 0.0  # scale of the sensor noise: 0 none, 1 as measured
    seed: int = 0  # of all random draws
    key: bytes | None = None  # 32-byte key for MAVLink 2 signing and for authenticating the feed; None: neither
    # rules of the game, which is played if there are as many red boats as blue ones
    preset: str | GameConfig = "aamas2024"
    rules: Mapping[str, Any] = field(default_factory=dict)  # game settings that override the preset's
    feed_to: Sequence[str] = ()  # HOST:PORT of each listener of the position feed
    record: bool = False  # whether to record the game, see `SimFleet.truth_record`
    separation_m: float = DEFAULT_SEPARATION_M  # distance that counts as a separation violation in the record, m
    waits: bool = True  # whether policies wait until the other boats are commanded
    random_start: bool = False  # draw start positions from ``seed`` instead of using the game's fixed ones
    allow_remote: bool = False  # whether links may leave this machine

    def __post_init__(self) -> None:
        check_bounds(self, noise=(0.0, 100.0))


class SimFleet(Closing):
    """Simulated boats. As a context manager, it starts the thread on entry and releases all resources on exit.

    Simulated time starts at 0 and is counted in seconds of ``clock``. Policies start to steer their boats once all
    other boats of the game have been commanded for 5 s (see ``waits`` and `play`).

    Args:
        boats: the boats to simulate.
        **settings: fields of `SimSettings`.

    Attributes:
        boats: by name.
        clock: the fleet's clock.
        let_go_s: simulated time skipped because the machine was too slow, s.
        cpu_s: processor time of the thread, s.

    Raises:
        ConfigError: boats contradict each other, an address cannot be used, or a setting is out of range; and from
            methods, if there is no such boat, fault or option, nothing was recorded, or the thread runs already.
    """

    def __init__(self, boats: Sequence[SimBoat], **settings: Any) -> None:
        if not boats or len({boat.name for boat in boats}) < len(boats):
            raise ConfigError("give at least one boat, each with a name of its own")
        chosen = SimSettings(**settings)
        self.frame = FieldFrame(*chosen.origin, chosen.y_axis_deg)
        self.clock: Clock = MonotonicClock(chosen.speed) if chosen.clock is None else chosen.clock
        self.let_go_s = self.cpu_s = 0.0
        self._lock, self._ends, self._ticks = threading.RLock(), threading.Event(), 0
        self._thread: threading.Thread | None = None
        self.boats: dict[str, Boat] = {}
        self._ports = Ports(chosen.allow_remote)
        self._hub: PositionHub | None = None
        config = game_of(boats, chosen.preset, chosen.rules)
        warp = float(getattr(self.clock, "speed", 1.0))
        setting = Setting(self.frame, chosen.autopilot, chosen.radio, chosen.noise, chosen.key, warp)
        try:
            places = start_places(boats, config, chosen.seed if chosen.random_start else None)
            seeds = np.random.SeedSequence(chosen.seed).spawn(len(boats))
            for i, (spec, place) in enumerate(zip(boats, places, strict=True)):
                self.boats[spec.name] = boat = Boat(spec, place, spec.system_id or i + 1, setting, seeds[i])
                self._ports.plug_in(boat)
            if chosen.feed_to:
                listeners = [near(to, chosen.allow_remote) for to in chosen.feed_to]
                self._hub = PositionHub(listeners, self.frame, chosen.noise, chosen.key)
            everyone = list(self.boats.values())
            players = [everyone[i] for i in playing(boats)]
            driven = {i: boat.spec.policy for i, boat in enumerate(players) if boat.spec.policy}
            game = None if config is None else Game(config, driven, chosen.seed)
            weather = Weather(chosen.water, self.frame, np.random.default_rng([chosen.seed, 0x9057]))
            radius_m = chosen.separation_m if chosen.record else None
            self._world = World(everyone, weather, game, players, self._hub, chosen.waits, radius_m)
        except BaseException:
            self.close()
            raise

    @classmethod
    def from_file(
        cls, fleet: FleetFile | str | Path, *, opponents: str = "medium", hulls: Hulls | None = None, **settings: Any
    ) -> SimFleet:
        """Build the boats of a FLEET.yaml; boats with a link obey it, policies steer the others.

        Args:
            fleet: the file or its path.
            opponents: scripted policy of the game's boats that the file's runner does not command.
            hulls: returns a boat's true platform, given its name and its platform in the file; None: the file's.
            **settings: fields of `SimSettings`; they override what the file says.

        Raises:
            FleetFileError: the file cannot be used.
            ConfigError: a setting cannot be used.
        """
        file = fleet if isinstance(fleet, FleetFile) else load_fleet(fleet)
        origin = file.field.origin
        said: dict[str, Any] = {
            "origin": (origin.latitude_deg, origin.longitude_deg),
            "y_axis_deg": file.field.y_axis_deg,
            "feed_to": file.position_listeners(),
            "separation_m": file.shield_config.separation_m,
            "key": key_of(file),
        }
        if file.agent_ids:
            said["preset"] = game_config(file).replace(dt_s=STEP_S)
        return cls(boats_of(file, opponents, hulls), **{**said, **settings})

    @property
    def addresses(self) -> dict[str, str]:
        """Address to connect to, for each boat with a link."""
        return self._ports.addresses

    @property
    def system_ids(self) -> dict[str, int]:
        """MAVLink system id of each boat."""
        return {name: boat.system_id for name, boat in self.boats.items()}

    @property
    def time_s(self) -> float:
        """Simulated time since the start, s."""
        return self._ticks * TICK_S

    @property
    def is_playing(self) -> bool:
        """Whether the game has begun: policies steer their boats and the record runs."""
        return self._world.is_playing

    @property
    def is_running(self) -> bool:
        """Whether the thread is alive."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def truth(self) -> TruthRecord | None:
        """The record so far; None without ``record`` or before the game begins."""
        return self._world.truth

    def play(self) -> None:
        """Begin the game: policies and record start immediately."""
        with self._lock:
            self._world.play()

    def states(self) -> dict[str, Array]:
        """Return the true state row (N_STATE,) of each boat, all at the same time."""
        with self._lock:
            return {name: boat.hull.state.copy() for name, boat in self.boats.items()}

    def place(self, boat: str, x_m: float, y_m: float, heading_deg: float, speed_mps: float = 0.0) -> None:
        """Move a boat to a position, heading and speed, and reset its controllers."""
        with self._lock:
            self.boat(boat).hull.place(x_m, y_m, heading_deg, speed_mps)

    def fault(self, boat: str, kind: str, *, duration_s: float = float("inf"), **options: Any) -> None:
        """Start a fault of a boat, see `faults.KINDS`; it ends after ``duration_s`` or with `clear`."""
        with self._lock:
            self.boat(boat).faults.start(kind, self.time_s, duration_s, **options)

    def clear(self, boat: str, kind: str | None = None) -> None:
        """End a fault of a boat, or all of them."""
        with self._lock:
            self.boat(boat).faults.stop(kind)

    def closest_approaches(self) -> list[Approach]:
        """Return the closest approach of each pair of boats since the start, closest first."""
        with self._lock:
            return self._world.closest.all()

    def truth_record(self) -> Record:
        """Return the record of the game since it began, with the boats' full states as array ``state``."""
        with self._lock:
            return record_of(self._world.truth).record()

    def judge(self, team: int = 0) -> list[dict[str, Any]]:
        """Return a team's separation violations since the game began, with verdicts (`docs.KEYS`)."""
        with self._lock:
            return record_of(self._world.truth).judge(team)

    def advance(self, seconds: float) -> None:
        """Simulate that many seconds at once, without thread and without waiting."""
        if self.is_running:
            raise ConfigError("the fleet runs by itself; call advance only on one that was not started")
        for _ in range(round(seconds / TICK_S)):
            self._receive(0.0)
            self._tick()

    def start(self) -> None:
        """Start the thread."""
        if self.is_running:
            raise ConfigError("the fleet runs already")
        self._world.warm_up()
        self._ends.clear()
        self._thread = threading.Thread(target=self._live, name="sim-boats", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop the thread and close the sockets; may be called again."""
        self._ends.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._ports.close()
        for boat in self.boats.values():
            if boat.community is not None:
                boat.community.close()
        if self._hub is not None:
            self._hub.close()

    def __enter__(self) -> Self:
        self.start()
        return self

    def boat(self, name: str) -> Boat:
        """Return the boat of that name."""
        if name not in self.boats:
            raise ConfigError(f"no simulated boat is named {name!r}; there are {', '.join(self.boats)}")
        return self.boats[name]

    def _live(self) -> None:
        """Simulate tick after tick by the clock, and read packets in between."""
        due_s = self.clock.now_s() + TICK_S
        began_s = time.thread_time()
        while not self._ends.is_set():
            lag_s = self.clock.now_s() - due_s
            if lag_s < 0.0:
                self._wait(due_s)
                continue
            if lag_s > _LONGEST_LAG_S:
                LOG.warning("simulated boats are %.1f s behind their clock and let the time go", lag_s)
                due_s += lag_s
                self.let_go_s += lag_s
            self._receive(min(lag_s, _LONGEST_LAG_S) + TICK_S)
            self._tick()
            due_s += TICK_S
            self.cpu_s = time.thread_time() - began_s

    def _wait(self, due_s: float) -> None:
        """Wait until then or until a packet comes, and read it."""
        left_s = (due_s - self.clock.now_s()) / getattr(self.clock, "speed", 1.0)
        patience_s = min(max(left_s, 0.0), _LONGEST_WAIT_S)
        if wait(self._ports.sockets(), patience_s):
            self._receive(self.clock.now_s() - due_s + TICK_S)

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
                    seen = [(name, other.spec.team, other.seen) for name, other in self.boats.items()]
                    boat.community.report(seen, self.time_s)
