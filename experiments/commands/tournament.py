"""``steerclear tournament``: the competition, with the shield and without."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer
from steerclear.shield.exceptions import ConfigError, PolicyError

from ..game_metrics import DEFAULT_PENALTY, check_penalty
from ..play.conditions import CALM
from ..play.kept_distance import check_shield
from ..play.sea import check_current
from ..play.spec import ANSWER_S
from ..result_files import write_json, write_table
from ..runner import RESULTS_FILE, ROWS_FILE
from ..tables import goals_table, titled
from ..tournament.campaign import Tournament
from ..tournament.pages import subtitle, write_html
from ..tournament.paper import SCRIPTED
from ..tournament.replays import chosen_games, write_replays
from ..tournament.results import compared_states, results_of, silent_teams
from ..tournament.settings import FINAL, TournamentSettings, quick
from ..tournament.tables import all_tables, cycle_lines
from ..verdicts import check_judge
from ..workers import Workers, end_failed, workers_of
from . import options as o
from .console import Interrupted, command, err, finish, out, progress
from .games import KEYBOARD, results_folder, say_of_distance
from .policies_tried import try_policies

Teams = Annotated[str, typer.Option(metavar="A,B", help="Teams: names or submissions' paths, separated by commas.")]
States = Annotated[
    list[str] | None,
    typer.Option(
        "--shield", metavar="WHO", help="off, all, or teams with commas; may be repeated.", show_default="off, all"
    ),
]
Repetitions = Annotated[int, typer.Option(metavar="N", help="Times each pair meets on each side.")]
Qualifying = Annotated[bool, typer.Option("--qualifying", help="Play easy, medium and hidden first.")]
Finalists = Annotated[
    int | None, typer.Option(metavar="N", help="Best of the qualifying that go on.", show_default="all")
]
Replays = Annotated[bool, typer.Option("--replays/--no-replays", help="Play best, worst and most changed game again.")]
QUICK_TIME_S = 120.0
WIDE = 104
"""Characters of the widest table: ranks, scores and collisions with intervals, and the paper's."""
DEFAULT_TEAMS = ",".join(SCRIPTED)


@command
def tournament(
    teams: Teams = DEFAULT_TEAMS,
    preset: o.Preset = "aamas2024",
    shield: States = None,
    repetitions: Repetitions = 1,
    qualifying: Qualifying = False,
    finalists: Finalists = None,
    seed: o.Seed = 0,
    out_folder: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for results.")] = None,
    quick_version: o.Quick = False,
    jobs: o.Jobs = None,
    engine: o.Engine = "pool",
    address: o.Address = None,
    resume: o.Resume = False,
    separation: o.Separation = None,
    shield_set: o.ShieldSet = None,
    penalty: o.Penalty = DEFAULT_PENALTY,
    max_time: o.MaxTime = None,
    rules: o.RuleSet = None,
    fixed_start: o.FixedStart = False,
    judge: o.Judge = "shielded",
    replays: Replays = True,
    trust: o.Trust = False,
    answer_time: o.AnswerTime = ANSWER_S,
    check: o.Check = False,
    json_file: o.JsonFile = None,
) -> None:
    """Let teams meet each other on both sides, with the shield and without; tables beside the paper's, report, replays.

    Exit status: 0 done, 1 a bar is not met (with --check), 2 bad input or a team that never played, 130 interrupted.
    """
    played = o.game_settings(max_time, None, rules)
    asked = o.shield_settings(separation, None, None, None, shield_set)
    settings = TournamentSettings(
        teams=o.split_names(teams, "--teams"),
        preset=preset,
        states=tuple(shield or ("off", "all")),
        repetitions=repetitions,
        seed=seed,
        qualifying=qualifying,
        finalists=finalists,
        penalty=check_penalty(penalty),
        judge=check_judge(judge),
        shield=o.with_distance(asked, preset, played),
        rules=played,
        fixed_start=fixed_start,
        trust=trust,
        answer_s=answer_time,
    )
    settings = quick(settings, QUICK_TIME_S) if quick_version else settings
    workers = workers_of(engine, address, jobs)
    _check(settings)
    folder = results_folder("tournament", out_folder, resume)
    results = _run(settings, folder, workers, resume, replays)
    if json_file is not None:
        write_json(json_file, results)
    _check_complete(results)
    finish(not check or all(bar["met"] is not False for bar in results["goals"]))


