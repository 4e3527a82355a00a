"""``steerclear entry``: a competition entry looked at: does it play, and what does the shield do to it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.policies.submissions.stage import ENTRY_FILE
from steerclear.shield.exceptions import ConfigError

from . import cli_options as o
from .ablation import quick as small_version
from .ablation import spec_of
from .cli_games import end_run, run_games
from .console import App, err, finish, progress, say, warn
from .entries.check import always_late, check_entry, headline
from .entries.report_page import PAGE, EntryGames, entry_report, games_to_look_at, shielded_zip
from .entries.team import LOAD_S, is_entry
from .entries.wrap import wrap_entry
from .play.match import play_again
from .play.spec import ANSWER_S
from .policy_checks import say_of_distance, say_of_elsewhere
from .provenance import machine, versions
from .replay_html import write_replay
from .result_files import NEW, write_json
from .runner import EXPERIMENT_FILE, Run, check_settings
from .words import count_text
from .workers import Workers

app = App(
    help="A competition entry: check that it plays, report what the shield does, wrap it into a shielded zip.",
    no_args_is_help=True,
)
Entry = Annotated[str, typer.Argument(metavar="ENTRY", help="Folder or zip with solution.py, as it is handed in.")]
GAMES, QUICK_GAMES, QUICK_TIME_S = 5, 2, 200.0


def check_path(entry: str) -> None:
    """Refuse (ConfigError) what is no path of an entry but a policy's name or a model."""
    path = Path(entry)
    if path.suffix == ".py" and path.name != ENTRY_FILE:
        words = f"copy it into a folder of its own as {ENTRY_FILE}, with the class solution, and give the folder"
        raise ConfigError(f"{entry} is no entry; {words}; or play it as it is: steerclear evaluate {entry}")
    if not is_entry(entry) or entry.startswith("sb3:"):
        there = [f"./{name}" for name in (entry, f"{entry}.zip") if Path(name).exists()]
        hint = f"; did you mean {there[0]}?" if there else ""
        raise ConfigError(f"{entry} is no entry; give a folder or a zip with {ENTRY_FILE}{hint}")


@app.command()
def check(
    entry: Entry,
    preset: o.Preset = "mctf2026",
    max_time: Annotated[float | None, o.option("S", "Length of the game it is tried in, s. [whole]")] = None,
    answer_time: o.AnswerTime = ANSWER_S,
    json_file: o.JsonFile = None,
) -> None:
    """Check an entry: whether it loads, what it imports, how long its actions take, a game against boats that hold.

    Exit status: 0 it plays, 1 a boat had no usable action in some step or every decision came too late, 2 it cannot be
    loaded or gave nothing usable.
    """
    check_path(entry)
    say_of_elsewhere([entry], GameConfig.preset(preset), warn)
    with err().status(f"{escape(Path(entry).name)} is loaded, for {LOAD_S:g} s at most, and tried in a game"):
        found = check_entry(entry, preset, max_time, answer_time)
    say(*check_lines(found))
    write_json(json_file, {"command": "entry check", "versions": versions(), "machine": machine(), **found})
    if always_late(found):
        say(f"next: let all boats of the team together answer within {found['decision_ms']:g} ms")
    elif found["made_for"] is None and not found["failures"]:
        say(f"next: steerclear entry wrap {entry} --out shielded.zip")
    finish(not found["failures"] and not always_late(found))


def check_lines(found: dict[str, Any]) -> list[str]:
    """What a check found, in sentences."""
    imports, game, made = found["imports"], found["game"], found["made_for"]
    made_in_game = ", ".join(count_text(game[f"{one}s"], one) for one in ("capture", "grab", "tag"))
    missing = f"; not installed here: {', '.join(imports['missing'])}" if imports["missing"] else ""
    missing += "; of these numba is only used where it is there" if made is not None else ""
    lines = [
        f"{headline(found)}.",
        f"imports beyond Python's own: {', '.join(imports['needed']) or 'nothing'}{missing}",
        f"time of a decision of the team: mean {time_text(found['mean_decision_ms'])}, longest "
        f"{time_text(found['max_decision_ms'])} in {count_text(found['decisions'], 'decision')} "
        f"({count_text(found['calls'], 'action')}); "
        f"{found['late_decisions']} took longer than the game gives ({found['decision_ms']:g} ms)",
        f"tried in {found['steps']} of the {found['game_steps']} decisions of a game",
        f"against boats that hold still, in {game['duration_s']:g} s: its boats made {made_in_game}; the game counted "
        f"{count_text(game['collisions'], 'collision')} of its boats (one for each of them in it)",
    ]
    if made is not None:
        lines.insert(1, f"made by steerclear for preset {made['preset']}; {_kept(made['shield'])}")
    lines += [f"could not be read as Python: {name}" for name in imports["unread"]]
    for one in found["failures"]:
        boats = ", ".join(f"{boat} x {count}" for boat, count in one["boats"].items())
        lines.append(f"failed: {one['kind']} ({boats}): {one['message']}")
    return lines


