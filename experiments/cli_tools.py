"""Commands about one thing each: compare, docs, render, parity, bench, warm-up, and platform files."""

from __future__ import annotations

import re
import shlex
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from itertools import takewhile
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text
from steerclear.env.parity import ParityReport, Tolerances, replay_trace
from steerclear.env.record import load
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import kept_in
from steerclear.shield.platforms import get_platform, known_platforms
from steerclear.shield.platforms.files import PlatformFile, is_path, load_platform, to_text
from steerclear.shield.platforms.registry import SHIPPED
from steerclear.shield.platforms.schema import ENTRIES, GAINS, KIND_WORDS, MEASURED
from steerclear.shield.renamed import current_keys
from steerclear.shield.tables.files import read_table

from . import cli_options as o
from .bench import BenchSettings, bench_tables, run_bench
from .cli_files import check_ending
from .cli_games import FEW_GAMES, met
from .compare_runs import compare_runs, read_run
from .console import App, command, err, finish, out, progress, say
from .docs import SOURCES, write_pages
from .fit.report import about_the_boat, promise
from .provenance import head_of
from .replay_html import check_endings, save_record, write_replay
from .result_files import NEW, check_new, read_json, write_json, write_new
from .runner import RESULTS_FILE
from .tables import figures_table, goals_table, titled
from .warming import PARTS
from .words import count_text
from .workers import end_failed, outcomes, processes_of

CHANCE_WORDS = (
    "A difference whose interval leaves out 0 is hardly chance. Of 20 figures that nothing changed, though, about one "
    "has such an interval: choose which figures you ask about before you look."
)
DIFFERENCES = {"first": "A", "second": "B", "difference": "B - A, paired"}
"""Columns of a comparison, by key."""
DEVIATIONS = ("position_m", "heading_deg", "speed_mps", "observation_normalised")
MISMATCHES_SHOWN = 5
PLAIN_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,31}")
platforms_app = App(no_args_is_help=True, help="Platforms: boats behind their autopilots, as files.")


@command()
def compare(
    first: Annotated[
        Path, typer.Argument(metavar="A", help="Results folder of ablate or evaluate.", show_default=False)
    ],
    second: Annotated[Path, typer.Argument(metavar="B", help="The same with another setting.", show_default=False)],
    json_file: o.JsonFile = None,
) -> None:
    """Compare two settings: games of two results folders from the same seeds, B less A with 95 % intervals.

    Games with the shield are compared, where a folder has any. Exit status: 0 done, 2 bad input, or games that are no
    pairs.
    """
    started = time.perf_counter()
    found = compare_runs(read_run(first), read_run(second))
    _show_comparison(found)
    settings = {"first": str(first), "second": str(second)}
    write_json(json_file, {**head_of("compare", settings, started), **found})


def _show_comparison(found: dict[str, Any]) -> None:
    for letter, run in (("A", found["first"]), ("B", found["second"])):
        say(f"{letter}: {run['folder']}: {run['own']}, shield {'on' if run['shielded'] else 'off'}")
    for name, (before, after) in found["differs"].items():
        say(f"differs: {name}: {_told(before)} in A, {_told(after)} in B")
    if not found["differs"]:
        say("No setting differs: these are the same games.")
    for pairing in found["pairings"]:
        title = (
            f"\nagainst {pairing['opponent']}: {count_text(pairing['pairs'], 'pair')}, means per game [95 % interval]"
        )
        out().print(figures_table(title, pairing["metrics"].values(), DIFFERENCES))
    say(f"\n{CHANCE_WORDS}")
    if min(pairing["pairs"] for pairing in found["pairings"]) < FEW_GAMES:
        say(f"Intervals of fewer than {FEW_GAMES} pairs say little.")


