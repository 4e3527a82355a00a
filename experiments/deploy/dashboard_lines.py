"""Every line of the dashboard as data with its meaning; dashboard and operator's page are made of it."""

from __future__ import annotations

import re
from typing import NamedTuple

from steerclear.shield.decision import Reason

from .dashboard_map import SYMBOLS


class Column(NamedTuple):
    """A column of the table: head, characters its longest cell needs, meaning."""

    title: str
    width: int
    meaning: str


COLUMNS = (
    Column("boat", 10, "its name in its team's colour, and its marks"),
    Column("hdg", 4, "heading, degrees clockwise from the field's y axis"),
    Column("m/s", 5, "speed"),
    Column("age", 5, "seconds since its position was true; red: older than the limit"),
    Column("wanted", 9, "what the policy, or a response, wants: speed m/s and heading"),
    Column("sent", 9, "what the shield made of it, as it left; cyan: changed by the shield"),
    Column("why", 9, "why the shield sent that, see below; red: the mode that keeps it from obeying"),
    Column("margin", 6, "how much more room than required its best manoeuvre keeps, m; red: less than required"),
    Column("closest", 14, "whom it meets closest when all hold course, how near and when; yellow: too near"),
    Column("bound by", 12, "what its command had to give way to"),
)
GROWING = (("closest", 26), ("boat", 16), ("bound by", 24), ("closest", 400))
"""Where room that is left over goes, in this order, each up to a width."""
DROPPED = ("bound by", "hdg", "m/s", "age", "closest", "why", "margin")
"""What is left out of a terminal too narrow for all, in this order; wanted and sent stand in every one, whole."""
WHY = {
    Reason.PASSED: ("passed", "green", "the nominal command leaves the boat a way out: sent as it is"),
    Reason.LEAST_CHANGE: ("least", "cyan", "changed as little as it takes to keep clear of everything"),
    Reason.QP_RELAXED: ("QP slack", "yellow", "of logs of 0.2.0 and before"),
    Reason.BACKUP: ("backup", "yellow", "its backup manoeuvre, which keeps clear of all boats"),
    Reason.BEST_EFFORT: (
        "best eff.",
        "bold red",
        "no manoeuvre keeps the margin, this one most of it: give it room, or SPACE",
    ),
    Reason.HELD: ("held", "magenta", "the nominal command is unusable: told to stop on its course"),
    Reason.NOT_COVERED: ("-", "dim", "this shield does not decide for the boat"),
    Reason.RIGHT_OF_WAY: ("way", "cyan", "two teammates kept each other from turning: one gives way, one stands on"),
    Reason.LIMITED: ("limit", "yellow", "more speed was asked than the boat can do"),
    Reason.STOPPED: (
        "stopped",
        "bold red",
        "beyond the hard line, or a shore too near: its link's own stop; bring it in by hand",
    ),
}
MARKS = (("⚑", "has_flag", "carries the flag"), ("T", "tagged", "tagged"), ("O", "oob", "out of bounds"))


class Banner(NamedTuple):
    """The line that says how things stand: words, style, what it means and what to do."""

    words: str
    style: str
    meaning: str


BANNERS = {
    "soft": Banner(
        "STOP ALL by {0}: boats are told to stop through the shield (again, then y: past it); r resumes",
        "bold white on red",
        "boats stop and the shield still keeps them clear; `r`, then `y`, lets the policy go on",
    ),
    "hard": Banner(
        "STOP ALL by {0}: boats are told to stop by their links, past the shield; r resumes",
        "bold white on red",
        "nothing keeps boats clear of each other: take them by hand, or `r` and `y`",
    ),
    "ended": Banner(
        "The run ends ({0}): boats are left stopped",
        "bold black on yellow",
        "wait until each boat is told to be in HOLD; get others off the water",
    ),
    "nothing": Banner("Nothing yet", "black on yellow", "no turn of the loop yet: wait"),
    "silent": Banner(
        "The loop stands still: no tick for {0:.1f} s",
        "bold white on red",
        "the runner is stuck; each boat stops by itself 3 s after the last command it heard: take them by hand",
    ),
    "unknown": Banner(
        "No boat's state is known: boats are told to stop",
        "bold white on red",
        "telemetry of all our boats is gone: their links stop them; look at radios and feed",
    ),
    "effect": Banner(
        "{0} in effect, see below",
        "black on yellow",
        "a fault was answered; the lines below say which boat, what is done, and how control returns",
    ),
    "fine": Banner("All within limits", "black on green", "nothing is declared: go on"),
}
KEYS = (
    ("SPACE or s", "STOP ALL", "all boats stop behind the shield; again, then `y`: by their links, past it"),
    ("r", "resume", "take STOP ALL back, after a question"),
    ("o", "overrides", "switch one response off for a time, for one boat or all"),
    ("t", "take back", "take a boat back that its pilot let go of, after a question"),
    ("q", "end", "stop all boats and end the run"),
)
HEAD = (
    ("tick N", "turns of the loop so far"),
    ("N s, blue A : B red", "the referee's clock and score; *no referee*: nobody keeps the game"),
    ("policy N", "seconds since the policy's answer was right; beyond `limits.policy` a response is due"),
    ("late N ms, at most M", "how much later than due the last 100 turns began, on average and at most"),
)


_FORMAT = re.compile(r"\{.*?\}")


def dashboard_page() -> str:
    """What every line of the dashboard means, for the operator's page, in Markdown."""
    parts = (
        ("first line", HEAD),
        (
            "banner",
            [
                (
                    banner.words.format("...", "s") if "{0:" not in banner.words else "The loop stands still",
                    banner.meaning,
                )
                for banner in BANNERS.values()
            ],
        ),
        ("map", SYMBOLS),
        ("table of boats", [(column.title, column.meaning) for column in COLUMNS]),
        ("mark beside a name", [(mark, meaning) for mark, _, meaning in MARKS]),
        ("why", [(words, meaning) for words, _, meaning in WHY.values()]),
        ("key", [(key, f"{words}: {meaning}") for key, words, meaning in KEYS]),
    )
    rows = [f"| {part} | {what} | {meaning} |" for part, lines in parts for what, meaning in lines]
    return "\n".join(["| where | it shows | what it means, and what to do |", "|---|---|---|", *rows])
