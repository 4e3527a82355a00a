"""``steerclear tournament``: the competition, with the shield and without."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from steerclear.shield.exceptions import PolicyError

from . import cli_options as o
from . import tournament as cup
from .cli_games import met
from .console import command, finish, out, say, warn
from .game_metrics import check_penalty
from .play.spec import MatchSpec, check_shield
from .policy_checks import check_run
from .rankings import SCRIPTED, all_tables
from .tables import goals_table, titled
from .verdicts import check_judge

QUICK_TIME_S = 120.0


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
        settings = replace(settings, rules={"max_time_s": QUICK_TIME_S, **settings.rules})
    shielded = set(settings.states) - {cup.OFF}
    if not shielded:  # hits are counted at the separation anyhow
        unused = dict.fromkeys(kept.given(), True) | {"separation_m": False}
        o.check_used(unused, "no team is shielded; add --shield all")
    experiment, workers = settings.experiment(), where.workers()
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
    _show(results, run.folder)
    if not run.interrupted:
        where.copy(results)
    run.end()
    if results["silent"]:
        names = ", ".join(results["silent"])
        raise PolicyError(f"{names} gave no usable answer throughout some game; mend it or leave it out")
    finish(not check or met(results))


def _show(results: dict[str, Any], folder: Path) -> None:
    say(f"{cup.subtitle(results)}\n", *(f"WARNING: {words}\n" for words in results["warnings"]))
    for table in all_tables(results):
        out().print(titled(table.title, table.heads, table.rows), "")
    if results["goals"]:
        out().print(goals_table(results["goals"]))
    for one in results["failed"]:
        say(f"not played: {one['blue']} against {one['red']}, {one['state']}: {one['error']}")
    say(*(folder / name for name in results["files"].values()))
