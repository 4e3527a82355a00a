"""``steerclear sim-boats``: simulated boats behind real MAVLink sockets."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.text import Text
from steerclear.env.record import save
from steerclear.shield.bridge.fleet_file import FleetFile, load_fleet
from steerclear.shield.exceptions import BridgeError, ConfigError
from steerclear.shield.platforms import Platform, get_platform

from ..deploy.demo import end_with_parent
from ..play.spec import check_seed
from ..result_files import NEW, write_json
from ..sim_boats import AutopilotSettings, RadioSettings, SimFleet, Water
from ..sim_boats.demo import demo_fleet, off_platform
from ..sim_boats.faults import Plan, parse_incident
from ..sim_boats.fleet import Hulls
from ..sim_boats.report import approaches_table, boats_table, content_of, state_line, verdicts_table
from . import deploying as d
from . import options as o
from .console import Interrupted, command, err, finish, out
from .files import check_ending

LOOK_S = 0.1
"""How often the terminal and the plan of faults are looked at, machine's s."""

Fleet = Annotated[Path | None, typer.Argument(metavar="FLEET.yaml", help="The runner's own file.", show_default=False)]
Demo = Annotated[bool, typer.Option("--demo", help="Take the fleet that comes with the package, 3 against 3.")]
Speed = Annotated[float, typer.Option(metavar="X", help="Times faster than real time, all clocks included.")]
Wind = Annotated[str, typer.Option(metavar="MPS@DEG", help="Wind, and where it comes from.")]
Current = Annotated[str, typer.Option(metavar="MPS@DEG", help="Current, and where it goes to.")]
Noise = Annotated[float, typer.Option(metavar="X", help="Noise of GPS and compass: 0 none, 1 as measured.")]
Loss = Annotated[float, typer.Option(metavar="SHARE", help="Share of packets lost, either way.")]
Delay = Annotated[float, typer.Option(metavar="S", help="Delay of every packet, one way, s, rounded up to 0.02.")]
Jitter = Annotated[float, typer.Option(metavar="S", help="Further delay, drawn for each packet.")]
Duration = Annotated[float | None, typer.Option(metavar="S", help="Simulated time.", show_default="until Ctrl-C")]
Boot = Annotated[float, typer.Option(metavar="S", help="From power on until the autopilot arms; 42 was measured.")]
Opponents = Annotated[
    str, typer.Option(metavar="NAME", help="Scripted policy of the boats that the file's runner does not command.")
]
NoWait = Annotated[bool, typer.Option("--no-wait", help="Let policies begin at once, not when all are commanded.")]
RandomStart = Annotated[bool, typer.Option("--random-start", help="Draw start places from the seed.")]
Fault = Annotated[
    list[str] | None,
    typer.Option("--fault", metavar="BOAT:KIND@S[+S]", help="Fault at a time, for a time; may be repeated."),
]
RecordFile = Annotated[
    Path | None, typer.Option("--record", metavar="FILE", help="Write what really happened (.npz) for render."), NEW
]
Really = Annotated[
    str | None, typer.Option(metavar="NAME|FILE", help="What our boats really are, whatever their platforms say.")
]
Off = Annotated[float, typer.Option(metavar="SHARE", help="Our boats' parameters are off by this, 0.2: 20 %.")]
Remote = Annotated[bool, typer.Option("--allow-remote", help="Let links and feed leave this machine.")]
Check = Annotated[
    bool, typer.Option("--check", help="Exit with status 1 after a breach of team-mates or an avoidable one.")
]


