"""Options that mean something only together with another: given alone they are refused, in one line, by one table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from steerclear.policies.registry import KEYBOARD
from steerclear.shield.bridge.moos import POLICY as MOOS_POLICY
from steerclear.shield.exceptions import ConfigError

Values = Mapping[str, Any]
"""A command's arguments by name, given or by default."""
OFF_WORDS = "the shield is off; add --shield"
ONE_BY_ONE = "--scene files are played one after another and leave no results; leave it out"
IN_FILE = "a --scene file holds its own; leave it out, or edit the file"
SHIELD = ("profile", "shield_set")
SEARCHED = ("seed", "platform", "family", "n", "radius", "delay", "noise", "current")


class Rule(NamedTuple):
    """Options, by the names of their arguments, that change nothing in these commands while ``idle``, and why.

    ``why`` ends with the remedy: the other option, or to leave it out.
    """

    commands: tuple[str, ...]
    options: tuple[str, ...]
    idle: Callable[[Values], bool]
    why: str


def _bare(values: Values) -> bool:
    return not values["shield"]


def _bare_cup(values: Values) -> bool:
    return values["shield"] is not None and set(values["shield"]) <= {"off"}


def _sets_more(values: Values) -> bool:
    """Whether ``--shield-set`` has more than the separation, at which hits are counted anyhow."""
    return any(pair.partition("=")[0].strip() != "separation_m" for pair in values["shield_set"] or ())


def _judges_shielded(values: Values) -> bool:
    return bool(values["judge"] == "shielded")


def _sets_time(values: Values) -> bool:
    pairs = values["rules"] or ()
    return values["max_time"] is not None or any(pair.partition("=")[0].strip() == "max_time_s" for pair in pairs)


def _unseen(values: Values) -> bool:
    return not values["window"] and KEYBOARD not in (values["own"], values["opponent"])


def _no_filter(values: Values) -> bool:
    """Whether the only filter is none."""
    asked = values["safety_filter"] or "shield"
    return {name.strip() for text in ([asked] if isinstance(asked, str) else asked) for name in text.split(",")} == {
        "none"
    }


def _ends_not_in(*endings: str) -> Callable[[Values], bool]:
    return lambda values: values["to"] is None or values["to"].suffix.lower() not in endings


def _no_log(ending: str) -> Callable[[Values], bool]:
    return lambda values: all(path.suffix.lower() != ending for path in values["logs"])


RULES = (
    Rule(("play",), ("separation", *SHIELD, "noise", "no_shield_autopilot"), _bare, OFF_WORDS),
    Rule(("play",), ("speed",), _unseen, "no window is shown; add --window"),
    Rule(("evaluate",), ("profile", "noise", "no_shield_autopilot"), _bare, OFF_WORDS),
    Rule(("evaluate",), ("shield_set",), lambda values: _bare(values) and _sets_more(values), OFF_WORDS),
    Rule(
        ("evaluate",),
        ("judge",),
        lambda values: _bare(values) and _judges_shielded(values),
        "the shield is off; add --shield, or give --judge all",
    ),
    Rule(("tournament",), ("profile",), _bare_cup, "no team is shielded; add --shield all"),
    Rule(
        ("tournament",),
        ("shield_set",),
        lambda values: _bare_cup(values) and _sets_more(values),
        "no team is shielded; add --shield all",
    ),
    Rule(
        ("tournament",),
        ("judge",),
        lambda values: _bare_cup(values) and _judges_shielded(values),
        "no team is shielded; add --shield all, or give --judge all",
    ),
    Rule(
        ("evaluate", "ablate", "entry report"),
        ("quick",),
        lambda values: values["games"] is not None and _sets_time(values),
        "--games and --max-time say how many and how long; leave one of the three out",
    ),
    Rule(("tournament",), ("quick",), _sets_time, "--max-time says how long games are; leave one of both out"),
    Rule(("encounters",), SEARCHED, lambda values: bool(values["scene"]), IN_FILE),
    Rule(
        ("encounters",),
        ("jobs", "engine", "address", "resume", "json_file"),
        lambda values: bool(values["scene"]),
        ONE_BY_ONE,
    ),
    Rule(("encounters", "attack"), ("noise",), _no_filter, "no filter looks; add --filter shield"),
    Rule(("render",), ("at",), _ends_not_in(".png"), "only a picture is of one moment; name a .png by --to"),
    Rule(("render",), ("speed",), _ends_not_in(".mp4", ".gif"), "only films have one; name an .mp4 or .gif by --to"),
    Rule(("deploy",), ("opponents", "link"), lambda values: not values["demo"], "no boats are simulated; add --demo"),
    Rule(
        ("deploy",),
        ("link",),
        lambda values: values["fleet"] is not None,
        "FLEET.yaml says what its boats run; leave it out, or FLEET.yaml",
    ),
    Rule(
        ("deploy",),
        ("seed", "trust"),
        lambda values: values["policy"] == MOOS_POLICY,
        f"commands come from MOOS; leave it out, or --policy {MOOS_POLICY}",
    ),
    Rule(("fit",), ("boat",), _no_log(".mcap"), "no log is a black box (.mcap); leave it out"),
    Rule(("fit",), ("system_id",), _no_log(".tlog"), "no log is a .tlog; leave it out"),
)
"""All of them. What hangs on the content of a file is looked at by its command."""


def check_used(given: Mapping[str, bool], why: str) -> None:
    """Refuse (ConfigError) options that are given and change nothing; ``why`` says so, and what to do."""
    if unused := [name for name, is_given in given.items() if is_given]:
        raise ConfigError(f"{', '.join(unused)} would change nothing: {why}")


def check_rules(command: str, typed: Mapping[str, str], values: Values) -> None:
    """Refuse (ConfigError) options that were typed and change nothing by `RULES`.

    Args:
        command: its name, such as ``entry report``.
        typed: arguments that were typed, by name as they were.
        values: of all arguments.
    """
    for rule in RULES:
        if command in rule.commands and any(name in typed for name in rule.options) and rule.idle(values):
            check_used({typed[name]: True for name in rule.options if name in typed}, rule.why)
