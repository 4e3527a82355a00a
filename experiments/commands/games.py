"""What the commands that play many games share: checking names, playing with a progress bar, showing tables."""

from __future__ import annotations

import time
from datetime import datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from steerclear.env.config import GameConfig
from steerclear.shield.exceptions import ConfigError, PolicyError

from ..measure.judging import check_judge
from ..measure.score import check_penalty
from ..measure.tally import RADII_M
from ..play.conditions import words_of, words_of_settings
from ..play.kept_distance import check_shield, words_of_less
from ..play.learned_elsewhere import made_of
from ..play.sea import check_current
from ..report.tables import bars_table, pairing_table, verdict_table
from ..runs.ablation import AblationSettings
from ..runs.campaign import Campaign, Played
from ..runs.engines import Workers
from ..runs.failed_jobs import end_failed
from ..runs.results import replay_of, results_of, write_results
from ..runs.store import LINES_FILE, ResultStore
from ..runs.warming import WARMED, warm_up
from .console import Interrupted, err, out, progress
from .policies_tried import try_policies

FEW_GAMES = 20
"""Fewer of a pairing give intervals that say little."""

KEYBOARD = "keyboard"
HITS_WORDS = (
    f"A hit is an entry into the radius: one stay within {RADII_M[1]:g} m may hold several\ninto {RADII_M[0]:g} m."
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
) -> dict[str, Any]:
    """Play all games of the settings, write everything, show the tables.

    Args:
        command: which command this is.
        settings: of the run.
        folder: for results.
        workers: processes here, or a cluster.
        resume: go on with what the folder holds.
        quick: whether this is the small version.

    Returns:
        The content of results.json.

    Raises:
        SteerclearError: bad input; what was played before stays on disk.
        Interrupted: by Ctrl-C; what is finished has been written.
    """
    check_settings(settings)
    folder = results_folder(command, folder, resume)
    campaign = Campaign(settings.specs(), ResultStore(folder, resume, command), workers)
    if resume:
        warn(campaign.words_of_before)
    started = time.perf_counter()
    try:
        played = _play(campaign, workers)
        replay = replay_of(played.rows, campaign.specs, settings.separation_m, workers)
    except KeyboardInterrupt:
        _write(command, settings, folder, campaign.so_far(), time.perf_counter() - started, quick)
        raise Interrupted(_how_to_go_on(folder, campaign)) from None
    results = _write(command, settings, folder, played, time.perf_counter() - started, quick, replay)
    show(out(), results, folder)
    return results


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
        console.print(pairing_table(summary))
        if (judged := verdict_table(summary)) is not None:
            console.print(judged)
        console.print()
    if results["pairings"]:
        console.print(f"{HITS_WORDS}\n", soft_wrap=True)
    if results["bars"]:
        console.print(bars_table(results["bars"]))
        console.print()
    for failed in results["failed"]:
        state = "on" if failed["shielded"] else "off"
        words = f"not played: {failed['pairing']}, game {failed['game']}, shield {state}: {failed['error']}"
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


def check_complete(results: dict[str, Any], folder_known: bool = True) -> None:
    """End with an error when games are missing, or a policy did not play in some.

    Raises:
        ConfigError: some games could not be played.
        JobFault: for one of them a fault of steerclear is why.
        PolicyError: a policy gave nothing usable throughout some game.
    """
    if results["failed"]:
        words = f"{len(results['failed'])} games could not be played"
        end_failed(results["failed"], words, " (see above); put that right, then add --resume")
    if results["held"]:
        raise PolicyError("; ".join(results["held"]))


def _play(campaign: Campaign, workers: Workers) -> Played:
    if isinstance(workers, int) and workers > 1 and len(campaign.specs) > 1:
        with progress("compiling; the first time a minute or two", WARMED) as notice:
            warm_up(campaign.specs, workers, notice)
    with progress("games", len(campaign.specs)) as notice:
        return campaign.run(notice)


def _write(
    command: str,
    settings: AblationSettings,
    folder: Path,
    played: Played,
    wall_s: float,
    quick: bool,
    replay: tuple[dict[str, Any], list[Any]] | None = None,
) -> dict[str, Any]:
    results = results_of(command, settings, played, wall_s, quick) | {"files": {}}
    if played.rows:
        entry, records = replay or (None, [])
        if entry is not None:
            results["replay"] = entry
        write_results(folder, results, played.rows, records)
    return results


def _how_to_go_on(folder: Path, campaign: Campaign) -> str:
    kept = len(campaign.so_far().rows)
    return (
        f"interrupted: {kept} of {len(campaign.specs)} games kept in {folder / LINES_FILE}; "
        f"the same command with --out {folder} --resume goes on from there"
    )


def _small_version(settings: dict[str, Any]) -> str:
    length_s = settings["rules"]["max_time_s"]
    return (
        f"This was the small version: {settings['games']} games of {length_s:g} s per pairing. "
        "Its intervals are wide; leave out --quick for 20 games of full length."
    )


def warn(text: str) -> None:
    """Say something on stderr."""
    err().print(text, markup=False, soft_wrap=True)
