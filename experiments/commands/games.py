"""What the commands that play many games share: checking names, playing with a progress bar, showing tables."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from steerclear.env.config import GameConfig
from steerclear.shield.exceptions import ConfigError, PolicyError

from ..ablation import AblationSettings, replay_of, results_of, write_results
from ..game_metrics import check_penalty
from ..metrics import RADII_M
from ..play.conditions import words_of, words_of_settings
from ..play.kept_distance import check_shield, words_of_less
from ..play.learned_elsewhere import made_of
from ..play.sea import check_current
from ..result_files import write_json
from ..runner import Run, execute
from ..tables import covered_table, goals_table, pairing_table, verdict_table
from ..verdicts import check_judge
from ..workers import Workers
from .console import err, finish, out, progress
from .policies_tried import try_policies

FEW_GAMES = 20
"""Fewer of a pairing give intervals that say little."""

KEYBOARD = "keyboard"
HITS_WORDS = (
    f"A hit is an entry into the radius: one stay within {RADII_M[1]:g} m may hold several\ninto {RADII_M[0]:g} m."
)
COVERED_WORDS = (
    "Shield on leaves boats that the game drives (tagged, out of bounds) to it, as\na real game does; covered decides "
    "for them too. Goals are of shield on."
)

MOST_GAMES = 100_000
"""Games of a pairing at most: all are listed before the first is played."""


def check_settings(settings: AblationSettings) -> None:
    """Find every bad name or number before the first game is played.

    Raises:
        SteerclearError: a policy, preset, platform, game or shield setting is unusable.
    """
    if not 1 <= settings.games <= MOST_GAMES:
        raise ConfigError(f"--games must be at least 1 and at most {MOST_GAMES:,}; got {settings.games:,}")
    check_penalty(settings.penalty)
    check_judge(settings.judge)
    game = settings.specs()[0].config()
    kept_m = check_shield(settings.shield, game).separation_m
    if any(settings.states):
        say_of_distance(kept_m, game)
        say_of_second(settings.own)
    for name in dict.fromkeys([settings.own, *settings.opponents]):
        if name == KEYBOARD:
            raise ConfigError(f"{KEYBOARD!r} needs a window; play single games with: steerclear play --own {KEYBOARD}")
    try_policies((settings.own, *settings.opponents), settings.trust, game)
    check_current(settings.conditions, game)


def say_of_distance(kept_m: float, game: GameConfig) -> None:
    """Say, once a command, that its shield keeps less than the distance at which the game counts collisions."""
    if words := words_of_less(kept_m, game):
        warn(words)


def say_of_second(own: str) -> None:
    """Say that a policy brings a shield of its own: games without ours are not games without a shield."""
    made = made_of(own)
    if made is not None and made.shielded:
        warn(f"{own} has a shield in it: off means that one alone, on that one and ours; play the bare entry instead")


def default_folder(command: str) -> Path:
    """Name a new results folder after the command and the time."""
    return Path("results") / f"{command}-{datetime.now():%Y%m%d-%H%M%S}"


def results_folder(command: str, folder: Path | None, resume: bool) -> Path:
    """The folder of results: the one named, or a new one.

    Raises:
        ConfigError: a run is to be gone on with, and it is not said which.
    """
    if resume and folder is None:
        raise ConfigError("--resume needs the --out folder of the run to go on with")
    return folder or default_folder(command)


def run_games(
    command: str,
    settings: AblationSettings,
    folder: Path | None,
    workers: Workers = 1,
    resume: bool = False,
    quick: bool = False,
) -> tuple[dict[str, Any], Run]:
    """Play all games of the settings, write everything, show the tables.

    Args:
        command: which command this is.
        settings: of the run.
        folder: for results.
        workers: processes here, or a cluster.
        resume: go on with what the folder holds.
        quick: whether this is the small version.

    Returns:
        The content of results.json, and the run, whose `end` ends the command.

    Raises:
        SteerclearError: bad input; what was played before stays on disk.
    """
    check_settings(settings)
    folder = results_folder(command, folder, resume)
    experiment = settings.experiment(command)
    with progress("games", len(experiment.jobs)) as notice:
        run = execute(experiment, folder, workers, resume, lambda done, of: notice(done), warn)
    replay = None
    if not run.interrupted:
        try:
            replay = replay_of(settings.off_and_on(run.table), settings.specs(), settings.separation_m, workers)
        except KeyboardInterrupt:
            run.interrupted = True
    results = results_of(run, settings, quick) | {"files": {}}
    if run.rows:
        entry, records = replay or (None, [])
        results |= {"replay": entry} if entry is not None else {}
        write_results(run, results, records)
    return results, run


def end_run(results: dict[str, Any], run: Run, check: bool, json_file: Path | None) -> None:
    """Show the tables, write the JSON a user asked for and choose the exit status.

    Raises:
        Interrupted: by Ctrl-C; what is finished has been written.
        ConfigError: some games could not be played.
        JobFault: for one of them a fault of steerclear is why.
        PolicyError: a policy gave nothing usable throughout some game.
    """
    if not run.interrupted:
        show(out(), results, run.folder)
        if json_file is not None:
            write_json(json_file, results)
    run.end()
    if results["held"]:
        raise PolicyError("; ".join(results["held"]))
    finish(not check or all(goal["met"] is not False for goal in results["goals"]))


def show(console: Console, results: dict[str, Any], folder: Path) -> None:
    """Print the tables of a run and where its files are."""
    conditions = words_of(results["settings"]["conditions"])
    if conditions:
        console.print(f"All games with {conditions}.\n", soft_wrap=True)
    if shield := words_of_settings(results["settings"]["shield"]):
        console.print(f"Shield with {shield}.\n", markup=False, soft_wrap=True)
    for words in results["warnings"]:
        console.print(f"WARNING: {words}\n", markup=False, soft_wrap=True)
    for summary in results["pairings"]:
        tables = (pairing_table(summary), covered_table(summary), verdict_table(summary))
        console.print(*(table for table in tables if table is not None))
        console.print()
    if results["pairings"]:
        console.print(f"{HITS_WORDS}\n", soft_wrap=True)
    if results["settings"]["covered"]:
        console.print(f"{COVERED_WORDS}\n", soft_wrap=True)
    if results["goals"]:
        console.print(goals_table(results["goals"]))
        console.print()
    for failed in results["failed"]:
        words = f"not played: {failed['pairing']}, game {failed['game']}, shield {failed['state']}: {failed['error']}"
        console.print(words, markup=False, soft_wrap=True)
    for name in results["files"].values():
        console.print(f"{folder / name}", soft_wrap=True)
    if results["quick"]:
        console.print(_small_version(results["settings"]))
    elif results["settings"]["games"] < FEW_GAMES:
        console.print(
            f"Intervals of {results['settings']['games']} games per pairing say little: those of means are drawn from "
            f"these games alone. Ask for {FEW_GAMES} and more."
        )


def _small_version(settings: dict[str, Any]) -> str:
    length_s = settings["rules"]["max_time_s"]
    return (
        f"This was the small version: {settings['games']} games of {length_s:g} s per pairing and state. "
        "Its intervals are wide; leave out --quick for 20 games of full length."
    )


def warn(text: str) -> None:
    """Say something on stderr."""
    err().print(text, markup=False, soft_wrap=True)
