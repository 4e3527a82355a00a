"""``steerclear evaluate``: a policy or submission against opponents, with the shield or without."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import typer
from steerclear.shield.exceptions import ConfigError

from ..ablation import AblationSettings
from ..ablation import quick as small_version
from ..game_metrics import DEFAULT_PENALTY
from ..play.conditions import Conditions
from ..play.spec import ANSWER_S
from ..workers import processes_of
from . import options as o
from .ablate import QUICK_GAMES, QUICK_TIME_S
from .console import command
from .games import end_run, run_games

Policy = Annotated[str, typer.Argument(help="A registered policy, or the folder or zip of a submission.")]
Shield = Annotated[bool, typer.Option("--shield/--no-shield", help="Whether the policy's boats are shielded.")]


@command
def evaluate(
    policy: Policy,
    opponents: o.Opponents = "easy,medium,hidden",
    shield: Shield = False,
    preset: o.Preset = "aamas2024",
    games: o.Games = None,
    seed: o.Seed = 0,
    out: o.Out = None,
    quick: o.Quick = False,
    jobs: o.Jobs = None,
    resume: o.Resume = False,
    separation: o.Separation = None,
    certificate: o.Certificate = None,
    profile: o.Profile = None,
    solver: o.Solver = None,
    shield_set: o.ShieldSet = None,
    no_shield_autopilot: o.NoAutopilot = False,
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
    json_file: o.JsonFile = None,
) -> None:
    """Play a policy or submission against opponents and report how it did.

    Exit status: 0 done, 2 bad input or a policy that never played, 130 interrupted.
    """
    wanted = o.shield_settings(separation, certificate, profile, solver, shield_set)
    unused = [name for name in wanted if name != "separation_m"]  # at that radius breaches are counted anyhow
    if unused and not shield:
        raise ConfigError(f"the shield is off, and {', '.join(unused)} would change nothing; add --shield")
    played = o.game_settings(max_time, platform, rules)
    settings = AblationSettings(
        preset=preset,
        own=policy,
        opponents=o.split_names(opponents, "--opponents"),
        seed=seed,
        shield=o.with_distance(wanted, preset, played),
        states=(shield,),
        shield_autopilot=not no_shield_autopilot,
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
    results, run = run_games("evaluate", settings, out, processes_of(jobs), resume, quick)
    end_run(results, run, False, json_file)
