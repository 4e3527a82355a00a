"""Commands that play games: play, evaluate, ablate, tournament; what they share."""

from __future__ import annotations

import math
import time
from dataclasses import asdict, dataclass, replace
from itertools import count
from pathlib import Path
from typing import Annotated, Any

import typer
from steerclear import policies
from steerclear.env.mctf import MctfEnv
from steerclear.policies.registry import KEYBOARD
from steerclear.shield.exceptions import ConfigError, PolicyError

from . import cli_options as o
from . import tournament as cup
from .ablation import AblationSettings, held_games, replay_of, results_of, write_results
from .ablation import quick as small_version
from .console import command, finish, out, progress, say, warn
from .game_metrics import check_penalty
from .metrics import RADII_M
from .play.conditions import words_of, words_of_settings
from .play.match import MatchResult, play_match
from .play.spec import MatchSpec, check_shield
from .policy_checks import check_run, made_of
from .provenance import head_of
from .rankings import SCRIPTED, all_tables
from .replay_html import check_endings, save_record
from .result_files import NEW, write_json
from .runner import Run
from .tables import (
    COVERED_WORDS,
    STATE_WORDS,
    covered_table,
    game_table,
    goals_table,
    pairing_table,
    titled,
    verdict_table,
)
from .verdicts import check_judge
from .words import count_text

FEW_GAMES = 20
"""Fewer of a pairing give intervals that say little."""
MOST_GAMES = 100_000
"""Games of a pairing at most: all are listed before the first is played."""
QUICK_GAMES, QUICK_TIME_S, QUICK_CUP_TIME_S = 4, 300.0, 120.0
HITS_WORDS = (
    f"A hit is an entry into that distance: one stay within {RADII_M[1]:g} m may hold several\ninto {RADII_M[0]:g} m."
)
STEERING = (
    "you steer the ringed boat, while the window has the keyboard: up or w ahead, left and right or a and d turn, "
    "down or s back, Shift half speed, no key stop; close the window to end"
)


@dataclass(frozen=True)
class PlayerOptions:
    """Who plays."""

    own: o.Own = "medium"
    opponent: o.Opponent = "easy"
    side: o.Side = "blue"
    shield: o.Shielded = True
    no_shield_autopilot: o.NoAutopilot = False
    seed: o.Seed = 0


@dataclass(frozen=True)
class WindowOptions:
    """How a game is looked at."""

    window: Annotated[bool, o.flag("Show the game in a window.", "--window/--headless")] = False
    speed: Annotated[float, o.option("X", "Times faster than the game, in a window.")] = 4.0
    save: Annotated[
        list[Path] | None,
        o.option("FILE", "Save as .npz, .html, .mp4, .gif or .png, a new file; may be repeated."),
        NEW,
    ] = None


@command()
def play(
    who: PlayerOptions,
    game: o.RuleOptions,
    shield: o.ShieldOptions,
    how: o.PlayOptions,
    water: o.WaterOptions,
    look: WindowOptions,
    json_file: o.JsonFile = None,
) -> None:
    """Play one game and show what happened.

    Exit status: 0 done, 2 bad input or a policy that never played, 130 interrupted.
    """
    if not 0.0 < look.speed < math.inf:
        raise ConfigError(f"--speed must be a number above 0; got {look.speed:g}")
    files, started = look.save or [], time.perf_counter()
    spec = _spec_of(who, game, shield, how, water)
    check_penalty(spec.penalty)
    check_endings(files)
    names = (spec.own, spec.opponent)
    check_run(names, spec.config(), spec.shield, warn, spec.conditions, spec.trust, many=False)
    if KEYBOARD in names:
        warn(STEERING)
    human = look.window or KEYBOARD in names
    if human:
        result = play_match(spec, lambda env: not (env.renderer and env.renderer.window_closed), "human", look.speed)
    else:
        result = _played(spec)
    row = result.row
    out().print(game_table(row, spec.radii_m))
    if row["first_failure"]:
        say(f"first policy failure: {row['first_failure']}")
    written = [str(save_record(result.record, path)) for path in files]
    say(*written)
    write_json(json_file, {**head_of("play", asdict(spec), started), "game": row, "files": written})
    if held := held_games([row]):
        raise PolicyError("; ".join(held))


def _spec_of(
    who: PlayerOptions, game: o.RuleOptions, shield: o.ShieldOptions, how: o.PlayOptions, water: o.WaterOptions
) -> MatchSpec:
    """The one game that options ask for."""
    asked, rules = shield.given(), game.given()
    return MatchSpec(
        game.preset,
        who.own,
        who.opponent,
        seed=who.seed,
        side=who.side,
        shield=o.with_distance(asked, game.preset, rules) if who.shield else None,
        shield_autopilot=not who.no_shield_autopilot,
        rules=rules,
        conditions=water.given(),
        files=(policies.fingerprint(who.own), policies.fingerprint(who.opponent)),
        **how.given(),
    )


