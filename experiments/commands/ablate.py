"""``steerclear ablate``: every pairing without and with the shield, from the same seeds.

With it twice: boats that the game drives left to the game, and covered.
"""

from __future__ import annotations

from dataclasses import replace

from ..ablation import AblationSettings
from ..ablation import quick as small_version
from ..game_metrics import DEFAULT_PENALTY
from ..play.conditions import Conditions
from ..play.spec import ANSWER_S
from ..workers import workers_of
from . import options as o
from .console import command
from .games import end_run, run_games

QUICK_GAMES = 4
QUICK_TIME_S = 300.0


@command
def ablate(
    preset: o.Preset = "aamas2024",
    own: o.Own = "medium",
    opponents: o.Opponents = "easy,medium,hidden",
    games: o.Games = None,
    seed: o.Seed = 0,
    out: o.Out = None,
    quick: o.Quick = False,
    jobs: o.Jobs = None,
    engine: o.Engine = "pool",
    address: o.Address = None,
    resume: o.Resume = False,
    separation: o.Separation = None,
    certificate: o.Certificate = None,
    profile: o.Profile = None,
    solver: o.Solver = None,
    shield_set: o.ShieldSet = None,
    no_shield_autopilot: o.NotCovered = False,
    penalty: o.Penalty = DEFAULT_PENALTY,
    max_time: o.MaxTime = None,
    platform: o.Platform = None,
    rules: o.RuleSet = None,
    fixed_start: o.FixedStart = False,
    delay: o.Delay = 0.0,
    noise: o.Noise = 0.0,
    current: o.Current = 0.0,
    judge: o.Judge = "shielded",
    trust: o.Trust = False,
    answer_time: o.AnswerTime = ANSWER_S,
    check: o.Check = False,
    json_file: o.JsonFile = None,
) -> None:
    """Play every pairing off, on and covered from the same seeds; write table, report and replay.

    On leaves boats that the game drives (tagged, out of bounds) to it, as a real game does; covered decides for them
    too. Goals are judged on the first.

    Exit status: 0 done, 1 a bar is not met (with --check), 2 bad input or a policy that never played, 130 interrupted.
    """
    played = o.game_settings(max_time, platform, rules)
    asked = o.shield_settings(separation, certificate, profile, solver, shield_set)
    settings = AblationSettings(
        preset=preset,
        own=own,
        opponents=o.split_names(opponents, "--opponents"),
        seed=seed,
        shield=o.with_distance(asked, preset, played),
        shield_autopilot=False,
        covered=not no_shield_autopilot,
        rules=played,
        fixed_start=fixed_start,
        penalty=penalty,
        judge=judge,
        conditions=Conditions(delay, noise, current),
        trust=trust,
        answer_s=answer_time,
    )
    if quick:
        settings = small_version(settings, QUICK_TIME_S if max_time is None else max_time, QUICK_GAMES)
    settings = settings if games is None else replace(settings, games=games)
    results, run = run_games("ablate", settings, out, workers_of(engine, address, jobs), resume, quick)
    end_run(results, run, check, json_file)
