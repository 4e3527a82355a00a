"""Commands about boats that are simulated, and about logs: sim-boats, replay, fit."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text
from steerclear.env.record import save
from steerclear.shield.bridge.blackbox import LogReader
from steerclear.shield.bridge.fleet_file import FleetFile, load_fleet
from steerclear.shield.bridge.mavlink.signing import read_key
from steerclear.shield.exceptions import BridgeError, ConfigError
from steerclear.shield.platforms import Platform, get_platform
from steerclear.shield.platforms.files import to_text

from . import cli_options as o
from .cli_boats import WithParent
from .cli_files import check_each_once, check_ending
from .console import ExitCode, Interrupted, command, err, finish, out, say, warn
from .deploy.demo import end_with_parent
from .deploy.replay import as_content, judge, replay_log, show
from .fit.fitting import best_of, fit_runs, platform_file, results_of
from .fit.models import MODELS
from .fit.reading import read_logs
from .fit.report import about_the_boat, promise
from .fit.report import draw as draw_fit
from .play.spec import check_seed
from .provenance import head_of
from .replay_html import write_replay
from .result_files import NEW, check_new, make_folder_of, write_json, write_new
from .sim_boats import AutopilotSettings, RadioSettings, SimFleet, Water
from .sim_boats.demo import demo_fleet, off_platform
from .sim_boats.faults import Plan, parse_incident
from .sim_boats.fleet import Hulls
from .sim_boats.report import approaches_table, boats_table, content_of, state_line, verdicts_table
from .unused import check_used

LOOK_S = 0.1
"""How often the terminal and the plan of faults are looked at, machine's s."""


@dataclass(frozen=True)
class SeaOptions:
    """Wind and current."""

    wind: Annotated[str, o.option("MPS@DEG", "Wind, and where it comes from.")] = "0"
    current: Annotated[str, o.option("MPS@DEG", "Current, and where it goes to.")] = "0"

    def given(self) -> Water:
        """The water.

        Raises:
            ConfigError: one of them is none.
        """
        wind_mps, wind_deg = _with_direction(self.wind, "--wind")
        current_mps, current_deg = _with_direction(self.current, "--current")
        return Water(wind_mps=wind_mps, wind_from_deg=wind_deg, current_mps=current_mps, current_to_deg=current_deg)


def _with_direction(text: str, option: str) -> tuple[float, float]:
    size, at, direction = text.partition("@")
    try:
        if at or float(size) == 0.0:
            return float(size), float(direction) if at else 0.0
    except ValueError:
        pass
    raise ConfigError(f"{option} is {text!r}; give m/s@deg, such as 5@270")


@dataclass(frozen=True)
class RadioOptions:
    """What happens to packets."""

    loss: Annotated[float, o.option("SHARE", "Share of packets lost, either way.")] = 0.0
    delay: Annotated[float, o.option("S", "Delay of every packet, one way, s, rounded up to 0.02.")] = 0.0
    jitter: Annotated[float, o.option("S", "Further delay, drawn for each packet.")] = 0.0


@dataclass(frozen=True)
class HullOptions:
    """What boats are, and what goes wrong with them."""

    noise: Annotated[float, o.option("X", "Noise of GPS and compass: 0 none, 1 as measured.")] = 0.0
    boot: Annotated[float, o.option("S", "From power on until the autopilot arms; 42 was measured.")] = 42.0
    really: Annotated[str | None, o.option("NAME|FILE", "What our boats really are, whatever their platforms say.")] = (
        None
    )
    off: Annotated[float, o.option("SHARE", "Our boats' parameters are off by this, 0.2: 20 %.")] = 0.0
    fault: Annotated[
        list[str] | None,
        o.option("BOAT:KIND@S[+S][,OPTION=X]", "Fault at a time, for a time; may be repeated.", "--fault"),
    ] = None


@dataclass(frozen=True)
class SimulatedOptions:
    """How the simulation goes."""

    demo: Annotated[bool, o.flag("Take the fleet that comes with the package, 3 against 3.", "--demo")] = False
    speed: Annotated[float, o.option("X", "Times faster than real time, all clocks included.")] = 1.0
    seed: o.DrawSeed = 0
    duration: Annotated[float | None, o.option("S", "Simulated time.", default="until Ctrl-C")] = None
    opponents: Annotated[
        str, o.option("NAME", "Scripted policy of the boats that the file's runner does not command.")
    ] = "medium"
    no_wait: Annotated[bool, o.flag("Let policies begin at once, not when all are commanded.", "--no-wait")] = False
    random_start: Annotated[bool, o.flag("Draw start places from the seed.", "--random-start")] = False
    allow_remote: Annotated[bool, o.flag("Let links and feed leave this machine.", "--allow-remote")] = False
    with_parent: WithParent = False