def _played(spec: MatchSpec) -> MatchResult:
    """Play a game that nobody looks at, and tell how far it is."""
    steps, config = count(1), spec.config()
    with progress("playing", round(config.max_time_s / config.decision_s)) as notice:

        def watch(env: MctfEnv) -> bool:
            if (step := next(steps)) % 50 == 0:
                notice(step)
            return True

        return play_match(spec, watch)


@command()
def evaluate(
    policy: Annotated[str, typer.Argument(help="A policy's name, or a submission's path.")],
    game: o.RuleOptions,
    shield_options: o.ShieldOptions,
    how: o.PlayOptions,
    water: o.WaterOptions,
    many: o.GamesOptions,
    where: o.RunOptions,
    shield: Annotated[bool, o.flag("Whether the policy's boats are shielded.", "--shield/--no-shield")] = False,
    no_shield_autopilot: o.NoAutopilot = False,
) -> None:
    """Play a policy or submission against opponents and report how it did.

    Exit status: 0 done, 2 bad input or a policy that never played, 130 interrupted.
    """
    states = {"states": (shield,), "shield_autopilot": not no_shield_autopilot}
    settings = settings_of(policy, game, shield_options, how, water, many, **states)
    about = o.counting_words(shield_options, shield)
    end_run(*run_games("evaluate", settings, where, many.quick, about), where)


@command()
def ablate(
    game: o.RuleOptions,
    shield_options: o.ShieldOptions,
    how: o.PlayOptions,
    water: o.WaterOptions,
    many: o.GamesOptions,
    where: o.RunOptions,
    own: o.Own = "medium",
    no_shield_autopilot: Annotated[
        bool, o.flag("Play off and on only, not the shield on boats the game drives.", "--no-shield-autopilot")
    ] = False,
    check: o.Check = False,
) -> None:
    """Play every pairing off, on and covered from the same seeds; write table, report and replay.

    On leaves boats that the game drives (tagged, out of bounds) to it, as a real game does; covered decides for them
    too. Goals are judged on the first.

    Exit status: 0 done, 1 a goal is not met (with --check), 2 bad input or a policy that never played, 130 interrupted.
    """
    states = {"shield_autopilot": False, "covered": not no_shield_autopilot}
    settings = settings_of(own, game, shield_options, how, water, many, **states)
    end_run(*run_games("ablate", settings, where, many.quick), where, check)


def settings_of(
    own: str,
    game: o.RuleOptions,
    shield: o.ShieldOptions,
    how: o.PlayOptions,
    water: o.WaterOptions,
    many: o.GamesOptions,
    **states: Any,
) -> AblationSettings:
    """What options ask for; ``states``: of the shield."""
    settings = AblationSettings(
        preset=game.preset,
        own=own,
        opponents=many.names(),
        seed=many.seed,
        shield=shield.of_game(game.preset, game.given()),
        rules=game.given(),
        judge=many.judge,
        conditions=water.given(),
        **how.given(),
        **states,
    )
    if many.quick:
        settings = small_version(settings, QUICK_TIME_S if game.max_time is None else game.max_time, QUICK_GAMES)
    return settings if many.games is None else replace(settings, games=many.games)


def run_games(
    name: str, settings: AblationSettings, where: o.RunOptions, quick: bool = False, about: str = ""
) -> tuple[dict[str, Any], Run]:
    """Play all games of the settings, write everything: the content of results.json, and the run, to be ended.

    ``about`` is said once nothing refuses them.
    """
    workers = where.workers()
    if not 1 <= settings.games <= MOST_GAMES:
        raise ConfigError(f"--games must be at least 1 and at most {MOST_GAMES:,}; got {settings.games:,}")
    check_penalty(settings.penalty)
    check_judge(settings.judge)
    game, shielded = settings.specs()[0].config(), any(settings.states)
    check_shield(settings.shield, game)
    shield, names = settings.shield if shielded else None, (settings.own, *settings.opponents)
    check_run(names, game, shield, warn, settings.conditions, settings.trust)
    made = made_of(settings.own) if shielded else None
    if made is not None and made.shielded:  # games without ours are not games without a shield
        words = "has a shield in it: off means that one alone, on that one and ours; play the bare entry instead"
        warn(f"{settings.own} {words}")
    experiment = settings.experiment(name)
    run = where.run(replace(experiment, about=about) if about else experiment)
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


def end_run(results: dict[str, Any], run: Run, where: o.RunOptions, check: bool = False) -> None:
    """Show the tables, write the JSON a user asked for and choose the exit status, which what is raised stands for."""
    if not run.interrupted:
        show(results, run.folder)
        where.copy(results)
    run.end()
    if results["held"]:
        raise PolicyError("; ".join(results["held"]))
    finish(not check or met(results))


