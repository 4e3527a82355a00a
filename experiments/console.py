"""Speaking to the user: results on stdout, progress and errors on stderr, exit codes that mean something."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import logging
import time
import typing
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from enum import IntEnum
from typing import Any, NoReturn

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from steerclear.shield.exceptions import SteerclearError
from typer.core import TyperCommand, TyperOption

from .cli_files import as_typed, check_files, hints_of
from .runner import Interrupted as Interrupted
from .terminal import SafeConsole
from .unused import check_rules
from .workers import JobFault, fault_words, interrupted_by_signals, machine_words

MAX_WIDTH = 100
"""Tables do not stretch over wider terminals."""
EVERY_S = 30.0
"""Time between two lines of progress where there is no terminal, s."""
MANY_OPTIONS = 13
"""A command with more options leaves those of `RARE` out of ``--help``, which then fits one screen."""

RARE = {
    *("--set", "--shield-set", "--fixed-start", "--penalty", "--trust"),
    *("--answer-time", "--delay", "--noise", "--current", "--judge", "--no-judge", "--no-shield-autopilot"),
    *("--engine", "--address", "--also", "--scene"),
    *("--restarts", "--population", "--generations", "--attackers", "--no-tlog", "--wait"),
    *("--wind", "--loss", "--jitter", "--boot", "--really", "--off", "--with-parent", "--allow-remote"),
    *("--no-wait", "--random-start", "--max-time"),
}
"""Options that few need, of whatever command has them."""

EXAMPLES = {
    "ablate": "steerclear ablate --preset mctf2025 --games 20 --out results/mine",
    "attack": "steerclear attack --platform heron --attackers 2 --out results/attack",
    "bench": "steerclear bench --quick",
    "compare": "steerclear compare results/before results/after",
    "deploy": "steerclear deploy --demo --policy medium",
    "docs": "steerclear docs results/mine --out docs/studies",
    "encounters": "steerclear encounters --family rammer_1 --n 100 --filter none,shield",
    "entry check": "steerclear entry check my_entry.zip",
    "entry report": "steerclear entry report my_entry.zip --quick",
    "entry wrap": "steerclear entry wrap my_entry.zip --out shielded.zip",
    "evaluate": "steerclear evaluate my_entry.zip --preset mctf2026 --games 20",
    "export": "steerclear export model.zip --out weights.npz",
    "fit": "steerclear fit logs/sea_trial.mcap --boat blue_1",
    "parity": "steerclear parity recorded_game.npz",
    "platform check": "steerclear platform check my_boat.yaml",
    "platform new": "steerclear platform new my_boat --from heron",
    "platform show": "steerclear platform show heron",
    "play": "steerclear play --own medium --opponent hidden --save game.html",
    "preflight": "steerclear preflight FLEET.yaml --no-drill",
    "reach check": "steerclear reach check table.npz",
    "reach compare": "steerclear reach compare --own heron --other heron",
    "reach play": "steerclear reach play --own surveyor --other heron",
    "reach show": "steerclear reach show --own heron --other heron",
    "reach solve": "steerclear reach solve --own my_boat.yaml --other heron --quick",
    "referee": "steerclear referee FLEET.yaml",
    "render": "steerclear render game.npz --to game.mp4",
    "replay": "steerclear replay logs/run.mcap --html run.html",
    "sea-trial": "steerclear sea-trial FLEET.yaml --only blue_1",
    "sim-boats": "steerclear sim-boats --demo --duration 120",
    "tournament": "steerclear tournament --teams lucas,chao,mine.zip --quick",
    "train": "steerclear train my_training.yaml --out results/training",
    "train-study": "steerclear train-study my_study.yaml --out results/study",
    "warm-up": "steerclear warm-up",
}
"""By the command's name, what somebody would type."""


class ExitCode(IntEnum):
    """What the command's exit status means."""

    OK = 0
    GOAL_MISSED = 1
    BAD_INPUT = 2
    NOT_PROVED = 3
    FAULT = 70
    INTERRUPTED = 130


EXIT_CODES = {
    ExitCode.OK: "done",
    ExitCode.GOAL_MISSED: "a goal is not met",
    ExitCode.BAD_INPUT: "bad input",
    ExitCode.NOT_PROVED: "not all is proved (replay)",
    ExitCode.FAULT: "a fault of steerclear",
    ExitCode.INTERRUPTED: "interrupted",
}
"""In words; each command's help says which of them it has, and for what."""