@command()
def sim_boats(
    how: SimulatedOptions,
    sea: SeaOptions,
    radio: RadioOptions,
    hulls: HullOptions,
    fleet: Annotated[
        Path | None, typer.Argument(metavar="FLEET.yaml", help="The runner's own file.", show_default=False)
    ] = None,
    record: Annotated[
        Path | None, o.option("FILE", "Write what really happened (.npz) for render.", "--record"), NEW
    ] = None,
    json_file: o.JsonFile = None,
) -> None:
    """Simulate the boats of a FLEET.yaml: MAVLink autopilots at its links, scripted opponents, the position feed.

    Runs until Ctrl-C or for --duration. Exit status: 0 done, 2 bad input, 130 interrupted before --duration was over.
    """
    if how.with_parent:
        end_with_parent()
    check_ending(record, "--record", ".npz")
    check_seed(how.seed)
    duration = how.duration
    if duration is not None and not 0.0 < duration < math.inf:
        raise ConfigError(f"--duration is {duration:g} s; give more than 0, or leave it out to run until Ctrl-C")
    if (fleet is None) != how.demo:
        raise ConfigError("give a FLEET.yaml, or --demo for the one that comes with the package")
    file = demo_fleet() if fleet is None else load_fleet(fleet)
    if not file.agent_ids:
        of_games = {"--record": record is not None, "--opponents": how.opponents != SimulatedOptions.opponents}
        of_games |= {"--no-wait": how.no_wait, "--random-start": how.random_start}
        check_used(of_games, f"{fleet} has no game; leave it out, or add the game to the file")
    boats, started = _boats(file, how, sea, radio, hulls, record is not None), time.perf_counter()
    try:
        plan = Plan([parse_incident(text) for text in hulls.fault or []], boats)
        out().print(boats_table(boats))
        cut_short = _simulate(boats, plan, duration)
        content = content_of(boats, file.team_number)
        files = [] if record is None or not boats.is_playing else [str(save(boats.truth_record(), record))]
    finally:
        boats.close()
    _show_boats(content, files, bool(file.agent_ids))
    if json_file is not None:
        given = {**vars(how), **vars(sea), **vars(radio), **vars(hulls), "fault": hulls.fault or []}
        chosen = {name: value for name, value in given.items() if name not in ("demo", "allow_remote", "with_parent")}
        settings = {"fleet": None if fleet is None else str(fleet), **chosen}
        wall_s = time.perf_counter() - started
        write_json(json_file, {**content, "settings": settings, "wall_s": wall_s, "files": files})
    if cut_short and duration is not None:
        raise Interrupted(f"interrupted after {content['simulated_s']:.0f} of {duration:g} simulated s")


def _boats(
    file: FleetFile, how: SimulatedOptions, sea: SeaOptions, radio: RadioOptions, hulls: HullOptions, record: bool
) -> SimFleet:
    return SimFleet.from_file(
        file,
        opponents=how.opponents,
        speed=how.speed,
        autopilot=AutopilotSettings(boot_s=hulls.boot),
        water=sea.given(),
        radio=RadioSettings(loss=radio.loss, delay_s=radio.delay, jitter_s=radio.jitter),
        noise=hulls.noise,
        seed=how.seed,
        record=record,
        waits=not how.no_wait,
        random_start=how.random_start,
        allow_remote=how.allow_remote,
        hulls=_hulls(file, hulls.really, hulls.off, how.seed),
    )


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


def _simulate(boats: SimFleet, plan: Plan, duration_s: float | None) -> bool:
    """Run until the end; whether it came by Ctrl-C (or SIGTERM)."""
    boats.start()
    try:
        with err().status("simulated boats run; Ctrl-C ends") as status:
            while duration_s is None or boats.time_s < duration_s:
                time.sleep(LOOK_S)
                if not boats.is_running:
                    raise BridgeError("the simulation stopped by itself; see the error above")
                for incident in plan.look():
                    err().print(f"{boats.time_s:8.1f} s  {incident.boat}: {incident.kind}")
                status.update(Text(state_line(boats)))
    except KeyboardInterrupt:
        return True
    return False


def _show_boats(content: dict[str, Any], files: list[str], plays: bool) -> None:
    out().print(approaches_table(content))
    if content["violations"] is not None:
        out().print(verdicts_table(content))
    say(*files)
    if not content["played"] and plays:
        warn("the game never began (not every boat was commanded): nothing was recorded")