def _check(settings: TournamentSettings) -> None:
    """Find every bad name or number before the first game is played.

    Raises:
        SteerclearError: a team, preset, game or shield setting is unusable.
    """
    game = settings.final(settings.teams)[0].spec.config()
    kept_m = check_shield(settings.shield, game).separation_m
    if set(settings.states) - {"off"}:
        say_of_distance(kept_m, game)
    if KEYBOARD in settings.teams:
        raise ConfigError(f"{KEYBOARD!r} needs a window; play single games with: steerclear play --own {KEYBOARD}")
    check_current(CALM, game)
    try_policies(settings.teams, settings.trust, game)


def _run(settings: TournamentSettings, folder: Path, workers: Workers, resume: bool, replays: bool) -> dict[str, Any]:
    played = Tournament(settings, folder, resume, workers)
    if resume:
        err().print(f"{played.resumed} games are in {folder / ROWS_FILE} and are taken from there", soft_wrap=True)
    started = time.perf_counter()
    try:
        _play(played, workers)
        links = _replays(played, folder, workers) if replays else []
    except KeyboardInterrupt:
        _write(played, folder, time.perf_counter() - started, [])
        raise Interrupted(
            f"interrupted: {len(played.rows())} of {played.expected} games kept in {folder / ROWS_FILE}; "
            f"the same command with --out {folder} --resume goes on from there"
        ) from None
    results = _write(played, folder, time.perf_counter() - started, links)
    _show(results, folder)
    return results


def _play(played: Tournament, workers: Workers) -> None:
    with progress("games", played.expected) as notice:
        played.run(lambda done, of: notice(done))


def _replays(played: Tournament, folder: Path, workers: Workers) -> list[dict[str, str]]:
    rows = [row for row in played.rows() if row["phase"] == FINAL]
    jobs = [job for job in played.jobs if job.phase == FINAL]
    return write_replays(chosen_games(rows, jobs, compared_states(played.settings)), folder, workers)


def _write(played: Tournament, folder: Path, wall_s: float, links: list[dict[str, str]]) -> dict[str, Any]:
    rows = played.rows()
    results = results_of(played.settings, rows, played.expected, played.failed, wall_s, played.resumed)
    results["silent"] = silent_teams(rows)
    results["files"] = {"results": RESULTS_FILE}
    if rows:
        results["files"] |= {"games": write_table(folder, rows).name, "report": "report.html"}
        results["files"] |= {f"replay_{k}": link["path"] for k, link in enumerate(links, start=1)}
        write_html(results, folder / "report.html", links)
        write_json(folder / RESULTS_FILE, results)
    return results


def _show(results: dict[str, Any], folder: Path) -> None:
    console = out()
    console.print(f"{subtitle(results)}\n", markup=False, soft_wrap=True)
    for words in results["warnings"]:
        console.print(f"WARNING: {words}\n", markup=False, soft_wrap=True)
    for title, heads, rows in all_tables(results):
        out(WIDE).print(titled(title, heads, rows))
        console.print()
    for words in cycle_lines(results):
        console.print(f"{words}", markup=False, soft_wrap=True)
    if results["goals"]:
        console.print(goals_table(results["goals"]))
    for failed in results["failed"]:
        words = f"not played: {failed['blue']} against {failed['red']}, {failed['state']}: {failed['error']}"
        console.print(words, markup=False, soft_wrap=True)
    for name in results["files"].values():
        console.print(f"{folder / name}", soft_wrap=True)


def _check_complete(results: dict[str, Any]) -> None:
    """End with an error when games are missing, or a team did not play in some.

    Raises:
        ConfigError: some games could not be played.
        JobFault: for one of them a fault of steerclear is why.
        PolicyError: a team gave nothing usable throughout some game.
    """
    if results["failed"]:
        words = f"{len(results['failed'])} games could not be played"
        end_failed(results["failed"], words, " (see above); put that right, then add --resume")
    if results["silent"]:
        names = ", ".join(results["silent"])
        raise PolicyError(f"{names} gave no usable answer throughout some game; mend it or leave it out")
