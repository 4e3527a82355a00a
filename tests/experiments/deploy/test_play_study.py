"""Play of three against three over loopback MAVLink in real time: whole parts, resumable, results as JSON.

Rammers hunt our boats in some, while faults of every kind act on one boat of ours after the other.

STEERCLEAR_STUDY_DIR says where parts are kept (results/boats), STEERCLEAR_STUDY_MINUTES how long each is (5).
"""

import dataclasses
import itertools
import os
import sys

import pytest
from play_parts import Part, circumstance, played, summary

pytestmark = pytest.mark.study
MINUTES = float(os.environ.get("STEERCLEAR_STUDY_MINUTES", "5"))
PARTS = [
    Part("heron_medium", "heron", "medium", "medium", MINUTES, 1),
    Part("heron_rammers", "heron", "medium", "rammer", MINUTES, 2),
    Part("heron_attack", "heron", "medium_attack", "hard", MINUTES, 3),
    Part("surveyor_medium", "surveyor", "medium", "medium", MINUTES, 4),
    Part("surveyor_rammers", "surveyor", "medium", "rammer", MINUTES, 5),
    Part("surveyor_attack", "surveyor", "medium_attack", "hard", MINUTES, 6),
]
UNSHIELDED = [
    dataclasses.replace(part, name=f"{part.name}_unshielded", shielded=False, minutes=min(1.0, MINUTES))
    for part in PARTS
]


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


FAULTY = [
    Part("faults_team", "heron", "medium", "rammer", MINUTES, 11, faults=mixed(MINUTES)),
    Part("faults_surveyor", "surveyor", "medium", "rammer", MINUTES, 12, faults=mixed(MINUTES)),
    Part("per_boat", "heron", "medium", "rammer", MINUTES, 13, per_boat=True),
    Part("per_boat_faults", "heron", "medium", "rammer", MINUTES, 14, per_boat=True, faults=mixed(MINUTES)),
]


def show(capsys, *results):
    with capsys.disabled():
        sys.stdout.write("\n" + summary(list(results)) + "\n")


@pytest.mark.parametrize("part", [*PARTS, *FAULTY], ids=lambda part: part.name)
def test_three_against_three(part, tmp_path, capsys):
    """No breach of teammates, no avoidable one with opponents, every command within the freshness contract.

    With faults: none while a boat hears us and is known.
    """
    result = played(part, tmp_path)
    show(capsys, result)
    during = [breach for breach in result["breaches"] if not breach["after_run"]]
    if part.faults:
        during = [b for b in during if not set(b["faults"]) & set(DEAF) and circumstance(b) != "nobody steered it"]
    assert [breach for breach in during if breach["kind"] == "teammate" or breach["verdict"] != "unavoidable"] == []
    assert all(runner["commands_without_answer"] == runner["decided_otherwise"] == 0 for runner in result["runners"])
    assert part.faults or all(runner["decisions"] > 500 * part.minutes for runner in result["runners"])


@pytest.mark.parametrize("part", UNSHIELDED, ids=lambda part: part.name)
def test_the_same_without_the_shield(part, tmp_path, capsys):
    """How often the same policies come too near when nobody heeds the shield."""
    result = played(part, tmp_path)
    show(capsys, result)
    assert result["minutes_played"] > 0.5 * part.minutes


def test_all_parts_together(tmp_path, capsys):
    """The sum over all parts; run after them."""
    results = [played(part, tmp_path / part.name) for part in (*PARTS, *UNSHIELDED)]
    show(capsys, *results)
    minutes = {shield: [r["minutes_played"] for r in results if r["part"]["shielded"] == shield] for shield in (0, 1)}
    rates = {
        shield: sum(not b["after_run"] for r in results if r["part"]["shielded"] == shield for b in r["breaches"])
        / sum(minutes[shield])
        for shield in minutes
    }
    assert rates[True] < 0.1 * rates[False]