@command()
def replay(
    log: Annotated[Path, typer.Argument(metavar="LOG.mcap", help="Black-box log that deploy wrote.")],
    judge_violations: Annotated[
        bool, o.flag("Also tell how close boats came, and judge which violations were avoidable.", "--judge")
    ] = False,
    html: Annotated[Path | None, o.flag("Write a replay to scrub in a browser; a new file."), NEW] = None,
    key: Annotated[Path | None, o.flag("Key file of the boats: check the codes of a log written with signing.")] = None,
    json_file: o.JsonFile = None,
) -> None:
    """Run the shield again on a recorded log and prove that it decides the same, bit for bit.

    Exit status: 0 all decisions are proved the same, 1 a decision differs or something else was sent, 2 bad input, 3
    not all is proved: turns missing from the log, no decisions, or the log is not as it was written, 130 interrupted.
    """
    started = time.perf_counter()
    check_ending(html, "--html", ".html", ".htm")
    with LogReader(log, None if key is None else read_key(key)) as reader:
        found = replay_log(reader, keep_tracks=judge_violations or html is not None)
    if judge_violations:
        judge(found)
    files = []
    if html is not None and found.record is not None:
        files.append(str(write_replay(found.record, html, f"steerclear replay of {log.name}")))
    show(out(), found)
    say(*files)
    if json_file is not None:
        settings = {"log": str(log), "judge": judge_violations}
        head = head_of("replay", settings, started)
        write_json(json_file, {**head, "log": str(log), **as_content(found), "files": files})
    finish(found.proof.holds)
    if not found.proved:
        raise typer.Exit(int(ExitCode.NOT_PROVED))


@command()
def fit(
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="LOG...", help="Logs of one boat: .csv of steps, .tlog, ArduPilot .bin, .mcap, .alog."),
    ],
    file: Annotated[Path, o.option("FILE", "Platform file to write (.yaml); a new one.", "--out"), NEW] = Path(
        "boat.yaml"
    ),
    name: Annotated[str | None, o.option("NAME", "Of the boat.", default="the file's name")] = None,
    kind: Annotated[str, o.option("KIND", "rate, usv, usv_by_speed, or auto: the one that predicts best.")] = "auto",
    boat: Annotated[str | None, o.option("NAME", "The boat, of a black-box log with several.")] = None,
    system_id: Annotated[int | None, o.option("N", "The boat, of a .tlog with several.")] = None,
    plot: Annotated[
        Path | None, o.option("FILE", "Picture of the fit, a new file.", default="beside --out, .png"), NEW
    ] = None,
    json_file: o.JsonFile = None,
) -> None:
    """Fit a boat to its logs: model, delay, and a model-error margin that covers 99 % of held-out runs.

    Exit status: 0 done, 2 bad input or too little to fit, 130 interrupted.
    """
    check_each_once(logs, "LOG...")  # else a run would be held out from a fit to itself
    check_ending(file, "--out", ".yaml", ".yml")
    picture = plot or file.with_suffix(".png")
    check_ending(picture, "--plot", ".png", ".pdf", ".svg")
    check_new(picture, "--plot")
    if kind != "auto" and kind not in MODELS:
        raise ConfigError(f"--kind is {kind!r}; give auto or one of {', '.join(MODELS)}")
    left_out: list[str] = []
    runs = read_logs(logs, boat, system_id, left_out.append)
    for words in left_out:
        err().print(f"left out: {words}", style="yellow", soft_wrap=True)
    kinds = tuple(MODELS) if kind == "auto" else (kind,)
    found = fit_runs(runs, kinds, lambda words: err().print(f"fitting {len(runs)} runs as {words} ...", style="dim"))
    chosen = best_of(found)
    described = platform_file(found[chosen], name or file.stem)
    results = results_of(found, chosen, described) | {"left_out": left_out}
    head = f"Fitted by steerclear fit to {len(runs)} runs of {', '.join(sorted({log.name for log in logs}))[:200]}."
    write_new(file, "--out", to_text(described, head))
    make_folder_of(picture)
    draw_fit(found[chosen], described.platform.name, picture)
    if json_file is not None:
        write_json(json_file, results)
    _show_fit(results, chosen)
    say(*about_the_boat(described.platform), *promise(described), file, picture)


def _show_fit(results: dict[str, Any], chosen: str) -> None:
    table = Table(title="held-out errors of the place, m (median / 99 of 100)", title_justify="left")
    table.add_column("model")
    for at in ("1 s", "3 s", "6 s"):
        table.add_column(f"{at} ahead", justify="right")
    for kind, errors in results["errors_m"].items():
        mark = " (taken)" if kind == chosen else ""
        table.add_row(kind + mark, *(f"{one['median']:.2f} / {one['p99']:.2f}" for one in errors.values()))
    out().print(table)
    alone = sorted({run["name"] for run in results["runs"] if not run["held_out"]})
    if alone:
        say(f"The only ones of their kind, and so not held out: {', '.join(alone)}.")
    medians = results["median_3_s_by_manoeuvre_m"]
    out().print("Median 3 s ahead: " + ", ".join(f"{kind} {value:.2f} m" for kind, value in medians.items()) + ".")
