"""What is lost by a shield that decides once for the ten moves of a decision, as a zip must, in the game of 2026."""

import os
import sys
from itertools import product

import numpy as np
import pytest
from steerclear import policies
from steerclear.experiments.entries.wrap import game_spec
from steerclear.experiments.play.match import Match
from steerclear.experiments.play.spec import MatchSpec
from steerclear.shield import Shield, ShieldConfig

RADIUS_M = 4.0
OPPONENTS, GAMES = ("easy", "medium"), int(os.environ.get("STEERCLEAR_STUDY_GAMES", "12"))
DRIVEN = ("is_tagged", "oob", "is_disabled")
COUNTED = ("collisions", "captures", "captures_against")


def played(opponent, seed, when):
    """One game: without a shield, with one that decides once a second, or at each of the ten moves."""
    shield = {"separation_m": RADIUS_M} if when == "each move" else None
    match = Match(MatchSpec("mctf2026", "medium", opponent, seed=seed, shield=shield, judge="none"))
    if when == "once":
        settings = ShieldConfig.of(**game_spec("mctf2026", {"separation_m": RADIUS_M})["shield"])
        match.seat(0, Shield(settings).wrap(policies.make("medium")))
    try:
        return match.play()
    finally:
        match.close()


def hits(record):
    """Entries into the radius: of a boat of ours that its entry commands, and of one that the game drives."""
    place, count = record["position"], {"commanded": 0, "driven": 0}
    driven = np.logical_or.reduce([record[name][: len(place)] for name in DRIVEN])
    pairs = [*product(range(3), range(3, 6)), (0, 1), (0, 2), (1, 2)]
    for i, j in pairs:
        inside = np.hypot(*(place[:, i] - place[:, j]).T) < RADIUS_M
        for step in np.flatnonzero(inside[1:] & ~inside[:-1]):
            ours = [i, j] if j < 3 else [i]
            count["driven" if driven[step, ours].all() else "commanded"] += 1
    return count


@pytest.mark.study
def test_a_decision_a_second_keeps_the_boats_it_commands(capsys):
    """Ten times fewer hits of boats that the entry commands; those the game drives are out of an entry's reach."""
    found = {}
    for when in ("off", "once", "each move"):
        games = [played(opponent, seed, when) for opponent in OPPONENTS for seed in range(GAMES)]
        found[when] = {name: sum(game.row[name] for game in games) for name in COUNTED}
        for kind in ("commanded", "driven"):
            found[when][kind] = sum(hits(game.record)[kind] for game in games)
    with capsys.disabled():
        sys.stderr.write("\n" + "\n".join(f"{when}: {counts}" for when, counts in found.items()) + "\n")
    assert found["off"]["commanded"] > GAMES, "boats meet"
    assert found["once"]["commanded"] <= 0.1 * found["off"]["commanded"]
