"""JSON keys of `deploy`, `preflight`, `referee` and `replay`, with meaning and unit.

A `Figure` documents its key and says how the terminal shows it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple


class Figure(NamedTuple):
    """One figure of a run."""

    key: str  # in results
    meaning: str  # with its unit, without a full stop
    label: str = ""  # text in the terminal's table; empty: not shown there
    factor: float = 1.0  # to the shown unit
    unit: str = ""  # the shown unit
    digits: int = 0  # digits shown


FIGURES = (
    Figure("ticks", "turns of the loop", "turns"),
    Figure("decided", "of those, with a decision"),
    Figure(
        "changed_share",
        "share of own boats' commands that the shield changed, 0 to 1",
        *("commands changed by the shield", 100.0, "%", 1),
    ),
    Figure("best_effort_commands", "own boats' commands for which no manoeuvre kept the required distance"),
    Figure(
        "ticks_with_actions",
        "turns in which a declared response, an override or STOP ALL did something",
        "turns with a declared response",
    ),
    Figure(
        "closest_m",
        "closest approach of an own boat to any other, as believed, m",
        *("closest approach of our boats, as believed", 1.0, "m", 2),
    ),
    Figure("least_safety_margin_m", "smallest safety margin of an own boat, m"),
    Figure("missed_turns", "turns skipped because the loop was late", "turns skipped"),
    Figure("jitter_p50_s", "turns begun after they were due, median, s"),
    Figure("jitter_p999_s", "the same, 999 of 1000, s", "turn began late, 999 of 1000 within", 1000.0, "ms", 1),
    Figure("jitter_max_s", "the same, the worst, s"),
    Figure("read_to_sent_p50_s", "from reading telemetry to the last command sent, median, s"),
    Figure(
        "read_to_sent_p99_s",
        "the same, 99 of 100, s",
        *("telemetry read to command sent, 99 of 100 within", 1000.0, "ms", 1),
    ),
    Figure("read_to_sent_max_s", "the same, the worst, s"),
    Figure("decide_p99_s", "the shield's decision alone, 99 of 100, s"),
)
"""Figures of a run, in the order of the table."""


def figure_rows(figures: Mapping[str, float]) -> list[tuple[str, str]]:
    """Return the rows of the terminal's table: label and value; inf: nobody else was there."""
    rows = [(one, figures[one.key]) for one in FIGURES if one.label]
    return [
        (one.label, "no other boat" if math.isinf(value) else f"{one.factor * value:.{one.digits}f} {one.unit}".strip())
        for one, value in rows
    ]


DEPLOY = {
    "ended": "why the run ended; empty: it never began",
    "refused[]": "checks neither passed nor accepted",
    "checks[].name": "name of the check, with the boat's where it is about one",
    "checks[].passed": "whether it passed",
    "checks[].text": "what was found, and the remedy",
    "checks[].figures.*": "what was measured; the unit ends the name",
    "left[]": "what each boat was left doing, and boats on the way to one of them then",
    "log": "path of the black box, or of the kept preflight; null: none",
    **{f"figures.{figure.key}": figure.meaning for figure in FIGURES},
}

REFEREE = {
    "ended": "why: over, time or stopped",
    "faults.*": "packets and fixes refused, by kind",
    "events[].time_s": "game time, s",
    "events[].text": "what happened",
    "game.time_s": "game time at the end, s",
    "game.boats.*.tagged": "whether it is tagged",
    "game.boats.*.has_flag": "whether it carries the other team's flag",
    "game.boats.*.oob": "whether it is out of bounds, or lost",
    "game.boats.*.on_side": "whether it was on its own side at the look before the last",
    "game.boats.*.cooldown_s": "time since its last tag, up to the cool-down, s",
    "game.boats.*.driven": "whether the game drives it: tagged or out of bounds",
    "game.flags[].x_m": "where the flag is, m; blue's, then red's",
    "game.flags[].y_m": "where the flag is, m",
    "game.flags[].taken": "whether an opponent carries it",
    "game.captures[]": "flags captured by blue and red",
    "game.grabs[]": "flags grabbed by blue and red",
    "game.tags[]": "tags made by blue and red",
    "game.over": "whether the game ended",
    "game.note": "what the referee had to say last",
}

REPLAY = {
    "log": "the log",
    "began": "when it began, UTC",
    "seconds": "its length, s",
    "policy": "name of the policy",
    "complete": "whether it was closed properly; false after a crash",
    "made_by": "which version wrote it",
    "proved": "whether every decision is proved, of a log that is as it was written",
    "chain.chained": "whether the log has a chain: every log that is read has one",
    "chain.keyed": "whether its links carry codes",
    "chain.codes_checked": "codes found right; 0 without --key",
    "chain.broken": "things that do not fit: records altered, removed, added or moved",
    "chain.breaks[]": "the first of them, in words",
    "damage[]": "what could not be read",
    "origin[]": "what differs between the log's program and this one and may change a last bit",
    "ticks": "turns of the loop in the log",
    "decisions": "decisions run again",
    "same": "of those, the same bit for bit",
    "different": "of those, not the same, with everything before them known: 0 is the proof",
    "unproven": "of those, not the same, but after missing turns: the shield's memory is not known",
    "missing[][]": "numbers of the turns before and after each stretch missing from the log, -1 before the first",
    "first_difference": "null where there is none",
    "first_difference.tick": "number of the turn",
    "first_difference.time_s": "since the log began, s",
    "first_difference.boat": "whose decision",
    "first_difference.what": "which value",
    "first_difference.recorded": "as recorded",
    "first_difference.replayed": "as decided again",
    "strayed": "commands sent that are not what was decided, or not sent",
    "unfounded": "commands sent, no stops, without a decision",
    "cut[].boat": "a boat whose autopilot's limit cut commands",
    "cut[].limit_mps": "that limit, m/s",
    "cut[].commands": "how many it cut",
    "first_sent": "null where there is none",
    "first_sent.tick": "number of the turn",
    "first_sent.time_s": "since the log began, s",
    "first_sent.boat": "whose command",
    "first_sent.what": "which value",
    "first_sent.recorded": "as decided, m/s or rad",
    "first_sent.replayed": "as sent",
    "reasons.*": "decisions of own boats by reason",
    "actions[].condition": "what happened, such as telemetry or stop_all",
    "actions[].response": "what was done",
    "actions[].subject": "boat, contact, policy or link it was about",
    "actions[].ticks": "turns of the loop in which it was in effect",
    "closest_teammate_m": "with --judge: closest distance of two own boats, m",
    "closest_opponent_m": "with --judge: closest distance of an own boat to another, m",
    "violations_teammate": "with --judge: entries of two own boats into the separation",
    "violations_opponent": "with --judge: entries of an own boat and another into the separation",
    "files[]": "what was written",
}
