"""Three against three on the real MOOS-IvP: MOOSDB, uSimMarine, pHelmIvP, pMarinePID and pNodeReporter for each boat.

The helms of all six drive lanes that cross; ours put RAW_ before their DESIRED_*, and the gate filters what they want.
What is measured is where the simulators say the boats are. NODE_REPORTs go from boat to boat by a relay of ours, as
uFldNodeComms does it on a shoreside. Whoever imports this asks `missing` first: without MOOS there is nothing to play.

The boats' platform is that of their simulator. `fit` makes one by the steps of the page on a boat of your own; `alone`
runs those steps' commands, such as the preflight that sees whether it fits.
"""

from __future__ import annotations

import contextlib
import math
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from drills import Gate
from moos_boats import HEAD
from steerclear.experiments.deploy.demo import free_ports
from steerclear.experiments.deploy.proof import prove
from steerclear.shield.bridge.blackbox import header_of_fleet
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.moos.client import MoosClient
from waiting import until

APPS = (("uSimMarineV22", "uSimMarine"), ("pMarinePIDV22", "pMarinePID"), ("pNodeReporter",), ("pHelmIvP",))
"""Of each kind the first that is installed is played."""
PLATFORMS = {"uSimMarineV22": "heron_v22", "uSimMarine": "heron"}
"""What describes the boats that each simulator moves, with the settings below."""
NAMES = ("blue_1", "blue_2", "blue_3", "red_1", "red_2", "red_3")
LANES = (
    ((6.0, 6.0), (74.0, 34.0)),
    ((6.0, 20.0), (74.0, 14.0)),
    ((6.0, 34.0), (74.0, 8.0)),
    ((74.0, 6.0), (6.0, 32.0)),
    ((74.0, 22.0), (6.0, 20.0)),
    ((74.0, 36.0), (6.0, 4.0)),
)
"""Where each boat begins, and whereto it drives, and back again, m: every lane of ours crosses lanes of theirs."""
SPEED_MPS, SEPARATION_M, POSITION_ERROR_M, START_S = 1.2, 2.5, 0.3, 60.0
APART_M = 0.25
"""Two simulators tell places of up to 0.1 s apart: so much less than the true distance may be measured."""
MISSION = """\
ServerHost = localhost
ServerPort = {port}
Community = {name}
MOOSTimeWarp = 1
LatOrigin = 42.0
LongOrigin = -71.0
ProcessConfig = {simulator}
{{
  AppTick = 10
  CommsTick = 10
  start_pos = x={x}, y={y}, heading={heading:.0f}, speed=0
  prefix = NAV
  turn_rate = 60
  thrust_map = 0:0, 40:1, 100:2
  turn_spd_loss = 0.85
}}
ProcessConfig = pHelmIvP
{{
  AppTick = 4
  CommsTick = 4
  behaviors = {behaviors}
  domain = course:0:359:360
  domain = speed:0:2:21
  {prefix}
}}
ProcessConfig = {pid}
{{
  AppTick = 10
  CommsTick = 10
  depth_control = false
  yaw_pid_kp = 0.9
  yaw_pid_kd = 0.6
  yaw_pid_ki = 0
  yaw_pid_integral_limit = 0.3
  speed_pid_kp = 1.0
  speed_pid_kd = 0
  speed_pid_ki = 0
  speed_pid_integral_limit = 0.07
  maxrudder = 100
  maxthrust = 100
  speed_factor = 0
  tardy_helm_threshold = 2
  tardy_nav_threshold = 2
}}
ProcessConfig = pNodeReporter
{{
  AppTick = 4
  CommsTick = 4
  platform_type = heron
  platform_length = 1.3
}}
"""
BEHAVIORS = """\
initialize DEPLOY = true
Behavior = BHV_Waypoint
{{
  name = lane
  pwt = 100
  condition = DEPLOY=true
  speed = {speed}
  capture_radius = 3
  slip_radius = 8
  points = {there} : {back}
  repeat = 1000
}}
"""