def out(least: int = 0) -> Console:
    """Return the console for results; lines of up to ``least`` characters run on rather than lose their ends."""
    return SafeConsole(width=max(min(SafeConsole().width, MAX_WIDTH), least))


def err() -> Console:
    """Return the console for everything else."""
    return SafeConsole(stderr=True)


def say(*lines: object) -> None:
    """Print lines as results: broken where they are, and nowhere else."""
    for line in lines:
        out().print(str(line), soft_wrap=True)


def warn(text: str) -> None:
    """Say something on stderr."""
    err().print(text, soft_wrap=True)


ALL = "steerclear.help_all"
"""Key of a context in which help shows every option."""
Made = Callable[[Callable[..., Any]], Callable[..., Any]]
_MADE = set[Callable[..., Any]]()
"""What `command` made."""


_TYPED = ContextVar("typed", default=("", dict[str, str]()))
"""The command that is run and, by name, its arguments that were typed as they were, until it begins."""


def _name_of(ctx: Any) -> str:
    """A command's name, without the program's."""
    return " ".join(ctx.command_path.split()[1:])


class OnceCommand(TyperCommand):
    """A command whose options count once, but for those that may be repeated, and whose help fits one screen.

    The help of a command with many options leaves those of `RARE` to ``--help-all``, and ends with an example.
    """

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        many = len(self.params) > MANY_OPTIONS
        self._rare = [option for option in self.params if many and {*option.opts} & RARE]

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help, of the options that most users want."""
        name, hidden = _name_of(ctx), [] if ctx.meta.get(ALL) else self._rare
        more = f"--help-all shows {len(hidden)} more options.\n\n" if hidden else ""
        self.epilog = f"{more}Example: {EXAMPLES[name]}" if name in EXAMPLES else None
        for option in hidden:
            vars(option)["hidden"] = True
        try:
            super().format_help(ctx, formatter)
        finally:
            for option in hidden:
                vars(option)["hidden"] = False

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse as usual what gives no option twice; ``--help-all`` shows the whole help instead.

        Raises:
            UsageError: an option is given twice, or without its value.
        """
        if "--help-all" in args:
            ctx.meta[ALL] = True
            args = ["--help"]
        self._check_values(ctx, args)
        _, _, given = self.make_parser(ctx).parse_args(args=list(args))
        words = {word.partition("=")[0] for word in args}
        spelled = {str(one.name): next((name for name in one.opts if name in words), one.opts[0]) for one in given}
        _TYPED.set((_name_of(ctx), spelled))
        for option in given:
            if isinstance(option, TyperOption) and not option.multiple and given.count(option) > 1:
                joined = ", values joined by commas" if "," in (option.metavar or "") else ""
                ctx.fail(f"{option.opts[0]} is given twice; give it once{joined}")
        takes_any, ctx.allow_extra_args = ctx.allow_extra_args, True  # to be refused in words of ours
        typed = list(args)  # what parses takes its words away
        try:
            extra = list(super().parse_args(ctx, args))
        except typer.BadParameter as error:
            _fail_of_number(ctx, typed, error)
            raise
        if extra and not takes_any:
            ctx.fail(f"{extra[0]} is one too many; {self._takes()}")
        return extra

    def _takes(self) -> str:
        """What is given besides options, as a remedy."""
        names = [str(one.metavar or one.name) for one in self.params if one.param_type_name == "argument"]
        return f"give {' and '.join(names)} alone, and the next one by itself" if names else "it takes options alone"

    def _check_values(self, ctx: Any, args: list[str]) -> None:
        """Refuse an option that another one follows, or nothing, in place of its value."""
        options = [option for option in self.get_params(ctx) if isinstance(option, TyperOption)]
        known = {name for option in options for name in (*option.opts, *option.secondary_opts)}
        takes = {name: option for option in options if not option.is_flag for name in option.opts}
        args = args[: args.index("--")] if "--" in args else args
        for name, after in zip(args, [*args[1:], None], strict=False):
            if name in takes and (after is None or after in known):
                found = "nothing follows it" if after is None else f"{after} follows it"
                ctx.fail(f"{name} has no value ({found}); give {name} {takes[name].metavar}")


