"""Figures of a run of simulated boats, and their display in the terminal."""

from __future__ import annotations

from collections import Counter
from typing import Any

from rich.console import Group
from steerclear.experiments.provenance import machine, versions
from steerclear.experiments.tables import titled

from .fleet import SimFleet

_SHOWN = 10


def boats_table(fleet: SimFleet) -> Group:
    """Return the table of boats: team, link, id and what steers each."""
    addresses = fleet.addresses
    rows = [
        [
            name,
            ("blue", "red", "-")[min(boat.spec.team, 2)],
            addresses.get(name, "-"),
            str(boat.system_id) if name in addresses else "-",
            boat.spec.policy or ("its link" if name in addresses else "nobody"),
        ]
        for name, boat in fleet.boats.items()
    ]
    return titled("Simulated boats", ["", "team", "link", "id", "driven by"], rows)


def state_line(fleet: SimFleet) -> str:
    """Return a status line."""
    commanded = sum(boat.is_commanded for boat in fleet.boats.values())
    linked = len(fleet.addresses)
    nearest = next(iter(fleet.closest_approaches()), None)
    closest = "" if nearest is None else f"; closest so far {nearest.distance_m:.1f} m"
    playing = "playing" if fleet.is_playing else "waiting for commands"
    return f"{fleet.time_s:.0f} s, {commanded} of {linked} commanded, {playing}{closest}; Ctrl-C ends"


def content_of(fleet: SimFleet, team: int) -> dict[str, Any]:
    """Return the figures described in `docs.KEYS`, with a team's separation violations if the game was recorded."""
    recorded = fleet.truth is not None
    violations = fleet.judge(team) if recorded else None
    return {
        "command": "sim-boats",
        "versions": versions(),
        "machine": machine(),
        "simulated_s": fleet.time_s,
        "let_go_s": fleet.let_go_s,
        "cpu_s": fleet.cpu_s,
        "played": fleet.is_playing,
        "boats": {name: _boat(fleet, name) for name in fleet.boats},
        "closest": [dict(vars(approach)) for approach in fleet.closest_approaches()],
        "captures": None if fleet.truth is None else fleet.truth.captures,
        "tags": None if fleet.truth is None else fleet.truth.tags,
        "violations": violations,
    }


def approaches_table(content: dict[str, Any]) -> Group:
    """Return the table of closest approaches."""
    rows = [
        [f"{entry['first']} - {entry['second']}", f"{entry['distance_m']:.2f}", f"{entry['time_s']:.1f}"]
        for entry in content["closest"][:_SHOWN]
    ]
    title = f"Closest approaches in {content['simulated_s']:.0f} simulated s"
    return titled(title, ["pair", "m", "at s"], rows)


def verdicts_table(content: dict[str, Any]) -> Group:
    """Return the own team's separation violations by kind and verdict."""
    when = {False: "during the run", True: "after it"}
    counted = Counter(
        (when[violation["after_run"]], violation["kind"], violation["verdict"]) for violation in content["violations"]
    )
    rows = [[*what, str(number)] for what, number in sorted(counted.items())]
    return titled("Violations of the own team", ["", "with", "verdict", "number"], rows or [["none", "", "", "0"]])


def _boat(fleet: SimFleet, name: str) -> dict[str, Any]:
    boat = fleet.boats[name]
    return {
        "address": fleet.addresses.get(name),
        "driven_by": boat.spec.policy,
        **boat.autopilot.counts,
        "lost_down": boat.down.lost,
        "lost_up": boat.up.lost,
    }