def _kept(shield: dict[str, Any] | None) -> str:
    return (
        f"its shield keeps {shield['separation_m']:g} m, profile {shield['profile']}" if shield else "no shield in it"
    )


def time_text(time_ms: float) -> str:
    """A time in ms, in microseconds where it is below 0.1 ms."""
    return f"{1e3 * time_ms:.1f} us" if time_ms < 0.1 else f"{time_ms:.1f} ms"


@dataclass(frozen=True)
class ReportedGames(o.GamesOptions):
    """Games that a report is of: each is played in every way."""

    opponents: o.Opponents = "easy,medium,hidden,hard"
    games: Annotated[
        int | None, o.option("N", "Games against each opponent, in each of the ways it is played.", default="5")
    ] = None
    judge: o.Judge = "none"


@app.command(defaults={"preset": "mctf2026"})
def report(
    entry: Entry,
    game: o.RuleOptions,
    kept: o.ShieldOptions,
    many: ReportedGames,
    where: o.RunOptions,
    also: Annotated[str | None, o.option("A.zip,B.zip", "Further opponents: entries or policies.")] = None,
    answer_time: o.AnswerTime = ANSWER_S,
) -> None:
    """Play an entry alone, as the zip that `entry wrap` writes, and with the shield round the game; write entry.html.

    Exit status: 0 done, 2 bad input or an entry that never played, 130 interrupted.
    """
    check_path(entry)
    names = o.split_names(many.opponents + (f",{also}" if also else ""), "--opponents")
    shield, workers = kept.of_game(game.preset, game.given()), where.workers()
    for name in names:
        policies.check(name)
    where = replace(where, folder=where.folder_of("entry-report"))
    if where.resume and (where.folder_of("") / EXPERIMENT_FILE).exists():  # before the zip there is written again
        check_settings(where.folder_of(""), {"preset": game.preset, "own": entry, "shield": shield})
    zip_file, why_none = shielded_zip(entry, where.folder_of(""), game.preset, shield, where.resume)
    settings = EntryGames(
        preset=game.preset,
        own=entry,
        zip_file=zip_file,
        opponents=names,
        games=GAMES if many.games is None else many.games,
        seed=many.seed,
        shield=shield,
        rules=game.given(),
        judge=many.judge,
        answer_s=answer_time,
    )
    if many.quick:
        count = QUICK_GAMES if many.games is None else many.games
        settings = small_version(settings, QUICK_TIME_S if game.max_time is None else game.max_time, count)
    results, run = run_games("entry report", settings, where, many.quick)
    results["warnings"] += why_none
    if not run.interrupted:
        _write_page(settings, run, results, workers)
    end_run(results, run, where)


def _write_page(settings: EntryGames, run: Run, results: dict[str, Any], workers: Workers) -> None:
    """Write the page and the replays of the games to look at, and say where they are."""
    specs, rows, folder = settings.specs(), run.rows, run.folder
    if not rows:
        return
    links = []
    for number, (words, off, on) in enumerate(games_to_look_at(rows, settings)):
        chosen = [replace(spec_of(row, specs), judge="none") for row in (off, on)]
        with progress(f"replay {number + 1}", 1):
            played = play_again(chosen, workers)
        if len(played) == len(chosen):
            name, against = f"look_{number + 1}.html", f"against {Path(off['opponent']).name}, game {off['game']}"
            title = f"{Path(settings.own).name} {against}: {words}"
            write_replay([played[spec.key].record for spec in chosen], folder / name, title)
            links.append({"label": f"{words}: {against}", "path": name})
    links.append({"label": "all figures and every game", "path": results["files"]["report"]})
    page = replace(entry_report(rows, settings), warnings=results["warnings"], links=links)
    say(*(f"{tile.label}: {tile.on} {tile.unit}: {tile.note}" for tile in page.tiles), page.write(folder / PAGE), "")


@app.command()
def wrap(
    entry: Entry,
    kept: o.ShieldOptions,
    out_file: Annotated[Path, o.option("FILE", "The zip to write; a new file.", "--out"), NEW],
    preset: o.Preset = "mctf2026",
    json_file: o.JsonFile = None,
) -> None:
    """Put an entry that plays behind the shield: a zip to hand in, which needs numpy and what the entry itself needs.

    Exit status: 0 written, 2 bad input or an entry that cannot be loaded or gave nothing usable.
    """
    check_path(entry)
    asked, game = kept.given(), GameConfig.preset(preset)
    say_of_elsewhere([entry], game, warn)
    made = wrap_entry(entry, out_file, preset, o.with_distance(asked, preset, {}))
    tried, settings = made.pop("tried"), made["shield"]
    if tried["failures"] or always_late(tried):
        stops = "; its shield tells boats to stop that fail" if tried["failures"] else ""
        warn(f"warning: {headline(tried)}{stops}")
    say_of_distance(settings["separation_m"], game, warn)
    say(f"{made['zip']}: {made['bytes'] / 1e6:.2f} MB; for preset {made['preset']}; {_kept(settings)}")
    say(f"next: steerclear entry check {made['zip']}")
    write_json(json_file, {"command": "entry wrap", "versions": versions(), "machine": machine(), **made})
