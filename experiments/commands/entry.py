"""``steerclear entry``: a competition entry looked at: does it play, and what does the shield do to it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.shield.exceptions import ConfigError

from ..ablation import quick as small_version
from ..ablation import spec_of
from ..entries.check import always_late, check_entry, headline
from ..entries.report_page import EntryGames, games_to_look_at, shielded_zip, write_entry_page
from ..entries.team import is_entry
from ..entries.wrap import wrap_entry
from ..play.match import play_match
from ..play.spec import ANSWER_S
from ..provenance import machine, versions
from ..replay_html import write_replay
from ..result_files import NEW, write_json
from ..runner import Run
from ..workers import outcomes, processes_of
from . import options as o
from .console import command, err, finish, out, progress
from .games import end_run, results_folder, run_games, say_of_distance
from .once import App
from .policies_tried import say_of_elsewhere

app = App(
    help="A competition entry: check that it plays, report what the shield does, wrap it into a shielded zip.",
    no_args_is_help=True,
)

Entry = Annotated[str, typer.Argument(metavar="ENTRY", help="Folder or zip with solution.py, as it is handed in.")]
Also = Annotated[str | None, typer.Option(metavar="A.zip,B.zip", help="Further opponents: entries or policies.")]
Games = Annotated[int, typer.Option(metavar="N", help="Games against each opponent, in each of the ways it is played.")]
Looks = Annotated[int, typer.Option(metavar="N", help="Pairs of games to keep as replays, 0 to 3.")]
CheckTime = Annotated[float | None, typer.Option(metavar="S", help="Length of the game it is tried in, s. [whole]")]
QUICK_GAMES, QUICK_TIME_S = 2, 200.0


def check_path(entry: str) -> None:
    """Refuse what is no path of an entry.

    Raises:
        ConfigError: it is a policy's name or a model.
    """
    if not is_entry(entry) or entry.startswith("sb3:"):
        raise ConfigError(f"{entry} is no entry; give a folder or a zip with solution.py, such as ./{entry}.zip")


@app.command()
@command
def check(
    entry: Entry,
    preset: o.Preset = "mctf2026",
    max_time: CheckTime = None,
    answer_time: o.AnswerTime = ANSWER_S,
    json_file: o.JsonFile = None,
) -> None:
    """Check an entry: whether it loads, what it imports, how long its actions take, a game against boats that hold.

    Exit status: 0 it plays, 1 a boat had no usable action in some step or every decision came too late, 2 it cannot be
    loaded or gave nothing usable.
    """
    check_path(entry)
    say_of_elsewhere([entry], GameConfig.preset(preset))
    found = check_entry(entry, preset, max_time, answer_time)
    console = out()
    for line in check_lines(found):
        console.print(line, markup=False, soft_wrap=True)
    if json_file is not None:
        write_json(json_file, {"command": "entry check", "versions": versions(), "machine": machine(), **found})
    finish(not found["failures"] and not always_late(found))


def check_lines(found: dict[str, Any]) -> list[str]:
    """What a check found, in sentences."""
    imports, game = found["imports"], found["game"]
    missing = f"; not installed here: {', '.join(imports['missing'])}" if imports["missing"] else ""
    lines = [
        f"{headline(found)}.",
        f"imports beyond Python's own: {', '.join(imports['needed']) or 'nothing'}{missing}",
        f"time of a decision of the team: mean {time_text(found['mean_decision_ms'])}, longest "
        f"{time_text(found['max_decision_ms'])} in {found['decisions']} decisions ({found['calls']} actions); "
        f"{found['late_decisions']} took longer than the game gives ({found['decision_ms']:g} ms)",
        f"tried in {found['steps']} of the {found['game_steps']} decisions of a game",
        f"against {game['duration_s']:g} s of boats that hold: {game['captures']} captures, {game['grabs']} grabs, "
        f"{game['tags']} tags, {game['collisions']} collisions counted by the game",
    ]
    if (made := found["made_for"]) is not None:
        lines.insert(1, f"made by steerclear for preset {made['preset']}; {_kept(made['shield'])}")
    lines += [f"could not be read as Python: {name}" for name in imports["unread"]]
    for one in found["failures"]:
        boats = ", ".join(f"{boat} x {count}" for boat, count in one["boats"].items())
        lines.append(f"failed: {one['kind']} ({boats}): {one['message']}")
    return lines


def _kept(shield: dict[str, Any] | None) -> str:
    return (
        "no shield in it" if shield is None else f"its shield keeps {shield['separation_m']:g} m, {shield['profile']}"
    )


def time_text(time_ms: float) -> str:
    """A time in ms, in microseconds where it is below 0.1 ms."""
    return f"{1e3 * time_ms:.1f} us" if time_ms < 0.1 else f"{time_ms:.1f} ms"


@app.command()
@command
def report(
    entry: Entry,
    opponents: o.Opponents = "easy,medium,hidden,hard",
    also: Also = None,
    preset: o.Preset = "mctf2026",
    games: Games = 5,
    seed: o.Seed = 0,
    out_folder: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for results.")] = None,
    quick: o.Quick = False,
    jobs: o.Jobs = None,
    resume: o.Resume = False,
    separation: o.Separation = None,
    profile: o.Profile = None,
    shield_set: o.ShieldSet = None,
    max_time: o.MaxTime = None,
    rules: o.RuleSet = None,
    looks: Looks = 2,
    judge: o.Judge = "none",
    answer_time: o.AnswerTime = ANSWER_S,
    json_file: o.JsonFile = None,
) -> None:
    """Play an entry bare, as the zip that `entry wrap` writes, and with the shield round the game; write entry.html.

    Exit status: 0 done, 2 bad input or an entry that never played, 130 interrupted.
    """
    check_path(entry)
    if not 0 <= looks <= 3:
        raise ConfigError(f"--looks is {looks}; give 0 to 3")
    names = o.split_names(opponents + (f",{also}" if also else ""), "--opponents")
    played = o.game_settings(max_time, None, rules)
    asked = o.shield_settings(separation, None, profile, None, shield_set)
    processes = processes_of(jobs)
    for name in names:
        policies.check(name)
    folder = results_folder("entry-report", out_folder, resume)
    shield = o.with_distance(asked, preset, played)
    zip_file, why_none = shielded_zip(entry, folder, preset, shield, resume)
    settings = EntryGames(
        preset=preset,
        own=entry,
        zip_file=zip_file,
        opponents=names,
        games=games,
        seed=seed,
        shield=shield,
        rules=played,
        judge=judge,
        answer_s=answer_time,
    )
    if quick:
        settings = small_version(settings, QUICK_TIME_S if max_time is None else max_time, QUICK_GAMES)
    err().print(settings.how_many(), markup=False, soft_wrap=True)
    results, run = run_games("entry report", settings, folder, processes, resume, quick)
    results["warnings"] += why_none
    if not run.interrupted:
        _show(settings, run, results, looks, processes)
    end_run(results, run, False, json_file)


@app.command()
@command
def wrap(
    entry: Entry,
    out_file: Annotated[Path, typer.Option("--out", metavar="FILE", help="The zip to write; a new file."), NEW],
    preset: o.Preset = "mctf2026",
    separation: o.Separation = None,
    profile: o.Profile = None,
    shield_set: o.ShieldSet = None,
    json_file: o.JsonFile = None,
) -> None:
    """Put an entry that plays behind the shield: a zip to hand in, which needs numpy and what the entry itself needs.

    Exit status: 0 written, 2 bad input or an entry that cannot be loaded or gave nothing usable.
    """
    check_path(entry)
    asked = o.shield_settings(separation, None, profile, None, shield_set)
    say_of_elsewhere([entry], GameConfig.preset(preset))
    made = wrap_entry(entry, out_file, preset, o.with_distance(asked, preset, {}))
    tried, settings = made.pop("tried"), made["shield"]
    if tried["failures"] or always_late(tried):
        stops = "; its shield tells boats to stop that fail" if tried["failures"] else ""
        err().print(f"warning: {headline(tried)}{stops}", markup=False, soft_wrap=True)
    say_of_distance(settings["separation_m"], GameConfig.preset(preset))
    console = out()
    words = f"{made['zip']}: {made['bytes'] / 1e6:.2f} MB; for preset {made['preset']}; {_kept(settings)}"
    console.print(words, markup=False, soft_wrap=True)
    if json_file is not None:
        write_json(json_file, {"command": "entry wrap", "versions": versions(), "machine": machine(), **made})


def _show(settings: EntryGames, run: Run, results: dict[str, Any], looks: int, processes: int) -> None:
    """Write the page and the replays of the games to look at, and say where they are."""
    specs, rows, folder = settings.specs(), run.rows, run.folder
    if not rows:
        return
    links = []
    for number, (words, off, on) in enumerate(games_to_look_at(rows, settings, looks)):
        chosen = [replace(spec_of(row, specs), judge="none") for row in (off, on)]
        with progress(f"replay {number + 1}", 1):
            answers = outcomes(play_match, chosen, processes)
            found = {one.job.key: one.answer.record for one in answers if one.answer is not None}
        records = [found[spec.key] for spec in chosen if spec.key in found]
        if len(records) == len(chosen):
            name = f"look_{number + 1}.html"
            write_replay(records, folder / name, f"{off['pairing']}, game {off['game']}: {words}")
            links.append((f"{words}: {off['pairing']}, game {off['game']}", name))
    links.append(("all figures and every game", results["files"]["report"]))
    page = write_entry_page(rows, settings, folder, links, results["warnings"])
    out().print(f"{page}", soft_wrap=True, markup=False)