@command
def sim_boats(
    fleet: Fleet = None,
    demo: Demo = False,
    speed: Speed = 1.0,
    wind: Wind = "0",
    current: Current = "0",
    noise: Noise = 0.0,
    loss: Loss = 0.0,
    delay: Delay = 0.0,
    jitter: Jitter = 0.0,
    seed: o.DrawSeed = 0,
    duration: Duration = None,
    boot: Boot = 42.0,
    opponents: Opponents = "medium",
    no_wait: NoWait = False,
    random_start: RandomStart = False,
    fault: Fault = None,
    record: RecordFile = None,
    allow_remote: Remote = False,
    check: Check = False,
    really: Really = None,
    off: Off = 0.0,
    with_parent: d.WithParent = False,
    json_file: o.JsonFile = None,
) -> None:
    """Simulate the boats of a FLEET.yaml: MAVLink autopilots at its links, scripted opponents, the position feed.

    Runs until Ctrl-C or for --duration. Exit status: 0 done, 1 a bar is not met (with --check), 2 bad input, 130
    interrupted before --duration was over.
    """
    if with_parent:
        end_with_parent()
    settings = {
        "fleet": None if fleet is None else str(fleet),
        **{"speed": speed, "wind": wind, "current": current, "noise": noise, "loss": loss, "delay": delay},
        **{"jitter": jitter, "seed": seed, "duration": duration, "boot": boot, "opponents": opponents},
        **{"really": really, "off": off, "no_wait": no_wait, "random_start": random_start, "fault": fault or []},
    }
    check_ending(record, "--record", (".npz",))
    check_seed(seed)
    if duration is not None and not 0.0 < duration < math.inf:
        raise ConfigError(f"--duration is {duration:g} s; give more than 0, or leave it out to run until Ctrl-C")
    file = _file(fleet, demo)
    boats = SimFleet.from_file(
        file,
        opponents=opponents,
        speed=speed,
        autopilot=AutopilotSettings(boot_s=boot),
        water=_water(wind, current),
        radio=RadioSettings(loss=loss, delay_s=delay, jitter_s=jitter),
        noise=noise,
        seed=seed,
        record=record is not None or check,
        waits=not no_wait,
        random_start=random_start,
        allow_remote=allow_remote,
        hulls=_hulls(file, really, off, seed),
    )
    started = time.perf_counter()
    try:
        plan = Plan([parse_incident(text) for text in fault or []], boats)
        out().print(boats_table(boats))
        cut_short = _run(boats, plan, duration)
        content = content_of(boats, file.team_number)
        files = [] if record is None or not boats.is_playing else [str(save(boats.truth_record(), record))]
    finally:
        boats.close()
    _show(content, files)
    if json_file is not None:
        wall_s = time.perf_counter() - started
        write_json(json_file, {**content, "settings": settings, "wall_s": wall_s, "files": files})
    if cut_short and duration is not None:
        raise Interrupted(f"interrupted after {content['simulated_s']:.0f} of {duration:g} simulated s")
    finish(not check or content["clean"])


def _file(path: Path | None, demo: bool) -> FleetFile:
    if (path is None) != demo:
        raise ConfigError("give a FLEET.yaml, or --demo for the one that comes with the package")
    return demo_fleet() if path is None else load_fleet(path)


def _hulls(file: FleetFile, really: str | None, off: float, seed: int) -> Hulls | None:
    """What boats of our team really are."""
    if really is None and off == 0.0:
        return None
    ours = {boat.name for boat in file.ours}
    true = None if really is None else get_platform(really)

    def hull(name: str, platform: Platform) -> Platform:
        return off_platform(true or platform, off, name, seed) if name in ours else platform

    for name in ours:
        hull(name, file.platform_of[name])  # what cannot be is refused before anything is opened
    return hull


def _water(wind: str, current: str) -> Water:
    wind_mps, wind_deg = _with_direction(wind, "--wind")
    current_mps, current_deg = _with_direction(current, "--current")
    return Water(wind_mps=wind_mps, wind_from_deg=wind_deg, current_mps=current_mps, current_to_deg=current_deg)


def _with_direction(text: str, option: str) -> tuple[float, float]:
    size, at, direction = text.partition("@")
    try:
        return float(size), float(direction) if at else 0.0
    except ValueError:
        raise ConfigError(f"{option} is {text!r}; give m/s@deg, such as 5@270") from None


def _run(boats: SimFleet, plan: Plan, duration_s: float | None) -> bool:
    """Run until the end; whether it came by Ctrl-C (or SIGTERM)."""
    boats.start()
    try:
        with _ended_by_sigterm(), err().status("simulated boats run; Ctrl-C ends") as status:
            while duration_s is None or boats.time_s < duration_s:
                time.sleep(LOOK_S)
                if not boats.is_running:
                    raise BridgeError("the simulation stopped by itself; see the error above")
                for incident in plan.look():
                    err().print(f"{boats.time_s:8.1f} s  {incident.boat}: {incident.kind}", markup=False)
                status.update(Text(state_line(boats)))
    except KeyboardInterrupt:
        return True
    return False


@contextmanager
def _ended_by_sigterm() -> Iterator[None]:
    """Let SIGTERM end the run as Ctrl-C does, with its figures and record."""

    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    before: Callable[..., Any] | int | None = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _show(content: dict[str, Any], files: list[str]) -> None:
    console = out()
    console.print(approaches_table(content))
    if content["breaches"] is not None:
        console.print(verdicts_table(content))
    for path in files:
        console.print(path, soft_wrap=True)
    if not content["played"]:
        err().print("the game never began (not every boat was commanded): nothing was recorded", soft_wrap=True)