def missing() -> str:
    """Which program of MOOS-IvP is not on the path, in words; empty: all are."""
    wanted = (("MOOSDB",), *APPS)
    absent = [" or ".join(names) for names in wanted if not any(map(shutil.which, names))]
    return f"{', '.join(absent)} not on the path: the real MOOS-IvP was not played" if absent else ""


class Boats:
    """Communities, each with programs of its own, and what their simulators say."""

    def __init__(self, folder: Path, names: tuple[str, ...] = NAMES) -> None:
        self.ports = dict(zip(names, free_ports(len(names)), strict=True))
        self.at: dict[str, dict[str, float]] = {name: {} for name in names}
        self._stack, self._folder, self._clients = contextlib.ExitStack(), folder, {}

    def __enter__(self) -> Boats:
        for name in self.at:
            file = self._write(name, LANES[NAMES.index(name)])
            self._run("MOOSDB", file)
            self._clients[name] = client = self._client(name)
            client.start()
        if not until(lambda: all(client.connected for client in self._clients.values()), START_S):
            raise RuntimeError("the MOOSDBs do not answer; see their output")
        for name in self.at:
            for kind in APPS:
                self._run(_installed(kind), self.mission(name))
        if not until(lambda: all({"NAV_X", "NAV_Y"} <= set(place) for place in self.at.values()), START_S):
            raise RuntimeError(f"no NAV_X and NAV_Y of {[name for name in self.at if not self.at[name]]}")
        return self

    def __exit__(self, *_: object) -> None:
        for client in self._clients.values():
            client.close()
        self._stack.close()

    def mission(self, name: str) -> Path:
        """A boat's .moos file."""
        return self._folder / f"{name}.moos"

    def deploy(self) -> None:
        """Press DEPLOY: nobody holds a boat by hand any more."""
        for client in self._clients.values():
            client.post({"MOOS_MANUAL_OVERRIDE": "false", "DEPLOY": "true"})

    def distances(self) -> dict[tuple[str, str], float]:
        """Of every pair with a boat of ours, m."""
        place = {name: (at["NAV_X"], at["NAV_Y"]) for name, at in self.at.items()}
        return {(a, b): math.dist(place[a], place[b]) for a in NAMES[:3] for b in NAMES if a < b}

    def _client(self, name: str) -> MoosClient:
        def hear(message, time_s: float) -> None:
            if message.key in ("NAV_X", "NAV_Y"):
                self.at[name][message.key] = message.value
            elif message.key == "NODE_REPORT_LOCAL":
                for other in self.at:
                    if other != name:
                        self._clients[other].post({"NODE_REPORT": message.text})

        variables = {"NAV_X": 0.0, "NAV_Y": 0.0, "NODE_REPORT_LOCAL": 0.0}
        return MoosClient(f"relay_{name}", "127.0.0.1", self.ports[name], MonotonicClock(), variables, hear)

    def _write(self, name: str, lane: tuple[tuple[float, float], tuple[float, float]]) -> Path:
        (x, y), (to_x, to_y) = lane
        behaviors, file = self._folder / f"{name}.bhv", self.mission(name)
        behaviors.write_text(BEHAVIORS.format(speed=SPEED_MPS, there=f"{to_x:g},{to_y:g}", back=f"{x:g},{y:g}"))
        heading = math.degrees(math.atan2(to_x - x, to_y - y)) % 360.0
        file.write_text(
            MISSION.format(
                **{"port": self.ports[name], "name": name, "x": x, "y": y, "heading": heading, "behaviors": behaviors},
                **{"simulator": _installed(APPS[0]), "pid": _installed(APPS[1])},
                prefix="helm_prefix = RAW_" if name.startswith("blue") else "",
            )
        )
        return file

    def _run(self, program: str, mission: Path) -> None:
        with (self._folder / f"{mission.stem}_{program}.txt").open("wb") as out:
            child = subprocess.Popen([program, str(mission)], cwd=self._folder, stdout=out, stderr=subprocess.STDOUT)

        def end() -> None:
            child.kill()
            child.wait()

        self._stack.callback(end)