def _told(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(str(one)[:12] or "none" for one in value) or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "default" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


@command()
def docs(
    sources: Annotated[
        list[Path] | None, typer.Argument(help=f"Results folders or JSON files of {SOURCES}; value tables (.npz).")
    ] = None,
    folder: Annotated[Path, o.option("DIR", "Folder for the pages.", "--out")] = Path("docs"),
) -> None:
    """Write documentation pages, tables and plots, from results.

    Exit status: 0 done, 2 bad input.
    """
    say(*write_pages([_read_results(source) for source in sources or []], folder))


def _read_results(source: Path) -> dict[str, Any]:
    if source.suffix == ".npz":
        return {"command": "reach", "card": read_table(source).card.to_json()}
    path = source / RESULTS_FILE if source.is_dir() else source
    content = read_json(path, "results", "give a results folder or a JSON file")
    if not isinstance(content, dict):
        raise ConfigError(f"{path} holds no results; give a results folder or a JSON file of {SOURCES}")
    return dict(current_keys(content))


@command()
def render(
    records: Annotated[list[Path], typer.Argument(help="Recorded games (.npz); several only for .html.")],
    to: Annotated[
        Path | None,
        o.option(
            "FILE",
            "What to write, a new file: .html, .mp4, .gif, .png or .npz.",
            "--to",
            default="a replay beside the record",
        ),
        NEW,
    ] = None,
    at: Annotated[float | None, o.option("S", "Moment a picture shows, s.", default="the closest approach")] = None,
    speed: Annotated[float, o.option("X", "Times faster than the game, for films.")] = 4.0,
    json_file: o.JsonFile = None,
) -> None:
    """Turn recorded games into a replay to scrub in a browser, a film or a picture.

    Exit status: 0 done, 2 bad input, 130 interrupted.
    """
    started = time.perf_counter()
    check_endings([to] if to else [])
    games = [load(path) for path in records]
    to = to or records[0].with_suffix(".html")
    check_new(to, "--to")
    several = to.suffix.lower() == ".html"
    if len(games) > 1 and not several:
        raise ConfigError(f"only a replay (.html) takes several games; give one record for {to.suffix}")
    path = write_replay(games, to) if several else save_record(games[0], to, at, speed)
    say(path)
    settings = {"records": [str(record) for record in records], "to": str(to), "at": at, "speed": speed}
    write_json(json_file, {**head_of("render", settings, started), "files": [str(path)]})


@command(jobs=1)
def parity(
    traces: Annotated[list[Path], typer.Argument(help="Recorded games (.npz).")],
    jobs: o.Jobs = 1,
    json_file: o.JsonFile = None,
) -> None:
    """Replay recorded Pyquaticus games and compare every value.

    Exit status: 0 all within the limits, 1 a deviation is over its limit or an event differs, 2 bad input.
    """
    started, found = time.perf_counter(), dict[Path, ParityReport]()
    with progress("traces", len(traces)) as notice:
        for outcome in outcomes(replay_trace, list(traces), processes_of(jobs)):
            if outcome.answer is None:
                end_failed([outcome.why], f"{outcome.job} could not be replayed", f": {outcome.error}")
            found[outcome.job] = outcome.answer
            notice(len(found))
    reports, limits = [found[path] for path in traces], asdict(Tolerances())
    passed = all(report.passed for report in reports)
    _show_parity(reports, limits)
    rows = []
    for row in (report.to_dict() for report in reports):
        first = row["mismatches"][:MISMATCHES_SHOWN]
        rows.append({**row, "mismatches": len(row["mismatches"]), "first_mismatches": first})
    head = head_of("parity", {"traces": [str(path) for path in traces]}, started)
    write_json(json_file, {**head, "passed": passed, "limits": limits, "traces": rows})
    finish(passed)


def _show_parity(reports: Sequence[ParityReport], limits: dict[str, float]) -> None:
    rows: list[list[str | Text]] = []
    for report in reports:
        deviations = [f"{getattr(report, name):.1e}" for name in DEVIATIONS]
        verdict = Text("ok", "green") if report.passed else Text("over", "red")
        rows.append([Path(report.path).stem, str(report.steps), *deviations, str(len(report.mismatches)), verdict])
    rows.append(["limit", "", *(f"{limits[name]:.0e}" for name in DEVIATIONS), "0", ""])
    heads = ["trace", "steps", "pos. m", "head. deg", "speed m/s", "obs.", "events", ""]
    out().print(titled("Largest deviation from the recorded games", heads, rows), "")
    for report in reports:
        stem = Path(report.path).stem
        for name, value in report.over().items():
            out().print(f"{stem}: {name} {value:.2g} is over {limits[name]:g}")
        for one in report.mismatches[:MISMATCHES_SHOWN]:
            out().print(f"{stem}: step {one.step}, {one.event} of {one.who}: expected {one.expected}, got {one.got}")
    over = sum(not report.passed for report in reports)
    words = f"{over} of {len(reports)} over the limits" if over else "all within the limits"
    steps = count_text(sum(report.steps for report in reports), "step")
    out().print(f"{count_text(len(reports), 'trace')}, {steps}: {words}")


@command()
def bench(
    preset: o.Preset = "aamas2024",
    seed: o.Seed = 0,
    quick: o.Quick = False,
    check: o.Check = False,
    json_file: o.JsonFile = None,
) -> None:
    """Measure decision times, solvers, batched games, memory and cost against the number of boats.

    Exit status: 0 done, 1 a goal is not met (with --check), 2 bad input, 130 interrupted.
    """
    settings = replace(BenchSettings(), preset=preset, seed=seed)
    with err().status("measuring") as status:

        def notice(words: str) -> None:
            status.update(Text(f"measuring: {words}"))
            if not err().is_terminal:
                err().print(f"measuring: {words}", soft_wrap=True)

        content = run_bench(settings.small() if quick else settings, notice)
    machine = content["machine"]
    say(f"{machine['processor']}, {count_text(machine['cores'], 'core')}, {machine['system']}", "")
    for table in bench_tables(content):
        out().print(titled(table.title, table.heads, table.rows, width=12 if len(table.heads) < 6 else 8))
        say("")
    out().print(goals_table(content["goals"]))
    if quick:
        out().print("This was the small version: its figures are rough. Leave out --quick for real ones.")
    write_json(json_file, content)
    finish(not check or met(content))


@command()
def warm_up() -> None:
    """Compile everything for this machine and say where it is kept: about a minute, once.

    Without it the first decision, game or command on a machine does so. Run it again after an update.

    Exit status: 0 done, 2 nothing can be kept (the message says how it can), 130 interrupted.
    """
    place, started = kept_in(), time.perf_counter()
    if not place:
        raise ConfigError("compiled code can be kept nowhere; set NUMBA_CACHE_DIR to a folder that can be written to")
    for name, compile_it in PARTS.items():
        err().print(f"compiling {name}", soft_wrap=True)
        compile_it()
    say(f"done ({time.perf_counter() - started:.0f} s); kept in {place}")


def _platform_of(name: str) -> PlatformFile:
    """The file of a platform named by its path or its name."""
    return load_platform(name) if is_path(name) else PlatformFile(get_platform(name))


@platforms_app.command("show")
def show_platform(
    name: Annotated[str | None, typer.Argument(metavar="[NAME|FILE]", show_default="all entries")] = None,
) -> None:
    """Print a platform as a file; without a name, every entry with its unit and the boats there are."""
    if name is not None:
        out().print(to_text(_platform_of(name)), soft_wrap=True, end="")
        return
    table = Table(title="entries of a platform file: name, kind, and", title_justify="left", box=SIMPLE_HEAD)
    for column in ("entry, unit", "of kinds"):
        table.add_column(column, no_wrap=True)
    table.add_column("what it is")
    for key, entry in ENTRIES.items():
        table.add_row(f"{key}\n  {entry.unit}" if entry.unit else key, "\n".join(entry.kinds), entry.words)
    for key, words in GAINS.items():
        table.add_row(f"*_pid.{key}", "usv\nrate", words)
    for key, entry in MEASURED.items():
        table.add_row(f"measured.{key}\n  {entry.unit}", "all", entry.words)
    out().print(table)
    say(*(f"{kind}: {words}" for kind, words in KIND_WORDS.items()), "", "boats:")
    say(*(f"{name}: {_origin(name)}" for name in sorted(known_platforms())))


def _origin(name: str) -> str:
    """What boat that is: the first sentence of its shipped file, of others what moves them."""
    file = SHIPPED / f"{name}.yaml"
    if not file.is_file():
        return KIND_WORDS[get_platform(name).kind]
    head = takewhile(lambda line: line.startswith("#"), file.read_text(encoding="utf-8").splitlines())
    return " ".join(line.removeprefix("# ") for line in head).split(". ")[0].rstrip(".")


@platforms_app.command("check")
def check_platform(
    name: Annotated[str, typer.Argument(metavar="NAME|FILE", help="A platform's name, or the path of its file.")],
) -> None:
    """Read a platform, run it in its own model, and say what it does and what the shield then promises.

    Exit status: 0 it is a boat that can be steered, 2 it is not, with the reason.
    """
    file = _platform_of(name)
    say(*about_the_boat(file.platform), *promise(file))


@platforms_app.command("new")
def new_platform(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Of the boat.")],
    begin: Annotated[str, o.option("NAME", "The platform to begin with.", "--from")] = ("ardurover_boat"),
    file: Annotated[Path | None, o.option("FILE", "A new file.", "--out", default="NAME.yaml"), NEW] = None,
) -> None:
    """Write a platform file to edit, with a word on each entry, beginning with a boat there is."""
    if not PLAIN_NAME.fullmatch(name) or is_path(name):
        raise ConfigError(
            f"NAME is {name!r}; give 1 to 32 letters, digits, '_', '-' or '.', no file; say where with --out"
        )
    path = file or Path(f"{name}.yaml")
    check_ending(path, "--out", ".yaml", ".yml")
    check_new(path, "--out")
    begun = PlatformFile(replace(_platform_of(begin).platform, name=name))
    write_new(path, "--out", to_text(begun, "Edit, then: steerclear platform check"))
    say(path, f"next: {shlex.join(['steerclear', 'platform', 'check', str(path)])}")