def _fail_of_number(ctx: Any, args: list[str], error: typer.BadParameter) -> None:
    """Refuse a value that is no number in words of ours: what was given, and what the option takes, with its unit."""
    option, kind = error.param, error.message.partition("unable to parse string as ")[2]
    if not kind or not isinstance(option, TyperOption):
        return
    found = [
        (word.partition("=")[0], word.partition("=")[2] if "=" in word else after)
        for word, after in zip(args, [*args[1:], ""], strict=False)
        if word.partition("=")[0] in option.opts
    ]
    name, value = found[0] if found else (option.opts[0], "what was given")
    whole = "whole " if "integer" in kind else ""
    ctx.fail(f"{name} is {value!r}, no {whole}number; give {name} {option.metavar}: {option.help}")


class App(typer.Typer):
    """Commands of the kind `OnceCommand`, made by `command`."""

    def command(self, name: str | None = None, **settings: Any) -> Made:  # type: ignore[override]
        """As Typer's; ``defaults``: a dict, see `command`."""
        make = command(**settings.pop("defaults", {}))
        register = super().command(name, **{"cls": OnceCommand, **settings})
        return lambda function: register(function if function in _MADE else make(function))


def command(**defaults: Any) -> Made:
    """Make a function a command: its options, its exit codes, its help.

    A parameter that is a dataclass is a group of options: each field becomes an option. Bad input ends in one line
    instead of a traceback; SIGTERM is Ctrl-C.

    Args:
        defaults: of options of groups, in place of the group's own.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        options, groups = _options_of(function, defaults)

        @functools.wraps(function)
        def guarded(**given: Any) -> Any:
            logging.captureWarnings(True)
            typed = dict(given)
            try:
                check_options(given)
                check_files(guarded, given)
                for name, group in groups.items():
                    given[name] = group(**{field.name: given.pop(field.name) for field in dataclasses.fields(group)})
                with interrupted_by_signals():
                    return function(**given)
            except SteerclearError as error:
                _leave(f"error: {as_typed(str(error), options, typed)}", ExitCode.BAD_INPUT)
            except JobFault as error:
                _leave(f"error: {error}", ExitCode.FAULT)
            except Interrupted as error:
                _leave(str(error), ExitCode.INTERRUPTED)
            except KeyboardInterrupt:
                _leave("interrupted", ExitCode.INTERRUPTED)
            except (typer.Exit, typer.Abort, typer.BadParameter, BrokenPipeError):
                raise  # ends in order, and a reader of a pipe that has enough
            except Exception as error:
                leave_failed(error)

        vars(guarded).pop("__wrapped__")  # options are those here, not the function's own
        vars(guarded)["__signature__"] = inspect.Signature(options)
        guarded.__annotations__ = {option.name: option.annotation for option in options}
        guarded.__doc__ = unbroken(function.__doc__ or "")
        _MADE.add(guarded)
        return guarded

    return decorate


def check_options(given: dict[str, Any]) -> None:
    """Refuse (ConfigError) options that were typed and change nothing beside the others; see `unused.RULES`."""
    (name, typed), _ = _TYPED.get(), _TYPED.set(("", {}))
    check_rules(name, typed, given)


def _options_of(
    function: Callable[..., Any], defaults: dict[str, Any]
) -> tuple[list[inspect.Parameter], dict[str, type[Any]]]:
    """Options of a function, and its groups of options by the name of the parameter."""
    hints, found, groups = hints_of(function), list[tuple[str, Any, Any]](), dict[str, type[Any]]()
    for name, parameter in inspect.signature(function).parameters.items():
        hint: Any = hints[name]
        if dataclasses.is_dataclass(hint):
            groups[name] = typing.cast("type[Any]", hint)
            fields = typing.get_type_hints(hint, include_extras=True)
            own = {one.name: one.default for one in dataclasses.fields(hint)} | defaults
            found += [(one.name, own[one.name], fields[one.name]) for one in dataclasses.fields(hint)]
        else:
            found.append((name, parameter.default, hint))
    keyword, empty = inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.empty
    return [
        inspect.Parameter(name, keyword, default=empty if default is dataclasses.MISSING else default, annotation=hint)
        for name, default, hint in found
    ], groups


def unbroken(text: str) -> str:
    """Paragraphs on one line each: help is broken where the terminal ends, not where the source does."""
    paragraphs = (" ".join(part.split()) for part in inspect.cleandoc(text).split("\n\n"))
    return "\n\n".join(part.replace("``", "") for part in paragraphs)


def _leave(text: str, code: ExitCode) -> NoReturn:
    warn(text)
    raise typer.Exit(int(code))


def leave_failed(error: Exception) -> NoReturn:
    """End with one line for what no one foresaw: the machine's doing, or a fault of steerclear kept in a file."""
    if words := machine_words(error):
        _leave(f"error: {words}", ExitCode.BAD_INPUT)
    _leave(f"error: {fault_words(error)}", ExitCode.FAULT)


