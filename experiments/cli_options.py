"""Options that several commands share, in groups, and what they become."""

from __future__ import annotations

import ast
import json
import math
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import typer
from steerclear.env.config import GameConfig
from steerclear.shield.config import PROFILES, ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.renamed import current_settings

from .console import progress, warn
from .game_metrics import DEFAULT_PENALTY
from .metrics import RADII_M
from .play.conditions import Conditions
from .play.spec import ANSWER_S, counted_m
from .result_files import NEW, write_json
from .runner import Experiment, Run, execute
from .workers import Workers, workers_of


def option(metavar: str, words: str, *names: str, default: str | None = None) -> Any:
    """An option that takes a value; ``default``: what is shown as its default, where that is not its value."""
    return typer.Option(*names, metavar=metavar, help=words, show_default=True if default is None else default)


def flag(words: str, *names: str) -> Any:
    """An option that takes no value."""
    return typer.Option(*names, help=words)


Preset = Annotated[str, option("NAME", "Rules of the game: aamas2024, mctf2025 or mctf2026.")]
Own = Annotated[str, option("NAME", "Policy of the shielded team: a name or a submission's path.")]
Opponent = Annotated[str, option("NAME", "Policy of the other team.")]
Opponents = Annotated[str, option("A,B", "Policies it meets, separated by commas.")]
Games = Annotated[int | None, option("N", "Games per pairing and shield state.", default="20")]
Seed = Annotated[int, option("N", "Game g is played from seed + g.")]
DrawSeed = Annotated[int, option("N", "Seed of what is drawn: the same one, the same draws.")]
Out = Annotated[Path | None, option("DIR", "Folder for results.", "--out", default="results/...")]
Jobs = Annotated[int | None, option("N", "Processes.", default="all cores")]
Resume = Annotated[bool, flag("Go on with what an interrupted run left in --out.", "--resume")]
Quick = Annotated[bool, flag("Fewer and shorter games.", "--quick")]
MaxTime = Annotated[float | None, option("S", "Length of a game, s.", default="600")]
Side = Annotated[str, option("COLOUR", "Colour of the own team: blue or red.")]
Shielded = Annotated[bool, flag("Whether the own team is shielded.", "--shield/--no-shield")]
NoAutopilot = Annotated[
    bool, flag("Leave boats the game drives (tagged, out of bounds) to it.", "--no-shield-autopilot")
]
Judge = Annotated[
    str, option("WHO", "Whose hits are judged avoidable or not: all, shielded (games with the shield) or none.")
]
Check = Annotated[bool, flag("Exit with status 1 when a goal is not met.", "--check")]
JsonFile = Annotated[Path | None, option("FILE", "Also write the results as JSON; a new file.", "--json"), NEW]
ShieldSet = Annotated[list[str] | None, option("KEY=VALUE", "Any shield setting.", "--shield-set")]


@dataclass(frozen=True)
class ShieldOptions:
    """What a shield keeps, and from whom; any other setting."""

    separation: Annotated[
        float | None,
        option("M", "Separation the shield keeps and hits are counted at, m.", default="at which the game counts"),
    ] = None
    profile: Annotated[str | None, option("NAME", f"Whom opponents are taken for: {', '.join(PROFILES)}.")] = None
    shield_set: ShieldSet = None

    def given(self) -> dict[str, Any]:
        """The settings of the shield that were given, each once; hits are counted at the separation as well."""
        named = {"separation_m": self.separation, "profile": self.profile}
        given = current_settings(_together(named, self.shield_set, "--shield-set"), warned=True)
        ShieldConfig.of(**{name: value for name, value in given.items() if name == "separation_m"})
        return given

    def of_game(self, preset: str, rules: dict[str, Any]) -> dict[str, Any]:
        """The same for a game: where none is given it keeps the distance at which the game counts collisions."""
        return with_distance(self.given(), preset, rules)


@dataclass(frozen=True)
class RuleOptions:
    """Rules of a game."""

    preset: Preset = "aamas2024"
    max_time: MaxTime = None
    platform: Annotated[str | None, option("NAME", "Platform of all boats, else the preset's.")] = None
    rules: Annotated[list[str] | None, option("KEY=VALUE", "Any setting of the game.", "--set")] = None

    def given(self) -> dict[str, Any]:
        """The settings of the game that were given, each once."""
        return _together({"max_time_s": self.max_time, "platforms": self.platform}, self.rules, "--set")


AnswerTime = Annotated[float, option("S", "Time a submission or model has for the actions of a step, s.")]
Trust = Annotated[
    bool, flag("Also load sb3: models that lie among entries of others: that runs their code.", "--trust")
]