def met(results: dict[str, Any]) -> bool:
    """Whether no goal is missed."""
    return all(goal["met"] is not False for goal in results["goals"])


def show(results: dict[str, Any], folder: Path) -> None:
    """Print the tables of a run and where its files are."""
    settings = results["settings"]
    if conditions := words_of(settings["conditions"]):
        say(f"All games with {conditions}.\n")
    if shield := words_of_settings(settings["shield"]):
        say(f"Shield with {shield}.\n")
    say(*(f"WARNING: {words}\n" for words in results["warnings"]))
    for summary in results["pairings"]:
        tables = (pairing_table(summary), covered_table(summary), verdict_table(summary))
        out().print(*(table for table in tables if table is not None))
        say("")
    if results["pairings"]:
        say(f"{HITS_WORDS}\n")
    if True in settings["states"]:
        out().print(f"{COVERED_WORDS if settings['covered'] else STATE_WORDS}\n")
    if results["goals"]:
        out().print(goals_table(results["goals"]))
        say("")
    for one in results["failed"]:
        say(f"not played: {one['pairing']}, game {one['game']}, shield {one['state']}: {one['error']}")
    say(*(folder / name for name in results["files"].values()))
    games = count_text(settings["games"], "game")
    if results["quick"]:
        out().print(
            f"This was the small version: {games} of {settings['rules']['max_time_s']:g} s per "
            "pairing and state. Its intervals are wide; leave out --quick for games of full length, 20 and more."
        )
    elif settings["games"] < FEW_GAMES:
        out().print(
            f"Intervals of {games} per pairing say little: those of means are drawn from "
            f"these games alone. Ask for {FEW_GAMES} and more."
        )


@dataclass(frozen=True)
class CupOptions:
    """Who meets whom, how often, and who is shielded."""

    teams: Annotated[str, o.option("A,B", "Teams: names or submissions' paths, separated by commas.")] = ",".join(
        SCRIPTED
    )
    shield: Annotated[
        list[str] | None,
        o.option("WHO", "off, all, or teams with commas; may be repeated.", "--shield", default="off, all"),
    ] = None
    repetitions: Annotated[int, o.option("N", "Times each pair meets on each side.")] = 1
    seed: o.Seed = 0
    quick: o.Quick = False
    judge: o.Judge = "shielded"


@command()
def tournament(
    who: CupOptions,
    game: o.RuleOptions,
    kept: o.ShieldOptions,
    how: o.PlayOptions,
    where: o.RunOptions,
    check: o.Check = False,
) -> None:
    """Let teams meet each other on both sides, with the shield and without; tables beside the paper's, report, replays.

    Exit status: 0 done, 1 a goal is not met (with --check), 2 bad input or a team that never played, 130 interrupted.
    """
    settings = cup.TournamentSettings(
        teams=o.split_names(who.teams, "--teams"),
        preset=game.preset,
        states=tuple(who.shield or (cup.OFF, cup.ALL)),
        repetitions=who.repetitions,
        seed=who.seed,
        judge=check_judge(who.judge),
        shield=kept.of_game(game.preset, game.given()),
        rules=game.given(),
        **how.given(),
    )
    check_penalty(settings.penalty)
    if who.quick:
        settings = replace(settings, rules={"max_time_s": QUICK_CUP_TIME_S, **settings.rules})
    shielded = set(settings.states) - {cup.OFF}
    experiment = replace(settings.experiment(), about=o.counting_words(kept, bool(shielded)))
    workers = where.workers()
    config = MatchSpec.of_job(experiment.jobs[0]).config()
    check_shield(settings.shield, config)
    check_run(settings.teams, config, settings.shield if shielded else None, warn, trust=settings.trust)
    run = where.run(experiment)
    results = cup.results_of(run, settings)
    if run.rows:
        links = [] if run.interrupted else cup.write_most_changed(run, settings, workers)
        results["files"] |= {"report": "report.html"} | ({"replay": "replay.html"} if links else {})
        cup.write_html(results, run.folder / "report.html", links)
        run.write(results)
    _show_cup(results, run.folder)
    if not run.interrupted:
        where.copy(results)
    run.end()
    if results["silent"]:
        names = ", ".join(results["silent"])
        raise PolicyError(f"{names} gave no usable answer throughout some game; mend it or leave it out")
    finish(not check or met(results))


def _show_cup(results: dict[str, Any], folder: Path) -> None:
    say(f"{cup.subtitle(results)}\n", *(f"WARNING: {words}\n" for words in results["warnings"]))
    for table in all_tables(results):
        out().print(titled(table.title, table.heads, table.rows), "")
    if results["goals"]:
        out().print(goals_table(results["goals"]))
    for one in results["failed"]:
        say(f"not played: {one['blue']} against {one['red']}, {one['state']}: {one['error']}")
    say(*(folder / name for name in results["files"].values()))
