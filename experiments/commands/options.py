"""Options that several commands share, and what they become."""

from __future__ import annotations

import ast
import json
import math
from pathlib import Path
from typing import Annotated, Any

import typer
from steerclear.env.config import GameConfig
from steerclear.shield.config import PROFILES, ShieldConfig
from steerclear.shield.exceptions import ConfigError

from ..metrics import RADII_M
from ..play.kept_distance import counted_m
from ..result_files import NEW

Preset = Annotated[str, typer.Option(metavar="NAME", help="Rules of the game: aamas2024, mctf2025 or mctf2026.")]
Own = Annotated[str, typer.Option(metavar="NAME", help="Policy of the shielded team: a name or a submission's path.")]
Opponents = Annotated[str, typer.Option(metavar="A,B", help="Policies it meets, separated by commas.")]
Games = Annotated[int | None, typer.Option(metavar="N", help="Games per pairing and shield state.", show_default="20")]
Seed = Annotated[int, typer.Option(metavar="N", help="Game g is played from seed + g.")]
DrawSeed = Annotated[int, typer.Option(metavar="N", help="Seed of what is drawn: the same one, the same draws.")]
Out = Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for results.", show_default="results/...")]
Jobs = Annotated[int | None, typer.Option(metavar="N", help="Processes.", show_default="all cores")]
Engine = Annotated[
    str, typer.Option("--engine", metavar="NAME", help="Where games run: pool (this machine) or ray (a cluster).")
]
Address = Annotated[
    str | None, typer.Option("--address", metavar="HOST:PORT", help="Ray cluster to use.", show_default="one here")
]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with what an interrupted run left in --out.")]
Quick = Annotated[bool, typer.Option("--quick", help="The small version: fewer and shorter games.")]
Separation = Annotated[
    float | None, typer.Option(metavar="M", help="Radius the shield keeps, m.", show_default="at which the game counts")
]
Certificate = Annotated[str | None, typer.Option(metavar="NAME", help="Certificate of the shield.")]
Profile = Annotated[
    str | None, typer.Option(metavar="NAME", help=f"Whom opponents are taken for: {', '.join(PROFILES)}.")
]
Solver = Annotated[str | None, typer.Option(metavar="NAME", help="QP solver of the shield.")]
ShieldSet = Annotated[list[str] | None, typer.Option("--shield-set", metavar="KEY=VALUE", help="Any shield setting.")]
NoAutopilot = Annotated[
    bool,
    typer.Option("--no-shield-autopilot", help="Leave boats the game drives (tagged, out of bounds) unshielded."),
]
NotCovered = Annotated[
    bool, typer.Option("--no-shield-autopilot", help="Play off and on only, not the shield on boats the game drives.")
]
Penalty = Annotated[float, typer.Option(metavar="W", help="Weight of a collision in the primary score.")]
MaxTime = Annotated[float | None, typer.Option(metavar="S", help="Length of a game, s.", show_default="600")]
Platform = Annotated[str | None, typer.Option(metavar="NAME", help="Platform of all boats, else the preset's.")]
RuleSet = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Any setting of the game.")]
Judge = Annotated[
    str,
    typer.Option(
        metavar="WHO", help="Whose breaches the oracle judges: all, shielded (games with the shield) or none."
    ),
]
Delay = Annotated[
    float,
    typer.Option(metavar="S", help="From own command to effect, s, in whole steps, rounded up; the shield is told."),
]
Noise = Annotated[
    float,
    typer.Option(
        metavar="M",
        help="Bound on the error of positions the shield sees, m; its position_error_m follows it. Policies see true.",
    ),
]
Current = Annotated[
    float,
    typer.Option(metavar="M/S", help="Speed of a current on all boats; the shield is told it, not where to."),
]
Trust = Annotated[
    bool, typer.Option("--trust", help="Also load sb3: models that lie among entries of others: that runs their code.")
]
AnswerTime = Annotated[
    float, typer.Option(metavar="S", help="Time a submission or model has for the actions of a step, s.")
]
FixedStart = Annotated[bool, typer.Option("--fixed-start", help="Start on the preset's fixed places.")]
Check = Annotated[bool, typer.Option("--check", help="Exit with status 1 when a bar is not met.")]
JsonFile = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Also write the results as JSON; a new file."), NEW
]


def key_values(pairs: list[str] | None, option: str) -> dict[str, Any]:
    """Read ``KEY=VALUE`` options; a value is inf, JSON or a tuple of numbers where it can be read so, else text.

    Raises:
        ConfigError: an entry without ``=``, or a key given twice.
    """
    settings: dict[str, Any] = {}
    for pair in pairs or []:
        name, equals, text = pair.partition("=")
        if not equals or not name:
            raise ConfigError(f"{option} takes KEY=VALUE; got {pair!r}")
        if name.strip() in settings:
            raise ConfigError(f"{name.strip()} is given twice, by {option} both times; leave one out")
        settings[name.strip()] = _value(text)
    return settings


def _value(text: str) -> Any:
    if text.strip().lower() in ("inf", "+inf"):  # as settings are told everywhere; JSON says Infinity
        return math.inf
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        pass
    try:
        value = ast.literal_eval(text)
    except (ValueError, SyntaxError, RecursionError, MemoryError):
        return text
    return value if isinstance(value, tuple) and all(type(item) in (int, float) for item in value) else text


def shield_settings(
    separation: float | None,
    certificate: str | None,
    profile: str | None,
    solver: str | None,
    pairs: list[str] | None,
) -> dict[str, Any]:
    """Collect the settings of the shield that were given.

    Raises:
        ConfigError: one is given twice, or the separation, at which hits are counted as well, is no distance.
    """
    named = {"separation_m": separation, "certificate": certificate, "profile": profile, "solver": solver}
    given = _together(named, pairs, "--shield-set")
    ShieldConfig.of(**{name: value for name, value in given.items() if name == "separation_m"})
    return given


def with_distance(shield: dict[str, Any], preset: str, rules: dict[str, Any]) -> dict[str, Any]:
    """Settings of a shield for a game: where none is given it keeps the distance at which the game counts collisions.

    Raises:
        ConfigError: a rule is unknown or unusable.
    """
    metres = counted_m(GameConfig.preset(preset, **rules))
    counted = {} if metres <= RADII_M[0] else {"separation_m": metres}
    return {**counted, **shield}


def game_settings(max_time_s: float | None, platform: str | None, pairs: list[str] | None) -> dict[str, Any]:
    """Collect the settings of the game that were given.

    Raises:
        ConfigError: one is given twice.
    """
    return _together({"max_time_s": max_time_s, "platforms": platform}, pairs, "--set")


def _together(named: dict[str, Any], pairs: list[str] | None, option: str) -> dict[str, Any]:
    """Settings with an option of their own and those of an option for any."""
    given = {name: value for name, value in named.items() if value is not None}
    more = key_values(pairs, option)
    for name in given:
        if name in more:
            raise ConfigError(f"{name} is given twice, by {option} and by an option of its own; leave one out")
    return given | more


def split_names(text: str, option: str) -> tuple[str, ...]:
    """Split a list of names at commas, in order, each once.

    Raises:
        ConfigError: no name at all.
    """
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    if not names:
        raise ConfigError(f"{option} names no policy; give names separated by commas, e.g. easy,medium")
    return names
