"""Faults of every kind while rammers hunt our boats, over loopback MAVLink in real time.

Parts are kept and sized as in `test_play_study`. A fault acts on one boat of ours after the other.
"""

import itertools
import sys

import pytest
from play_parts import Part, circumstance, played, summary
from test_play_study import MINUTES

pytestmark = pytest.mark.study
FIRST_S, EVERY_S = 45.0, 12.0
KINDS = (
    "telemetry_stop:4", "freeze:8", "jump:8", "late:8", "out_of_order:8", "duplicate:8", "corrupt:8", "link_loss:2",
    "commands_lost:2", "telemetry_stop:9", "link_loss:9",
)  # fmt: skip
DEAF = ("telemetry_stop", "link_loss", "commands_lost", "mode")
"""Nothing reaches the boat, or nobody knows where it is: what remains may not suffice."""


def mixed(minutes):
    """One fault every 12 s, the boats in turn; at the end a pilot puts one into HOLD and leaves it there."""
    boats = itertools.cycle(("blue_1", "blue_2", "blue_3"))
    last_s = FIRST_S + 60.0 * minutes - 70.0
    faults, at_s = [], FIRST_S
    for boat, kind in zip(boats, itertools.cycle(KINDS), strict=False):
        if at_s > last_s:
            break
        name, _, lasts_s = kind.partition(":")
        faults.append(f"{boat}:{name}@{at_s:g}+{lasts_s}")
        at_s += EVERY_S
    return (*faults, f"blue_3:mode@{at_s:g}")


PARTS = [
    Part("faults_team", "heron", "medium", "rammer", MINUTES, 11, faults=mixed(MINUTES)),
    Part("faults_surveyor", "surveyor", "medium", "rammer", MINUTES, 12, faults=mixed(MINUTES)),
    Part("per_boat", "heron", "medium", "rammer", MINUTES, 13, per_boat=True),
    Part("per_boat_faults", "heron", "medium", "rammer", MINUTES, 14, per_boat=True, faults=mixed(MINUTES)),
]


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.name)
def test_faults_while_rammers_hunt(part, tmp_path, capsys):
    """No breach that the information left could have prevented: none while a boat hears us and is known."""
    result = played(part, tmp_path)
    with capsys.disabled():
        sys.stdout.write("\n" + summary([result]) + "\n")
    during = [breach for breach in result["breaches"] if not breach["after_run"]]
    left = [b for b in during if not set(b["faults"]) & set(DEAF) and circumstance(b) != "nobody steered it"]
    assert [breach for breach in left if breach["kind"] == "teammate" or breach["verdict"] != "unavoidable"] == []
    assert all(runner["commands_without_answer"] == runner["decided_otherwise"] == 0 for runner in result["runners"])
