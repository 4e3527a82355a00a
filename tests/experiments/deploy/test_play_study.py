"""Play of three against three over loopback MAVLink in real time: whole parts, resumable, results as JSON.

STEERCLEAR_STUDY_DIR says where parts are kept (results/boats), STEERCLEAR_STUDY_MINUTES how long each is (5).
"""

import dataclasses
import os
import sys

import pytest
from play_parts import Part, played, summary

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


def show(capsys, *results):
    with capsys.disabled():
        sys.stdout.write("\n" + summary(list(results)) + "\n")


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.name)
def test_three_against_three(part, tmp_path, capsys):
    """No breach of teammates, no avoidable one with opponents, every command within the freshness contract."""
    result = played(part, tmp_path)
    show(capsys, result)
    during = [breach for breach in result["breaches"] if not breach["after_run"]]
    assert [breach for breach in during if breach["kind"] == "teammate"] == []
    assert [breach for breach in during if breach["verdict"] not in ("unavoidable",)] == []
    assert all(runner["commands_without_answer"] == runner["decided_otherwise"] == 0 for runner in result["runners"])
    assert all(runner["decisions"] > 500 * part.minutes for runner in result["runners"])


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
