"""What is declared for everything that can go wrong: one table, which `failsafe` applies and the pages show.

A time or response in backquotes is a key of FLEET.yaml's ``limits`` (``end.`` of its ``end``).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from .fleet_settings import End, Limits


class Condition(NamedTuple):
    """A row."""

    name: str  # of `Action.condition`; the part before a dot where several rows are of one kind
    happens: str  # what is wrong
    seen: str  # how it is noticed
    response: str  # what is done
    within: str = "1 turn"  # within what time
    returns: str = "by itself, in the first turn without it"  # how control comes back
    disables: str = ""  # what an override of it switches off; empty: it cannot be overridden


_BY_KEY = "the operator takes it back"
_LINKS_STOP = "its link's own stop"

CONDITIONS = {
    row.name: row
    for row in (
        Condition(
            "navigation.old",
            "A boat's own telemetry is old or refused: a jump, a frozen or impossible place, no GPS fix.",
            "age of its position, heading and speed",
            "`navigation.then`, steered by its model behind the shield; the feed stands in where it knows the boat",
            within="`navigation.max_age_s`",
        ),
        Condition(
            "navigation.lost",
            "Nobody knows where a boat of ours is.",
            "the same age, and the feed's",
            "its link's own stop; the others keep clear of where it may be",
            within="`navigation.lost_after_s`",
        ),
        Condition(
            "link",
            "Nothing comes from a boat.",
            "age of its newest packet",
            "`link.then`; its autopilot stops it 3 s after the last command it hears",
            within="`link.max_age_s`",
        ),
        Condition(
            "mode.pilot",
            "A pilot takes a boat, or disarms it.",
            "its heartbeat, four a second",
            "nothing is sent to it; the others keep clear of it",
            within="0.5 s",
            returns=_BY_KEY,
        ),
        Condition(
            "mode.failsafe",
            "The autopilot's own fail-safe takes a boat.",
            "its heartbeat, four a second, and the autopilot's word within 3 s",
            "nothing is sent to it; the others keep clear of it",
            within="0.5 s",
            returns=(
                "the operator takes it back once the autopilot says it is over, or the loop does with retake; "
                "set: `after_failsafe`"
            ),
        ),
        Condition(
            "commander",
            "Somebody else commands a boat of ours.",
            "packets on its link, and answers to commands that are not ours",
            "`link.then`, until 2 s after the last of them",
            disables="the response to a second commander; both steer the boat",
        ),
        Condition(
            "model.off",
            "A boat is farther than `model.outside_m` from where its model has it 2 s ahead.",
            "prediction against telemetry; its model-error margin grows from the first error on",
            "`model.then`",
            within="`model.after_s`",
            disables="the response to a boat far outside its model; the shield foretells it wrongly",
        ),
        Condition(
            "model.given_up",
            "The same for longer.",
            "likewise",
            "`model.give_up_then`: take it by hand, and fit its platform anew",
            within="`model.give_up_after_s`",
        ),
        Condition(
            "geofence",
            "A boat is outside the operating area.",
            "its position",
            "`geofence.then`",
            returns="by itself, inside",
            disables="the response to leaving the geofence; the shield still turns boats back at the edge",
        ),
        Condition(
            "hard_line",
            "A boat is beyond the hard line, with geofence then: stop.",
            "the shield's decision",
            "its link's own stop every turn; it is handed over to the pilot",
            returns="the pilot brings it in, then the operator takes it back",
        ),
        Condition(
            "obstacle",
            "No command would keep a boat off a shore or an obstacle but to stop, with geofence then: stop.",
            "the shield's decision",
            _LINKS_STOP,
            returns="by itself, with a command that stays clear",
        ),
        Condition(
            "policy.old",
            "The policy's answer is old or unusable.",
            "its age and its values",
            "`policy.then`",
            within="`policy.max_age_s`",
            disables="the response to an old or unusable policy; the boat stands by with no speed instead",
        ),
        Condition(
            "policy.given_up",
            "The same for longer.",
            "likewise",
            "`policy.give_up_then`",
            within="`policy.give_up_after_s`",
        ),
        Condition(
            "contact.old",
            "Another boat's position is old.",
            "age of its newest fix, by any source",
            "`contact.then`, all boats of ours; the room it may be in grows",
            within="`contact.max_age_s`",
            disables="the response to an old or lost contact; once it is lost, boats no longer keep clear of it",
        ),
        Condition(
            "contact.lost",
            "Another boat is lost.",
            "likewise",
            "`contact.lost_then`, all boats of ours",
            within="`contact.lost_after_s`",
        ),
        Condition(
            "contact.doubt",
            "Sources contradict each other about another boat.",
            "places that cannot be one boat's, two programs under one name",
            "`contact.then`, and boats keep clear of every place told; `contact.lost_then` where more than 3 are told, "
            "or one to no better than 10 m",
        ),
        Condition(
            "contact.unlisted",
            "Somebody tells of a boat that is not in the fleet file: nobody keeps clear of it.",
            "a fix of it on the feed or a NODE_REPORT in the last 5 s",
            "`contact.then`, all boats of ours: add it to the file",
        ),
        Condition(
            "game.old",
            "The referee is silent.",
            "age of the state of the game",
            "`game.then`",
            within="`game.max_age_s`",
            disables="the response to an old state of the game; the policy goes on with what it last saw",
        ),
        Condition(
            "game.over",
            "The game is over.",
            "the referee's word",
            "hold_station",
            returns="a new game",
        ),
        Condition(
            "log",
            "The black box cannot be written.",
            "the disk's answer",
            "`log.then`",
            within="1 s; 10 s where the disk only hangs",
            returns="not in this run: free space, end it and start anew; by itself where the disk only hung",
            disables="the response to a black box that cannot be written; what follows is not recorded",
        ),
        Condition(
            "decision",
            "The shield cannot decide, or a turn breaks.",
            "any error",
            "the links' own stop, all boats",
            within="the same turn",
        ),
        Condition(
            "send",
            "A command is no number.",
            "the link refuses it",
            _LINKS_STOP,
            within="the same turn",
        ),
        Condition(
            "stop_all",
            "STOP ALL.",
            "the operator's key",
            "stop, through the shield; asked for twice: the links' own stop, past the shield",
            returns="the operator resumes",
        ),
        Condition(
            "end",
            "The run ends.",
            "key, signal or time",
            (
                "stop, through the shield, until all lie still and nobody comes near, for at most `end.longest_s`; "
                "then HOLD, verified"
            ),
            returns="a new start",
        ),
    )
}
"""Everything that is declared, by name."""

DISABLES = {row.name.partition(".")[0]: row.disables for row in CONDITIONS.values() if row.disables}
"""What can be overridden, and what that switches off. The shield itself, own navigation and lost links cannot be."""


def setting(key: str, limits: Limits, end: End) -> Any:
    """The value of a key as the table names it, such as ``navigation.max_age_s``."""
    value: Any = end if key.startswith("end.") else limits
    for name in key.removeprefix("end.").split("."):
        value = getattr(value, name)
    return value


def response_table(limits: Limits | None = None, end: End | None = None) -> list[tuple[str, ...]]:
    """Rows for a person: what happens, how it is seen, within what time, what is done, how control returns.

    With the times and responses of a file's limits and end; None: the defaults.
    """

    def filled(text: str) -> str:
        parts = text.split("`")
        for k in range(1, len(parts), 2):
            value = setting(parts[k], limits or Limits(), end or End())
            unit = " s" if parts[k].endswith("_s") else " m" if parts[k].endswith("_m") else ""
            shown = f"{value:g}{unit}" if isinstance(value, float) else str(value)
            parts[k] = f"{shown} (`{parts[k]}`)"
        return "".join(parts)

    return [tuple(map(filled, (r.happens, r.seen, r.within, r.response, r.returns))) for r in CONDITIONS.values()]


def response_page() -> str:
    """The table in Markdown, as docs/boat_reference.md shows it."""
    head = ("What happens", "How it is seen", "Within", "What is done", "How control returns")
    rows = [head, ("---",) * len(head), *response_table()]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)