def _installed(names: tuple[str, ...]) -> str:
    return next(name for name in names if shutil.which(name))


def fleet_text(boats: Boats, platform: str | None = None) -> str:
    """The runner's file for these boats, all of the platform; None: the one that describes their simulator."""
    lines = [HEAD.replace(", y_axis_deg: 30", "").rstrip()]
    platform = platform or PLATFORMS[_installed(APPS[0])]
    for i, (name, port) in enumerate(boats.ports.items()):
        side = f"agent: agent_{i}" if len(boats.ports) == len(NAMES) else "team: blue"
        link = f'kind: moos, address: "moos://127.0.0.1:{port}", mission: "{boats.mission(name)}"'
        link = f", link: {{{link}}}" if name.startswith("blue") else ""
        lines.append(f'  - {{name: {name}, {side}, platform: "{platform}"{link}}}')
    return "\n".join([*lines, f"shield: {{delay_s: 0.2, position_error_m: {POSITION_ERROR_M:g}}}"]) + "\n"


def alone(command: str, folder: Path, platform: str | None = None) -> subprocess.CompletedProcess[str]:
    """Run ``steerclear`` with such a command on one of our boats, the only one on the water; ended, with its words."""
    with Boats(folder, NAMES[:1]) as boats:
        file = folder / "FLEET.yaml"
        file.write_text(fleet_text(boats, platform))
        boats.deploy()
        return _steerclear(command, str(file))


def fit(out: Path) -> str:
    """Write the platform that fits the simulator's boats, from a sea trial of 8 minutes; what was said of it."""
    with tempfile.TemporaryDirectory() as folder:
        alone("sea-trial", Path(folder)).check_returncode()
        (log,) = Path(folder).glob("logs/*.mcap")
        return _steerclear("fit", str(log), "--boat", NAMES[0], "--out", str(out)).stdout


def _steerclear(*words: str) -> subprocess.CompletedProcess[str]:
    program = Path(sys.executable).with_name("steerclear")
    return subprocess.run([str(program), *words], capture_output=True, text=True, check=False)


def play(seconds: float = 180.0, platform: str | None = None) -> dict[str, float]:
    """Play the mission behind the gate, with `fleet_text`'s platform; what came of it."""
    closest = {"teammate": math.inf, "opponent": math.inf}
    inside: set[tuple[str, str]] = set()
    violations: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder, Boats(Path(folder)) as boats:
        text = fleet_text(boats, platform)
        fleet = parse_fleet(text)
        with Gate(fleet) as gate:
            header = header_of_fleet(fleet, text, policy="moos", commanded=gate.links, clock_s=gate.clock.now_s())
            boats.deploy()
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                time.sleep(0.05)
                for pair, apart_m in boats.distances().items():
                    kind = "teammate" if pair[1].startswith("blue") else "opponent"
                    closest[kind] = min(closest[kind], apart_m)
                    if apart_m < SEPARATION_M and pair not in inside:
                        violations[kind] += 1
                    (inside.add if apart_m < SEPARATION_M else inside.discard)(pair)
            missed = gate.loop.overruns.missed
        ticks = gate.ticks.all
    proof = prove(header, ticks)
    moved = sum(bool(tick.sent) and max(sent.speed_mps for sent in tick.sent.values()) > 0.5 for tick in ticks)
    return {
        "closest teammate, m": closest["teammate"],
        "closest opponent, m": closest["opponent"],
        "separation violations with teammates": float(violations["teammate"]),
        "separation violations with opponents": float(violations["opponent"]),
        "turns": float(len(ticks)),
        "turns skipped": float(missed),
        "turns under way": float(moved),
        "commands changed, share": sum(t.decisions.count_intervened for t in ticks if t.decisions is not None)
        / max(1, 3 * proof.decisions),
        "decisions": float(proof.decisions),
        "decided again the same": float(proof.same),
    }