@dataclass(frozen=True)
class PlayOptions:
    """How games are begun, scored and answered."""

    fixed_start: Annotated[bool, flag("Start on the preset's fixed places.", "--fixed-start")] = False
    penalty: Annotated[float, option("W", "Weight of a collision in the primary score.")] = DEFAULT_PENALTY
    trust: Trust = False
    answer_time: AnswerTime = ANSWER_S

    def given(self) -> dict[str, Any]:
        """As settings of games."""
        named = {"fixed_start": self.fixed_start, "penalty": self.penalty, "trust": self.trust}
        return {**named, "answer_s": self.answer_time}


@dataclass(frozen=True)
class WaterOptions:
    """Conditions beside the rules."""

    delay: Annotated[
        float, option("S", "From own command to effect, s, in whole steps, rounded up; the shield is told.")
    ] = 0.0
    noise: Annotated[
        float,
        option(
            "M",
            "Bound on the error of positions the shield sees, m; its position_error_m follows it. Policies see true.",
        ),
    ] = 0.0
    current: Annotated[
        float, option("M/S", "Speed of a current on all boats; the shield is told it, not where to.")
    ] = 0.0

    def given(self) -> Conditions:
        """The conditions; ConfigError where one is out of range."""
        return Conditions(self.delay, self.noise, self.current)


@dataclass(frozen=True)
class GamesOptions:
    """Which games, and how many."""

    opponents: Opponents = "easy,medium,hidden"
    games: Games = None
    seed: Seed = 0
    quick: Quick = False
    judge: Judge = "shielded"

    def names(self) -> tuple[str, ...]:
        """The opponents."""
        return split_names(self.opponents, "--opponents")


@dataclass(frozen=True)
class RunOptions:
    """Where many games run and where their results go."""

    folder: Out = None
    jobs: Jobs = None
    engine: Annotated[str, option("NAME", "Where games run: pool (this machine) or ray (a cluster).", "--engine")] = (
        "pool"
    )
    address: Annotated[str | None, option("HOST:PORT", "Ray cluster to use.", "--address", default="one here")] = None
    resume: Resume = False
    json_file: JsonFile = None

    def run(self, experiment: Experiment, folder: Path | None = None) -> Run:
        """Run an experiment into a folder, that of its command unless one is given, and show progress."""
        folder, workers = folder or self.folder_of(experiment.command.replace(" ", "-")), self.workers()
        least = workers if isinstance(workers, int) else workers.processes
        with progress(experiment.unit, len(experiment.jobs), least) as notice:
            return execute(experiment, folder, workers, self.resume, notice, warn)

    def workers(self) -> Workers:
        """Where jobs run; ConfigError where they cannot."""
        return workers_of(self.engine, self.address, self.jobs)

    def folder_of(self, command: str) -> Path:
        """The folder of results: the one named, or a new one; ConfigError where one to go on with is not named."""
        if self.resume and self.folder is None:
            raise ConfigError("--resume needs the --out folder of the run to go on with")
        return self.folder or Path("results") / f"{command}-{datetime.now():%Y%m%d-%H%M%S}"

    def copy(self, results: dict[str, Any]) -> None:
        """Write the JSON that ``--json`` asks for."""
        write_json(self.json_file, results)


def counting_words(shield: ShieldOptions, is_kept: bool) -> str:
    """Say that a separation that no shield keeps is only the distance at which hits are counted; else nothing."""
    metres = shield.given().get("separation_m")
    if is_kept or metres is None:
        return ""
    return f"the shield is off: {metres:g} m is only the distance at which hits are counted; add --shield to keep it"


def key_values(pairs: list[str] | None, option: str) -> dict[str, Any]:
    """Read ``KEY=VALUE`` options, each key once; a value is inf, JSON or a tuple of numbers, else text."""
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


def with_distance(shield: dict[str, Any], preset: str, rules: dict[str, Any]) -> dict[str, Any]:
    """Settings of a shield for a game: unless given it keeps the distance at which the game counts collisions."""
    metres = counted_m(GameConfig.preset(preset, **rules))
    counted = {} if metres <= RADII_M[0] else {"separation_m": metres}
    return {**counted, **shield}


def _together(named: dict[str, Any], pairs: list[str] | None, option: str) -> dict[str, Any]:
    """Settings with an option of their own and those of an option for any."""
    given = {name: value for name, value in named.items() if value is not None}
    more = key_values(pairs, option)
    for name in given:
        if name in more:
            raise ConfigError(f"{name} is given twice, by {option} and by an option of its own; leave one out")
    return given | more


def split_names(text: str, option: str) -> tuple[str, ...]:
    """Split a list of names at commas, in order, each once; ConfigError where there is none."""
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    if not names:
        raise ConfigError(f"{option} names no policy; give names separated by commas, e.g. easy,medium")
    return names
