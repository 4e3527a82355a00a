"""``steerclear play``: one game, in a window or not, saved if wanted."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from steerclear import policies
from steerclear.env.mctf import MctfEnv
from steerclear.policies.registry import KEYBOARD
from steerclear.shield.exceptions import ConfigError, PolicyError

from ..ablation import held_games
from ..game_metrics import DEFAULT_PENALTY, check_penalty
from ..play.conditions import Conditions
from ..play.kept_distance import check_shield
from ..play.match import MatchResult, Watcher, play_match
from ..play.sea import check_current
from ..play.spec import ANSWER_S, MatchSpec
from ..provenance import machine, versions
from ..result_files import NEW, write_json
from ..tables import game_table
from . import options as o
from .console import command, err, out, progress
from .games import say_of_distance
from .policies_tried import try_policies
from .saving import check_endings, save_record

Opponent = Annotated[str, typer.Option(metavar="NAME", help="Policy of the other team.")]
Side = Annotated[str, typer.Option(metavar="COLOUR", help="Colour of the own team: blue or red.")]
Shield = Annotated[bool, typer.Option("--shield/--no-shield", help="Whether the own team is shielded.")]
Window = Annotated[bool, typer.Option("--window/--headless", help="Show the game in a window.")]
Keyboard = Annotated[
    bool,
    typer.Option(
        "--keyboard", help="Steer the first own boat with the arrow keys, as --own keyboard does (a window opens)."
    ),
]
Save = Annotated[
    list[Path] | None,
    typer.Option(metavar="FILE", help="Save as .npz, .html, .mp4, .gif or .png, a new file; may be repeated."),
    NEW,
]
Speed = Annotated[float, typer.Option(metavar="X", help="Times faster than the game, in a window.")]

STEERING = (
    "you steer the ringed boat, while the window has the keyboard: up or w ahead, left and right or a and d turn, "
    "down or s back, Shift half speed, no key stop; close the window to end"
)


@command
def play(
    own: o.Own = "medium",
    opponent: Opponent = "easy",
    preset: o.Preset = "aamas2024",
    side: Side = "blue",
    shield: Shield = True,
    seed: o.Seed = 0,
    window: Window = False,
    keyboard: Keyboard = False,
    speed: Speed = 4.0,
    save: Save = None,
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
    trust: o.Trust = False,
    answer_time: o.AnswerTime = ANSWER_S,
    json_file: o.JsonFile = None,
) -> None:
    """Play one game and show what happened.

    Exit status: 0 done, 2 bad input or a policy that never played, 130 interrupted.
    """
    if keyboard and own not in ("medium", "keyboard"):
        raise ConfigError(f"--keyboard steers the own boats itself; leave out --keyboard, or --own {own}")
    own = "keyboard" if keyboard else own
    asked = o.shield_settings(separation, certificate, profile, solver, shield_set)
    if asked and not shield:
        raise ConfigError(f"the shield is off, and {', '.join(asked)} would change nothing; add --shield")
    played = o.game_settings(max_time, platform, rules)
    spec = MatchSpec(
        preset=preset,
        own=own,
        opponent=opponent,
        seed=seed,
        side=side,
        shield=o.with_distance(asked, preset, played) if shield else None,
        shield_autopilot=not no_shield_autopilot,
        rules=played,
        fixed_start=fixed_start,
        penalty=check_penalty(penalty),
        conditions=Conditions(delay, noise, current),
        trust=trust,
        answer_s=answer_time,
        files=(policies.fingerprint(own), policies.fingerprint(opponent)),
    )
    if not 0.0 < speed < math.inf:
        raise ConfigError(f"--speed must be a number above 0; got {speed:g}")
    started = time.perf_counter()
    result = _play(spec, save or [], window or KEYBOARD in (spec.own, spec.opponent), speed)
    out().print(game_table(result.row, result.spec.radii_m))
    if result.row["first_failure"]:
        out().print(f"first policy failure: {result.row['first_failure']}", markup=False, soft_wrap=True)
    files = [save_record(result.record, path) for path in save or []]
    for path in files:
        out().print(f"{path}", soft_wrap=True)
    if json_file is not None:
        write_json(json_file, _content(result, files, time.perf_counter() - started))
    held = held_games([result.row])
    if held:
        raise PolicyError("; ".join(held))


def _play(spec: MatchSpec, save: Sequence[Path], window: bool, speed: float) -> MatchResult:
    check_endings(save)
    check_current(spec.conditions, spec.config())
    if spec.shield is not None:
        say_of_distance(check_shield(spec.shield, spec.config()).separation_m, spec.config())
    try_policies((spec.own, spec.opponent), spec.trust, spec.config())
    if KEYBOARD in (spec.own, spec.opponent):
        err().print(STEERING, soft_wrap=True)
    if window:
        return play_match(spec, _until_closed, "human", speed)
    total = round(spec.config().max_time_s / spec.config().decision_s)
    with progress("playing", total) as notice:
        return play_match(spec, _reporter(notice))


def _until_closed(env: MctfEnv) -> bool:
    return env.renderer is None or not env.renderer.window_closed


def _reporter(notice: Any) -> Watcher:
    steps = 0

    def watch(env: MctfEnv) -> bool:
        nonlocal steps
        steps += 1
        if steps % 50 == 0:
            notice(steps)
        return True

    return watch


def _content(result: MatchResult, files: Sequence[Path], wall_s: float) -> dict[str, Any]:
    return {
        "command": "play",
        "settings": asdict(result.spec),
        "versions": versions(),
        "machine": machine(),
        "wall_s": wall_s,
        "game": result.row,
        "files": [str(path) for path in files],
    }