def finish(passed: bool) -> None:
    """End a command that judged something: exit status 1 when it did not pass."""
    if not passed:
        raise typer.Exit(int(ExitCode.GOAL_MISSED))


class PlainProgress:
    """Progress where there is no terminal to draw a bar on: how much is done and left, at most a line in `EVERY_S`.

    The time left is told by the rate since the first was done, which may have waited until machine code was compiled.

    Args:
        words: what is counted.
        total: how many there are.
        console: where to.
        at_once: print the first that is told, too, so that a long command is seen to have begun.
        least: how many are done beyond the first before the time left is told: as many as are done side by side.
        clock: s.
    """

    def __init__(
        self,
        words: str,
        total: int | None,
        console: Console,
        at_once: bool = False,
        least: int = 1,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._words, self._total, self._console, self._clock = words, total, console, clock
        self._next_s = clock() + (0.0 if at_once else EVERY_S)
        self._least = least
        self._before: int | None = None
        self._first: tuple[int, float] | None = None

    def __call__(self, done: int, words: str = "", total: int | None = None) -> None:
        """Tell that so many are done in all; those told first may be an earlier run's and say nothing of the rate."""
        now_s, self._total = self._clock(), total or self._total or done
        if self._before is None:
            self._before = done
        elif self._first is None and done > self._before:
            self._first = done, now_s
        if now_s < self._next_s:
            return
        self._next_s, left = now_s + EVERY_S, ""
        if self._first is not None and self._first[0] + self._least <= done < self._total:
            each_s = (now_s - self._first[1]) / (done - self._first[0])
            left = f"about {time_words((self._total - done) * each_s)} left"
        parts = [f"{self._words}: {done:,} of {self._total:,}", words, left]
        self._console.print(", ".join(part for part in parts if part), soft_wrap=True)


def time_words(time_s: float) -> str:
    """A time to read: 40 s, 12 min, 3 h 5 min."""
    if time_s < 90.0:
        return f"{time_s:.0f} s"
    minutes = round(time_s / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"


@contextmanager
def bars() -> Iterator[Callable[..., Callable[..., None]]]:
    """Show progress on stderr, on a terminal as bars, elsewhere as a plain line now and then.

    What it yields begins one: ``begin(words, total, at_once, least)``, see `PlainProgress`, gives what is told how much
    is done, what else is known in words, and the total where it is known only now.
    """
    console = err()
    if not console.is_terminal:
        yield lambda words, total=None, at_once=False, least=1: PlainProgress(words, total, console, at_once, least)
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(20), MofNCompleteColumn(), TimeElapsedColumn())
    left = (TextColumn("left"), TimeRemainingColumn(), TextColumn("{task.fields[more]}", markup=False))
    with Progress(*columns, *left, console=console, transient=True) as bar:

        def begin(words: str, total: int | None = None, at_once: bool = False, least: int = 1) -> Callable[..., None]:
            task = bar.add_task(words, total=total, more="")

            def notice(done: int, more: str = "", total: int | None = None) -> None:
                bar.update(task, completed=done, total=total, more=more, refresh=True)

            return notice

        yield begin


@contextmanager
def progress(words: str, total: int, least: int = 1) -> Iterator[Callable[..., None]]:
    """A single one of `bars`: call what it yields with the number of finished jobs, ``least`` of them side by side."""
    with bars() as begin:
        notice = begin(words, total, least=least)
        yield lambda done, *_: notice(done)
